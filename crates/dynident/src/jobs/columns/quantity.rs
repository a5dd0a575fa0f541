//! The quantity that a column holds.

/// What a column holds of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum Quantity {
    Position,
    Velocity,
    Acceleration,
    Torque,
    /// A motor's current: a torque once its constant and gear ratio are known.
    Current,
}
