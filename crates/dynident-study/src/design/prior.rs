//! `[design.prior]`: prior knowledge, so that the design favours parameters that are still uncertain.

use crate::error::{Expected, StudyError};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Section `[design.prior]`. The information matrices of several sources are added.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct PriorSection {
    /// `result.json` of an earlier identification of the same robot; its covariance is the prior of the base
    /// parameters. The path is resolved in the same way as those of the logs.
    pub result: Option<PathBuf>,
    /// Relative uncertainty of the inertial parameters in the robot description, percent (one standard deviation
    /// each, independent). A parameter smaller than a tenth of the largest one of its kind (first moments, moments of
    /// inertia) in its body gets the uncertainty of that tenth. If all parameters of this kind are zero in the body,
    /// the largest of the robot is used. The same percentage applies to friction in the robot description; other
    /// friction is treated as unknown.
    pub cad_std_percent: Option<f64>,
}

impl PriorSection {
    pub(super) fn is_empty(&self) -> bool {
        self.result.is_none() && self.cad_std_percent.is_none()
    }

    pub(super) fn validate(&self) -> Result<(), StudyError> {
        self.cad_std_percent
            .map_or(Ok(()), |percent| Expected::Range(1e-3, 1e6).check("prior.cad_std_percent", percent))
    }
}
