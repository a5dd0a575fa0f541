//! Declared torques among the base parameters: a user's expression may equal a gravity torque (`sin(q)` is the weight
//! of a link), which the structure does not show. So their columns are compared with all others at random states.
//!
//! A declared column that is a combination of the others in the rows of all joints is regrouped like any dependent
//! column: its coefficient is not identifiable, and base parameters include it.

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

/// Regroups declared columns that depend on others. In the structural split each is a base column.
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
    /// Positions within the limits of every joint (without limits: ±π or ±1 m), one in four at an end; velocities
    /// within their limits (without: ±2), accelerations within ±5.
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
