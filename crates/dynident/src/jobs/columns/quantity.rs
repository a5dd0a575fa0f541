//! Quantity of a column.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::jobs) enum Quantity {
    Position,
    Velocity,
    Acceleration,
    Torque,
    /// Motor current: proportional to torque by motor constant and gear ratio.
    Current,
}
