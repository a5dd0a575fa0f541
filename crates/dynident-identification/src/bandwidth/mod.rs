//! Selection of the cut-off frequency with the smallest predicted parameter error, from simulated copies of the
//! recordings.
//!
//! With a low cut-off, the low-pass on the positions removes fast motion that the torque still contains (for example
//! the velocity change at a reversal), and few rows remain. With a high cut-off, position noise enters the regressor
//! after two differentiations. The spectrum of the positions alone does not show the optimum. Therefore Dynident
//! simulates [copies of the recordings](simulated_copies::SimulatedCopies): the denoised motion, the torque that a
//! first fit predicts for this motion, and noise as in the recordings. A fit of the copies with each candidate cut-off
//! is compared with the parameters that generated the torque. This is a parametric bootstrap (Efron and Tibshirani, *An
//! Introduction to the Bootstrap*, 1993, 6.5) of the error, including filter bias and noise.

mod read_logs;
mod simulated_copies;
mod thinned;

use crate::error::IdentificationError;
use crate::settings::{GainChoice, IdentificationSettings};
use crate::training::plain_fit;
use dynident_estimation::SegmentSettings;
use dynident_rows::{Execution, Logs, ParallelFilterSettings, RegressorModel};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use simulated_copies::SimulatedCopies;

/// Ratio of neighbouring candidate cut-offs.
const CANDIDATE_RATIO: f64 = core::f64::consts::SQRT_2;
/// Range of candidates: the lowest candidate relative to the lowest cut-off that the spectrum of a joint suggests, and
/// the highest candidate relative to the highest of these cut-offs. The lowest candidate must not be above the velocity
/// band of any joint, although noise can raise the cut-offs from the spectra.
const CANDIDATE_RANGE: [f64; 2] = [0.7, 6.0];
/// Maximum ratio of a candidate to the sample rate.
const MAX_SAMPLE_RATE_RATIO: f64 = 0.4;
/// Ratio of predicted errors within which candidates are treated as equally good. The simulated copies lack unmodelled
/// friction and elasticity, so smaller differences are not significant.
const MAX_EQUAL_ERROR_RATIO: f64 = 1.1;

/// One candidate cut-off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffCandidate {
    /// Cut-off of the low-pass on the positions, hertz.
    pub cutoff_hz: f64,
    /// Predicted torque error of the fitted model on similar motion, percent: root mean square over the joints, where
    /// each joint's error is relative to the standard deviation of its torque.
    pub predicted_error_percent: f64,
}

/// A cut-off that was selected by the predicted parameter error: a cut-off whose error is nearly the smallest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffByError {
    /// Selected cut-off, hertz. If noise still biases least squares, the estimator `auto` lowers the cut-off afterwards
    /// ([`NoiseInRegressor::cutoff_before_hz`](crate::estimators::NoiseInRegressor)).
    pub cutoff_hz: f64,
    /// Cut-off that the position spectra suggest, hertz: twice the highest frequency of the motion. Held-out errors are
    /// for torque below 0.7 times this frequency, for any cut-off of the fit.
    pub motion_hz: f64,
    /// All candidates, lowest first.
    pub candidates: Vec<CutoffCandidate>,
}

impl CutoffByError {
    /// The highest cut-off whose predicted error is nearly as small as the smallest one, hertz. This cut-off is best
    /// for the selection of friction, because fast changes of friction at reversals are above the frequency band of the
    /// motion.
    pub fn highest_alike_hz(&self) -> f64 {
        let errors = || self.candidates.iter().map(|candidate| candidate.predicted_error_percent);
        let least = errors().fold(f64::INFINITY, f64::min);
        let alike = self
            .candidates
            .iter()
            .filter(|candidate| candidate.predicted_error_percent <= MAX_EQUAL_ERROR_RATIO * least);
        alike.map(|candidate| candidate.cutoff_hz).fold(self.cutoff_hz, f64::max)
    }
}

