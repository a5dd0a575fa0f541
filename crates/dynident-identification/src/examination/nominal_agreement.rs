//! What the description's own inertials say about a log: is the torque's sign right?
//!
//! Least squares fits either sign equally well (all parameters change sign), so only a nominal model can decide.

use dynident_dynamics::Column;
use dynident_estimation::{
    EstimationError, FactorWorkspace, SegmentedFactor, TriangularFactor, nonnegative_least_squares,
};
use dynident_model::terms::TorqueTerm;
use dynident_recording::{Finding, Level};
use dynident_rows::{JointRows, RegressorModel, predicted_torque};
use nalgebra::{DMatrix, DVector};
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
    /// Joints whose torque fits far better with the opposite sign, each with friction and offset that suit it.
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

/// Squares of one joint's torque and of what the nominal values leave of it, with the given sign and with the other.
#[derive(Clone, Copy, Default)]
struct JointAgreement {
    torque: f64,
    left: [f64; 2],
    /// What is left beside friction that suits the torque best.
    left_beside_friction: [f64; 2],
}

impl JointAgreement {
    /// Of the rows behind a factor, with the nominal values of its columns; those in `friction` may have other ones.
    fn of(factor: &TriangularFactor, nominal: &[f64], friction: &OwnFriction) -> Self {
        let size = factor.columns() + 1;
        let column = |column: usize| DVector::from_fn(size, |row, _| factor.entry(row, column));
        let torque = column(size - 1);
        let mut predicted = DVector::zeros(size);
        for (place, value) in nominal.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            predicted.axpy(*value, &column(place), 1.0);
        }
        let left = [&torque - &predicted, -&torque - &predicted];
        let columns = DMatrix::from_fn(size, friction.columns.len(), |row, k| factor.entry(row, friction.columns[k]));
        let gram = columns.tr_mul(&columns);
        let beside_friction = |left: &DVector<f64>| {
            let values = nonnegative_least_squares(&gram, &columns.tr_mul(left), &friction.is_nonnegative);
            (left - &columns * values).norm_squared()
        };
        let left_beside_friction = left.each_ref().map(beside_friction);
        let squares = left.each_ref().map(DVector::norm_squared);
        Self { torque: torque.norm_squared(), left: squares, left_beside_friction }
    }

    /// Whether the torque fits far better with the opposite sign beside friction that suits either: in seconds of one
    /// phase of a motion friction may stand against the bodies, but never drives.
    fn is_reversed(&self) -> bool {
        let [given, other] = self.left_beside_friction;
        other < CLEARLY_BETTER * CLEARLY_BETTER * given
    }
}

/// Which of the columns of a joint are its own friction and offset.
struct OwnFriction {
    columns: Vec<usize>,
    /// Those whose parameters are never negative.
    is_nonnegative: Vec<bool>,
}

impl OwnFriction {
    fn of(model: &RegressorModel, joint: usize) -> Self {
        let term = |(place, &column): (usize, &usize)| match &model.layout().columns()[column] {
            Column::Term(term) if term.is_joint_friction() || matches!(term, TorqueTerm::Offset(_)) => {
                Some((place, term.is_nonnegative()))
            }
            Column::Term(_) | Column::Body { .. } => None,
        };
        let (columns, is_nonnegative) = model.layout().joint_columns(joint).iter().enumerate().filter_map(term).unzip();
        Self { columns, is_nonnegative }
    }
}

/// Rows of one joint for their agreement with nominal values, while they pass.
pub(crate) struct AgreementRows<'a> {
    columns: &'a [usize],
    nominal: &'a [f64],
    friction: OwnFriction,
    /// Of the columns of friction, the predicted torque and the torque.
    factor: TriangularFactor,
    workspace: FactorWorkspace,
    predicted: Vec<f64>,
    panel: Vec<f64>,
}

impl<'a> AgreementRows<'a> {
    /// For rows of a joint of the model, with the nominal values of all its columns.
    pub(crate) fn new(model: &'a RegressorModel, joint: usize, nominal: &'a [f64]) -> Self {
        let friction = OwnFriction::of(model, joint);
        let factor = TriangularFactor::new(friction.columns.len() + 1);
        let columns = model.layout().joint_columns(joint);
        let workspace = FactorWorkspace::default();
        Self { columns, nominal, friction, factor, workspace, predicted: Vec::new(), panel: Vec::new() }
    }

