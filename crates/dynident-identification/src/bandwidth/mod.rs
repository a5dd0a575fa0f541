//! Selection of the cut-off with the smallest parameter error, by simulated copies of the recordings.
//!
//! A low cut-off removes motion from the positions that is still in the torque (its highest frequencies, the velocity
//! near a reversal) and leaves few rows. A high cut-off lets position noise into the regressor, differentiated twice.
//! The spectrum of the positions alone does not show the optimum. So [copies of the
//! recordings](simulated_copies::SimulatedCopies) are simulated: the denoised motion, the torque of a first fit for it,
//! and noise as in the recordings. The fit with each candidate is compared with the parameters that generated the
//! torque. This is a parametric bootstrap (Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, 6.5) of the
//! error, including filter bias and noise.

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

/// Ratio of neighbouring candidates.
const CANDIDATE_RATIO: f64 = core::f64::consts::SQRT_2;
/// Range of candidates: the lowest relative to the lowest cut-off of a joint's spectrum, the highest relative to the
/// highest one. Noise can raise the cut-offs of the spectra, so the lowest candidate is not above the velocity band of
/// any joint.
const CANDIDATE_RANGE: [f64; 2] = [0.7, 6.0];
/// Maximum ratio of candidate to sample rate.
const MAX_SAMPLE_RATE_RATIO: f64 = 0.4;
/// Ratio of predicted errors within which candidates are treated as equal. Copies lack unmodelled friction and
/// elasticity, so smaller differences are not significant.
const MAX_EQUAL_ERROR_RATIO: f64 = 1.1;

/// One candidate cut-off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffCandidate {
    /// Cut-off of the positions, hertz.
    pub cutoff_hz: f64,
    /// Predicted torque error of the fitted model on motion like that of the recordings: root mean square over joints,
    /// each in percent of its torque's spread.
    pub predicted_error_percent: f64,
}

/// A cut-off selected by the predicted error of the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffByError {
    /// Selected cut-off, hertz. If noise still biases least squares, `auto` lowers it afterwards with its instruments
    /// ([`NoiseInRegressor::cutoff_before_hz`](crate::estimators::NoiseInRegressor)).
    pub cutoff_hz: f64,
    /// Cut-off that the position spectra suggest, hertz: twice the highest frequency of the motion. Held-out figures
    /// use the torque below 0.7 of it, for any cut-off of the fit.
    pub motion_hz: f64,
    /// All candidates, lowest first.
    pub candidates: Vec<CutoffCandidate>,
}

impl CutoffByError {
    /// The highest cut-off with nearly the smallest error, hertz. It is best for friction, whose details lie above the
    /// band of the motion.
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

/// Compares cut-offs on simulated copies of the recordings `training` and returns the best one. `None` if the cut-off
/// is stated, or if the recordings are too short for a copy.
///
/// The error of a candidate is that of the torque `W (θ̂ - θ)`, each joint in units of its torque's spread, over motion
/// that was not used for the fit: the denoised motion with each joint at another time. Recordings with a payload are
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
    // The cut-off of the first fit is among the candidates.
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
    // Among equal candidates prefer the cut-off of the spectra, otherwise the lowest one, which passes the least noise.
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
