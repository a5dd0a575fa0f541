//! What the description's own inertials say about a log: is the torque's sign right, does torque come late?
//!
//! Least squares fits either sign equally well (all parameters change sign), so only a prior can tell.

use crate::rows::{JointRows, RawSamples};
use dynident_recording::{DecimationSettings, Decimator, Finding, Lag, Level, best_lag};
use serde::Serialize;

/// Samples kept to look for a lag.
const LAG_SAMPLES: usize = 20_000;
/// Longest lag looked for, seconds: drives and buses stay below.
const LONGEST_LAG_S: f64 = 0.1;
/// The other sign counts as right when it leaves less than this share of what the given sign leaves.
const CLEARLY_BETTER: f64 = 0.5;

/// How well the prior model explains the torque as given and with the opposite sign.
#[derive(Clone, Debug, Serialize)]
pub struct PriorAgreement {
    /// `100 ‖τ - τ_prior‖ / ‖τ‖`, all joints stacked.
    pub residual_percent: Option<f64>,
    /// `100 ‖-τ - τ_prior‖ / ‖τ‖`, all joints stacked.
    pub residual_percent_if_reversed: Option<f64>,
    /// Joints whose torque fits far better with the opposite sign.
    pub reversed_joints: Vec<String>,
    /// Lag of torque behind motion by joint, seconds; `None` where the motion does not tell.
    pub torque_lag_s: Vec<Option<f64>>,
}

#[derive(Clone, Copy, Default)]
struct Products {
    measured: f64,
    predicted: f64,
    mixed: f64,
}

/// Gathers the evidence while rows pass.
pub(crate) struct Evidence<'a> {
    columns: Vec<&'a [usize]>,
    prior: &'a [f64],
    products: Vec<Products>,
    /// Predicted and measured torque of the first uninterrupted samples, joint by joint.
    early: Vec<[Vec<f64>; 2]>,
    first_segment: Option<usize>,
    rate_hz: f64,
}

/// `panel · θ` for one joint.
pub(crate) fn predicted(panel: &[f64], rows: usize, columns: &[usize], theta: &[f64], out: &mut Vec<f64>) {
    out.clear();
    out.resize(rows, 0.0);
    for (place, &column) in columns.iter().enumerate() {
        let value = theta[column];
        for (to, x) in out.iter_mut().zip(&panel[place * rows..(place + 1) * rows]) {
            *to += value * x;
        }
    }
}

impl<'a> Evidence<'a> {
    pub(crate) fn new(columns: Vec<&'a [usize]>, prior: &'a [f64]) -> Self {
        let joints = columns.len();
        Self {
            columns,
            prior,
            products: vec![Products::default(); joints],
            early: vec![[Vec::new(), Vec::new()]; joints],
            first_segment: None,
            rate_hz: 0.0,
        }
    }

    pub(crate) fn filtered(&mut self, rows: &JointRows<'_>, buffer: &mut Vec<f64>) {
        let columns = self.columns[rows.joint];
        predicted(rows.panel, rows.rows, columns, self.prior, buffer);
        let measured = &rows.panel[columns.len() * rows.rows..];
        let sums = &mut self.products[rows.joint];
        for (p, m) in buffer.iter().zip(measured) {
            sums.measured += m * m;
            sums.predicted += p * p;
            sums.mixed += m * p;
        }
    }

    pub(crate) fn raw(&mut self, samples: &RawSamples<'_>, buffer: &mut Vec<f64>) {
        if self.early[0][0].len() >= LAG_SAMPLES
            || *self.first_segment.get_or_insert(samples.segment) != samples.segment
        {
            return;
        }
        self.rate_hz = samples.rate_hz;
        let rows = samples.panels.samples();
        for (joint, [early_predicted, early_measured]) in self.early.iter_mut().enumerate() {
            let panel = samples.panels.joint(joint);
            predicted(panel, rows, self.columns[joint], self.prior, buffer);
            early_predicted.extend_from_slice(buffer);
            early_measured.extend_from_slice(&panel[self.columns[joint].len() * rows..]);
        }
    }

    pub(crate) fn agreement(&self, joints: &[String], cutoff_hz: Option<f64>) -> PriorAgreement {
        let residual = |p: &Products, sign: f64| {
            let share = (p.measured - 2.0 * sign * p.mixed + p.predicted) / p.measured;
            (p.measured > 0.0).then(|| 100.0 * share.max(0.0).sqrt())
        };
        let total = self.products.iter().fold(Products::default(), |a, b| Products {
            measured: a.measured + b.measured,
            predicted: a.predicted + b.predicted,
            mixed: a.mixed + b.mixed,
        });
        let reversed = |p: &Products| match (residual(p, 1.0), residual(p, -1.0)) {
            (Some(given), Some(other)) => other < CLEARLY_BETTER * given,
            _ => false,
        };
        PriorAgreement {
            residual_percent: residual(&total, 1.0),
            residual_percent_if_reversed: residual(&total, -1.0),
            reversed_joints: joints
                .iter()
                .zip(&self.products)
                .filter(|(_, products)| reversed(products))
                .map(|(name, _)| name.clone())
                .collect(),
            torque_lag_s: self.early.iter().map(|pair| self.lag(pair, cutoff_hz)).collect(),
        }
    }

    /// The lag of one joint, both signals through one low-pass.
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
        let lag: Lag = best_lag(&model, &measured, longest, self.rate_hz)?;
        lag.matters().then_some(lag.seconds)
    }
}

/// The agreement as sentences, where they matter.
pub(crate) fn findings(agreement: &PriorAgreement, joints: &[String]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut add = |level, channel: String, message| findings.push(Finding { level, channel, message });
    if let (Some(given), Some(other)) = (agreement.residual_percent, agreement.residual_percent_if_reversed) {
        if other < CLEARLY_BETTER * given {
            let message = format!(
                "the torque has the opposite sign of the model: the description's own inertials leave {given:.0} % of the torque as given and \
                 {other:.0} % of its negative; write `sign = -1` under torque"
            );
            add(Level::Problem, "torque".to_owned(), message);
        } else {
            let message = format!(
                "the description's own inertials leave {given:.1} % of the torque ({other:.0} % of its negative)"
            );
            add(Level::Info, "torque".to_owned(), message);
            for joint in &agreement.reversed_joints {
                let message =
                    "fits far better with the opposite sign: check the sign of position and torque".to_owned();
                add(Level::Problem, format!("torque {joint}"), message);
            }
        }
    }
    for (joint, lag) in joints.iter().zip(&agreement.torque_lag_s) {
        if let Some(lag) = lag {
            let side = if *lag > 0.0 { "after" } else { "before" };
            add(Level::Info, format!("torque {joint}"), format!("comes {:.1} ms {side} the motion", 1e3 * lag.abs()));
        }
    }
    findings
}
