//! What the description's own inertials say about a log: is the torque's sign right?
//!
//! Least squares fits either sign equally well (all parameters change sign), so only a nominal model can decide.

use crate::regressor_model::RegressorModel;
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

impl Products {
    /// `100 ‖τ − sign · τ_prior‖ / ‖τ‖`; none without torque.
    fn residual_percent(&self, sign: f64) -> Option<f64> {
        let share = (self.measured - 2.0 * sign * self.mixed + self.predicted) / self.measured;
        (self.measured > 0.0).then(|| 100.0 * share.max(0.0).sqrt())
    }

    fn is_reversed(&self) -> bool {
        let both = self.residual_percent(1.0).zip(self.residual_percent(-1.0));
        both.is_some_and(|(given, other)| other < CLEARLY_BETTER * given)
    }
}

/// Gathers the evidence of one joint while its rows pass.
pub(crate) struct Evidence<'a> {
    columns: &'a [usize],
    prior: &'a [f64],
    products: Products,
    predicted: Vec<f64>,
}

impl<'a> Evidence<'a> {
    /// For rows of a joint of the model, with the nominal values of all its columns.
    pub(crate) fn new((model, joint): (&'a RegressorModel, usize), prior: &'a [f64]) -> Self {
        let columns = model.layout().joint_columns(joint);
        Self { columns, prior, products: Products::default(), predicted: Vec::new() }
    }

    pub(crate) fn filtered(&mut self, rows: &JointRows<'_>) {
        predicted_torque(rows.panel, rows.rows, self.columns, self.prior, &mut self.predicted);
        let measured = &rows.panel[self.columns.len() * rows.rows..];
        for (p, m) in self.predicted.iter().zip(measured) {
            self.products.measured += m * m;
            self.products.predicted += p * p;
            self.products.mixed += m * p;
        }
    }
}

impl PriorAgreement {
    /// What all joints' evidence says, joint by joint with its name.
    pub(crate) fn of<'e>(joints: impl IntoIterator<Item = (&'e String, &'e Evidence<'e>)>) -> Self {
        let (mut total, mut reversed_joints) = (Products::default(), Vec::new());
        for (name, Evidence { products, .. }) in joints {
            total.measured += products.measured;
            total.predicted += products.predicted;
            total.mixed += products.mixed;
            if products.is_reversed() {
                reversed_joints.push(name.clone());
            }
        }
        let [residual_percent, residual_percent_if_reversed] = [1.0, -1.0].map(|sign| total.residual_percent(sign));
        Self { residual_percent, residual_percent_if_reversed, reversed_joints }
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
