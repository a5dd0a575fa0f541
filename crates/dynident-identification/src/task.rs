//! Identification task: robot, recordings, settings.

use crate::payload::Payload;
use crate::settings::IdentificationSettings;
use dynident_dynamics::ParametricModel;
use dynident_rows::Recording;

/// A robot, its recordings, and the settings.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct IdentificationTask {
    /// The robot model with the torque terms to estimate.
    pub robot: ParametricModel,
    /// Recordings for the fit and for the test.
    pub recordings: Vec<Recording>,
    /// Payloads in the recordings.
    pub payloads: Vec<Payload>,
    /// Filters, estimator, prior knowledge of the bodies.
    pub settings: IdentificationSettings,
}

impl IdentificationTask {
    /// A task with default settings and without payloads.
    pub fn new(robot: ParametricModel, recordings: Vec<Recording>) -> Self {
        Self { robot, recordings, payloads: Vec::new(), settings: IdentificationSettings::default() }
    }
}

/// Those of the recordings `chosen` without a declared payload; all if each carries one.
pub(crate) fn logs_without_payload(recordings: &[Recording], chosen: &[usize]) -> Vec<usize> {
    let bare: Vec<usize> = chosen.iter().copied().filter(|&log| recordings[log].payload.is_none()).collect();
    if bare.is_empty() { chosen.to_vec() } else { bare }
}
