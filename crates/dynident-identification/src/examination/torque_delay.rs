//! Does the torque come late? The delay between motion and torque, joint by joint, with its error bar.
//!
//! A model that was fitted to late torque has absorbed a part of the lag (the inertia's column a quarter period on is
//! the viscous one), and what a prior's wrong inertias leave looks like a lag of many milliseconds. So lag and
//! parameters are estimated together, from one log at a time: `τ(t + d) = Y(t) θ − (δ − d) ∂(Yθ)/∂t` with the torque
//! taken `d` later, until `d` is the lag `δ` itself. The last step's covariance, from time segments, is the lag's. What
//! the model cannot say (backlash, elasticity) is in it as far as it differs from segment to segment.

use crate::estimators::EstimationSettings;
use crate::examination::delay_rows::{DelayRows, FilteredRows, NODES, Piece, lagrange};
use crate::logs::Logs;
use crate::regressor_model::RegressorModel;
use crate::rows::{JointRows, RawSamples, motion_band_hz, predicted_torque};
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimationError, LinearProblem, SegmentedFactor, WeightedSettings,
    weighted_least_squares,
};
use dynident_recording::{DecimationSettings, Decimator, Finding, Level, best_lag};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Samples that are looked at: some tens of seconds of any log.
pub(crate) const DELAY_SAMPLES: usize = 20_000;
/// Numbers that are kept at most, 64 MB.
const MOST_NUMBERS: usize = 8_000_000;
/// Longest lag looked for, seconds: drives and buses stay below.
const LONGEST_DELAY_S: f64 = 0.1;
/// Steps at most; two to four are usual.
const MOST_STEPS: usize = 12;
/// The steps end when no lag moves by more than this share of its standard deviation, or by so many samples.
const SETTLED: (f64, f64) = (0.02, 1.0e-6);
/// Lags below a picosecond are rounding, and so are their error bars.
const ROUNDING_S: f64 = 1.0e-12;

/// By how much one joint's torque comes after the motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueLag {
    /// Seconds; negative where the torque comes before.
    pub lag_s: f64,
    /// Its standard deviation.
    pub std_s: f64,
    /// Half the width of its 95 % interval.
    pub half_width_95_s: f64,
    /// Whether it is beyond its interval and moves more torque than the model leaves unexplained.
    pub matters: bool,
}

/// Gathers a log's first samples, then determines their lags.
pub(crate) struct DelayCheck<'a> {
    model: &'a RegressorModel,
    theta: &'a [f64],
    pieces: Vec<Piece>,
    samples: usize,
    numbers: usize,
    full: bool,
    rate_hz: f64,
    buffer: Vec<f64>,
}

impl<'a> DelayCheck<'a> {
    pub(crate) fn new(model: &'a RegressorModel, theta: &'a [f64]) -> Self {
        let (pieces, buffer) = (Vec::new(), Vec::new());
        Self { model, theta, pieces, samples: 0, numbers: 0, full: false, rate_hz: 0.0, buffer }
    }

    /// Rows as they leave the parallel filter; the samples that they belong to came before.
    pub(crate) fn filtered(&mut self, rows: &JointRows<'_>) {
        let Some(piece) = self.pieces.last_mut().filter(|_| !self.full) else { return };
        let regressor = &rows.panel[..self.model.layout().joint_columns(rows.joint).len() * rows.rows];
        self.numbers += regressor.len();
        let (regressor, coverage) = (regressor.to_vec(), rows.coverage.to_vec());
        piece.rows[rows.joint].push(FilteredRows { rows: rows.rows, regressor, coverage });
    }

    pub(crate) fn raw(&mut self, samples: &RawSamples<'_>) {
        self.full |= self.samples >= DELAY_SAMPLES || self.numbers >= MOST_NUMBERS;
        if self.full {
            return;
        }
        self.rate_hz = samples.rate_hz;
        let joints = self.model.model().dof();
        if self.pieces.last().is_none_or(|piece| piece.segment != samples.segment) {
            self.pieces.push(Piece::new(samples.segment, joints));
        }
        let rows = samples.panels.samples();
        self.samples += rows;
        let Some(piece) = self.pieces.last_mut() else { return };
        for joint in 0..joints {
            let columns = self.model.layout().joint_columns(joint);
            let panel = samples.panels.joint(joint);
            predicted_torque(panel, rows, columns, self.theta, &mut self.buffer);
            piece.model[joint].extend_from_slice(&self.buffer);
            piece.measured[joint].extend_from_slice(&panel[columns.len() * rows..]);
            piece.leave_out(joint, samples.set_aside.get(joint).map_or(&[], Vec::as_slice));
            self.numbers += 2 * rows;
        }
    }

