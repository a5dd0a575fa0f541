//! Blocks of a motion, and the settings for converting a log to a motion.

use super::torque_lag::TorqueShift;
use crate::cleaning::CleaningSettings;
use crate::clock::ClockSettings;
use crate::derivative::DifferentiatorSettings;
use crate::error::{FilterError, require};
use crate::filter::CutoffSettings;
use crate::log::OneOrMany;
use crate::report::ReportSettings;
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Settings for converting a log to a motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct MotionSettings {
    /// Differentiator, which computes velocity and acceleration from the positions.
    pub differentiator: DifferentiatorSettings,
    /// Whether to smooth the torque like the positions, as [`MotionBlock::tau_smooth`].
    pub smooth_torque: bool,
    /// Time that is omitted at both ends of every uninterrupted piece, where a zero-phase filter extrapolates, s; 0 to
    /// 1,000,000, 0 by default.
    pub trim_s: f64,
    /// Whether to keep all samples as logged. By default, two kinds of torque samples are ignored (single samples far
    /// from their neighbours, and values that are repeated while their joint moves), and single spikes of a position
    /// are replaced; see [`RejectedSamples`](crate::RejectedSamples).
    pub keep_outliers: bool,
    /// Time by which the torque is later than the motion, s: one value for all joints or one for each. The torque is
    /// shifted by it. Negative if the torque is early. `identify` permits 2.5 times the time scale of the robot (2.5 s
    /// for an arm of 1.2 m). If it is not given, the torque is not shifted here, and `identify` estimates the lag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_lag_s: Option<OneOrMany<f64>>,
    /// Limits of the decisions on samples, clock and cut-off; not part of a study file.
    #[serde(skip)]
    pub limits: ImportLimits,
}

/// Limits of the decisions that Dynident makes while it reads a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportLimits {
    /// Limits of the detection of invalid samples.
    pub cleaning: CleaningSettings,
    /// Limits of the decision on the times of samples.
    pub clock: ClockSettings,
    /// Limits of the selection of a cut-off.
    pub cutoff: CutoffSettings,
    /// Limits of the findings in the report.
    pub report: ReportSettings,
}

/// Maximum lag for any robot, s.
const MAX_LAG_S: f64 = 1e4;

impl MotionSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        require((0.0..=1e6).contains(&self.trim_s), "trim_s", self.trim_s, "give seconds, 0 to 1000000")?;
        for lag_s in self.torque_lag_s.iter().flat_map(OneOrMany::values) {
            let fix = "give seconds, -10000 to 10000";
            require((-MAX_LAG_S..=MAX_LAG_S).contains(lag_s), "torque_lag_s", *lag_s, fix)?;
        }
        self.limits.cleaning.validate()?;
        self.limits.clock.validate()?;
        self.limits.cutoff.validate()?;
        self.limits.report.validate()?;
        self.differentiator.validate()
    }

    /// The torque lags of the joints, s; empty if not set.
    ///
    /// # Errors
    /// If the list has another length.
    pub(crate) fn torque_lags_s(&self, joints: usize) -> Result<Vec<f64>, FilterError> {
        let Some(stated) = &self.torque_lag_s else { return Ok(Vec::new()) };
        let lags: Vec<f64> = (0..joints).filter_map(|joint| stated.at(joint)).collect();
        let fits = lags.len() == joints && (stated.values().len() == 1 || stated.values().len() == joints);
        let fix = "give one number, or one for each joint of the log";
        require(fits, "torque_lag_s (number of values)", stated.values().len() as f64, fix)?;
        Ok(lags)
    }
}

/// Length of the part of a piece at each end that depends on extrapolated samples, in periods of the cut-off. After
/// this time, the transients of a Butterworth filter of order 4 have decayed to 3 %.
const UNSETTLED_PERIODS: f64 = 1.5;

/// Number of samples at each end of a long piece whose motion depends on samples that a low-pass with this cut-off
/// extrapolates.
pub fn unsettled_samples(rate_hz: f64, cutoff_hz: f64) -> usize {
    (UNSETTLED_PERIODS * rate_hz / cutoff_hz) as usize
}

