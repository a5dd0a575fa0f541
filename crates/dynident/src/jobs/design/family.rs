//! What further motions are designed from, as a study's `[design]` says it.

use super::setup::DesignSetup;
use crate::error::Error;
use crate::jobs::options::RunOptions;
use crate::study::Study;
use dynident_excitation::limits::Limits;
use dynident_excitation::{DesignSettings, Family};
use std::path::Path;

/// Motions of a study's `[design]`.
pub(in crate::jobs) struct MotionFamily {
    /// The family, with the study's duration.
    pub(in crate::jobs) family: Box<dyn Family>,
    /// The limits in force: the description's, those assumed, and the study's.
    pub(in crate::jobs) limits: Limits,
    /// How much is searched.
    pub(in crate::jobs) search: DesignSettings,
}

/// The motions of a study, something bounding how fast each joint moves.
///
/// # Errors
/// As [`design_study`](super::design_study).
pub(in crate::jobs) fn motion_family(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
) -> Result<MotionFamily, Error> {
    let setup = DesignSetup::for_search(study, study_path, options)?;
    let family = setup.section.family.family(setup.robot.model().dof(), setup.section.duration_s);
    let family = family.map_err(Error::section(study_path, "design.family"))?;
    Ok(MotionFamily { family, limits: setup.limits, search: setup.section.search })
}