    /// Lag of torque behind motion by joint; `None` where the log does not determine it.
    pub(crate) fn delays(&self, logs: &Logs<'_>, settings: &EstimationSettings) -> Vec<Option<TorqueLag>> {
        let joints = self.model.model().dof();
        let motion = &logs.motion;
        let filter = logs.filter.decimation(self.rate_hz, motion_band_hz(motion));
        let longest = LONGEST_DELAY_S * self.rate_hz;
        let start = (0..joints)
            .into_par_iter()
            .map(|joint| self.coarse(joint, motion.differentiator.cutoff_hz()).unwrap_or(0.0).clamp(-longest, longest))
            .collect();
        // A log too short to fit to has no lag either.
        self.estimated(settings, filter.as_ref(), start, longest).unwrap_or_else(|_| vec![None; joints])
    }

    /// Where to begin: the best match of prediction and torque, where a shift matters; samples.
    fn coarse(&self, joint: usize, cutoff_hz: Option<f64>) -> Option<f64> {
        let piece = self.pieces.iter().max_by_key(|piece| piece.measured[joint].len())?;
        let settings = DecimationSettings { factor: 1, cutoff_hz, ..DecimationSettings::default() };
        let smooth = |signal: &[f64]| -> Option<Vec<f64>> {
            let mut out = Vec::new();
            let rows = Decimator::new(&settings, self.rate_hz, 1).ok()?.push(signal, signal.len(), &mut out);
            out.truncate(rows);
            Some(out)
        };
        let (model, measured) = (smooth(&piece.model[joint])?, smooth(&piece.measured[joint])?);
        let longest = (LONGEST_DELAY_S * self.rate_hz).ceil() as usize;
        let lag = best_lag(&model, &measured, longest, self.rate_hz)?;
        lag.matters().then_some(lag.samples)
    }

    fn estimated(
        &self,
        settings: &EstimationSettings,
        filter: Option<&DecimationSettings>,
        mut shift: Vec<f64>,
        longest: f64,
    ) -> Result<Vec<Option<TorqueLag>>, EstimationError> {
        let mut rows: Vec<DelayRows> = (0..shift.len())
            .into_par_iter()
            .map(|joint| self.rows(settings, filter, joint, shift[joint]))
            .collect::<Result<_, _>>()?;
        let quick = WeightedSettings {
            rank: settings.rank,
            covariance: CovarianceMethod::White,
            ..WeightedSettings::default()
        };
        let base = self.model.layout().columns().len();
        for _ in 0..MOST_STEPS {
            let step = weighted_least_squares(&self.problem(&rows, &shift, |rows| &rows.merged)?, &quick)?;
            let mut settled = true;
            for joint in 0..shift.len() {
                let (rest, std) = (step.values[base + joint], step.std[base + joint]);
                settled &= rest.abs() <= (SETTLED.0 * std).max(SETTLED.1);
                shift[joint] = (shift[joint] + rest).clamp(-longest, longest);
                if !rows[joint].reaches(shift[joint]) {
                    rows[joint] = self.rows(settings, filter, joint, shift[joint])?;
                }
            }
            if settled {
                break;
            }
        }
        let last_step = WeightedSettings { covariance: settings.covariance, ..quick };
        let last = weighted_least_squares(&self.problem(&rows, &shift, |rows| &rows.factor)?, &last_step)?;
        Ok((0..shift.len()).map(|joint| self.joint_delay(&last, &rows[joint], joint, shift[joint], longest)).collect())
    }

    /// The lag of one joint from the last step, if it settled.
    fn joint_delay(
        &self,
        last: &Estimate,
        rows: &DelayRows,
        joint: usize,
        shift: f64,
        longest: f64,
    ) -> Option<TorqueLag> {
        let column = self.model.layout().columns().len() + joint;
        let (rest, std) = (last.values[column], last.std[column]);
        let lag = shift + rest;
        let excited = last.rank.fixed.iter().all(|fixed| fixed.column != column);
        let settled = rest.abs() <= (0.5 * std).max(1.0e3 * SETTLED.1);
        let half_width = last.half_width_95[column];
        if !excited || !settled || lag.abs() >= 0.999 * longest || half_width >= longest {
            return None;
        }
        let moved = lag.abs() * rows.slope_rms;
        Some(TorqueLag {
            lag_s: lag / self.rate_hz,
            std_s: std / self.rate_hz,
            half_width_95_s: half_width / self.rate_hz,
            matters: lag.abs() > half_width && moved > last.joint_sigma[joint],
        })
    }

    fn rows(
        &self,
        settings: &EstimationSettings,
        filter: Option<&DecimationSettings>,
        joint: usize,
        shift: f64,
    ) -> Result<DelayRows, EstimationError> {
        let columns = self.model.layout().joint_columns(joint).len();
        DelayRows::new(&self.pieces, joint, columns, (self.rate_hz, filter), shift, settings.segments)
    }

