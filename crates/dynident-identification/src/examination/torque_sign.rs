//! Test of the sign of the torque by physical consistency.
//!
//! Least squares fits a reversed torque equally well, because all parameters can change their signs. A physically
//! consistent set has positive masses and inertias and dissipative friction, so it fits only one sign.

use crate::consistent::{ConsistencySettings, nearest_consistent_parameters};
use crate::examination_settings::ExaminationSettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::{Estimate, LinearProblem};
use dynident_recording::{Finding, Level};
use serde::{Deserialize, Serialize};

/// Residuals of the best physically consistent robot for both signs of the torque, without prior knowledge of the
/// bodies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueSignCheck {
    /// Residual of the best physically consistent fit, `100 ‖τ − W θ‖ / ‖τ‖` with torque τ, regressor W and base
    /// parameters θ; rows in units of their joint's noise.
    pub residual_percent: f64,
    /// Residual of the best physically consistent fit to the torque with the opposite sign, in the same unit.
    pub residual_percent_if_reversed: f64,
}

impl TorqueSignCheck {
    /// Whether only the torque with the opposite sign is physically consistent, with the thresholds of the default
    /// [`ExaminationSettings`].
    pub fn is_reversed(&self) -> bool {
        self.is_reversed_by(&ExaminationSettings::default())
    }

    /// Whether only the torque with the opposite sign is physically consistent, with the thresholds in `settings`.
    pub fn is_reversed_by(&self, settings: &ExaminationSettings) -> bool {
        self.residual_percent_if_reversed < settings.max_reversed_ratio * self.residual_percent
    }
}

/// Fits a physically consistent set to the torque and to the torque with the opposite sign. The prior bodies are
/// approximate bodies of 1 kg without friction, not the nominal bodies. `None` if a fit fails.
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

/// The finding, if the sign is reversed.
pub fn sign_findings(evidence: &TorqueSignCheck) -> Option<Finding> {
    evidence.is_reversed().then(|| Finding {
        code: "fit-torque-sign".to_owned(),
        level: Level::Problem,
        channel: "torque".to_owned(),
        message: format!(
            "the torque has the opposite sign of any physically consistent robot: the best consistent fit has a residual of {:.0} % as given and {:.0} % with the opposite sign; \
             write `sign = -1` under torque",
            evidence.residual_percent, evidence.residual_percent_if_reversed
        ),
    })
}
