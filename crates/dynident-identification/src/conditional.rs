//! What an estimate is conditional on: the parameters that stayed at nominal.

use crate::consistent::{ConsistencySettings, nominal_covariance};
use crate::training::Training;
use dynident_estimation::{Estimate, HALF_WIDTH_95};
use serde::{Deserialize, Serialize};

/// An estimate is conditional where the nominal values may move it by this share of its own error bar.
const MATTERS: f64 = 0.1;
/// A held parameter is named where it may move the estimate by this share of what all of them may.
const NAMED: f64 = 0.1;
/// A parameter at nominal that an estimate hangs on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Condition {
    /// Its symbol.
    pub on: String,
    /// How much the estimate changes with it: the logs say the sum `estimate - per_unit * (it)`.
    pub per_unit: f64,
}

/// What a base parameter hangs on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Conditional {
    /// The parameters at nominal that matter for it, the strongest first; empty for one that stands on its own.
    pub on: Vec<Condition>,
    /// Standard deviation by the error of the nominal values, in the parameter's unit; none where nothing is known of
    /// them, and where they do not matter.
    pub nominal_std: Option<f64>,
    /// Half the width of the 95 % interval with what the nominal values may be wrong by; for a parameter at nominal
    /// that alone. None where nothing is known of the nominal values.
    pub half_width_95: Option<f64>,
}

/// For every base parameter what it hangs on: `θ_F` is estimated with the others at `θ_H = nominal`, and answers to
/// them by `∂θ_F/∂θ_H = −(W_FᵀW_F)⁻¹W_FᵀW_H`. Its variance with theirs is `σ² + ∂ C_H ∂ᵀ`, C_H being how far a
/// description may be wrong ([`nominal_covariance`]). What matters is judged by the intervals of the noise alone,
/// `noise_half_width_95`: a lag that is hardly known does not hide it. Empty where all parameters are excited.
pub fn conditionals(
    training: &Training,
    estimate: &Estimate,
    noise_half_width_95: &[f64],
    knowledge: &ConsistencySettings,
) -> Vec<Conditional> {
    let robot = &training.model.parametric;
    let count = training.columns.base();
    let fixed: Vec<_> = estimate.rank.fixed.iter().filter(|fixed| fixed.column < count).collect();
    if fixed.is_empty() {
        return Vec::new();
    }
    let known = robot.nominal_base().filter(|nominal| nominal.len() == robot.base().count());
    let spread = known.map(|_| nominal_covariance(robot, &training.problem, knowledge));
    let of_free = |column: usize| {
        let answers: Vec<f64> = fixed.iter().map(|fixed| fixed.answers.get(column).copied().unwrap_or(0.0)).collect();
        let own = estimate.half_width_95[column];
        let matters = MATTERS * noise_half_width_95.get(column).copied().unwrap_or(own);
        let part = |place: usize| match &spread {
            Some(spread) => {
                let variance: f64 = spread[(fixed[place].column, fixed[place].column)];
                HALF_WIDTH_95 * (answers[place] * answers[place] * variance).sqrt()
            }
            None if answers[place] != 0.0 => f64::INFINITY,
            None => 0.0,
        };
        let variance = spread.as_ref().map(|spread| {
            let pairs = (0..fixed.len()).flat_map(|a| (0..fixed.len()).map(move |b| (a, b)));
            let of = |(a, b): (usize, usize)| answers[a] * answers[b] * spread[(fixed[a].column, fixed[b].column)];
            pairs.map(of).sum::<f64>().max(0.0)
        });
        let total = variance.map_or(f64::INFINITY, |variance| HALF_WIDTH_95 * variance.sqrt());
        let mut places: Vec<usize> = (0..fixed.len()).filter(|&place| part(place) > matters).collect();
        if total <= matters || places.is_empty() {
            return Conditional::default();
        }
        let largest = places.iter().map(|&place| part(place)).fold(0.0, f64::max);
        places.retain(|&place| part(place) >= NAMED * largest);
        places.sort_by(|a, b| part(*b).total_cmp(&part(*a)));
        let name = |&place: &usize| Condition { on: fixed[place].name.clone(), per_unit: answers[place] };
        Conditional {
            on: places.iter().map(name).collect(),
            nominal_std: variance.map(f64::sqrt),
            half_width_95: variance.map(|variance| own.hypot(HALF_WIDTH_95 * variance.sqrt())),
        }
    };
    let of_fixed = |column: usize| Conditional {
        on: Vec::new(),
        nominal_std: spread.as_ref().map(|spread| spread[(column, column)].sqrt()),
        half_width_95: spread.as_ref().map(|spread| HALF_WIDTH_95 * spread[(column, column)].sqrt()),
    };
    let is_fixed = |column: usize| fixed.iter().any(|fixed| fixed.column == column);
    (0..count).map(|column| if is_fixed(column) { of_fixed(column) } else { of_free(column) }).collect()
}

/// Joints that no training log moves above the noise of their positions.
pub fn resting_joints(training: &Training) -> Vec<usize> {
    let rests = |joint: &usize| {
        let mut reports = training.logs.iter().map(|log| log.statistics.report.as_ref());
        reports.all(|report| {
            // The importer has the joints in the model's order.
            report.is_some_and(|report| report.cutoff.joints_hz.get(*joint).is_some_and(Option::is_none))
        })
    };
    (0..training.model.dof()).filter(rests).collect()
}
