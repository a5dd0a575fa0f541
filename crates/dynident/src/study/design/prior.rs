//! `[design.prior]`: what is known before the motion, so that the next one looks for what is not.

use crate::error::{Expected, StudyError};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// `[design.prior]`. What several sources say adds up.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct PriorSection {
    /// `result.json` of an earlier identification of the same robot: its covariance says how well each base parameter
    /// is known. Found as the study's logs are.
    pub result: Option<PathBuf>,
    /// The description's own inertial parameters, good to so many percent each (one standard deviation, independent of
    /// each other). A parameter that is smaller than a tenth of the largest of its kind (first moments, moments of
    /// inertia) in its body counts as if it were of that tenth; of a kind that the body has nothing of, the largest of
    /// the robot counts. Friction is taken from the description where it says something, else it is unknown.
    pub cad_std_percent: Option<f64>,
}

impl PriorSection {
    /// Whether it says anything.
    pub(super) fn is_empty(&self) -> bool {
        self.result.is_none() && self.cad_std_percent.is_none()
    }

    pub(super) fn validate(&self) -> Result<(), StudyError> {
        self.cad_std_percent
            .map_or(Ok(()), |percent| Expected::Range(1e-3, 1e6).check("prior.cad_std_percent", percent))
    }
}
