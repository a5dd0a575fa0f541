//! Does the torque come late? The fitted model's prediction against the measured torque, shifted until they match.
//!
//! The prior would not do: what its wrong inertias and missing friction leave looks like a lag of many milliseconds. The fitted model has absorbed a part of the lag, so the
//! figure is a lower bound.

use crate::error::Error;
use crate::machine::Machine;
use crate::measured::evidence::predicted;
use crate::measured::rows::{JointRows, RawSamples, RowSink};
use dynident_recording::{DecimationSettings, Decimator, Finding, Level, best_lag};

/// Samples that are looked at: some tens of seconds of any log.
pub(crate) const LAG_SAMPLES: usize = 20_000;
/// Longest lag looked for, seconds: drives and buses stay below.
const LONGEST_LAG_S: f64 = 0.1;

/// Predicted and measured torque of a log's first uninterrupted samples.
pub(crate) struct LagCheck<'a> {
    machine: &'a Machine,
    theta: &'a [f64],
    early: Vec<[Vec<f64>; 2]>,
    segment: Option<usize>,
    rate_hz: f64,
    buffer: Vec<f64>,
}

impl<'a> LagCheck<'a> {
    pub(crate) fn new(machine: &'a Machine, theta: &'a [f64]) -> Self {
        let early = vec![[Vec::new(), Vec::new()]; machine.model.dof()];
        Self { machine, theta, early, segment: None, rate_hz: 0.0, buffer: Vec::new() }
    }

    /// Lag of torque behind motion by joint, seconds; `None` where the motion does not tell.
    pub(crate) fn lags(&self, cutoff_hz: Option<f64>) -> Vec<Option<f64>> {
        self.early.iter().map(|pair| self.lag(pair, cutoff_hz)).collect()
    }

    fn lag(&self, [model, measured]: &[Vec<f64>; 2], cutoff_hz: Option<f64>) -> Option<f64> {
        let settings = DecimationSettings { factor: 1, cutoff_hz, ..DecimationSettings::default() };
        let smooth = |signal: &[f64]| -> Option<Vec<f64>> {
            let mut out = Vec::new();
            let rows = Decimator::new(&settings, self.rate_hz, 1).ok()?.push(signal, signal.len(), &mut out);
            out.truncate(rows);
            Some(out)
        };
        let (model, measured) = (smooth(model)?, smooth(measured)?);
        let longest = (LONGEST_LAG_S * self.rate_hz).ceil() as usize;
        let lag = best_lag(&model, &measured, longest, self.rate_hz)?;
        lag.matters().then_some(lag.seconds)
    }
}

impl RowSink for LagCheck<'_> {
    fn filtered(&mut self, _rows: &JointRows<'_>) -> Result<(), Error> {
        Ok(())
    }

    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), Error> {
        let full = self.early[0][0].len() >= LAG_SAMPLES;
        if full || *self.segment.get_or_insert(samples.segment) != samples.segment {
            return Ok(());
        }
        self.rate_hz = samples.rate_hz;
        let rows = samples.panels.samples();
        for (joint, [model, measured]) in self.early.iter_mut().enumerate() {
            let columns = self.machine.layout.joint_columns(joint);
            let panel = samples.panels.joint(joint);
            predicted(panel, rows, columns, self.theta, &mut self.buffer);
            model.extend_from_slice(&self.buffer);
            measured.extend_from_slice(&panel[columns.len() * rows..]);
        }
        Ok(())
    }
}

/// The lags as sentences.
pub(crate) fn findings(lags: &[Option<f64>], joints: &[String]) -> Vec<Finding> {
    let of_joint = |(joint, lag): (&String, &Option<f64>)| {
        lag.map(|lag| {
            let side = if lag > 0.0 { "after" } else { "before" };
            Finding {
                level: Level::Info,
                channel: format!("torque {joint}"),
                message: format!("comes {:.1} ms {side} the motion, by the fitted model", 1e3 * lag.abs()),
            }
        })
    };
    joints.iter().zip(lags).filter_map(of_joint).collect()
}
