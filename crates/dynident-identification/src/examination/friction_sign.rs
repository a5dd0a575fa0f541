//! Test for negative friction, which indicates that the sign of a joint's torque or of its motion is reversed.
//!
//! The least-squares estimate of the friction of a reversed joint is negative. [`sign_evidence`](super::sign_evidence)
//! tests all joints together and does not detect a single joint.

use crate::examination_settings::ExaminationSettings;
use dynident_dynamics::Column;
use dynident_estimation::{Estimate, LinearProblem};
use dynident_recording::{Finding, Level};
use dynident_rows::RegressorModel;

/// Mean friction of a joint in the estimate: each friction term, evaluated at the root mean square of its column.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionSign {
    /// The joint.
    pub joint: String,
    /// Mean friction torque `Σ_k θ_k ‖w_k‖ / √N` over the friction terms of this joint, Nm (N): parameters θ_k, columns
    /// w_k with the sign of the motion, and N rows. It is negative if friction would drive the joint.
    pub torque: f64,
    /// Standard deviation of this torque, from the covariance of the estimate.
    pub std: f64,
    /// Root mean square residual of the joint, Nm (N).
    pub left: f64,
}

impl FrictionSign {
    /// Whether the friction is significantly negative, with the thresholds of the default [`ExaminationSettings`].
    pub fn is_reversed(&self) -> bool {
        self.is_reversed_by(&ExaminationSettings::default())
    }

    /// Whether the friction is significantly negative, with the thresholds in `settings`.
    pub fn is_reversed_by(&self, settings: &ExaminationSettings) -> bool {
        let ExaminationSettings { min_friction_deviations, min_friction_ratio, .. } = *settings;
        self.std > 0.0
            && self.torque < -min_friction_deviations * self.std
            && self.torque < -min_friction_ratio * self.left
    }
}

/// Mean friction of every joint with friction terms. Load-dependent terms are excluded, because they need a correct
/// load.
pub fn friction_signs(model: &RegressorModel, problem: &LinearProblem, estimate: &Estimate) -> Vec<FrictionSign> {
    let (norms, rows, names) = (problem.column_norms(), problem.joint_rows(), model.joint_names());
    let columns = model.layout().columns();
    let excited = |index: usize| estimate.rank.fixed.iter().all(|fixed| fixed.column != index);
    let of_joint = |joint: usize| -> Option<FrictionSign> {
        let own = |(index, column): (usize, &Column)| match column {
            Column::Term(term) => (term.own_joint() == Some(joint)
                && term.is_joint_friction()
                && term.is_nonnegative()
                && !term.needs_load()
                && excited(index))
            .then_some(index),
            Column::Body { .. } => None,
        };
        let own: Vec<usize> = columns.iter().enumerate().filter_map(own).collect();
        let root = (rows[joint].max(1) as f64).sqrt();
        let weight = |index: usize| norms[index] / root;
        let torque = own.iter().map(|&index| weight(index) * estimate.values[index]).sum();
        let pairs = own.iter().flat_map(|&a| own.iter().map(move |&b| (a, b)));
        let variance: f64 = pairs.map(|(a, b)| weight(a) * weight(b) * estimate.covariance[(a, b)]).sum();
        let (std, left) = (variance.max(0.0).sqrt(), estimate.joint_sigma[joint]);
        (!own.is_empty()).then(|| FrictionSign { joint: names[joint].clone(), torque, std, left })
    };
    (0..model.dof()).filter_map(of_joint).collect()
}

/// A sentence for each joint with negative friction. It is only a warning if no other hypothesis about the logs is
/// better (`no_other_reading`), because an unmodelled effect is then the more probable cause.
pub fn friction_sign_findings(signs: &[FrictionSign], no_other_reading: bool) -> impl Iterator<Item = Finding> {
    signs.iter().filter(|sign| sign.is_reversed()).map(move |sign| Finding {
        code: "fit-negative-friction".to_owned(),
        level: if no_other_reading { Level::Warning } else { Level::Problem },
        channel: format!("torque {}", sign.joint),
        message: format!(
            "negative friction of {:.3} ± {:.3} Nm (N): its torque or its position has the opposite sign, or its torque belongs to another joint; \
             compare `sign` and the order of columns under torque and position",
            sign.torque, sign.std
        ),
    })
}
