//! `motion` of `[iteration]`: one motion for all runs, or a new design for each run.

use super::super::{CriterionChoice, Study};
use super::IterationSection;
use crate::error::StudyError;
use dynident_iteration::{RedesignSettings, Scheme};
use serde::{Deserialize, Serialize};

/// Motion of the runs.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum MotionChoice {
    /// Repeats the motion of the first run.
    #[default]
    Repeat,
    /// From the second run on, a motion of `[design]`'s family within its limits, which reduces the widest error bars
    /// most. Further runs follow while a motion reduces them enough.
    Redesign(RedesignSettings),
}

impl IterationSection {
    /// Settings for designing each motion again; `None` if not requested.
    ///
    /// # Errors
    /// A key that conflicts with a redesign, with the fix.
    pub fn redesign(&self, study: &Study) -> Result<Option<&RedesignSettings>, StudyError> {
        let MotionChoice::Redesign(settings) = &self.motion else { return Ok(None) };
        settings.validate().map_err(StudyError::at("iteration.motion"))?;
        let conflict = |fix: &'static str| Err(StudyError::conflict("motion = \"redesign\"", fix));
        let Some(design) = &study.design else {
            return Err(StudyError::missing(
                "[design]",
                "motion = \"redesign\" needs a family of motions and limits: give [design] with family, duration_s and limits (the first motion may still come from trajectory)",
            ));
        };
        if let CriterionChoice::WindowedCondition(_) = design.criterion {
            return conflict("a windowed design has fixed strokes: set another criterion in [design]");
        }
        if !self.leg.is_empty() {
            return conflict("legs and held joints cannot be redesigned: remove [[iteration.leg]]");
        }
        if self.scheme == Scheme::StepByStep {
            return conflict("a redesign uses all joints together: remove scheme = \"step-by-step\"");
        }
        if self.literal || !self.pool {
            return conflict("complementary motions must be fitted together: remove literal and pool = false");
        }
        Ok(Some(settings))
    }
}
