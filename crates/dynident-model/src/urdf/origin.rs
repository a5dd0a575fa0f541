//! `<origin>`: pose of a frame in another.

use super::values::{child, numbers};
use super::{UrdfError, UrdfFault, fault_at};
use crate::spatial::{Mat3, Transform, Vec3};
use roxmltree::Node;

/// Reads `<origin xyz rpy>` or, in URDF 1.1, `<origin xyz quat_xyzw>`; the identity if missing. `rpy` together with
/// `quat_xyzw` is an error, as in the reference parser.
pub(super) fn origin(node: Node<'_, '_>, owner: impl Fn() -> String) -> Result<Transform, UrdfError> {
    let Some(origin) = child(node, "origin") else { return Ok(Transform::IDENTITY) };
    let translation = Vec3(numbers(origin, "xyz")?.unwrap_or_default());
    let rotation = match (numbers(origin, "rpy")?, numbers::<4>(origin, "quat_xyzw")?) {
        (Some(_), Some(_)) => return Err(fault_at(origin, UrdfFault::TwoRotations { owner: owner() })),
        (None, Some(quaternion)) => {
            let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
            // Printed digits change the norm of a unit quaternion by far less than 0.1.
            if (norm - 1.0).abs() > 0.1 {
                return Err(fault_at(origin, UrdfFault::NoRotation { owner: owner(), norm }));
            }
            Mat3::from_quaternion(quaternion.map(|x| x / norm))
        }
        (rpy, None) => {
            let [roll, pitch, yaw] = rpy.unwrap_or_default();
            Mat3::from_roll_pitch_yaw(roll, pitch, yaw)
        }
    };
    Ok(Transform { rotation, translation })
}
