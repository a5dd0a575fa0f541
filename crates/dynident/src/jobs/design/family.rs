//! Family, limits and search settings for further motions, from a study's `[design]`.

use super::setup::DesignSetup;
use crate::error::Error;
use crate::jobs::options::RunOptions;
use crate::study::StudyFile;
use dynident_excitation::limits::Limits;
use dynident_excitation::{DesignSettings, Family};

pub(in crate::jobs) struct MotionFamily {
    pub(in crate::jobs) family: Box<dyn Family>,
    /// The limits that apply: those of the robot description, the assumed ones, and those of the study.
    pub(in crate::jobs) limits: Limits,
    pub(in crate::jobs) search: DesignSettings,
}

/// The trajectory family of a study; the velocity of every joint must be limited.
///
/// # Errors
/// Same as for [`design_study`](super::design_study).
pub(in crate::jobs) fn motion_family(study: StudyFile<'_>, options: &RunOptions<'_>) -> Result<MotionFamily, Error> {
    let setup = DesignSetup::for_search(study, options)?;
    let family = setup.section.family.family(setup.robot.model().dof(), setup.section.duration_s);
    let family = family.map_err(Error::section(study.path, "design.family"))?;
    Ok(MotionFamily { family, limits: setup.limits, search: setup.section.search })
}
