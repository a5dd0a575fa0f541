//! Limits of joint torque, computed by the prior model and the known torque of friction and drives, with a margin for
//! unknown torque.

use super::description::JointLimit;
use super::kind::{Constraint, LimitKind};
use super::term::{Adjoint, Inputs, Term};
use crate::motion::{Motion, MotionAdjoint};
use dynident_dynamics::{Workspace, inverse_dynamics_derivatives};
use dynident_model::Model;

/// Constraint `max(τ_high, -τ_low) / ((1 - margin) limit) - 1`.
#[derive(Clone, Debug)]
pub(crate) struct TorqueLimits(Vec<(usize, Constraint)>);

impl TorqueLimits {
    pub(crate) fn new(model: &Model, limits: &[JointLimit]) -> Self {
        let mut rows = Vec::new();
        for (index, joint) in model.joints().iter().enumerate() {
            let limit = limits.iter().find(|limit| limit.joint == joint.name);
            let Some((limit, torque)) = limit.and_then(|limit| Some((limit, limit.torque?))) else { continue };
            let constraint = Constraint {
                kind: LimitKind::Torque,
                subject: joint.name.clone(),
                middle: 0.0,
                size: torque * (1.0 - limit.torque_margin),
                unit: if joint.is_rotary() { "Nm" } else { "N" },
            };
            rows.push((index, constraint));
        }
        Self(rows)
    }
}

impl Term for TorqueLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.0.iter().map(|(_, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        for ((joint, constraint), row) in self.0.iter().zip(out.chunks_exact_mut(inputs.motion.samples)) {
            let scale = 1.0 / constraint.size;
            let range = inputs.motion.of(*joint);
            let torques = inputs.torque.low[range.clone()].iter().zip(&inputs.torque.high[range]);
            for (c, (low, high)) in row.iter_mut().zip(torques) {
                *c = high.max(-low) * scale - 1.0;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        for ((joint, constraint), row) in self.0.iter().zip(weights.chunks_exact(inputs.motion.samples)) {
            let scale = 1.0 / constraint.size;
            for (at, weight) in inputs.motion.of(*joint).zip(row) {
                if inputs.torque.high[at] >= -inputs.torque.low[at] {
                    adjoint.torque.high[at] += weight * scale;
                } else {
                    adjoint.torque.low[at] -= weight * scale;
                }
            }
        }
    }

    fn needs_torque(&self) -> bool {
        true
    }
}

/// Adds to `adjoint` the derivatives of a cost with respect to the motion, given its derivatives `by_torque`
/// (joint-major) with respect to the rigid-body torques: `(∂τ/∂q)ᵀ w`, `(∂τ/∂q̇)ᵀ w`, `Mᵀ w` at every sample with a
/// nonzero weight.
///
/// # Panics
/// If sizes differ.
pub(crate) fn torque_adjoint(
    model: &Model,
    workspace: &mut Workspace,
    motion: &Motion,
    by_torque: &[f64],
    adjoint: &mut MotionAdjoint,
) {
    let (dof, samples) = (motion.joints, motion.samples);
    assert_eq!(by_torque.len(), dof * samples, "one weight per torque");
    let mut state = [vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]];
    for sample in 0..samples {
        if (0..dof).all(|joint| by_torque[joint * samples + sample] == 0.0) {
            continue;
        }
        for (to, from) in state.iter_mut().zip([&motion.q, &motion.dq, &motion.ddq]) {
            for (joint, to) in to.iter_mut().enumerate() {
                *to = from[joint * samples + sample];
            }
        }
        let [q, dq, ddq] = &state;
        let derivatives = inverse_dynamics_derivatives(model, workspace, q, dq, ddq);
        for row in 0..dof {
            let weight = by_torque[row * samples + sample];
            if weight == 0.0 {
                continue;
            }
            let row = row * dof..(row + 1) * dof;
            for column in 0..dof {
                let to = column * samples + sample;
                adjoint.q[to] += weight * derivatives.by_position[row.clone()][column];
                adjoint.dq[to] += weight * derivatives.by_velocity[row.clone()][column];
                adjoint.ddq[to] += weight * derivatives.by_acceleration[row.clone()][column];
            }
        }
    }
}
