//! `motion` of `[iteration]`: whether runs repeat one motion, or each is designed with what is known.

use super::super::{CriterionChoice, Study};
use super::IterationSection;
use crate::error::StudyError;
use dynident_iteration::{RedesignSettings, Scheme};
use serde::{Deserialize, Serialize};

/// What the motion of every run is.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum MotionChoice {
    /// That of the first run, always.
    #[default]
    Repeat,
    /// From the second run on the motion of `[design]`'s family, within its limits, that is to narrow the worst known
    /// directions most; and further runs for that alone while one is worth it.
    Redesign(RedesignSettings),
}

impl IterationSection {
    /// The settings of a redesign, if one is asked for.
    ///
    /// # Errors
    /// What keeps motions from being redesigned, with the fix.
    pub(crate) fn redesign(&self, study: &Study) -> Result<Option<&RedesignSettings>, StudyError> {
        let MotionChoice::Redesign(settings) = &self.motion else { return Ok(None) };
        settings.validate().map_err(StudyError::at("iteration.motion"))?;
        let conflict = |fix: &'static str| Err(StudyError::conflict("motion = \"redesign\"", fix));
        let Some(design) = &study.design else {
            return Err(StudyError::missing(
                "[design]",
                "motion = \"redesign\" needs a family of motions and what the robot may do: give [design] with family, duration_s and limits (the first motion may still come from trajectory)",
            ));
        };
        if let CriterionChoice::WindowedCondition(_) = design.criterion {
            return conflict("a windowed design has strokes of its own: give another criterion in [design]");
        }
        if !self.leg.is_empty() {
            return conflict("several legs, or held joints, are run as they are: take out [[iteration.leg]]");
        }
        if self.scheme == Scheme::StepByStep {
            return conflict("it needs what all joints say together: take out scheme = \"step-by-step\"");
        }
        if self.literal || !self.pool {
            return conflict(
                "motions that complement each other are to be fitted together: take out literal and pool = false",
            );
        }
        Ok(Some(settings))
    }
}
