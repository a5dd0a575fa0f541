//! `held_out` of `[iteration]`: a motion that is never fitted.

use super::super::{CriterionChoice, DesignSection, Study};
use super::IterationSection;
use crate::error::{Expected, StudyError};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What the seed of the study's own design grows by where the held-out motion is looked for.
const OTHER_STARTS: u64 = 0x5851_f42d_4c95_7f2d;

/// `held_out`: a motion that is run to judge the newest model and never fitted. Without a key it is looked for as the
/// study's own, from other random starts, and run before the iteration may end as converged.
///
/// ```
/// let section: dynident::study::IterationSection = toml::from_str("held_out = { every = 2 }")?;
/// assert_eq!(section.held_out.unwrap().every, Some(2));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct HeldOutSection {
    /// It is run after every so many runs, of those that are good; by default only where all else is met.
    pub every: Option<usize>,
    /// Its trajectory, as `trajectory` of `[iteration]`.
    pub trajectory: Option<PathBuf>,
    /// Its design, in place of the study's `[design]` with another seed.
    pub design: Option<DesignSection>,
}

impl IterationSection {
    /// Checks `held_out`.
    ///
    /// # Errors
    /// What keeps a study from having one, with the fix.
    pub(crate) fn check_held_out(&self, study: &Study) -> Result<(), StudyError> {
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
            let fix =
                "it takes one motion of which everything counts: take out [[iteration.leg]], or the windowed design";
            return Err(StudyError::conflict("held_out", fix));
        }
        if own.trajectory.is_none() && own.design.is_none() && study.design.is_none() {
            let fix = "without [design] another motion cannot be looked for: name a file with held_out = { trajectory = \"...\" }, or give a [design]";
            return Err(StudyError::missing("held_out.trajectory", fix));
        }
        Ok(())
    }

    /// The study whose trajectory the held-out motion is; none without one.
    pub(crate) fn held_out_study(&self, study: &Study) -> Option<Study> {
        let own = self.held_out.as_ref()?;
        let mut other = study.clone();
        other.iteration.get_or_insert_default().trajectory.clone_from(&own.trajectory);
        match &own.design {
            Some(design) => other.design = Some(design.clone()),
            None => {
                if let Some(design) = &mut other.design {
                    design.search.seed = design.search.seed.wrapping_add(OTHER_STARTS);
                }
            }
        }
        Some(other)
    }
}
