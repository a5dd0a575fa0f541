//! **Step-wise design**: each joint makes a logistic stroke (smooth move from one position to another) while the
//! others rest.
//!
//! *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, equations 9, 10 and 17 to 19,
//! for any arm. A revolute joint that moves alone excites three parameters of the bodies that it carries: the inertia
//! about its axis and the two first moments normal to it. The regressor row is `[q̈, g cos q, -g sin q]`, where g is
//! the gravity component normal to the axis. The zero position only rotates the last two columns, which does not
//! change the condition number. The objective of equation 19 is therefore H = Σ cond, the sum of the joints'
//! condition numbers, and the joints can be optimised separately.

mod singular_values;
mod smooth;
mod stroke;
#[cfg(test)]
mod tests;

pub use stroke::{Stroke, StrokeConstants, StrokeLimit, StrokeQuantity};

use crate::optimisers::{AugmentedLagrangianSettings, AugmentedLagrangianState, OptimiserError, Progress, multi_start};
use core::ops::ControlFlow;
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::Model;
use dynident_model::sample::Random;
use smooth::SmoothStroke;
use thiserror::Error;

/// Minimum share of gravity normal to an axis; below it the joint torque depends only on the inertia.
const MIN_GRAVITY_SHARE: f64 = 1e-6;

const VARIABLES_PER_STROKE: usize = 3;

/// Reason why a joint cannot be designed separately.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StepWiseError {
    /// A windowed (step-wise) design identifies joints one after the other by gravity, which does not work for a joint
    /// that slides. List only revolute joints in `criterion.joints`.
    #[error("joint `{joint}` is prismatic, but step-wise designs need revolute joints: list the revolute joints")]
    Slides {
        /// Name of the joint.
        joint: String,
    },
    /// A windowed (step-wise) design identifies joints one after the other by gravity, and gravity does not act on this
    /// joint, for example because its axis is vertical. Remove it from `criterion.joints`.
    #[error(
        "gravity has no torque about joint `{joint}` while the others rest, so that its motion determines only one parameter: list the other joints"
    )]
    NoGravity {
        /// Name of the joint.
        joint: String,
    },
}

/// Gravity component, m/s², normal to the axis of a revolute joint while the robot rests at `rest` (rad, m).
///
/// # Errors
/// A prismatic joint, or an axis parallel to gravity.
///
/// # Panics
/// If the joint does not exist or `rest` has another length.
pub fn gravity_across(model: &Model, joint: usize, rest: &[f64]) -> Result<f64, StepWiseError> {
    let name = || model.joints()[joint].name.clone();
    if !model.joints()[joint].is_rotary() {
        return Err(StepWiseError::Slides { joint: name() });
    }
    let mut workspace = Workspace::new(model);
    let axis =
        body_placements(model, &mut workspace, rest)[model.body_of(joint)].rotation.mul_vec(model.joints()[joint].axis);
    let gravity = model.gravity();
    let across = (gravity - axis.scale(gravity.dot(axis) / axis.dot(axis))).norm();
    if across > MIN_GRAVITY_SHARE * gravity.norm() {
        Ok(across)
    } else {
        Err(StepWiseError::NoGravity { joint: name() })
    }
}

/// Data of one joint's stroke.
#[derive(Clone, Debug, PartialEq)]
pub struct StepWiseJoint {
    /// Index of the joint in the model.
    pub joint: usize,
    /// Constants of the stroke; positions are measured from its start.
    pub constants: StrokeConstants,
}

/// The strokes of all joints, in the order of the motions. The variables of each are amplitude A, steepness ω and
/// window half width δ.
#[derive(Clone, Debug, PartialEq)]
pub struct StepWiseProblem {
    /// The joints.
    pub joints: Vec<StepWiseJoint>,
}

impl StepWiseProblem {
    /// Checks every constant.
    ///
    /// # Errors
    /// The first error of [`StrokeConstants::validate`].
    pub fn validate(&self) -> Result<(), OptimiserError> {
        self.joints.iter().try_for_each(|joint| joint.constants.validate())
    }

