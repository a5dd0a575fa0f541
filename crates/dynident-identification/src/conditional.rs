//! Dependence of estimates on parameters that are fixed at nominal values.

use crate::consistent::{ConsistencySettings, nominal_covariance};
use crate::training::Training;
use dynident_estimation::{Estimate, HALF_WIDTH_95};
use serde::{Deserialize, Serialize};

/// Minimum ratio of the effect of an uncertain nominal value to the error bar of an estimate, for the estimate to be
/// reported as conditional.
const MIN_EFFECT_RATIO: f64 = 0.1;
/// Minimum effect of a fixed parameter relative to the largest effect, for the parameter to be listed.
const MIN_LISTED_RATIO: f64 = 0.1;
/// A parameter that is fixed at its nominal value and influences an estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Condition {
    /// Symbol of the fixed parameter.
    pub on: String,
    /// Change of the estimate per unit of the fixed parameter. The logs determine `estimate - per_unit * parameter`.
    pub per_unit: f64,
}

/// Dependence of a base parameter on fixed parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConditionalEstimate {
    /// Fixed parameters with a significant effect, the strongest first; empty for an estimate without such a
    /// dependence.
    pub on: Vec<Condition>,
    /// Standard deviation of the estimate that the uncertainty of the nominal values causes, in the parameter's unit;
    /// `None` if nominal values are unknown or have no significant effect.
    pub nominal_std: Option<f64>,
    /// Half-width of the 95 % interval, including the uncertainty of the nominal values; for a fixed parameter, only
    /// the latter. `None` if nominal values are unknown.
    pub half_width_95: Option<f64>,
}

/// Dependence of every base parameter on the parameters that are fixed at nominal values. The parameters θ_F are
/// estimated while θ_H are fixed; W_F and W_H are their regressor columns. The sensitivity is
/// `S = ∂θ_F/∂θ_H = −(W_FᵀW_F)⁻¹W_FᵀW_H`, and the variance is `σ² + S C_H Sᵀ`, where C_H is the covariance of the
/// nominal values ([`nominal_covariance`]). An effect is significant compared with the intervals from noise alone,
/// `noise_half_width_95`, so that an uncertain lag does not hide the dependence. Empty if all parameters are excited.
pub fn conditionals(
    training: &Training,
    estimate: &Estimate,
    noise_half_width_95: &[f64],
    knowledge: &ConsistencySettings,
) -> Vec<ConditionalEstimate> {
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
        let matters = MIN_EFFECT_RATIO * noise_half_width_95.get(column).copied().unwrap_or(own);
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
            return ConditionalEstimate::default();
        }
        let largest = places.iter().map(|&place| part(place)).fold(0.0, f64::max);
        places.retain(|&place| part(place) >= MIN_LISTED_RATIO * largest);
        places.sort_by(|a, b| part(*b).total_cmp(&part(*a)));
        let name = |&place: &usize| Condition { on: fixed[place].name.clone(), per_unit: answers[place] };
        ConditionalEstimate {
            on: places.iter().map(name).collect(),
            nominal_std: variance.map(f64::sqrt),
            half_width_95: variance.map(|variance| own.hypot(HALF_WIDTH_95 * variance.sqrt())),
        }
    };
    let of_fixed = |column: usize| ConditionalEstimate {
        on: Vec::new(),
        nominal_std: spread.as_ref().map(|spread| spread[(column, column)].sqrt()),
        half_width_95: spread.as_ref().map(|spread| HALF_WIDTH_95 * spread[(column, column)].sqrt()),
    };
    let is_fixed = |column: usize| fixed.iter().any(|fixed| fixed.column == column);
    (0..count).map(|column| if is_fixed(column) { of_fixed(column) } else { of_free(column) }).collect()
}

/// Joints whose motion is not above the position noise in any training log.
pub fn resting_joints(training: &Training) -> Vec<usize> {
    let rests = |joint: &usize| {
        let mut reports = training.logs.iter().map(|log| log.statistics.report.as_ref());
        reports.all(|report| {
            // The import report has the joints in the order of the model.
            report.is_some_and(|report| report.cutoff.joints_hz.get(*joint).is_some_and(Option::is_none))
        })
    };
    (0..training.model.dof()).filter(rests).collect()
}
