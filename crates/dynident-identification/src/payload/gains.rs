//! Drive gains (newton metres per logged unit), estimated from logs without and with a known payload.

use super::columns::LoadColumns;
use super::error::PayloadError;
use crate::estimators::EstimationSettings;
use dynident_estimation::{Estimate, EstimationError, GainProblem, JointGain, LinearProblem, joint_gains};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Estimated drive gain of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DriveGain {
    /// Name of the joint.
    pub joint: String,
    /// Torque per logged unit, Nm (N): a factor for `torque.scale` of the format. If the gain is not identified, the
    /// value at which it was fixed.
    pub gain: f64,
    /// Standard deviation of the gain.
    pub std: f64,
    /// Half-width of the 95 % interval of the gain.
    pub half_width_95: f64,
    /// Whether the logs determine the gain.
    pub identified: bool,
    /// Reason why the logs do not determine the gain; `None` if they do.
    pub reason: Option<String>,
}

impl DriveGain {
    /// Increases the uncertainty by an independent error with the relative standard deviation `share`.
    pub(crate) fn widen(&mut self, share: f64) {
        let further = (share * self.gain).abs();
        let wider = self.std.hypot(further);
        if wider > self.std {
            self.half_width_95 *= if self.std > 0.0 { wider / self.std } else { 1.0 };
            self.std = wider;
        }
    }
}

pub(crate) struct Gains {
    pub(crate) of_joints: Vec<DriveGain>,
    /// Estimate with the columns of the problem, in SI units.
    pub(crate) estimate: Estimate,
    /// The problem in newton metres, without the torque of known payloads.
    pub(crate) problem: LinearProblem,
}

/// Effect of the known payloads on the base parameters of each training log, if it is sufficient to estimate gains.
pub(crate) fn known_loads(columns: &LoadColumns, training: &[usize]) -> Result<Vec<Vec<f64>>, PayloadError> {
    let known: Vec<Vec<f64>> = training.iter().map(|&log| columns.known(log)).collect();
    let (with, without): (Vec<bool>, Vec<bool>) =
        known.iter().map(|known| known.iter().any(|&value| value != 0.0)).map(|loaded| (loaded, !loaded)).unzip();
    if !with.contains(&true) || !without.contains(&true) {
        return Err(PayloadError::GainsNeedPayload);
    }
    Ok(known)
}

/// Estimates the torque per logged unit of each drive together with the dynamic parameters. The logged torque in `rows`
/// includes the torque of the `known` payloads, which determines the scale.
pub(crate) fn drive_gains(
    settings: &EstimationSettings,
    known: &[Vec<f64>],
    rows: &LinearProblem,
) -> Result<Gains, EstimationError> {
    let found = joint_gains(&GainProblem { rows, known: known.to_vec() }, &settings.weighted())?;
    let scale: Vec<f64> = found.gains.iter().map(|gain| gain.gain).collect();
    let problem = in_newton_metres(rows, known, &scale)?;
    let estimate = without_gains(found.estimate, rows.columns().len(), &scale);
    let of_joint = |gain| drive_gain(gain, settings.thresholds.gain.max_half_width);
    Ok(Gains { of_joints: found.gains.into_iter().map(of_joint).collect(), estimate, problem })
}

fn drive_gain(gain: JointGain, max_half_width: f64) -> DriveGain {
    let wide = gain.half_width_95 > max_half_width * gain.gain.abs();
    let reason = if !gain.identified {
        Some("the payload does not change the torque of this joint, so any gain fits equally well; record a motion in which the weight or the inertia of the payload loads the joint".to_owned())
    } else if wide {
        Some(format!(
            "the payload hardly changes the torque of this joint: the half width of the gain's 95 % interval exceeds {:.0} % of the gain; use a heavier payload, a larger distance, or a motion that loads the joint more",
            100.0 * max_half_width
        ))
    } else {
        None
    };
    let JointGain { joint, gain, std, half_width_95, .. } = gain;
    DriveGain { joint, gain, std, half_width_95, identified: reason.is_none(), reason }
}

fn in_newton_metres(rows: &LinearProblem, known: &[Vec<f64>], scale: &[f64]) -> Result<LinearProblem, EstimationError> {
    let mut problem = LinearProblem::new(rows.columns().to_vec(), rows.joints().to_vec())
        .with_fallback(rows.fallback().to_vec())?
        .with_unexcited(rows.unexcited().clone())?;
    for equation in rows.equations() {
        let own = equation.columns.len();
        let mut map = DMatrix::identity(own + 1, own + 1);
        for (row, &column) in equation.columns.iter().enumerate() {
            map[(row, own)] = -known[equation.log][column];
        }
        map[(own, own)] = scale[equation.joint];
        let factor = equation.factor.mapped(&map)?;
        problem.add(&rows.logs()[equation.log], equation.joint, equation.columns.clone(), factor)?;
    }
    Ok(problem)
}

/// Removes the columns of the gains, which are the last ones; the residuals are converted to newton metres.
fn without_gains(full: Estimate, count: usize, scale: &[f64]) -> Estimate {
    let mut estimate = full;
    estimate.names.truncate(count);
    estimate.values.truncate(count);
    estimate.std.truncate(count);
    estimate.std_degrees_of_freedom.truncate(count);
    estimate.half_width_95.truncate(count);
    estimate.relative_std_percent.truncate(count);
    estimate.covariance = estimate.covariance.view((0, 0), (count, count)).into_owned();
    estimate.covariance_white = estimate.covariance_white.view((0, 0), (count, count)).into_owned();
    estimate.rank.fixed.retain(|fixed| fixed.column < count);
    for (sigma, scale) in estimate.joint_sigma.iter_mut().zip(scale) {
        *sigma *= scale.abs();
    }
    estimate
}
