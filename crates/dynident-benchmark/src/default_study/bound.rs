//! Cramér-Rao bound of a case for known friction laws, lag and noise, and unknown motion.

use super::cases::DefaultCase;
use super::simulated::{Simulated, colour};
use crate::simulated_logs::{PERIOD_S, torque};
use dynident_dynamics::Column;
use dynident_estimation::{ChannelNoise, EstimationError, SimultaneousModel, simultaneous_bound};
use dynident_excitation::Motion;
use dynident_identification::estimators::{FourierSeries, PeriodicModel, PeriodicRecord};

/// Sampling rate with which one period of a recording with white noise is evaluated, Hz; more samples only scale the
/// information.
const RATE_HZ: f64 = 250.0;

/// Cramér-Rao bound of the base parameters' standard deviations for unbiased estimators, with the motion as a Fourier
/// series with unknown coefficients; `None` for load-dependent friction. Computed for one period and scaled to all
/// periods.
pub(super) fn bound(case: &DefaultCase, made: &Simulated) -> Result<Option<Vec<f64>>, EstimationError> {
    if made.regressor.needs_load() {
        return Ok(None);
    }
    let white = case.noise.torque_colour_s == 0.0;
    let thinning = if white { (case.motion.rate_hz / RATE_HZ).floor().max(1.0) as usize } else { 1 };
    let rate_hz = case.motion.rate_hz / thinning as f64;
    let samples = (PERIOD_S * rate_hz) as usize;
    let q = made.motion.q.chunks_exact(made.motion.samples);
    let q: Vec<f64> = q.flat_map(|joint| joint.iter().step_by(thinning).take(samples).copied()).collect();
    let period = thinned(&made.motion, thinning, samples);
    let tau = torque(&made.regressor, &period, &made.theta);
    let record = PeriodicRecord { rate_hz, q, tau };
    let series = FourierSeries { period_s: PERIOD_S, harmonics: case.motion.harmonics };
    let mut model = PeriodicModel::new(&made.regressor, &record, series, 1);
    let motion = model.fitted_motion().ok_or(EstimationError::Empty)?;
    let rows = model.linearised(&motion, &made.theta)?;
    // Number of recorded samples per evaluated sample.
    let more = (thinning as f64 * case.motion.duration_s / PERIOD_S).sqrt();
    let correlation = colour(case);
    // Quantisation error of an encoder: uniform distribution.
    let steps = case.noise.encoder_bits.map_or(0.0, |bits| core::f64::consts::TAU / 2.0_f64.powi(bits));
    let position_std = (case.noise.position_rad.powi(2) + steps * steps / 12.0).sqrt() / more;
    let position = ChannelNoise { std: position_std, autoregression: Vec::new() };
    let of_torque = |std: &f64| ChannelNoise {
        std: std * (1.0 - correlation * correlation).sqrt() / more,
        autoregression: if correlation == 0.0 { Vec::new() } else { vec![correlation] },
    };
    let mut noise = vec![position; made.regressor.dof()];
    noise.extend(made.torque_std.iter().map(of_torque));
    let names: Vec<String> = made.regressor.layout().columns().iter().map(Column::symbol).collect();
    let covariance = simultaneous_bound(&names, motion.len(), &rows, &noise)?;
    Ok(Some(covariance.diagonal().iter().map(|variance: &f64| variance.sqrt()).collect()))
}

/// Takes `samples` samples of a motion, every `step`-th one.
fn thinned(motion: &Motion, step: usize, samples: usize) -> Motion {
    let of = |all: &[f64]| -> Vec<f64> {
        let joints = all.chunks_exact(motion.samples);
        joints.flat_map(|joint| joint.iter().step_by(step).take(samples).copied()).collect()
    };
    Motion {
        samples,
        joints: motion.joints,
        q: of(&motion.q),
        dq: of(&motion.dq),
        ddq: of(&motion.ddq),
        dddq: of(&motion.dddq),
    }
}