/// Successive samples of a motion on a uniform clock, joint after joint: the value at `joint * rows + row`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionBlock {
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Index of the uninterrupted piece. Blocks of different pieces must not be filtered together.
    pub segment: usize,
    /// Time of the first row, s after the first data row of the file.
    pub first_time_s: f64,
    /// Number of rows.
    pub rows: usize,
    /// Number of joints.
    pub joints: usize,
    /// Filtered positions (rad, m).
    pub q: Vec<f64>,
    /// Velocities (rad/s, m/s).
    pub dq: Vec<f64>,
    /// Accelerations (rad/s², m/s²).
    pub ddq: Vec<f64>,
    /// Torques as logged, on the uniform clock, unfiltered (N m, N).
    pub tau: Vec<f64>,
    /// Torques smoothed like the positions; empty unless requested.
    pub tau_smooth: Vec<f64>,
    /// Temperatures of the joints on the uniform clock, unfiltered (°C); empty without a `temperature` group.
    pub temperature_c: Vec<f64>,
    /// For each torque value, whether it is ignored (outlier, held value, filled hole); empty if all are valid. An
    /// ignored value is replaced by a straight line, and a fit excludes the sample from torque and regressor.
    pub set_aside: Vec<bool>,
    /// Number of rows at the start and at the end of the block whose motion depends on samples that the filter
    /// extrapolated at the ends of a piece: 1.5 periods of the cut-off, at most the length of the filter and a quarter
    /// of the piece.
    pub unsettled: [usize; 2],
}

impl MotionBlock {
    /// The torques for the fit: smoothed like the positions if requested, otherwise as logged.
    pub fn fitted_tau(&self) -> &[f64] {
        if self.tau_smooth.is_empty() { &self.tau } else { &self.tau_smooth }
    }

    /// The values of one joint in one of this block's fields.
    pub fn joint<'a>(&self, values: &'a [f64], joint: usize) -> &'a [f64] {
        &values[joint * self.rows..(joint + 1) * self.rows]
    }

    /// Shifts the torque of each joint by its lag `lag_s` (s, one value for all joints or one for each; missing values
    /// are zero), as [`MotionSettings::torque_lag_s`] does while a log is read. Samples that have no torque after the
    /// shift are marked in `set_aside`.
    #[must_use]
    pub fn without_torque_lag(&self, lag_s: &OneOrMany<f64>) -> Self {
        let lags = (0..self.joints).map(|joint| lag_s.at(joint).unwrap_or(0.0));
        let shift = TorqueShift::new(lags, self.rate_hz);
        let mut shifted = self.clone();
        shifted.tau.clear();
        shifted.tau_smooth.clear();
        for joint in 0..self.joints {
            for row in shift.append(joint, self.joint(&self.tau, joint), 0..self.rows, &mut shifted.tau) {
                shifted.set_aside.resize(self.joints * self.rows, false);
                shifted.set_aside[joint * self.rows + row] = true;
            }
            if !self.tau_smooth.is_empty() {
                let smooth = self.joint(&self.tau_smooth, joint);
                shift.append(joint, smooth, 0..self.rows, &mut shifted.tau_smooth);
            }
        }
        shifted
    }

    /// The rows in the range `run` of the block.
    ///
    /// # Panics
    /// If the block has fewer rows.
    #[must_use]
    pub fn part(&self, run: Range<usize>) -> Self {
        let some = |values: &[f64]| -> Vec<f64> {
            if values.is_empty() {
                return Vec::new();
            }
            (0..self.joints).flat_map(|joint| self.joint(values, joint)[run.clone()].iter().copied()).collect()
        };
        Self {
            rate_hz: self.rate_hz,
            segment: self.segment,
            first_time_s: self.first_time_s + run.start as f64 / self.rate_hz,
            rows: run.len(),
            joints: self.joints,
            q: some(&self.q),
            dq: some(&self.dq),
            ddq: some(&self.ddq),
            tau: some(&self.tau),
            tau_smooth: some(&self.tau_smooth),
            temperature_c: some(&self.temperature_c),
            set_aside: (0..self.joints)
                .filter(|_| !self.set_aside.is_empty())
                .flat_map(|joint| self.set_aside[joint * self.rows..][run.clone()].iter().copied())
                .collect(),
            unsettled: [
                self.unsettled[0].saturating_sub(run.start).min(run.len()),
                (self.unsettled[1] + run.end).saturating_sub(self.rows).min(run.len()),
            ],
        }
    }
}