/// Compares cut-offs on simulated copies of the recordings `training` and returns the best one. `None` if the settings
/// state the cut-off, or if the recordings are too short for a copy.
///
/// The error of a candidate is the torque `W (θ̂ - θ)`: regressor W, fitted parameters θ̂ and true parameters θ of the
/// copy. Each joint's error is divided by the standard deviation of its torque. The error is evaluated on motion that
/// was not used for the fit: the denoised motion with each joint shifted by another time. Recordings with a payload are
/// skipped.
///
/// # Errors
/// Recordings cannot be read.
pub fn choose_cutoff(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    model: &RegressorModel,
    training: &[usize],
) -> Result<Option<CutoffByError>, IdentificationError> {
    let Some(motion_hz) = logs.automatic_cutoff_hz() else { return Ok(None) };
    if settings.gains == GainChoice::Unknown || model.joint_that_needs_temperature().is_some() {
        return Ok(None);
    }
    let suggested = || logs.spectra().iter().flat_map(|log| log.choice.joints_hz.iter().flatten().copied());
    let velocities = logs.spectra().iter().flat_map(|log| log.choice.velocity_hz.iter().flatten().copied());
    let lowest = velocities.fold(CANDIDATE_RANGE[0] * suggested().fold(f64::INFINITY, f64::min), f64::min);
    let highest = CANDIDATE_RANGE[1] * suggested().fold(0.0, f64::max);
    if !(lowest > 0.0 && lowest < highest) {
        return Ok(None);
    }
    let Some(simulated_copies) = SimulatedCopies::of(logs, settings, model, training, highest)? else {
        return Ok(None);
    };
    let highest = highest.min(MAX_SAMPLE_RATE_RATIO * simulated_copies.log_rate_hz());
    // The candidates include the cut-off of the first fit.
    let below = ((motion_hz / lowest).ln() / CANDIDATE_RATIO.ln()).floor() as i32;
    let above = ((highest / motion_hz).ln() / CANDIDATE_RATIO.ln()).floor() as i32;
    let ladder: Vec<f64> = (-below..=above).map(|step| motion_hz * CANDIDATE_RATIO.powi(step)).collect();
    let plain = plain_settings(settings);
    let alone = Execution { threads: 1, ..Execution::default() };
    let tried: Vec<Option<f64>> = ladder
        .par_iter()
        .map(|&cutoff_hz| {
            let filter = filter_of_copy(&simulated_copies, cutoff_hz);
            let (mut sum, mut copies) = (0.0, 0.0);
            for pieces in simulated_copies.copies(&settings.motion, cutoff_hz).ok()? {
                let values = plain_fit(model.clone(), pieces?, &filter, &plain, alone).ok()?;
                sum += simulated_copies.square_error(model, &values);
                copies += 1.0;
            }
            Some(f64::sqrt(sum / copies)).filter(|error| error.is_finite())
        })
        .collect();
    let candidates: Vec<CutoffCandidate> = ladder
        .iter()
        .zip(&tried)
        .filter_map(|(&cutoff_hz, error)| {
            error.map(|error| CutoffCandidate { cutoff_hz, predicted_error_percent: 100.0 * error })
        })
        .collect();
    let least = candidates.iter().map(|candidate| candidate.predicted_error_percent).fold(f64::INFINITY, f64::min);
    // Among equally good candidates, prefer the cut-off from the spectra; otherwise the lowest one, which passes the
    // least noise.
    let mut alike =
        candidates.iter().filter(|candidate| candidate.predicted_error_percent <= MAX_EQUAL_ERROR_RATIO * least);
    let lowest = alike.clone().next();
    let Some(best) = alike.find(|candidate| candidate.cutoff_hz == motion_hz).or(lowest) else { return Ok(None) };
    let cutoff_hz = best.cutoff_hz;
    Ok(Some(CutoffByError { cutoff_hz, motion_hz, candidates }))
}

fn plain_settings(settings: &IdentificationSettings) -> IdentificationSettings {
    let mut plain = settings.clone();
    plain.estimation.segments = SegmentSettings { max_segments: 2, first_length_rows: 1024 };
    plain
}

fn filter_of_copy(simulated_copies: &SimulatedCopies, cutoff_hz: f64) -> ParallelFilterSettings {
    let automatic = ParallelFilterSettings::default();
    match automatic.decimation(simulated_copies.log_rate_hz(), Some(cutoff_hz)) {
        None => ParallelFilterSettings { enabled: false, ..automatic },
        Some(filter) => {
            let gain_half_hz = 0.4 * simulated_copies.log_rate_hz() / filter.factor as f64;
            ParallelFilterSettings {
                factor: Some((filter.factor / simulated_copies.thinning()).max(1)),
                cutoff_hz: Some(gain_half_hz),
                transition_hz: Some(gain_half_hz),
                ..automatic
            }
        }
    }
}
