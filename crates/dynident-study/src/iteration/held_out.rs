//! `held_out` of `[iteration]`: a validation motion.

use super::super::{CriterionChoice, DesignSection, Study};
use super::IterationSection;
use crate::error::{Expected, StudyError};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Added to the seed of the study's design for the search of the held-out motion, so that it differs.
const HELD_OUT_SEED_OFFSET: u64 = 0x5851_f42d_4c95_7f2d;

/// Key `held_out`: a motion that validates the newest model and is never used for a fit. Without keys it is designed
/// like the study's motion, but with another seed. It runs before the iteration can end as converged.
///
/// ```
/// let section: dynident_study::IterationSection = toml::from_str("held_out = { every = 2 }")?;
/// assert_eq!(section.held_out.unwrap().every, Some(2));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct HeldOutSection {
    /// The motion runs after every `every` accepted runs; by default only when all other conditions of convergence
    /// are met.
    pub every: Option<usize>,
    /// Trajectory file, in the format of `trajectory` of `[iteration]`.
    pub trajectory: Option<PathBuf>,
    /// Design of this motion; by default the study's `[design]` with another seed.
    pub design: Option<DesignSection>,
}

impl IterationSection {
    /// Checks the key `held_out`.
    ///
    /// # Errors
    /// A conflicting key, with the fix.
    pub fn check_held_out(&self, study: &Study) -> Result<(), StudyError> {
        let Some(own) = &self.held_out else { return Ok(()) };
        if own.trajectory.is_some() && own.design.is_some() {
            return Err(StudyError::Exclusive { keys: vec!["held_out.trajectory", "held_out.design"] });
        }
        if let Some(every) = own.every {
            Expected::Positive.check("held_out.every", every as f64)?;
        }
        let windowed = |design: &DesignSection| matches!(design.criterion, CriterionChoice::WindowedCondition(_));
        let several = !self.leg.is_empty()
            || self.trajectory.is_none() && study.design.as_ref().is_some_and(windowed)
            || own.design.as_ref().is_some_and(windowed);
        if several {
            let fix = "it needs one motion without legs or windows: remove [[iteration.leg]], or the windowed design";
            return Err(StudyError::conflict("held_out", fix));
        }
        if own.trajectory.is_none() && own.design.is_none() && study.design.is_none() {
            let fix = "without [design] no other motion can be designed: name a file with held_out = { trajectory = \"...\" }, or give a [design]";
            return Err(StudyError::missing("held_out.trajectory", fix));
        }
        Ok(())
    }

    /// The study for the held-out motion; `None` without `held_out`.
    pub fn held_out_study(&self, study: &Study) -> Option<Study> {
        let own = self.held_out.as_ref()?;
        let mut other = study.clone();
        other.iteration.get_or_insert_default().trajectory.clone_from(&own.trajectory);
        match &own.design {
            Some(design) => other.design = Some(design.clone()),
            None => {
                if let Some(design) = &mut other.design {
                    design.search.seed = design.search.seed.wrapping_add(HELD_OUT_SEED_OFFSET);
                }
            }
        }
        Some(other)
    }
}
