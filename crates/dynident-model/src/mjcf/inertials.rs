//! `<inertial>`, and the settings of `<compiler>` that change masses.

use super::classes::Stated;
use super::compiler::Compiler;
use super::fault::{MjcfError, MjcfFault};
use super::orientation::{ORIENTATIONS, place};
use crate::inertial::InertialParameters;
use crate::spatial::{Mat3, Transform, Vec3};
use nalgebra::{Matrix3, Vector3};

/// `<inertial>` of a body, in the body's frame; `body_from_frame` is the pose of the surrounding `<frame>`.
pub(super) fn inertial(
    stated: &Stated<'_>,
    body_from_frame: &Transform,
    compiler: &Compiler,
) -> Result<InertialParameters, MjcfError> {
    let missing = |attribute| MjcfFault::MissingAttribute { element: "inertial".to_owned(), attribute };
    if stated.get("pos").is_none() {
        return Err(stated.fault(missing("pos")));
    }
    let mass = stated.size("mass")?.ok_or_else(|| stated.fault(missing("mass")))?;
    let both = |second| stated.fault(MjcfFault::Both { element: "inertial".to_owned(), first: "fullinertia", second });
    let at_com = match (stated.numbers::<6>("fullinertia")?, stated.numbers::<3>("diaginertia")?) {
        (Some(_), Some(_)) => return Err(both("diaginertia")),
        (Some([xx, yy, zz, xy, xz, yz]), None) => {
            if let Some((orientation, _)) = stated.nearest(&ORIENTATIONS).first() {
                return Err(both(orientation));
            }
            Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        }
        (None, Some([x, y, z])) => Mat3([[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]),
        (None, None) => Mat3::ZERO,
    };
    let frame_from_inertial = place(stated, compiler)?;
    let body_from_inertial = body_from_frame.then(&frame_from_inertial);
    let r = &body_from_inertial.rotation;
    // Without a rotation the numbers are not changed by rounding.
    let turned = if *r == Mat3::IDENTITY { at_com } else { r.mul_mat(&at_com).mul_mat(&r.transpose()) };
    Ok(InertialParameters::from_centre_of_mass(mass, body_from_inertial.translation, &turned))
}

/// Applies `boundmass`, `boundinertia` and `balanceinertia` in MuJoCo's order; a body without an inertial gets the
/// bounds.
pub(super) fn corrected(inertial: Option<InertialParameters>, compiler: &Compiler) -> Option<InertialParameters> {
    let is_bounded = compiler.bound_mass > 0.0 || compiler.bound_inertia > 0.0;
    if !is_bounded && !compiler.balance {
        return inertial;
    }
    let given = match inertial {
        Some(inertial) => inertial,
        None if is_bounded => InertialParameters::ZERO,
        None => return None,
    };
    let mass = given.mass_kg().max(compiler.bound_mass);
    let com = given.com_m().unwrap_or(Vec3::ZERO);
    // A body without mass has no centre of mass: the moments are then about the frame's origin.
    let at_com = given.inertia_at_com().unwrap_or_else(|| given.inertia_at_origin()).0;
    let eigen = Matrix3::from_fn(|a, b| at_com[a][b]).symmetric_eigen();
    let bounded: Vec<f64> = eigen.eigenvalues.iter().map(|moment| moment.max(compiler.bound_inertia)).collect();
    let mut moments = [bounded[0], bounded[1], bounded[2]];
    let [x, y, z] = moments;
    if compiler.balance && (x + y < z || x + z < y || y + z < x) {
        moments = [(x + y + z) / 3.0; 3];
    }
    if mass == given.mass_kg() && moments[..] == *eigen.eigenvalues.as_slice() {
        return Some(given);
    }
    let axes = eigen.eigenvectors;
    let turned = axes * Matrix3::from_diagonal(&Vector3::from(moments)) * axes.transpose();
    let at_com = Mat3([0, 1, 2].map(|a| [0, 1, 2].map(|b| turned[(a, b)])));
    Some(InertialParameters::from_centre_of_mass(mass, com, &at_com))
}
