//! Which sign of the torque can a robot have at all?
//!
//! Least squares fits either sign equally well: all parameters change sign. A physically consistent set has positive
//! masses and inertias and friction that takes energy out, so it fits one of the two only.

use crate::consistent::{ConsistencySettings, nearest_consistent_parameters};
use dynident_dynamics::ParametricModel;
use dynident_estimation::{Estimate, LinearProblem};
use dynident_recording::{Finding, Level};
use serde::{Deserialize, Serialize};

/// The other sign counts as right when a physically consistent set leaves less than this share of what it leaves with
/// the given sign.
const CLEARLY_BETTER: f64 = 0.5;

/// How well physically consistent robots explain the torque with either sign, by no prior knowledge of the bodies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueSignCheck {
    /// `100 ‖τ − W θ‖ / ‖τ‖` of the physically consistent set that fits best, rows in units of their joint's noise.
    pub residual_percent: f64,
    /// The same for the torque with the opposite sign.
    pub residual_percent_if_reversed: f64,
}

impl TorqueSignCheck {
    /// Whether only the opposite sign is one that a robot can have.
    pub fn is_reversed(&self) -> bool {
        self.residual_percent_if_reversed < CLEARLY_BETTER * self.residual_percent
    }
}

/// Fits a physically consistent set to the torque and to its negative. The description's own inertials are not looked
/// at: rough bodies of 1 kg are the prior, and no friction. None where a fit fails.
pub fn sign_evidence(
    nominal: &ParametricModel,
    problem: &LinearProblem,
    estimate: &Estimate,
) -> Option<TorqueSignCheck> {
    let nothing = vec![0.0; nominal.nominal().len()];
    let robot = nominal.clone().with_nominal(nothing).ok()?;
    let settings = ConsistencySettings::default();
    let sigma = &estimate.joint_sigma;
    let mut sums = (0.0, 0.0);
    for equation in problem.equations() {
        let theta: Vec<f64> = equation.columns.iter().map(|&column| estimate.values[column]).collect();
        let factor = equation.factor.total();
        let scale = sigma[equation.joint];
        if scale > 0.0 {
            sums.0 += factor.residual_sum_of_squares(&theta).ok()? / (scale * scale);
            sums.1 += (factor.torque_norm() / scale).powi(2);
        }
    }
    let (left, torque) = sums;
    let percent = |sign: f64| {
        let theta: Vec<f64> = estimate.values.iter().map(|value| sign * value).collect();
        let fit = nearest_consistent_parameters(&robot, problem, sigma, &settings, &theta).ok()?;
        let percent = 100.0 * ((left + fit.moved_sigma * fit.moved_sigma) / torque).sqrt();
        percent.is_finite().then_some(percent)
    };
    Some(TorqueSignCheck { residual_percent: percent(1.0)?, residual_percent_if_reversed: percent(-1.0)? })
}

/// The evidence as a sentence, where it speaks against the log.
pub fn sign_findings(evidence: &TorqueSignCheck) -> Option<Finding> {
    evidence.is_reversed().then(|| Finding {
        level: Level::Problem,
        channel: "torque".to_owned(),
        message: format!(
            "the torque has the opposite sign of any physically consistent robot: positive masses, inertias and friction leave {:.0} % of it as given and {:.0} % of its negative; \
             write `sign = -1` under torque",
            evidence.residual_percent, evidence.residual_percent_if_reversed
        ),
    })
}
