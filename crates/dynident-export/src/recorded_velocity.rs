//! Recorded velocities, over which friction is fitted to the laws of simulators.

/// A velocity of a joint, with the number of samples at this velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedVelocity {
    /// Velocity, rad/s (m/s), not zero.
    pub velocity: f64,
    /// Number of samples (weight).
    pub samples: f64,
}
