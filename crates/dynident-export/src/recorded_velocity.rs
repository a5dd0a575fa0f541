//! What is known of a recorded motion when friction is simplified.

/// A velocity of a joint, and how often it was recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedVelocity {
    /// rad/s (m/s), not zero.
    pub velocity: f64,
    /// Its weight: samples.
    pub samples: f64,
}
