//! Agreement of a log with the robot description (nominal model): residual and sign of the torque.
//!
//! Least squares fits a reversed torque equally well, because all parameters can change their signs. Only a nominal
//! model determines the sign.

use crate::examination_settings::ExaminationSettings;
use dynident_dynamics::Column;
use dynident_estimation::{
    EstimationError, FactorWorkspace, SegmentedFactor, TriangularFactor, nonnegative_least_squares,
};
use dynident_model::terms::TorqueTerm;
use dynident_recording::{Finding, Level};
use dynident_rows::{JointRows, RegressorModel, predicted_torque};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Residual of the nominal model for the torque as logged and for the torque with the opposite sign.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PriorAgreement {
    /// Residual for the torque τ as logged, `100 ‖τ - τ_prior‖ / ‖τ‖`, where τ_prior is the torque of the nominal
    /// model; all joints stacked.
    pub residual_percent: Option<f64>,
    /// Residual for the torque with the opposite sign, `100 ‖-τ - τ_prior‖ / ‖τ‖`; all joints stacked.
    pub residual_percent_if_reversed: Option<f64>,
    /// Joints whose torque agrees far better with the nominal model if its sign is reversed. Friction and offset are
    /// fitted for both signs.
    pub reversed_joints: Vec<String>,
}

impl PriorAgreement {
    /// Whether the torque of all joints, or of one joint, agrees far better with the opposite sign. (The settings of
    /// the examination were used for `reversed_joints`.)
    pub fn is_reversed_by(&self, settings: &ExaminationSettings) -> bool {
        self.is_whole_reversed(settings) || !self.reversed_joints.is_empty()
    }

    fn is_whole_reversed(&self, settings: &ExaminationSettings) -> bool {
        let whole = self.residual_percent.zip(self.residual_percent_if_reversed);
        whole.is_some_and(|(given, other)| other < settings.max_reversed_ratio * given)
    }

    /// Whether the residual is so large that the nominal bodies may belong to another robot.
    pub fn is_poor_by(&self, settings: &ExaminationSettings) -> bool {
        self.residual_percent.is_some_and(|left| left > settings.max_nominal_residual_percent)
    }
}

/// Sum of squares of one joint's torque, and of its residuals with the nominal values, for the torque as logged and
/// with the opposite sign.
#[derive(Clone, Copy, Default)]
struct JointAgreement {
    torque: f64,
    left: [f64; 2],
    /// Residuals with fitted friction and offset.
    left_with_friction: [f64; 2],
}

impl JointAgreement {
    /// Computes the agreement from the rows of a triangular factor, with the nominal values of its columns. The columns
    /// in `friction` are also fitted.
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
        let with_friction = |left: &DVector<f64>| {
            let values = nonnegative_least_squares(&gram, &columns.tr_mul(left), &friction.is_nonnegative);
            (left - &columns * values).norm_squared()
        };
        let left_with_friction = left.each_ref().map(with_friction);
        let squares = left.each_ref().map(DVector::norm_squared);
        Self { torque: torque.norm_squared(), left: squares, left_with_friction }
    }

    /// Whether the torque agrees far better with the opposite sign. Friction is fitted for both signs, but it must not
    /// drive the joint. (In a few seconds of motion in one direction, friction could otherwise compensate for the
    /// bodies.)
    fn is_reversed(&self, settings: &ExaminationSettings) -> bool {
        let [given, other] = self.left_with_friction;
        other < settings.max_reversed_ratio * settings.max_reversed_ratio * given
    }
}

/// Columns of friction and offset that belong to one joint.
struct OwnFriction {
    columns: Vec<usize>,
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

/// Accumulates the rows of one joint for their agreement with nominal values.
pub(crate) struct AgreementAccumulator<'a> {
    columns: &'a [usize],
    nominal: &'a [f64],
    friction: OwnFriction,
    /// Triangular factor of the columns friction, predicted torque and measured torque.
    factor: TriangularFactor,
    workspace: FactorWorkspace,
    predicted: Vec<f64>,
    panel: Vec<f64>,
}

