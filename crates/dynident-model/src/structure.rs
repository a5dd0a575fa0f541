//! What of a robot's geometry is zero, and within what: algorithms leave its products out.

use crate::spatial::Vec3;

/// Axes are taken for parallel or at a right angle within this, rad: what rounding leaves of rotations by multiples of
/// 90° that were written as roll, pitch and yaw. It moves no result by more than its own rounding.
pub(crate) const EXACT: f64 = 1e-15;

/// Where an origin stands in the parent's frame, by the entries that are not zero: what is zero needs no product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shift {
    /// At the parent's origin.
    None,
    /// On the x axis.
    X,
    /// On the y axis.
    Y,
    /// On the z axis.
    Z,
    /// Anywhere, or moving with the joint.
    Any,
}

impl Shift {
    /// Of an origin that does not move.
    pub(crate) fn of(Vec3([x, y, z]): Vec3) -> Self {
        match (x != 0.0, y != 0.0, z != 0.0) {
            (false, false, false) => Self::None,
            (true, false, false) => Self::X,
            (false, true, false) => Self::Y,
            (false, false, true) => Self::Z,
            _ => Self::Any,
        }
    }
}
