//! Recorded velocities for the simplification of friction.

/// A velocity of a joint, with its number of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedVelocity {
    /// Velocity, rad/s (m/s), not zero.
    pub velocity: f64,
    /// Number of samples (weight).
    pub samples: f64,
}
