//! Orientations in MJCF: `quat`, `axisangle`, `euler`, `xyaxes`, `zaxis`.

use super::classes::Stated;
use super::compiler::Compiler;
use super::fault::{MjcfError, MjcfFault};
use crate::spatial::{Mat3, Transform, Vec3};

/// Attributes of an orientation; an element may have only one of them.
pub(super) const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// Rotation that the attributes of an element define, if any.
pub(super) fn orientation(stated: &Stated<'_>, compiler: &Compiler) -> Result<Option<Mat3>, MjcfError> {
    let (name, attribute) = match stated.nearest(&ORIENTATIONS)[..] {
        [] => return Ok(None),
        [only] => only,
        [(first, _), (second, _), ..] => {
            return Err(stated.fault(MjcfFault::Both { element: stated.tag.to_owned(), first, second }));
        }
    };
    let located = |fault| stated.document.fault(attribute.place, fault);
    let rotation = match name {
        "quat" => {
            let [w, x, y, z] = stated.numbers::<4>("quat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
            let norm = (w * w + x * x + y * y + z * z).sqrt();
            if norm < 1e-9 {
                return Err(located(MjcfFault::NoDirection { element: stated.tag.to_owned(), attribute: "quat" }));
            }
            Mat3::from_quaternion([x, y, z, w].map(|part| part / norm))
        }
        "axisangle" => {
            let [x, y, z, angle] = stated.numbers::<4>("axisangle")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
            let axis = stated.unit(Vec3([x, y, z]), "axisangle").map_err(located)?;
            Mat3::from_axis_angle(axis, compiler.radians(angle))
        }
        "euler" => euler(stated.numbers::<3>("euler")?.unwrap_or_default(), compiler),
        "xyaxes" => {
            let [a, b, c, d, e, f] = stated.numbers::<6>("xyaxes")?.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
            let x = stated.unit(Vec3([a, b, c]), "xyaxes").map_err(located)?;
            let y = Vec3([d, e, f]);
            let y = stated.unit(y - x.scale(x.dot(y)), "xyaxes").map_err(located)?;
            let z = x.cross(y);
            Mat3([[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]])
        }
        _ => from_z(stated.direction("zaxis")?.unwrap_or(Vec3([0.0, 0.0, 1.0]))),
    };
    Ok(Some(rotation))
}

/// Pose `parent_from_element` from `pos` and orientation of an element.
pub(super) fn place(stated: &Stated<'_>, compiler: &Compiler) -> Result<Transform, MjcfError> {
    Ok(Transform {
        rotation: orientation(stated, compiler)?.unwrap_or(Mat3::IDENTITY),
        translation: stated.vector("pos")?.unwrap_or(Vec3::ZERO),
    })
}

fn euler(angles: [f64; 3], compiler: &Compiler) -> Mat3 {
    let mut rotation = Mat3::IDENTITY;
    for (angle, letter) in angles.into_iter().zip(compiler.eulerseq) {
        let axis = match letter.to_ascii_lowercase() {
            b'x' => [1.0, 0.0, 0.0],
            b'y' => [0.0, 1.0, 0.0],
            _ => [0.0, 0.0, 1.0],
        };
        let turn = Mat3::from_axis_angle(Vec3(axis), compiler.radians(angle));
        rotation = if letter.is_ascii_lowercase() { rotation.mul_mat(&turn) } else { turn.mul_mat(&rotation) };
    }
    rotation
}

/// Smallest rotation from z to the unit vector `z`; half a turn about x if `z` points down.
pub(super) fn from_z(z: Vec3) -> Mat3 {
    let axis = Vec3([0.0, 0.0, 1.0]).cross(z);
    let sine = axis.norm();
    if sine < 1e-10 {
        let x = Vec3([1.0, 0.0, 0.0]);
        return Mat3::from_axis_angle(x, if z[2] > 0.0 { 0.0 } else { core::f64::consts::PI });
    }
    Mat3::from_axis_angle(axis.scale(1.0 / sine), sine.atan2(z[2]))
}
