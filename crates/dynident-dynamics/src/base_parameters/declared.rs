//! Declared (user-defined) torques among the base parameters. A user's expression may equal a gravity torque, for
//! example `sin(q)` the effect of a link's weight. The structure of the robot does not show this, so declared columns
//! are compared with all others at random states.
//!
//! A declared column that is a combination of other columns in the rows of all joints is regrouped like any dependent
//! column: its coefficient is not identifiable separately and becomes part of base parameters.

use super::numerical::stacked;
use crate::independent_columns::{IndependentColumns, independent_regressor_columns};
use crate::regressor_panels::Column;
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_model::terms::{JointMotion, TorqueTerm};
use nalgebra::DMatrix;

/// Fixed, so that the choice is reproducible.
const SEED: u64 = 27;
/// Number of states for the check of a single declared torque.
const CHECKED_STATES: usize = 2000;
/// A declared torque is zero if its function stays below this value.
const MIN_TORQUE_VALUE: f64 = 1e-9;

/// Fault of a declared torque within the joint limits.
pub(crate) enum DeclaredFault {
    /// Undefined at these positions and velocities of its joints.
    Undefined(Vec<(usize, f64, f64)>),
    Nothing,
}

/// Searches for a fault of a declared torque at random states within the joint limits, including their ends. A table
/// may cover a smaller range.
pub(crate) fn fault(model: &Model, term: &TorqueTerm) -> Option<DeclaredFault> {
    let function = term.state_function()?;
    let states = States::inside_limits(model, CHECKED_STATES);
    let motion = states.motion();
    let mut values = vec![0.0; states.samples];
    function.fill(&motion, &mut values);
    if let Some(sample) = values.iter().position(|value| value.is_nan()) {
        let at = |joint: usize| (joint, motion.q_of(joint)[sample], motion.dq_of(joint)[sample]);
        return Some(DeclaredFault::Undefined(function.follows().into_iter().map(at).collect()));
    }
    let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    (largest < MIN_TORQUE_VALUE).then_some(DeclaredFault::Nothing)
}

/// Regroups declared columns that depend on others. The structural split initially treats each as a base column.
pub(super) fn regrouped(
    model: &Model,
    columns: &[Column],
    split: IndependentColumns,
    tolerance: f64,
) -> IndependentColumns {
    let is_declared = |column: usize| matches!(&columns[column], Column::Term(term) if term.is_declared());
    let (declared, others): (Vec<usize>, Vec<usize>) =
        split.independent.iter().partition(|&&column| is_declared(column));
    if declared.is_empty() {
        return split;
    }
    // Declared columns come last, because a column is compared with those before it.
    let order = [others, declared].concat();
    let states = States::inside_limits(model, 4 * order.len() / model.dof().max(1) + 20);
    let tried = order.iter().map(|&column| columns[column].clone()).collect();
    let values = stacked(model, tried, &states.motion());
    let found = independent_regressor_columns(&values, tolerance);
    let lost: Vec<usize> =
        (0..order.len()).filter(|place| found.dependent.contains(place) && is_declared(order[*place])).collect();
    if lost.is_empty() {
        return split;
    }
    let independent: Vec<usize> =
        split.independent.iter().copied().filter(|column| !lost.iter().any(|&place| order[place] == *column)).collect();
    let mut dependent: Vec<usize> = split.dependent.iter().copied().chain(lost.iter().map(|&p| order[p])).collect();
    dependent.sort_unstable();
    let mut regrouping = DMatrix::zeros(independent.len(), dependent.len());
    for (to, column) in dependent.iter().enumerate() {
        for (row, base) in independent.iter().enumerate() {
            let known = split.dependent.iter().position(|other| other == column);
            regrouping[(row, to)] = if let Some(from) = known {
                // No structural column depends on a declared one.
                let own = split.independent.iter().position(|other| other == base);
                own.map_or(0.0, |own| split.regrouping[(own, from)])
            } else {
                let place = |of: usize| order.iter().position(|other| *other == of);
                let from = place(*column).and_then(|p| found.dependent.iter().position(|other| *other == p));
                let own = place(*base).and_then(|p| found.independent.iter().position(|other| *other == p));
                from.zip(own).map_or(0.0, |(from, own)| found.regrouping[(own, from)])
            };
        }
    }
    IndependentColumns {
        independent,
        dependent,
        regrouping,
        weakest_independent: split.weakest_independent,
        strongest_dependent: split.strongest_dependent,
    }
}

struct States {
    samples: usize,
    q: Vec<f64>,
    dq: Vec<f64>,
    ddq: Vec<f64>,
}

impl States {
    /// Random states: positions within the limits of every joint (±π or ±1 m without limits), one in four at a limit;
    /// velocities within their limits (±2 without limits), accelerations within ±5.
    fn inside_limits(model: &Model, samples: usize) -> Self {
        let mut random = Random::new(SEED);
        let mut states = Self { samples, q: Vec::new(), dq: Vec::new(), ddq: Vec::new() };
        let own = model.characteristic_scale();
        for joint in model.joints() {
            let usual = if joint.is_rotary() { core::f64::consts::PI } else { own.metres(1.0) };
            let limits = joint.limits.lower.zip(joint.limits.upper).filter(|(lower, upper)| lower < upper);
            let (lower, upper) = limits.unwrap_or((-usual, usual));
            let most = joint
                .limits
                .velocity
                .filter(|most| *most > 0.0 && most.is_finite())
                .unwrap_or(own.velocity(joint.is_rotary(), 2.0));
            let quickest = own.acceleration(joint.is_rotary(), 5.0);
            for _ in 0..samples {
                states.q.push(match random.uniform(0.0, 8.0) as usize {
                    0 => lower,
                    1 => upper,
                    _ => random.uniform(lower, upper),
                });
                states.dq.push(random.uniform(-most, most));
                states.ddq.push(random.uniform(-quickest, quickest));
            }
        }
        states
    }

    fn motion(&self) -> JointMotion<'_> {
        JointMotion { samples: self.samples, q: &self.q, dq: &self.dq, ddq: &self.ddq }
    }
}
