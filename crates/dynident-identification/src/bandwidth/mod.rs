//! Which cut-off leaves the parameters the smallest error: tried on a simulated copy of the recordings.
//!
//! A low cut-off takes from the positions what the torque still shows (the motion's highest frequencies, velocity about
//! a reversal) and leaves few rows; a high one lets the noise of the positions into the regressor, twice
//! differentiated. Neither can be read off the positions' spectrum alone. So the recordings stand in for themselves
//! ([`StandIn`](stand_in::StandIn)): their motion with its noise removed as far as it can be, the torque of a first fit
//! on it, then noise as in the recordings, and each candidate's fit is compared with the parameters that made the
//! torque. That is a parametric bootstrap (Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, 6.5) of the
//! error, filter bias and noise alike.

mod stand_in;
mod thinned;

use crate::error::IdentificationError;
use crate::settings::{GainChoice, IdentificationSettings};
use crate::training::plain_fit;
use dynident_estimation::SegmentSettings;
use dynident_rows::{Execution, Logs, ParallelFilterSettings, RegressorModel};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use stand_in::StandIn;

/// Candidates are this far apart.
const STEP: f64 = core::f64::consts::SQRT_2;
/// The lowest candidate is this part of the lowest cut-off that a joint's spectrum asks for, the highest so many times
/// the highest.
const SPAN: [f64; 2] = [0.7, 6.0];
/// No candidate comes closer to the sampling rate than this part of it.
const HIGHEST: f64 = 0.4;
/// Candidates whose predicted error is within this factor of the least count: what a copy cannot hold (friction that is
/// not as modelled, elasticity) makes smaller differences mean little.
const ALIKE: f64 = 1.1;

/// One cut-off that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffCandidate {
    /// The cut-off of the positions.
    pub cutoff_hz: f64,
    /// Predicted error of the fitted model's torque on motion like the recordings', root mean square over joints, each
    /// in percent of its torque's spread.
    pub predicted_error_percent: f64,
}

/// A cut-off chosen by the predicted error of the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffByError {
    /// The cut-off that was chosen. Where noise biases least squares all the same, `auto` lowers it afterwards with its
    /// instruments ([`NoiseInRegressor::cutoff_before_hz`](crate::estimators::NoiseInRegressor)).
    pub cutoff_hz: f64,
    /// What the positions' spectra alone ask for: twice the highest frequency of the motion. Held-out figures are for
    /// the torque below 0.7 of it, whatever cut-off the fit has.
    pub motion_hz: f64,
    /// All that were tried, lowest first.
    pub candidates: Vec<CutoffCandidate>,
}

impl CutoffByError {
    /// The highest that serves the parameters nearly as well as the best: where friction is told best, whose details
    /// are beyond the motion's band.
    pub fn highest_alike_hz(&self) -> f64 {
        let errors = || self.candidates.iter().map(|candidate| candidate.predicted_error_percent);
        let least = errors().fold(f64::INFINITY, f64::min);
        let alike = self.candidates.iter().filter(|candidate| candidate.predicted_error_percent <= ALIKE * least);
        alike.map(|candidate| candidate.cutoff_hz).fold(self.cutoff_hz, f64::max)
    }
}

/// Tries cut-offs on a simulated copy of the recordings `training` and returns the best; `None` where the cut-off is
/// not left to the data, or where the recordings are too short for a copy to say anything.
///
/// The error of a candidate is that of the torque `W (θ̂ - θ)`, each joint in units of its torque's spread, over a
/// motion that the fit has not seen: the recordings' own without noise, each joint at another time. Payloads do not
/// count: recordings with one are passed over.
///
/// # Errors
/// Recordings that cannot be read.
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
    let asked = || logs.spectra().iter().flat_map(|log| log.choice.joints_hz.iter().flatten().copied());
    let lowest = SPAN[0] * asked().fold(f64::INFINITY, f64::min);
    let highest = SPAN[1] * asked().fold(0.0, f64::max);
    if !(lowest > 0.0 && lowest < highest) {
        return Ok(None);
    }
    // The first fit and what noise there is.
    let Some(stand_in) = StandIn::of(logs, settings, model, training, highest)? else { return Ok(None) };
    let highest = highest.min(HIGHEST * stand_in.log_rate_hz());
    // The pilot itself is among the candidates.
    let below = ((motion_hz / lowest).ln() / STEP.ln()).floor() as i32;
    let above = ((highest / motion_hz).ln() / STEP.ln()).floor() as i32;
    let ladder: Vec<f64> = (-below..=above).map(|step| motion_hz * STEP.powi(step)).collect();
    let plain = plain_settings(settings);
    let alone = Execution { threads: 1, ..Execution::default() };
    let tried: Vec<Option<f64>> = ladder
        .par_iter()
        .map(|&cutoff_hz| {
            let filter = filter_of_copy(&stand_in, cutoff_hz);
            let (mut sum, mut copies) = (0.0, 0.0);
            for pieces in stand_in.copies(&settings.motion, cutoff_hz).ok()? {
                let values = plain_fit(model.clone(), pieces?, &filter, &plain, alone).ok()?;
                sum += stand_in.square_error(model, &values);
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
    // Of those alike the one that the spectra ask for, or else the lowest, which lets least noise in.
    let mut alike = candidates.iter().filter(|candidate| candidate.predicted_error_percent <= ALIKE * least);
    let lowest = alike.clone().next();
    let Some(best) = alike.find(|candidate| candidate.cutoff_hz == motion_hz).or(lowest) else { return Ok(None) };
    let cutoff_hz = best.cutoff_hz;
    Ok(Some(CutoffByError { cutoff_hz, motion_hz, candidates }))
}

/// The settings without error bars, for fits of the copies.
fn plain_settings(settings: &IdentificationSettings) -> IdentificationSettings {
    let mut plain = settings.clone();
    plain.estimation.segments = SegmentSettings { max_segments: 2, first_length_rows: 1024 };
    plain
}

/// The parallel filter that goes with a cut-off, at the rate of the copy.
fn filter_of_copy(stand_in: &StandIn, cutoff_hz: f64) -> ParallelFilterSettings {
    let automatic = ParallelFilterSettings::default();
    match automatic.decimation(stand_in.log_rate_hz(), Some(cutoff_hz)) {
        None => ParallelFilterSettings { enabled: false, ..automatic },
        Some(filter) => {
            let gain_half_hz = 0.4 * stand_in.log_rate_hz() / filter.factor as f64;
            ParallelFilterSettings {
                factor: Some((filter.factor / stand_in.thinning()).max(1)),
                cutoff_hz: Some(gain_half_hz),
                transition_hz: Some(gain_half_hz),
                ..automatic
            }
        }
    }
}
