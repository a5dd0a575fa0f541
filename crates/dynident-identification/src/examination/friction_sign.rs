//! Friction that drives its joint: the sign of that joint's torque, or of its motion, is reversed.
//!
//! Least squares follows a reversed joint: its friction comes out negative, which no robot has. The check of the torque
//! as a whole, [`sign_evidence`](super::sign_evidence), asks the same of all joints at once and does not see one alone.

use dynident_dynamics::Column;
use dynident_estimation::{Estimate, LinearProblem};
use dynident_recording::{Finding, Level};
use dynident_rows::RegressorModel;

/// Standard deviations below zero from which friction counts as negative. On the real logs that this was first tried
/// on, honest joints stay above −2.5 and dead ones lie below −8.
const CLEARLY_NEGATIVE: f64 = 5.0;
/// The same as a share of what is left of the joint's torque: less may be the work of what the model has no term for,
/// as at a wrist whose torque is measured behind the gear and is mostly noise.
const SHARE_OF_LEFT: f64 = 0.5;

/// The mean friction of a joint by the estimate, each term at the root mean square of its column.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionSign {
    /// The joint.
    pub joint: String,
    /// `Σ_k θ_k ‖w_k‖ / √N` over the joint's own friction terms, whose columns w_k oppose the motion: Nm (N), negative
    /// where friction would drive the joint.
    pub torque: f64,
    /// Its standard deviation by the estimate's covariance.
    pub std: f64,
    /// What the estimate leaves of the joint's torque, Nm (N), root mean square.
    pub left: f64,
}

impl FrictionSign {
    /// Whether friction is negative beyond doubt.
    pub fn is_reversed(&self) -> bool {
        self.std > 0.0 && self.torque < -CLEARLY_NEGATIVE * self.std && self.torque < -SHARE_OF_LEFT * self.left
    }
}

/// The mean friction of every joint that has friction terms of its own, no load-dependent ones among them: these need a
/// load that is right.
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

/// A sentence for each joint whose friction is negative; a warning where other readings of the logs were tried and none
/// is better (`no_other_reading`): then it is the work of what the model has no term for.
pub fn friction_sign_findings(signs: &[FrictionSign], no_other_reading: bool) -> impl Iterator<Item = Finding> {
    signs.iter().filter(|sign| sign.is_reversed()).map(move |sign| Finding {
        level: if no_other_reading { Level::Warning } else { Level::Problem },
        channel: format!("torque {}", sign.joint),
        message: format!(
            "its friction comes out as {:.3} ± {:.3} Nm (N) and would drive the joint: its torque, or its position, has the opposite sign, or its torque is another joint's; \
             compare `sign` and the order of columns under torque and position",
            sign.torque, sign.std
        ),
    })
}
