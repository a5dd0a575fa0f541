//! What is to be identified, from which recordings, and how.

use crate::payload::Payload;
use crate::settings::IdentificationSettings;
use dynident_dynamics::ParametricModel;
use dynident_rows::Recording;

/// A robot, its recordings, and how to go about it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct IdentificationTask {
    /// The robot with the torque terms that are looked for.
    pub robot: ParametricModel,
    /// Recordings to fit to and to test on.
    pub recordings: Vec<Recording>,
    /// What recordings were made with.
    pub payloads: Vec<Payload>,
    /// Filters, estimator, what is known of the bodies.
    pub settings: IdentificationSettings,
}

impl IdentificationTask {
    /// The task with default settings and no payload.
    pub fn new(robot: ParametricModel, recordings: Vec<Recording>) -> Self {
        Self { robot, recordings, payloads: Vec::new(), settings: IdentificationSettings::default() }
    }
}
