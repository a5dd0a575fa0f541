//! Forward kinematics of the links of a robot.

use crate::errors::RobotError;
use dynident::dynamics::{Workspace, body_placements, point_jacobian};
use dynident::model::{Model, Transform, Vec3};
use pyo3::prelude::*;

/// Values of a pose as a homogeneous matrix.
pub(crate) const POSE_VALUES: usize = 16;

/// A link: its body (`None` for the base), and its pose in the frame of the body.
#[derive(Clone, Debug)]
pub(crate) struct LinkPlace {
    body: Option<usize>,
    placement: Transform,
}

/// Names of all links, those of the base first.
pub(crate) fn link_names(model: &Model) -> Vec<String> {
    let bodies = core::iter::once(model.base()).chain(model.bodies());
    bodies.flat_map(|body| &body.links).map(|link| link.name.clone()).collect()
}

/// The link called `name`, by default the last one.
///
/// # Errors
/// An unknown name.
pub(crate) fn link(model: &Model, name: Option<&str>) -> PyResult<LinkPlace> {
    let own = model.bodies().iter().enumerate().map(|(place, body)| (Some(place), body));
    let mut all = core::iter::once((None, model.base()))
        .chain(own)
        .flat_map(|(body, links)| links.links.iter().map(move |link| (body, link)));
    let found = match name {
        Some(name) => all.find(|(_, link)| link.name == name),
        None => all.last(),
    };
    found.map(|(body, link)| LinkPlace { body, placement: link.placement }).ok_or_else(|| {
        let (name, known) = (name.unwrap_or_default(), link_names(model).join(", "));
        RobotError::new_err(format!("no link `{name}`: give one of {known}"))
    })
}

/// The pose of a link in the base frame, as a homogeneous matrix in row-major order.
pub(crate) fn pose(model: &Model, workspace: &mut Workspace, link: &LinkPlace, q: &[f64], out: &mut [f64]) {
    let place = match link.body {
        Some(body) => body_placements(model, workspace, q)[body].then(&link.placement),
        None => link.placement,
    };
    for (row, out) in out.chunks_exact_mut(4).enumerate() {
        match place.rotation.0.get(row) {
            Some(rotation) => {
                out[..3].copy_from_slice(rotation);
                out[3] = place.translation.0[row];
            }
            None => out.copy_from_slice(&[0.0, 0.0, 0.0, 1.0]),
        }
    }
}

/// The Jacobian of the point `point` of a link: three rows of the linear, and three of the angular velocity.
pub(crate) fn jacobian(
    model: &Model,
    workspace: &mut Workspace,
    link: &LinkPlace,
    point: [f64; 3],
    q: &[f64],
    out: &mut [f64],
) {
    out.fill(0.0);
    let Some(body) = link.body else { return };
    let found = point_jacobian(model, workspace, q, body, link.placement.point(Vec3(point)));
    let joints = model.dof();
    for (joint, (linear, angular)) in found.linear.iter().zip(&found.angular).enumerate() {
        for axis in 0..3 {
            out[axis * joints + joint] = linear.0[axis];
            out[(3 + axis) * joints + joint] = angular.0[axis];
        }
    }
}
