//! **One joint after another**: each makes a logistic stroke while the others rest.
//!
//! *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, equations 9, 10 and 17 to 19, for
//! any arm. A revolute joint that moves alone excites three parameters of all that it carries: the inertia about its
//! axis and the two first moments across it, whose row is `[q̈, g cos q, -g sin q]` with the part g of gravity across
//! the axis. Where gravity leans to zero position only turns the last two columns, which changes no condition number.
//! So H = Σ cond over the joints, and the search falls apart into joints.

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

/// Least part of gravity across an axis, as a share of all of it: below, the joint feels its inertia only.
const LEAST_GRAVITY: f64 = 1e-6;

/// Numbers of one stroke: A, ω, δ.
const EACH: usize = 3;

/// Why a joint cannot be designed for alone.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StepWiseError {
    /// A joint that slides: its motion alone determines a mass, and no window is needed for that.
    #[error("joint `{joint}` slides: step-wise designs are for revolute joints; name the joints that take part")]
    Slides {
        /// The joint.
        joint: String,
    },
    /// A joint on which gravity does not act.
    #[error(
        "gravity does not act about joint `{joint}` while the others rest: its motion alone determines one parameter, for any stroke; name the joints that take part"
    )]
    NoGravity {
        /// The joint.
        joint: String,
    },
}

/// The part of gravity, m/s², that acts across a revolute joint's axis while the robot stands at `rest` (rad, m).
///
/// # Errors
/// A joint that slides, or along whose axis gravity stands.
///
/// # Panics
/// If the joint does not exist or `rest` has another length.
pub fn gravity_across(model: &Model, joint: usize, rest: &[f64]) -> Result<f64, StepWiseError> {
    let name = || model.joints()[joint].name.clone();
    if !model.joints()[joint].turns() {
        return Err(StepWiseError::Slides { joint: name() });
    }
    let mut workspace = Workspace::new(model);
    let axis =
        body_placements(model, &mut workspace, rest)[model.body_of(joint)].rotation.mul_vec(model.joints()[joint].axis);
    let gravity = model.gravity();
    let across = (gravity - axis.scale(gravity.dot(axis) / axis.dot(axis))).norm();
    if across > LEAST_GRAVITY * gravity.norm() { Ok(across) } else { Err(StepWiseError::NoGravity { joint: name() }) }
}

/// One joint's stroke: where it starts and what it must keep.
#[derive(Clone, Debug, PartialEq)]
pub struct StepWiseJoint {
    /// Number of the joint in the model.
    pub joint: usize,
    /// Its constants; positions count from the start of the stroke.
    pub constants: StrokeConstants,
}

/// All strokes, in the order in which the joints move; its vector is A, ω, δ of each.
#[derive(Clone, Debug, PartialEq)]
pub struct StepWiseProblem {
    /// The joints.
    pub joints: Vec<StepWiseJoint>,
}

impl StepWiseProblem {
    /// Whether every constant is usable.
    ///
    /// # Errors
    /// The first that is not, as [`StrokeConstants::validate`] names it.
    pub fn validate(&self) -> Result<(), OptimiserError> {
        self.joints.iter().try_for_each(|joint| joint.constants.validate())
    }

    /// Ranges of A, ω, δ of each joint.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        self.joints.iter().flat_map(|joint| joint.constants.bounds()).collect()
    }

    /// The strokes of a vector.
    ///
    /// # Panics
    /// If `x` has fewer than three entries a joint.
    pub fn strokes(&self, x: &[f64]) -> Vec<Stroke> {
        x.chunks_exact(EACH).take(self.joints.len()).map(Stroke::of).collect()
    }

    /// Condition number of each joint's window.
    pub fn condition_numbers(&self, strokes: &[Stroke]) -> Vec<f64> {
        self.joints.iter().zip(strokes).map(|(joint, stroke)| joint.constants.condition_number(stroke)).collect()
    }

    /// Position, velocity, acceleration and rest of one stroke. What limits the arm's place is for the check of the
    /// whole motion.
    pub fn limits(&self, place: usize, stroke: &Stroke) -> [StrokeLimit; 5] {
        self.joints[place].constants.limits(stroke)
    }

    /// H of equation 19: the sum of the condition numbers, with the penalty where a limit is broken (once, as in the
    /// paper).
    ///
    /// # Panics
    /// If `x` has fewer than three entries a joint.
    pub fn fitness(&self, x: &[f64]) -> f64 {
        let strokes = self.strokes(x);
        let kept = (0..strokes.len()).all(|place| self.limits(place, &strokes[place]).iter().all(StrokeLimit::kept));
        let penalty = self.joints.first().map_or(0.0, |joint| joint.constants.penalty);
        self.condition_numbers(&strokes).iter().sum::<f64>() + if kept { 0.0 } else { penalty }
    }

    /// H with a penalty that grows with the violation: Σ cond + penalty · Σ max(0, value/limit - 1). Inside the limits
    /// it is H, and its lowest point is the same, because the penalty outweighs what a violation gains. The step of
    /// equation 19 hides from a search on which side of a limit to go, and lets evolution strategies die at the wall:
    /// their covariance collapses before they have slid along it.
    ///
    /// # Panics
    /// If `x` has fewer than three entries a joint.
    pub fn graded_fitness(&self, x: &[f64]) -> f64 {
        let strokes = self.strokes(x);
        let broken = |place: usize| -> f64 {
            let violation: f64 = self.limits(place, &strokes[place]).iter().map(StrokeLimit::violation).sum();
            self.joints[place].constants.penalty * violation
        };
        self.condition_numbers(&strokes).iter().sum::<f64>() + (0..strokes.len()).map(broken).sum::<f64>()
    }

    /// The best strokes by exact gradients, joint by joint from `starts` random points of the ranges, and the number of
    /// evaluations. They keep every limit if any start came inside.
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
            best.extend_from_slice(&result.best().ok_or(OptimiserError::Start)?.best[..EACH]);
        }
        Ok((best, evaluations))
    }
}