impl<'a> AgreementAccumulator<'a> {
    /// Creates an accumulator; `nominal` contains the nominal values of all columns of the model.
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
    /// Agreement from accumulated rows, one accumulator for each joint.
    pub(crate) fn of_rows(
        model: &RegressorModel,
        joints: &[AgreementAccumulator<'_>],
        settings: &ExaminationSettings,
    ) -> Self {
        Self::of_joints(model, joints.iter().map(AgreementAccumulator::agreement), settings)
    }

    /// Agreement from triangular factors of all columns, one for each joint, with the nominal values of the columns.
    pub(crate) fn of_factors(
        model: &RegressorModel,
        factors: &[SegmentedFactor],
        nominal: &[f64],
        settings: &ExaminationSettings,
    ) -> Self {
        let of_joint = |(joint, factor): (usize, &SegmentedFactor)| {
            let own: Vec<f64> = model.layout().joint_columns(joint).iter().map(|&column| nominal[column]).collect();
            JointAgreement::of(factor.total(), &own, &OwnFriction::of(model, joint))
        };
        Self::of_joints(model, factors.iter().enumerate().map(of_joint), settings)
    }

    fn of_joints(
        model: &RegressorModel,
        joints: impl Iterator<Item = JointAgreement>,
        settings: &ExaminationSettings,
    ) -> Self {
        let (mut torque, mut left, mut reversed_joints) = (0.0, [0.0; 2], Vec::new());
        for (name, joint) in model.joint_names().into_iter().zip(joints) {
            torque += joint.torque;
            left = [left[0] + joint.left[0], left[1] + joint.left[1]];
            if joint.is_reversed(settings) {
                reversed_joints.push(name);
            }
        }
        let percent = |left: f64| (torque > 0.0).then(|| 100.0 * (left / torque).sqrt());
        let [residual_percent, residual_percent_if_reversed] = left.map(percent);
        Self { residual_percent, residual_percent_if_reversed, reversed_joints }
    }
}

/// Findings about the agreement, in sentences.
pub fn agreement_findings(agreement: &PriorAgreement) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut add = |code: &str, level, channel: String, message| {
        findings.push(Finding { code: code.to_owned(), level, channel, message });
    };
    if let (Some(given), Some(other)) = (agreement.residual_percent, agreement.residual_percent_if_reversed) {
        if agreement.is_whole_reversed(&ExaminationSettings::default()) {
            let message = format!(
                "the torque has the opposite sign of the model: with the robot description {given:.0} % of the torque are unexplained as given and \
                 {other:.0} % with the opposite sign; write `sign = -1` under torque"
            );
            add("fit-torque-sign", Level::Problem, "torque".to_owned(), message);
        } else {
            let message = format!(
                "with the robot description {given:.1} % of the torque are unexplained ({other:.0} % with the opposite sign)"
            );
            add("fit-description", Level::Info, "torque".to_owned(), message);
            for joint in &agreement.reversed_joints {
                let message = "the opposite sign fits far better: check the sign of position and torque".to_owned();
                add("fit-joint-sign", Level::Problem, format!("torque {joint}"), message);
            }
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a body, friction and an offset, for a joint that moves in one direction.
    fn columns() -> [Vec<f64>; 3] {
        let body = |k: u32| 1.0 + 0.3 * (0.7 * f64::from(k)).sin();
        let velocity = |k: u32| -0.5 - 0.1 * (0.2 * f64::from(k)).cos();
        let of = |column: &dyn Fn(u32) -> f64| (0..40).map(column).collect();
        [of(&body), of(&velocity), of(&|_| 1.0)]
    }

    /// The nominal values are 1 for the body and 0 for the others; the true values are `truth`.
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
    fn friction_against_the_bodies_is_not_a_reversed_sign() {
        let correct = agreement([1.0, 2.0, -0.8], 1.0);
        // Without friction the opposite sign fits far better.
        assert!(correct.left[1] < 0.25 * correct.left[0], "{:?}", correct.left);
        assert!(correct.left_with_friction[0] < 1e-12 * correct.torque);
        assert!(!correct.is_reversed(&ExaminationSettings::default()));
    }

    #[test]
    fn detects_a_reversed_sign_with_friction() {
        let is_reversed = |truth, sign| agreement(truth, sign).is_reversed(&ExaminationSettings::default());
        for truth in [[1.0, 0.3, 0.1], [1.2, 0.3, 0.0], [0.8, 0.0, -0.1], [0.3, 5.0, 0.1]] {
            assert!(is_reversed(truth, -1.0), "{truth:?}");
            assert!(!is_reversed(truth, 1.0), "{truth:?}");
        }
    }
}