    pub(crate) fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), EstimationError> {
        predicted_torque(rows.panel, rows.rows, self.columns, self.nominal, &mut self.predicted);
        self.panel.clear();
        let column = |place: usize| &rows.panel[place * rows.rows..(place + 1) * rows.rows];
        for &place in &self.friction.columns {
            self.panel.extend_from_slice(column(place));
        }
        self.panel.extend_from_slice(&self.predicted);
        self.panel.extend_from_slice(column(self.columns.len()));
        self.factor.absorb_with(&mut self.workspace, &self.panel, rows.rows)
    }

    fn agreement(&self) -> JointAgreement {
        let last = self.friction.columns.len();
        let friction =
            OwnFriction { columns: (0..last).collect(), is_nonnegative: self.friction.is_nonnegative.clone() };
        let mut nominal = vec![0.0; last + 1];
        nominal[last] = 1.0;
        JointAgreement::of(&self.factor, &nominal, &friction)
    }
}

impl PriorAgreement {
    /// Of rows that have passed, joint by joint.
    pub(crate) fn of_rows(model: &RegressorModel, joints: &[AgreementRows<'_>]) -> Self {
        Self::of_joints(model, joints.iter().map(AgreementRows::agreement))
    }

    /// Of the rows behind factors of all columns, joint by joint, with the nominal values of the columns.
    pub(crate) fn of_factors(model: &RegressorModel, factors: &[SegmentedFactor], nominal: &[f64]) -> Self {
        let of_joint = |(joint, factor): (usize, &SegmentedFactor)| {
            let own: Vec<f64> = model.layout().joint_columns(joint).iter().map(|&column| nominal[column]).collect();
            JointAgreement::of(factor.total(), &own, &OwnFriction::of(model, joint))
        };
        Self::of_joints(model, factors.iter().enumerate().map(of_joint))
    }

    fn of_joints(model: &RegressorModel, joints: impl Iterator<Item = JointAgreement>) -> Self {
        let (mut torque, mut left, mut reversed_joints) = (0.0, [0.0; 2], Vec::new());
        for (name, joint) in model.joint_names().into_iter().zip(joints) {
            torque += joint.torque;
            left = [left[0] + joint.left[0], left[1] + joint.left[1]];
            if joint.is_reversed() {
                reversed_joints.push(name);
            }
        }
        let percent = |left: f64| (torque > 0.0).then(|| 100.0 * (left / torque).sqrt());
        let [residual_percent, residual_percent_if_reversed] = left.map(percent);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns: a body's, friction, an offset; rows of a joint that goes one way only.
    fn columns() -> [Vec<f64>; 3] {
        let body = |k: u32| 1.0 + 0.3 * (0.7 * f64::from(k)).sin();
        let velocity = |k: u32| -0.5 - 0.1 * (0.2 * f64::from(k)).cos();
        let of = |column: &dyn Fn(u32) -> f64| (0..40).map(column).collect();
        [of(&body), of(&velocity), of(&|_| 1.0)]
    }

    /// Nominally the body's column counts 1 and nothing is known of the others; the joint's parameters are `truth`.
    fn agreement(truth: [f64; 3], sign: f64) -> JointAgreement {
        let columns = columns();
        let torque = (0..40).map(|k| sign * truth.iter().zip(&columns).map(|(value, own)| value * own[k]).sum::<f64>());
        let panel: Vec<f64> = columns.iter().flatten().copied().chain(torque).collect();
        let factor = TriangularFactor::from_rows(3, &panel, 40).unwrap();
        JointAgreement::of(
            &factor,
            &[1.0, 0.0, 0.0],
            &OwnFriction { columns: vec![1, 2], is_nonnegative: vec![true, false] },
        )
    }

    #[test]
    fn friction_that_stands_against_the_bodies_is_no_other_sign() {
        let honest = agreement([1.0, 2.0, -0.8], 1.0);
        // By the bodies alone it is the other sign that fits far better.
        assert!(honest.left[1] < CLEARLY_BETTER * CLEARLY_BETTER * honest.left[0], "{:?}", honest.left);
        assert!(honest.left_beside_friction[0] < 1e-12 * honest.torque);
        assert!(!honest.is_reversed());
    }

    #[test]
    fn the_other_sign_is_seen_beside_friction() {
        for truth in [[1.0, 0.3, 0.1], [1.2, 0.3, 0.0], [0.8, 0.0, -0.1], [0.3, 5.0, 0.1]] {
            assert!(agreement(truth, -1.0).is_reversed(), "{truth:?}");
            assert!(!agreement(truth, 1.0).is_reversed(), "{truth:?}");
        }
    }
}
