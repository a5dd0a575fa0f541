//! Analytic derivatives of the forward dynamics.

use crate::derivatives::inverse_dynamics_derivatives;
use crate::forward_dynamics::forward_dynamics;
use crate::workspace::Workspace;
use dynident_lanes::{Kernel, Lane, dispatch_single};
use dynident_model::Model;

/// Joint accelerations and their derivatives: row-major, dof × dof, row = acceleration, column = variable.
#[derive(Clone, Copy, Debug)]
pub struct ForwardDynamicsDerivatives<'w> {
    /// `q̈`, rad/s² (m/s²).
    pub acceleration: &'w [f64],
    /// `∂q̈/∂q`.
    pub by_position: &'w [f64],
    /// `∂q̈/∂q̇`.
    pub by_velocity: &'w [f64],
    /// `∂q̈/∂τ`, the inverse of the mass matrix.
    pub by_torque: &'w [f64],
}

/// Computes the analytic derivatives of [`forward_dynamics`](crate::forward_dynamics()) with respect to position,
/// velocity and torque.
///
/// They follow from the derivatives of `M q̈ + C q̇ + g = τ`, with the derivatives of the [inverse
/// dynamics](inverse_dynamics_derivatives) at the computed accelerations:
///
/// ```text
/// ∂q̈/∂q = -M⁻¹ ∂τ/∂q      ∂q̈/∂q̇ = -M⁻¹ ∂τ/∂q̇      ∂q̈/∂τ = M⁻¹
/// ```
///
/// (Carpentier and Mansard, *Analytical derivatives of rigid body dynamics algorithms*, RSS 2018.) M is factorised as
/// `M = Lᵀ L`, where a row of L has entries at the joint and its ancestors only: Featherstone (2008), section 6.5.
/// Allocation-free.
///
/// If a joint moves no inertia (massless tip), the inverse does not exist and the result is infinite or NaN: check
/// [`Model::bodies_without_prior`] first.
///
/// ```
/// # use dynident_dynamics::{Workspace, forward_dynamics_derivatives};
/// # let text = r#"<robot name="arm"><link name="base"/><link name="upper"><inertial><origin xyz="0 0 0.2"/>
/// #   <mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
/// #   </robot>"#;
/// # let model = dynident_model::read_urdf(text)?.model;
/// let mut workspace = Workspace::new(&model);
/// // A pendulum of 0.1 kg m² in its upright position: gravity accelerates it by m g l / I = 39.24 1/s² per rad.
/// let found = forward_dynamics_derivatives(&model, &mut workspace, &[0.0], &[0.0], &[0.0]);
/// assert!((found.by_torque[0] - 10.0).abs() < 1e-12);
/// assert!((found.by_position[0] - 2.0 * 9.81 * 0.2 / 0.1).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another tree.
#[doc(alias("jacobian", "aba derivatives"))]
pub fn forward_dynamics_derivatives<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    tau: &[f64],
) -> ForwardDynamicsDerivatives<'w> {
    // Taken out while other algorithms use the workspace.
    let mut acceleration = core::mem::take(&mut workspace.acceleration);
    acceleration.copy_from_slice(forward_dynamics(model, workspace, q, dq, tau));
    inverse_dynamics_derivatives(model, workspace, q, dq, &acceleration);
    workspace.acceleration = acceleration;
    let is_coupled = model.coupling().is_some();
    let Workspace { level, dof, parents, matrices, acceleration_derivatives, acceleration, .. } = workspace;
    // Solutions couple joints of different branches.
    let [torque_by_position, torque_by_velocity, mass] = matrices;
    let [by_position, by_velocity, by_torque] = acceleration_derivatives;
    by_position.copy_from_slice(torque_by_position);
    by_velocity.copy_from_slice(torque_by_velocity);
    by_torque.fill(0.0);
    by_torque.iter_mut().step_by(*dof + 1).for_each(|diagonal| *diagonal = 1.0);
    let before = |joint: usize| if is_coupled { joint.checked_sub(1) } else { parents[joint] };
    dispatch_single(*level, Solve { dof: *dof, before, mass, right: [by_position, by_velocity, by_torque] });
    for value in by_position.iter_mut().chain(by_velocity.iter_mut()) {
        *value = -*value;
    }
    ForwardDynamicsDerivatives { acceleration, by_position, by_velocity, by_torque }
}

/// Factorises a mass matrix and solves for three matrices.
struct Solve<'a, F: Fn(usize) -> Option<usize>> {
    dof: usize,
    /// The parent of a joint; the previous joint if all joints couple.
    before: F,
    mass: &'a mut [f64],
    right: [&'a mut [f64]; 3],
}

impl<F: Fn(usize) -> Option<usize>> Kernel for Solve<'_, F> {
    type Output = ();

    // Rows are plain slices: the compiler vectorises for the processor level.
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { dof, before, mass, mut right } = self;
        // M = LᵀL, from the tips inward: the square of a joint's row is subtracted from the entries of its ancestors.
        for joint in (0..dof).rev() {
            let row = joint * dof;
            let diagonal = mass[row + joint].sqrt();
            mass[row + joint] = diagonal;
            let mut outer = before(joint);
            while let Some(i) = outer {
                mass[row + i] /= diagonal;
                outer = before(i);
            }
            let mut outer = before(joint);
            while let Some(i) = outer {
                let mut inner = Some(i);
                while let Some(j) = inner {
                    mass[i * dof + j] -= mass[row + i] * mass[row + j];
                    inner = before(j);
                }
                outer = before(i);
            }
        }
        // Lᵀ Y = B, then L X = Y.
        for joint in (0..dof).rev() {
            for matrix in &mut right {
                let (above, own) = matrix.split_at_mut(joint * dof);
                let own = &mut own[..dof];
                let scale = 1.0 / mass[joint * dof + joint];
                for value in own.iter_mut() {
                    *value *= scale;
                }
                let mut at = before(joint);
                while let Some(i) = at {
                    let factor = mass[joint * dof + i];
                    for (to, from) in above[i * dof..(i + 1) * dof].iter_mut().zip(&*own) {
                        *to -= factor * from;
                    }
                    at = before(i);
                }
            }
        }
        for joint in 0..dof {
            for matrix in &mut right {
                let (above, own) = matrix.split_at_mut(joint * dof);
                let own = &mut own[..dof];
                let mut at = before(joint);
                while let Some(i) = at {
                    let factor = mass[joint * dof + i];
                    for (to, from) in own.iter_mut().zip(&above[i * dof..(i + 1) * dof]) {
                        *to -= factor * from;
                    }
                    at = before(i);
                }
                let scale = 1.0 / mass[joint * dof + joint];
                for value in own.iter_mut() {
                    *value *= scale;
                }
            }
        }
    }
}
