//! Structural zeros of a robot's geometry, which algorithms skip.

use crate::spatial::Vec3;

/// Tolerance for parallel and perpendicular axes, rad: the rounding error of rotations by multiples of 90° in roll,
/// pitch and yaw. It changes results by less than their own rounding error.
pub(crate) const PARALLEL_TOLERANCE_RAD: f64 = 1e-15;

/// Which coordinates of an origin in the parent's frame are nonzero; products with zeros are skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shift {
    /// Origin at the parent's origin.
    None,
    /// Origin on the parent's x axis.
    X,
    /// Origin on the parent's y axis.
    Y,
    /// Origin on the parent's z axis.
    Z,
    /// Origin anywhere, or moving with the joint.
    Any,
}

impl Shift {
    /// Class of an origin that does not move.
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