    /// Ranges of A, ω, δ of each joint.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        self.joints.iter().flat_map(|joint| joint.constants.bounds()).collect()
    }

    /// Strokes of a vector of variables.
    ///
    /// # Panics
    /// If `x` has fewer than three entries per joint.
    pub fn strokes(&self, x: &[f64]) -> Vec<Stroke> {
        x.chunks_exact(VARIABLES_PER_STROKE).take(self.joints.len()).map(Stroke::of).collect()
    }

    /// Condition number of each joint's regressor within its window.
    pub fn condition_numbers(&self, strokes: &[Stroke]) -> Vec<f64> {
        self.joints.iter().zip(strokes).map(|(joint, stroke)| joint.constants.condition_number(stroke)).collect()
    }

    /// Limits of position, velocity, acceleration and rest of one stroke. Limits of places in the workspace are
    /// checked on the whole motion.
    pub fn limits(&self, place: usize, stroke: &Stroke) -> [StrokeLimit; 5] {
        self.joints[place].constants.limits(stroke)
    }

    /// H of equation 19: the sum of the condition numbers, plus a constant penalty if any limit is violated (added
    /// once, as in the paper).
    ///
    /// # Panics
    /// If `x` has fewer than three entries per joint.
    pub fn fitness(&self, x: &[f64]) -> f64 {
        let strokes = self.strokes(x);
        let kept = (0..strokes.len()).all(|place| self.limits(place, &strokes[place]).iter().all(StrokeLimit::kept));
        let penalty = self.joints.first().map_or(0.0, |joint| joint.constants.penalty);
        self.condition_numbers(&strokes).iter().sum::<f64>() + if kept { 0.0 } else { penalty }
    }

    /// H with a penalty that grows with the violation: Σ cond + penalty · Σ max(0, value/limit - 1). Inside the
    /// limits it equals H. Its minimum is the same, because the penalty exceeds the gain by a violation. The constant
    /// penalty of equation 19 has no slope towards the limit, so that the covariance of evolution strategies
    /// collapses there.
    ///
    /// # Panics
    /// If `x` has fewer than three entries per joint.
    pub fn graded_fitness(&self, x: &[f64]) -> f64 {
        let strokes = self.strokes(x);
        let broken = |place: usize| -> f64 {
            let violation: f64 = self.limits(place, &strokes[place]).iter().map(StrokeLimit::violation).sum();
            self.joints[place].constants.penalty * violation
        };
        self.condition_numbers(&strokes).iter().sum::<f64>() + (0..strokes.len()).map(broken).sum::<f64>()
    }

    /// Optimises the strokes by exact gradients, joint by joint, from `starts` random points of the ranges. Returns
    /// the strokes and the number of evaluations. The strokes keep every limit if any start reached a feasible point.
    ///
    /// # Errors
    /// A constant out of range; no start.
    pub fn gradient_solution(
        &self,
        seed: u64,
        starts: usize,
        watch: impl Fn(&Progress<'_>) -> ControlFlow<()> + Sync,
    ) -> Result<(Vec<f64>, usize), OptimiserError> {
        self.validate()?;
        let mut random = Random::new(seed);
        let (mut best, mut evaluations) = (Vec::new(), 0);
        for joint in &self.joints {
            let smooth = SmoothStroke::new(&joint.constants);
            let bounds = joint.constants.bounds();
            let points: Vec<AugmentedLagrangianState> = (0..starts)
                .map(|_| {
                    let x: Vec<f64> = bounds.iter().map(|[lower, upper]| random.uniform(*lower, *upper)).collect();
                    smooth.start(&x).into()
                })
                .collect();
            let result = multi_start(|| smooth.clone(), &points, &AugmentedLagrangianSettings::default(), &watch)?;
            evaluations += result.evaluations();
            best.extend_from_slice(&result.best().ok_or(OptimiserError::Start)?.best[..VARIABLES_PER_STROKE]);
        }
        Ok((best, evaluations))
    }
}
