//! Test whether noise in the regressor biases least squares, and selection of the cut-off of instruments.
//!
//! Instruments are regressor columns from a motion with less noise. With half the cut-off of the regressor, they
//! contain the motion, but hardly any noise of the accelerations (for white position noise, 3 % of its power). Least
//! squares is treated as biased if two conditions are met: the torque does not follow the fast motion that the lower
//! cut-off removes ([`fast_motion`]), *and* the estimates with and without instruments differ by more than their error
//! bars. Then the cut-off of the instruments is lowered. The highest cut-off is selected below which the estimate no
//! longer changes (Lepski, Theory Probab. Appl. 35 (1990) 454). It is a compromise between noise and motion content.

use super::band_motion::regressor_cutoff_hz;
use super::instrumental::{BandEstimate, InstrumentSettings, fast_motion_problem, with_band};
use super::noise_in_regressor::{EstimateContrast, NoiseInRegressor, NoiseVerdict};
use super::{EstimatorError, TrainingRows};
use crate::thresholds::NoiseThresholds;
use dynident_estimation::{
    Estimate, HausmanTest, HausmanVerdict, InstrumentReport, InstrumentalEstimate, fast_motion, hausman_test,
    weighted_least_squares,
};

/// Ratios of the instruments' cut-off to the regressor's cut-off. They are tried in this order until the instruments
/// are strong.
const CUTOFF_RATIOS: [f64; 3] = [0.5, core::f64::consts::FRAC_1_SQRT_2, 0.84];
/// Ratio of successive cut-offs that are tried.
const BAND_RATIO: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Maximum number of cut-offs below the first: six octaves.
const MAX_BANDS: usize = 12;

/// Tests least squares with instruments from the logs' own motion at a lower cut-off, and returns the
/// instrumental-variables estimate with the selected cut-off.
pub(super) fn examined(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    least_squares: &Estimate,
) -> Result<(InstrumentalEstimate, NoiseInRegressor), EstimatorError> {
    let first = match settings.cutoff_hz {
        Some(cutoff_hz) => with_band(rows, settings, cutoff_hz)?,
        None => first_band(rows, settings, least_squares)?,
    };
    let estimation = rows.settings;
    let fast = fast_motion(&first.problem, &first.found, estimation.rank, estimation.covariance)?;
    let thresholds = &estimation.thresholds.noise;
    let agrees = |band: &BandEstimate| agree(least_squares, &band.found.estimate, thresholds);
    let noise = fast.filter(|fast| fast.followed + fast.half_width_95 < thresholds.max_followed);
    let is_suspect =
        noise.is_some_and(|noise| noise.share_of_torque > thresholds.max_fast_torque_share || !agrees(&first));
    let chosen = if is_suspect && settings.cutoff_hz.is_none() && is_strong(&first, least_squares) {
        highest_stable_band(rows, settings, first, least_squares)
    } else {
        first
    };
    let verdict = if is_suspect && !agrees(&chosen) {
        NoiseVerdict::BiasesLeastSquares
    } else if fast.is_none() || chosen.found.instruments.weak {
        // With weak instruments, the estimate agrees with least squares in any case.
        NoiseVerdict::Undecided
    } else {
        NoiseVerdict::Harmless
    };
    let hausman = hausman_test(&chosen.problem, &chosen.found, &settings.hausman(estimation))?;
    let mut noise = NoiseInRegressor::of_test(chosen.found.instruments.clone(), hausman);
    noise.instrument_cutoff_hz = Some([chosen.cutoff_hz; 2]);
    (noise.verdict, noise.fast_motion) = (verdict, fast);
    noise.least_squares = self::contrast(least_squares, &chosen.found.estimate);
    Ok((chosen.found, noise))
}

