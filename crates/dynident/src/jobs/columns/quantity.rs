//! The quantity that a column holds.

/// The quantity of a joint that a column contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum Quantity {
    Position,
    Velocity,
    Acceleration,
    Torque,
    /// A motor's current: a torque once its constant and gear ratio are known.
    Current,
}