    /// Parameters, then the rest of every joint's lag in samples.
    fn problem(
        &self,
        rows: &[DelayRows],
        shift: &[f64],
        factor: impl Fn(&DelayRows) -> &SegmentedFactor + Sync,
    ) -> Result<LinearProblem, EstimationError> {
        let layout = self.model.layout();
        let base = layout.columns().len();
        let names = (0..base + rows.len()).map(|column| format!("column {column}")).collect();
        let joints = (0..rows.len()).map(|joint| format!("joint {joint}")).collect();
        // What the log does not determine stays as it was fitted, for the slope was made with it.
        let fallback = self.theta.iter().copied().chain(vec![0.0; rows.len()]).collect();
        let mut problem = LinearProblem::new(names, joints).with_fallback(fallback)?;
        let mapped = |(joint, rows): (usize, &DelayRows)| {
            let own = layout.joint_columns(joint);
            let mut map = DMatrix::zeros(own.len() + 1 + NODES, own.len() + 2);
            for column in 0..=own.len() {
                map[(column, column)] = 1.0;
            }
            for (node, weight) in lagrange(shift[joint] - rows.centre as f64).into_iter().enumerate() {
                map[(own.len() + 1 + node, own.len() + 1)] = weight;
            }
            factor(rows).mapped(&map)
        };
        let mapped: Vec<_> = rows.par_iter().enumerate().map(mapped).collect::<Result<_, _>>()?;
        for (joint, mapped) in mapped.into_iter().enumerate() {
            let columns = layout.joint_columns(joint).iter().copied().chain([base + joint]).collect();
            problem.add("log", joint, columns, mapped)?;
        }
        Ok(problem)
    }
}

/// One lag from those of several logs: the mean weighted by their variances. Where logs differ by more than their error
/// bars say, the bar grows to what they differ by (Birge, Phys. Rev. 40 (1932) 207).
pub fn pooled_delay(lags: &[TorqueLag]) -> Option<TorqueLag> {
    let weight = |lag: &TorqueLag| lag.std_s.max(ROUNDING_S).powi(-2);
    let total: f64 = lags.iter().map(weight).sum();
    let first = lags.first()?;
    let mean = lags.iter().map(|lag| weight(lag) * lag.lag_s).sum::<f64>() / total;
    let scatter: f64 = lags.iter().map(|lag| weight(lag) * (lag.lag_s - mean).powi(2)).sum();
    let inflation = if lags.len() > 1 { (scatter / (lags.len() - 1) as f64).sqrt().max(1.0) } else { 1.0 };
    let half: f64 = lags.iter().map(|lag| (weight(lag) * lag.half_width_95_s).powi(2)).sum();
    let half_width_95_s = if lags.len() > 1 { inflation * half.sqrt() / total } else { first.half_width_95_s };
    let std_s = if lags.len() > 1 { inflation / total.sqrt() } else { first.std_s };
    let matters = lags.iter().any(|lag| lag.matters) && mean.abs() > half_width_95_s;
    Some(TorqueLag { lag_s: mean, std_s, half_width_95_s, matters })
}

/// The lags that matter as sentences.
pub fn delay_findings(lags: &[Option<TorqueLag>], joints: &[String]) -> Vec<Finding> {
    let of_joint = |(joint, lag): (&String, &Option<TorqueLag>)| {
        lag.filter(|lag| lag.matters).map(|lag| {
            let side = if lag.lag_s > 0.0 { "after" } else { "before" };
            let message = format!(
                "comes {:.1} +- {:.1} ms {side} the motion (95 %), estimated together with the model",
                1e3 * lag.lag_s.abs(),
                1e3 * lag.half_width_95_s
            );
            Finding { level: Level::Info, channel: format!("torque {joint}"), message }
        })
    };
    joints.iter().zip(lags).filter_map(of_joint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_that_agree_sharpen_the_lag_and_logs_that_do_not_widen_it() {
        let lag = |lag_s| TorqueLag { lag_s, std_s: 1e-3, half_width_95_s: 2e-3, matters: true };
        assert_eq!(pooled_delay(&[]), None);
        assert_eq!(pooled_delay(&[lag(5e-3)]), Some(lag(5e-3)));
        let agreeing = pooled_delay(&[lag(5e-3), lag(5e-3)]).unwrap_or(lag(0.0));
        // Two equal measurements: the mean's deviation is that of one by √2.
        assert!((agreeing.std_s - 1e-3 / 2_f64.sqrt()).abs() < 1e-12 && (agreeing.lag_s - 5e-3).abs() < 1e-12);
        let apart = pooled_delay(&[lag(0.0), lag(10e-3)]).unwrap_or(lag(0.0));
        // Half the difference of two is the deviation of their mean.
        assert!((apart.std_s - 5e-3).abs() < 1e-12 && !apart.matters);
    }
}
