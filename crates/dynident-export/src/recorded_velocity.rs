//! Recorded velocities, over which friction is fitted to the laws of simulators.

/// An interval of the velocity of a joint, represented by one velocity, with the number of its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedVelocity {
    /// Velocity, rad/s (m/s), not zero.
    pub velocity: f64,
    /// Number of samples (weight).
    pub samples: f64,
}
