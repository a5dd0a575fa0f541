//! Gravity torque, and its derivative.

use crate::ground::Spatial;
use crate::inverse_dynamics::inverse_dynamics;
use crate::varied_body::VariedBody;
use crate::workspace::{CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Scalar, dispatch_single};
use dynident_model::{Model, Vec3};

/// Torques `g(q)` that hold the robot at rest, Nm (N).
///
/// # Panics
/// If `q` does not have one entry per joint, or for a workspace of another size.
#[doc(alias("generalized gravity", "gravity vector"))]
pub fn gravity_torque<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64]) -> &'w [f64] {
    // A joint vector of zeros without allocation.
    const ZEROS: [f64; 1024] = [0.0; 1024];
    let rest = &ZEROS[..model.dof()];
    inverse_dynamics(model, workspace, q, rest, rest)
}

/// Computes `∂g/∂q`, row-major, dof × dof, Nm/rad (N/m): derivative of the gravity torque with respect to position.
/// It is the stiffness due to gravity, and symmetric, because it is the second derivative of the potential energy.
///
/// Axes `S` are in the base frame, `I` is the inertia of a subtree and `a` minus the gravity acceleration. For a
/// joint `i` on the path from the base to `j`
///
/// ```text
/// ∂g_i/∂q_j = S_i · (S_j ×* I_j a + I_j (a × S_j))
/// ```
///
/// the [derivatives of the inverse dynamics](crate::inverse_dynamics_derivatives) at rest (Singh, Russell and Wensing,
/// RA-L 2022) without the terms that are zero. Allocation-free.
///
/// ```
/// # use dynident_dynamics::{Workspace, gravity_torque_derivative};
/// # let text = r#"<robot name="arm"><link name="base"/><link name="upper"><inertial><origin xyz="0 0 0.2"/>
/// #   <mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
/// #   </robot>"#;
/// # let model = dynident_model::read_urdf(text)?.model;
/// let mut workspace = Workspace::new(&model);
/// // An upright pendulum is unstable: -m g l.
/// let stiffness = gravity_torque_derivative(&model, &mut workspace, &[0.0]);
/// assert!((stiffness[0] + 2.0 * 9.81 * 0.2).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// If `q` does not have one entry per joint, or for a workspace of another tree.
#[doc(alias("gravity gradient", "hessian", "stiffness"))]
pub fn gravity_torque_derivative<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64]) -> &'w [f64] {
    workspace.check(model, &[q]);
    workspace.check_tree(model);
    let Workspace { level, scratch, matrices: [matrix, ..], tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        tree.take_motion(coupling, q, q, q);
        let (q, of_tree) = (&tree.q[..], &mut tree.matrices[0]);
        dispatch_single(*level, Single { model, scratch, q, out: of_tree });
        coupling.project_matrix(of_tree, matrix);
    } else {
        dispatch_single(*level, Single { model, scratch, q, out: matrix });
    }
    matrix
}

one_sample_kernel!((q), stiffness, out: matrix);

#[inline(always)]
fn stiffness<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let steps = model.steps();
    let dof = steps.len();
    scratch.hinges.place(steps, &scratch.q);
    let hinges = scratch.hinges.placed(dof);
    let varied = &mut scratch.varied[..dof];
    let base = VariedBody::REST;
    for index in 0..dof {
        let (inner, outer) = varied.split_at_mut(index);
        let parent = steps[index].parent.map_or(&base, |parent| &inner[parent]);
        outer[0].follow(parent, &steps[index], index, &hinges);
    }
    let against_gravity = Spatial { angular: Vec3::ZERO, linear: (-model.gravity()).splat() };
    let matrix = &mut scratch.matrix[..dof * dof];
    for index in (0..dof).rev() {
        let (inner, outer) = varied.split_at_mut(index);
        let VariedBody { axis, moments, .. } = &outer[0];
        let held = axis.cross_dual_add(&moments.times(&against_gravity), &Spatial::ZERO);
        let column = moments.times_add(&against_gravity.cross(axis), &held);
        matrix[index * dof + index] = axis.dot(&column);
        let mut link = steps[index].parent;
        while let Some(at) = link {
            let entry = inner[at].axis.dot(&column);
            matrix[at * dof + index] = entry;
            matrix[index * dof + at] = entry;
            link = steps[at].parent;
        }
        if let Some(parent) = steps[index].parent {
            let moments = *moments;
            inner[parent].moments += moments;
        }
    }
}
