//! The Coriolis matrix.

use crate::joint_matrices::MatrixRows;
use crate::sample_lanes::take_lanes;
use crate::tree_scratch::TreeScratch;
use crate::varied_body::VariedBody;
use crate::workspace::{AnyScratch, CoreScratch, Workspace};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch_single};
use dynident_model::Model;
use dynident_model::terms::JointMotion;

/// Computes the matrix `C(q, q̇)` of Christoffel symbols, row-major, dof × dof, Nm s (N s for a prismatic joint). The
/// velocity-dependent torque is `C q̇`, and `Ṁ = C + Cᵀ`, so that `Ṁ − 2C` is skew-symmetric. Passivity-based and
/// adaptive controllers need `C(q, q̇) q̇_r` with another velocity `q̇_r`, which inverse dynamics do not give.
///
/// Axes `S` and their rates `Ψ̇ = v × S` are in the base frame; the inertia `I` and the body Coriolis matrix `B` of a
/// subtree are sums over its bodies. For a joint `i` on the path from the base to `j`
///
/// ```text
/// C_ij = S_i · (B_j S_j + I_j Ψ̇_j)      C_ji = S_i · (B_jᵀ S_j) + Ψ̇_i · (I_j S_j)
/// ```
///
/// Echeandia and Wensing, *Numerical methods to compute the Coriolis matrix and Christoffel symbols for rigid-body
/// systems*, Journal of Computational and Nonlinear Dynamics 16 (2021) 091004. It is half of the derivative of the
/// torque by velocity ([`inverse_dynamics_derivatives`](crate::inverse_dynamics_derivatives)), because the torque is
/// quadratic in the velocity. O(n · depth), allocation-free.
///
/// ```
/// # use dynident_dynamics::{Workspace, coriolis_matrix};
/// # let text = r#"<robot name="arm"><link name="base"/>
/// #   <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
/// #     <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <link name="fore"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
/// #     <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
/// #   <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
/// #     <origin xyz="0 0 0.4"/></joint></robot>"#;
/// # let model = dynident_model::read_urdf(text)?.model;
/// let mut workspace = Workspace::new(&model);
/// let c = coriolis_matrix(&model, &mut workspace, &[0.3, -0.8], &[0.5, 1.0]);
/// // The textbook's two-link arm: h = -m₂ l₁ l_c2 sin(q₂), C = [h q̇₂, h (q̇₁ + q̇₂); -h q̇₁, 0].
/// let h = -1.0 * 0.4 * 0.2 * (-0.8_f64).sin();
/// for (found, wanted) in c.iter().zip([h * 1.0, h * 1.5, -h * 0.5, 0.0]) {
///     assert!((found - wanted).abs() < 1e-15);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another tree.
#[doc(alias("christoffel", "centrifugal"))]
pub fn coriolis_matrix<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64], dq: &[f64]) -> &'w [f64] {
    workspace.check(model, &[q, dq]);
    workspace.check_tree(model);
    let Workspace { level, scratch, matrices: [matrix, ..], tree, .. } = workspace;
    // The accelerations are not used.
    if let Some(coupling) = model.coupling() {
        tree.take_motion(coupling, q, dq, dq);
        let TreeScratch { q, dq, matrices: [of_tree, ..], .. } = tree;
        let motion = &JointMotion { samples: 1, q, dq, ddq: dq };
        dispatch_single(*level, Fill { model, scratch, motion, out: MatrixRows { out: of_tree, stride: 1 } });
        coupling.project_matrix(of_tree, matrix);
    } else {
        let motion = &JointMotion { samples: 1, q, dq, ddq: dq };
        // Entries of joints on different branches are never written and remain zero.
        dispatch_single(*level, Fill { model, scratch, motion, out: MatrixRows { out: matrix, stride: 1 } });
    }
    matrix
}

struct Fill<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    motion: &'a JointMotion<'a>,
    out: MatrixRows<'a>,
}

impl Kernel for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { model, scratch, motion, mut out } = self;
        let core = &mut scratch.of::<T>().core;
        for at in (0..motion.samples).step_by(T::LANES) {
            take_lanes(&mut core.q, motion.q, motion.samples, at);
            take_lanes(&mut core.dq, motion.dq, motion.samples, at);
            core.hinges.place(model.steps(), &core.q);
            outward(model, core);
            inward(model, core, &mut out, at);
        }
    }
}

/// Axes, their rates, and the contribution of every single body.
#[inline(always)]
fn outward<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let steps = model.steps();
    let joints = steps.len();
    let hinges = scratch.hinges.placed(joints);
    let (varied, dq) = (&mut scratch.varied[..joints], &scratch.dq[..joints]);
    let base = VariedBody::REST;
    for index in 0..joints {
        let step = &steps[index];
        let (inner, outer) = varied.split_at_mut(index);
        let parent = step.parent.map_or(&base, |parent| &inner[parent]);
        outer[0].follow(parent, step, index, &hinges);
        outer[0].move_along(parent, dq[index]);
    }
}

/// Inward: products of each subtree with all axes on the path to it.
#[inline(always)]
fn inward<T: Lane>(model: &Model, scratch: &mut CoreScratch<T>, out: &mut MatrixRows<'_>, sample: usize) {
    let steps = model.steps();
    let dof = steps.len();
    let varied = &mut scratch.varied[..dof];
    let half = T::splat(0.5);
    for index in (0..dof).rev() {
        let (inner, outer) = varied.split_at_mut(index);
        let VariedBody { axis, twice_rate, moments, rates, .. } = &outer[0];
        let twice_column = rates.coriolis_add(axis.angular + axis.angular, &moments.times(twice_rate));
        let momentum = moments.times(axis);
        let row = rates.coriolis_transposed(axis);

        out.put(index * dof + index, sample, half * axis.dot(&twice_column));
        let mut link = steps[index].parent;
        while let Some(at) = link {
            let above = &inner[at];
            out.put(at * dof + index, sample, half * above.axis.dot(&twice_column));
            let turned = above.axis.angular.dot(row + row);
            out.put(index * dof + at, sample, half * (turned + above.twice_rate.dot(&momentum)));
            link = steps[at].parent;
        }
        if let Some(parent) = steps[index].parent {
            let (moments, rates) = (*moments, *rates);
            inner[parent].moments += moments;
            inner[parent].rates += rates;
        }
    }
}
