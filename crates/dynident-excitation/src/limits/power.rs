//! Mechanical power of a joint, including the known torque of friction and drives.

use super::description::JointLimit;
use super::kind::{Constraint, LimitKind};
use super::term::{Adjoint, Inputs, Term};
use dynident_model::Model;

/// Constraint `max(|τ_low q̇|, |τ_high q̇|) / limit - 1`.
#[derive(Clone, Debug)]
pub(crate) struct PowerLimits(Vec<(usize, Constraint)>);

impl PowerLimits {
    pub(crate) fn new(model: &Model, limits: &[JointLimit]) -> Self {
        let row = |index: usize, name: &str| {
            let size = limits.iter().find(|limit| limit.joint == name)?.power_w?;
            let subject = name.to_owned();
            Some((index, Constraint { kind: LimitKind::Power, subject, middle: 0.0, size, unit: "W" }))
        };
        Self(model.joints().iter().enumerate().filter_map(|(index, joint)| row(index, &joint.name)).collect())
    }
}

impl Term for PowerLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.0.iter().map(|(_, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        let motion = inputs.motion;
        for ((joint, constraint), row) in self.0.iter().zip(out.chunks_exact_mut(motion.samples)) {
            let (scale, range) = (1.0 / constraint.size, motion.of(*joint));
            let torques = inputs.torque.low[range.clone()].iter().zip(&inputs.torque.high[range.clone()]);
            for ((c, (low, high)), dq) in row.iter_mut().zip(torques).zip(&motion.dq[range]) {
                *c = (low * dq).abs().max((high * dq).abs()) * scale - 1.0;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        let motion = inputs.motion;
        for ((joint, constraint), row) in self.0.iter().zip(weights.chunks_exact(motion.samples)) {
            let scale = 1.0 / constraint.size;
            for (at, weight) in motion.of(*joint).zip(row) {
                let (low, high, dq) = (inputs.torque.low[at], inputs.torque.high[at], motion.dq[at]);
                let is_high = high.abs() >= low.abs();
                let (tau, to) =
                    if is_high { (high, &mut adjoint.torque.high[at]) } else { (low, &mut adjoint.torque.low[at]) };
                let signed = weight * scale * (tau * dq).signum();
                *to += signed * dq;
                adjoint.motion.dq[at] += signed * tau;
            }
        }
    }

    fn needs_torque(&self) -> bool {
        true
    }
}
