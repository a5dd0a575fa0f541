//! What the description's own inertials say about a log: is the torque's sign right?
//!
//! Least squares fits either sign equally well (all parameters change sign), so only a nominal model can decide.

use crate::rows::{JointRows, predicted_torque};
use dynident_recording::{Finding, Level};
use serde::{Deserialize, Serialize};

/// The other sign counts as right when it leaves less than this share of what the given sign leaves.
const CLEARLY_BETTER: f64 = 0.5;

/// Percent of the torque that a description of the robot at hand hardly ever leaves; torque without friction is less.
const POOR_PERCENT: f64 = 50.0;

/// How well the prior model explains the torque as given and with the opposite sign.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PriorAgreement {
    /// `100 ‖τ - τ_prior‖ / ‖τ‖`, all joints stacked.
    pub residual_percent: Option<f64>,
    /// `100 ‖-τ - τ_prior‖ / ‖τ‖`, all joints stacked.
    pub residual_percent_if_reversed: Option<f64>,
    /// Joints whose torque fits far better with the opposite sign.
    pub reversed_joints: Vec<String>,
}

impl PriorAgreement {
    /// Whether the torque as a whole, or that of some joint, fits far better with the opposite sign.
    pub fn is_reversed(&self) -> bool {
        let whole = self.residual_percent.zip(self.residual_percent_if_reversed);
        whole.is_some_and(|(given, other)| other < CLEARLY_BETTER * given) || !self.reversed_joints.is_empty()
    }

    /// Whether the prior model leaves so much of the torque that its bodies may be another robot's.
    pub fn is_poor(&self) -> bool {
        self.residual_percent.is_some_and(|left| left > POOR_PERCENT)
    }
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
}

impl<'a> Evidence<'a> {
    pub(crate) fn new(columns: Vec<&'a [usize]>, prior: &'a [f64]) -> Self {
        let joints = columns.len();
        Self { columns, prior, products: vec![Products::default(); joints] }
    }

    pub(crate) fn filtered(&mut self, rows: &JointRows<'_>, buffer: &mut Vec<f64>) {
        let columns = self.columns[rows.joint];
        predicted_torque(rows.panel, rows.rows, columns, self.prior, buffer);
        let measured = &rows.panel[columns.len() * rows.rows..];
        let sums = &mut self.products[rows.joint];
        for (p, m) in buffer.iter().zip(measured) {
            sums.measured += m * m;
            sums.predicted += p * p;
            sums.mixed += m * p;
        }
    }

    pub(crate) fn agreement(&self, joints: &[String]) -> PriorAgreement {
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
        }
    }
}

/// The agreement as sentences, where they matter.
pub fn agreement_findings(agreement: &PriorAgreement) -> Vec<Finding> {
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
    findings
}
