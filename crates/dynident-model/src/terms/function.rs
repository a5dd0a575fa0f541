//! A torque law in the caller's code, for laws that expressions cannot represent.

use super::JointMotion;
use core::fmt::Debug;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Step of the central differences, relative to the position or velocity (absolute near zero): the cube root of the
/// rounding error, which is optimal for central differences.
const DIFFERENCE_STEP: f64 = 6e-6;

/// A function `f(q, q̇)` of positions and velocities of any joints, for a whole block of samples at once.
///
/// The values must depend only on the motion at each sample, not on the division into blocks.
pub trait TorqueLaw: Debug + Send + Sync {
    /// Writes one value per sample of `motion` into `out`: the torque that the drive has to provide, per unit of the
    /// coefficient. NaN where it is undefined.
    fn fill(&self, motion: &JointMotion<'_>, out: &mut [f64]);
}

/// A [`TorqueLaw`] with a name. Code cannot be serialised: a deserialised function has a name but no values.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueFunction {
    /// Name in results.
    pub name: String,
    /// Joints on whose motion the function depends, ascending.
    pub follows: Vec<usize>,
    #[serde(skip)]
    law: Option<Arc<dyn TorqueLaw>>,
}

impl PartialEq for TorqueFunction {
    fn eq(&self, other: &Self) -> bool {
        let same = match (&self.law, &other.law) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => true,
            _ => false,
        };
        same && self.name == other.name && self.follows == other.follows
    }
}

impl TorqueFunction {
    /// Creates a function that depends on the motion of the joints `follows`.
    pub fn new(name: impl Into<String>, mut follows: Vec<usize>, law: Arc<dyn TorqueLaw>) -> Self {
        follows.sort_unstable();
        follows.dedup();
        Self { name: name.into(), follows, law: Some(law) }
    }

    /// Values at all samples; NaN where undefined.
    pub(super) fn fill(&self, motion: &JointMotion<'_>, out: &mut [f64]) {
        match &self.law {
            Some(law) => law.fill(motion, out),
            None => out.fill(f64::NAN),
        }
        out.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = f64::NAN);
    }

    /// Value at one sample of a motion.
    pub(super) fn value(&self, motion: &JointMotion<'_>, sample: usize) -> Option<f64> {
        let at = |rows: &[f64]| -> Vec<f64> { rows.iter().skip(sample).step_by(motion.samples).copied().collect() };
        let (q, dq, ddq) = (at(motion.q), at(motion.dq), at(motion.ddq));
        let mut value = [f64::NAN];
        self.fill(&JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq }, &mut value);
        Some(value[0]).filter(|value| value.is_finite())
    }

    /// Adds `weights · ∂f` with respect to the positions and velocities of the function's joints, by central
    /// differences with two calls each. Adds nothing where `f` is undefined on either side.
    pub(super) fn apply_adjoint(&self, motion: &JointMotion<'_>, weights: &[f64], adjoints: [&mut [f64]; 2]) {
        let [by_q, by_dq] = adjoints;
        let (mut q, mut dq) = (motion.q.to_vec(), motion.dq.to_vec());
        let mut sides = [vec![0.0; motion.samples], vec![0.0; motion.samples]];
        for &joint in &self.follows {
            let own = joint * motion.samples..(joint + 1) * motion.samples;
            for is_velocity in [false, true] {
                let state = if is_velocity { motion.dq } else { motion.q };
                let step = |at: usize| DIFFERENCE_STEP * (1.0 + state[at].abs());
                for (side, sign) in sides.iter_mut().zip([-1.0, 1.0]) {
                    let moved = if is_velocity { &mut dq } else { &mut q };
                    own.clone().for_each(|at| moved[at] = state[at] + sign * step(at));
                    self.fill(&JointMotion { samples: motion.samples, q: &q, dq: &dq, ddq: motion.ddq }, side);
                }
                let moved = if is_velocity { &mut dq } else { &mut q };
                moved[own.clone()].copy_from_slice(&state[own.clone()]);
                let to = if is_velocity { &mut *by_dq } else { &mut *by_q };
                for (sample, at) in own.clone().enumerate() {
                    let slope = (sides[1][sample] - sides[0][sample]) / (2.0 * step(at));
                    if slope.is_finite() {
                        to[at] += weights[sample] * slope;
                    }
                }
            }
        }
    }
}