/// Fast test whether noise can matter. It compares the torques of the complete motion and of its part below half the
/// cut-off, in some milliseconds; instruments need tens of milliseconds. `None` if instruments are needed for a
/// decision.
pub(super) fn harmless(
    rows: &TrainingRows<'_>,
    least_squares: &Estimate,
) -> Result<Option<NoiseInRegressor>, EstimatorError> {
    let cutoff_hz = CUTOFF_RATIOS[0] * regressor_cutoff_hz(rows)?;
    let (problem, squares) = fast_motion_problem(rows, cutoff_hz, &least_squares.values)?;
    let terms = squares.iter().zip(&least_squares.joint_sigma);
    let move_squared: f64 =
        terms.filter(|(_, sigma)| **sigma > 0.0).map(|(square, sigma)| square / sigma / sigma).sum();
    let columns = least_squares.std.iter().filter(|std| **std > 0.0).count().max(1);
    let settings = rows.settings.weighted();
    let followed = weighted_least_squares(&problem, &settings).ok().filter(|fit| fit.rank.fixed.is_empty());
    let followed = followed.map(|fit| (fit.values[0], fit.half_width_95[0]));
    let thresholds = &rows.settings.thresholds.noise;
    let is_motion = followed.is_none_or(|(followed, half_width)| followed + half_width > thresholds.max_followed);
    if !is_motion && (move_squared / columns as f64).sqrt() > thresholds.min_parameter_shift {
        return Ok(None);
    }
    let reason = "not tested: torque follows the fast motion, or the fast motion is too small to matter".to_owned();
    let (verdict, degrees_of_freedom) = (HausmanVerdict::Undecided, [0.0; 2]);
    let test =
        HausmanTest { verdict, f: None, degrees_of_freedom, p_value: None, columns: Vec::new(), reason: Some(reason) };
    let instruments = InstrumentReport {
        instruments: 0,
        noisy_columns: Vec::new(),
        weakest_f: None,
        weakest_column: None,
        weak: false,
    };
    Ok(Some(NoiseInRegressor { verdict: NoiseVerdict::Harmless, ..NoiseInRegressor::of_test(instruments, test) }))
}

/// Estimate with the lowest of the cut-off ratios for which the instruments are strong, or else with the highest ratio.
fn first_band(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    least_squares: &Estimate,
) -> Result<BandEstimate, EstimatorError> {
    let cutoff_hz = regressor_cutoff_hz(rows)?;
    let mut band = with_band(rows, settings, CUTOFF_RATIOS[0] * cutoff_hz)?;
    for share in &CUTOFF_RATIOS[1..] {
        if is_strong(&band, least_squares) {
            break;
        }
        band = with_band(rows, settings, share * cutoff_hz)?;
    }
    Ok(band)
}

/// Estimate with the highest cut-off below which the estimate no longer changes.
fn highest_stable_band(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    first: BandEstimate,
    least_squares: &Estimate,
) -> BandEstimate {
    let mut bands = vec![first];
    while let Some(last) = bands.last().filter(|_| bands.len() <= MAX_BANDS) {
        // If a piece is too short for a filter with this cut-off, only the previous cut-offs are used.
        let Ok(band) = with_band(rows, settings, BAND_RATIO * last.cutoff_hz) else { break };
        if !is_strong(&band, least_squares) {
            break;
        }
        bands.push(band);
    }
    let is_stable = |place: &usize| {
        let (band, lower) = (&bands[*place].found.estimate, &bands[place + 1..]);
        lower.iter().all(|lower| agree(band, &lower.found.estimate, &rows.settings.thresholds.noise))
    };
    let place = (0..bands.len()).find(is_stable).unwrap_or(bands.len() - 1);
    bands.swap_remove(place)
}

/// Whether the instruments are strong and determine all columns that least squares determines.
fn is_strong(band: &BandEstimate, least_squares: &Estimate) -> bool {
    let found = &band.found;
    !found.instruments.weak && found.estimate.rank.fixed.len() <= least_squares.rank.fixed.len()
}

fn agree(a: &Estimate, b: &Estimate, thresholds: &NoiseThresholds) -> bool {
    contrast(a, b).is_none_or(|contrast| {
        contrast.rms <= thresholds.max_contrast_rms && contrast.largest <= thresholds.max_contrast
    })
}

/// Difference `a − b` of two estimates in standard deviations of b, over the columns that both estimate.
fn contrast(a: &Estimate, b: &Estimate) -> Option<EstimateContrast> {
    let differences: Vec<(usize, f64)> = (0..b.values.len().min(a.values.len()))
        .filter(|&column| a.std[column] > 0.0 && b.std[column] > 0.0)
        .map(|column| (column, (a.values[column] - b.values[column]).abs() / b.std[column]))
        .collect();
    let &(place, largest) = differences.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let squares: f64 = differences.iter().map(|(_, difference)| difference * difference).sum();
    Some(EstimateContrast { rms: (squares / differences.len() as f64).sqrt(), largest, column: b.names[place].clone() })
}
