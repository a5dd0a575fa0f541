//! Collection of the samples of a log for the estimation of its lags.

use super::rows::{DelayRows, FilteredRows, Piece};
use crate::estimators::EstimationSettings;
use dynident_dynamics::Column;
use dynident_estimation::EstimationError;
use dynident_recording::{DecimationSettings, Decimator, best_lag};
use dynident_rows::{JointRows, Logs, RawSamples, RegressorModel, motion_band_hz, predicted_torque};

/// Maximum number of samples; it is some tens of seconds of any log.
pub(crate) const DELAY_SAMPLES: usize = 20_000;
/// Number of samples per period of the cut-off frequency for the correlation of low-passed signals. A parabola through
/// three of them gives the position of a peak within a thousandth of the period.
const SAMPLES_PER_PERIOD: f64 = 20.0;
/// Maximum number of values that are kept in memory (64 MB).
const MAX_KEPT_VALUES: usize = 8_000_000;

/// Collects the first samples of a log and estimates their lags.
pub(crate) struct DelayCheck<'a> {
    model: &'a RegressorModel,
    theta: &'a [f64],
    /// `theta` with zeros except for friction that has a sign function.
    step_theta: Vec<f64>,
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
        let has_step = |column: &Column| matches!(column, Column::Term(term) if term.step_width().is_some());
        let columns = model.layout().columns().iter().zip(theta);
        let step_theta = columns.map(|(column, value)| if has_step(column) { *value } else { 0.0 }).collect();
        Self { model, theta, step_theta, pieces, samples: 0, numbers: 0, full: false, rate_hz: 0.0, buffer }
    }

    pub(super) fn take_filtered(&mut self, rows: &JointRows<'_>) {
        let Some(piece) = self.pieces.last_mut().filter(|_| !self.full) else { return };
        let regressor = &rows.panel[..self.model.layout().joint_columns(rows.joint).len() * rows.rows];
        self.numbers += regressor.len();
        let (regressor, coverage) = (regressor.to_vec(), rows.coverage.to_vec());
        piece.rows[rows.joint].push(FilteredRows { rows: rows.rows, regressor, coverage });
    }

    pub(super) fn take_raw(&mut self, samples: &RawSamples<'_>) {
        self.full |= self.samples >= DELAY_SAMPLES || self.numbers >= MAX_KEPT_VALUES;
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
            predicted_torque(panel, rows, columns, &self.step_theta, &mut self.buffer);
            piece.step[joint].extend_from_slice(&self.buffer);
            piece.measured[joint].extend_from_slice(&panel[columns.len() * rows..]);
            piece.leave_out(joint, samples.set_aside.get(joint).map_or(&[], Vec::as_slice));
            self.numbers += 3 * rows;
        }
    }

    pub(crate) fn model(&self) -> &'a RegressorModel {
        self.model
    }

    pub(crate) fn theta(&self) -> &'a [f64] {
        self.theta
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Start value of the lag, samples: the shift with the best match of predicted and measured torque, if a shift is
    /// significant.
    pub(crate) fn coarse(&self, joint: usize, cutoff_hz: Option<f64>, longest_s: f64) -> Option<f64> {
        let piece = self.pieces.iter().max_by_key(|piece| piece.measured[joint].len())?;
        let factor = cutoff_hz.map_or(1, |hz| (self.rate_hz / (SAMPLES_PER_PERIOD * hz)).clamp(1.0, 1000.0) as usize);
        let settings = DecimationSettings { factor, cutoff_hz, ..DecimationSettings::default() };
        let smooth = |signal: &[f64]| -> Option<Vec<f64>> {
            let mut out = Vec::new();
            let rows = Decimator::new(&settings, self.rate_hz, 1).ok()?.push(signal, signal.len(), &mut out);
            out.truncate(rows);
            Some(out)
        };
        let (model, measured) = (smooth(&piece.model[joint])?, smooth(&piece.measured[joint])?);
        let rate_hz = self.rate_hz / factor as f64;
        let longest = (longest_s * rate_hz).ceil() as usize;
        let lag = best_lag(&model, &measured, longest, rate_hz)?;
        lag.matters().then_some(lag.samples * factor as f64)
    }

    pub(crate) fn rows(
        &self,
        logs: &Logs<'_>,
        settings: &EstimationSettings,
        joint: usize,
        shift: f64,
    ) -> Result<DelayRows, EstimationError> {
        let columns = self.model.layout().joint_columns(joint).len();
        let filter = logs.filter.decimation(self.rate_hz, motion_band_hz(&logs.motion));
        DelayRows::new(&self.pieces, joint, columns, self.rate_hz, filter.as_ref(), shift, settings.segments)
    }
}
