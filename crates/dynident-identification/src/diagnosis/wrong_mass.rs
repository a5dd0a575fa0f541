//! One body whose mass the description has wrong: one number, in place of another unit of every joint's torque.

use super::motion_rows::MotionRows;
use super::nominal::nominal_torque;
use dynident_dynamics::ParametricModel;
use dynident_model::InertialParameters;
use nalgebra::{DMatrix, DVector};

/// Factors within which descriptions err.
const USUAL: [f64; 2] = [0.5, 2.0];

/// A body whose inertials, times a factor, explain what else asks for another unit of every torque.
#[derive(Clone, Debug, PartialEq)]
pub struct WrongMass {
    /// The body's number.
    pub body: usize,
    /// What its mass and inertia have to be multiplied by.
    pub factor: f64,
    /// Share of the joints' torques, friction aside, that the description so corrected leaves (root mean squares).
    pub left: f64,
}

/// The body whose factor leaves less of the torques than a factor of every joint's own leaves, `left_by_scales` (the
/// sum over joints of squares, each joint in units of what friction leaves of its torque); none where no body does.
///
/// With friction, drive inertia and an offset taken off joint by joint, `τ - τ_others = s τ_body` has one unknown for
/// all joints.
pub(super) fn wrong_mass(robot: &ParametricModel, rows: &MotionRows, left_by_scales: f64) -> Option<WrongMass> {
    let all = nominal_torque(robot, rows)?;
    let aside = Aside::new(rows)?;
    let torque: Vec<DVector<f64>> = rows.tau.iter().enumerate().map(|(joint, tau)| aside.without(joint, tau)).collect();
    let inertials = robot.model().inertials();
    let of_body = |body: usize| {
        let own: Vec<InertialParameters> = (0..inertials.len())
            .map(|other| if other == body { inertials[other] } else { InertialParameters([0.0; 10]) })
            .collect();
        let alone = ParametricModel::new(robot.model().with_inertials(&own).ok()?, Vec::new()).ok()?;
        let alone = nominal_torque(&alone, rows)?;
        let (mut product, mut square, mut left) = (0.0, 0.0, 0.0);
        for (joint, torque) in torque.iter().enumerate().filter(|(_, torque)| torque.norm_squared() > 0.0) {
            let own = aside.without(joint, &alone[joint]);
            let rest = torque - (aside.without(joint, &all[joint]) - &own);
            let weight = torque.norm_squared().recip();
            product += weight * own.dot(&rest);
            square += weight * own.norm_squared();
            left += weight * rest.norm_squared();
        }
        let factor = product / square;
        let left = left - product * factor;
        let is_wrong = factor.is_finite() && factor > 0.0 && !(USUAL[0]..=USUAL[1]).contains(&factor);
        let share = (left.max(0.0) / torque.len() as f64).sqrt();
        (is_wrong && left < left_by_scales).then_some(WrongMass { body, factor, left: share })
    };
    (0..inertials.len()).filter_map(of_body).min_by(|a, b| a.left.total_cmp(&b.left))
}

/// Takes friction, drive inertia and an offset off each joint's torque.
struct Aside(Vec<DMatrix<f64>>);

impl Aside {
    fn new(rows: &MotionRows) -> Option<Self> {
        let of_joint = |joint: usize| {
            let (dq, ddq) = (&rows.dq[joint], &rows.ddq[joint]);
            let matrix = DMatrix::from_fn(rows.len(), 4, |row, k| match k {
                0 => 1.0,
                1 => dq[row],
                2 => dq[row].signum(),
                _ => ddq[row],
            });
            // A joint at rest has no friction to take off: its directions are no directions.
            let decomposition = matrix.svd(true, false);
            let basis = decomposition.u?;
            let most = decomposition.singular_values.max();
            let kept: Vec<usize> = (0..4).filter(|&k| decomposition.singular_values[k] > 1e-9 * most).collect();
            Some(basis.select_columns(&kept))
        };
        (0..rows.dq.len()).map(of_joint).collect::<Option<_>>().map(Self)
    }

    fn without(&self, joint: usize, torque: &[f64]) -> DVector<f64> {
        let torque = DVector::from_column_slice(torque);
        let basis = &self.0[joint];
        &torque - basis * basis.tr_mul(&torque)
    }
}
