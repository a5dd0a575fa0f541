//! Numerical rank of regressors at random states: the cross-check of the structural base parameters.

use crate::independent_columns::independent_regressor_columns;
use crate::regressor_panels::{Column, PanelLayout, Panels, all_columns, regressor_panels};
use crate::workspace::BatchWorkspace;
use dynident_model::sample::Random;
use dynident_model::terms::{JointMotion, TorqueTerm};
use dynident_model::{Model, Vec3};
use nalgebra::DMatrix;

/// Result of the rank test at random states.
#[derive(Clone, Debug, PartialEq)]
pub struct NumericalRank {
    /// Indices of the independent columns by the same left-to-right rule, ascending.
    pub independent: Vec<usize>,
    /// Smallest share of a column that was accepted as independent.
    pub weakest_independent: f64,
    /// Largest share of a column that was rejected as dependent.
    pub strongest_dependent: f64,
}

/// Stacks regressors of `2 · columns / dof + 10` random states (positions within ±π rad or ±ℓ, velocities within ±2
/// rad or ℓ per second, accelerations within ±5) and splits their columns at `tolerance`. The unit of length ℓ is the
/// robot's longest link, and gravity has separate rows, so the split does not depend on the size of the robot.
/// Deterministic in `seed`.
pub fn numerical_rank(model: &Model, terms: &[TorqueTerm], seed: u64, tolerance: f64) -> NumericalRank {
    let split = independent_regressor_columns(&ScaledRegressors::new(model, terms, seed).rows, tolerance);
    NumericalRank {
        independent: split.independent,
        weakest_independent: split.weakest_independent,
        strongest_dependent: split.strongest_dependent,
    }
}

/// Dimensionless regressors at random states: lengths in units of the longest link, inertia and gravity in units of
/// their largest entries.
///
/// A combination of columns is zero in all states if and only if it is zero at rest and its change due to motion is
/// zero. So rows at rest and rows of that change have the same dependencies, for any ratio of gravity to inertia.
pub(super) struct ScaledRegressors {
    /// Rows of the change due to motion, joint after joint, then rows at rest; all columns.
    pub(super) rows: DMatrix<f64>,
    pub(super) factors: Vec<f64>,
}

impl ScaledRegressors {
    pub(super) fn new(model: &Model, terms: &[TorqueTerm], seed: u64) -> Self {
        let columns = all_columns(model, terms);
        let (dof, count) = (model.dof(), columns.len());
        let samples = 2 * count / dof.max(1) + 10;
        let length = longest_link_m(model);
        let reach = |joint: usize| if model.joints()[joint].is_rotary() { 1.0 } else { length };
        let mut random = Random::new(seed);
        let mut states = |range: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..dof * samples).map(|k| random.uniform(-1.0, 1.0) * range(k / samples)).collect()
        };
        let q = states(&|joint| if model.joints()[joint].is_rotary() { core::f64::consts::PI } else { length });
        let (dq, ddq) = (states(&|joint| 2.0 * reach(joint)), states(&|joint| 5.0 * reach(joint)));
        let still = vec![0.0; dof * samples];
        let weightless = model.clone().with_gravity(Vec3::ZERO).unwrap_or_else(|_| model.clone());
        let resting = JointMotion { samples, q: &q, dq: &still, ddq: &still };
        let moving = stacked(&weightless, columns.clone(), &JointMotion { samples, q: &q, dq: &dq, ddq: &ddq })
            - stacked(&weightless, columns.clone(), &resting);
        let at_rest = stacked(model, columns.clone(), &resting);

        let of_body = |column: &Column| match column {
            Column::Body { parameter: 0, .. } => Some(1.0),
            Column::Body { parameter: 1..=3, .. } => Some(length),
            Column::Body { .. } => Some(length * length),
            Column::Term(_) => None,
        };
        let mut factors: Vec<f64> = columns.iter().map(|column| of_body(column).unwrap_or(1.0)).collect();
        let bodies = model.inertial_count();
        let mut rows = DMatrix::zeros(2 * dof * samples, count);
        for (begin, mut block) in [(0, moving), (dof * samples, at_rest)] {
            for (column, factor) in factors.iter().enumerate() {
                block.column_mut(column).scale_mut(*factor);
            }
            for joint in 0..dof {
                block.rows_mut(joint * samples, samples).unscale_mut(reach_of_torque(model, joint, length));
            }
            let largest = block.columns(0, bodies).amax();
            if largest > 0.0 {
                block.unscale_mut(largest);
            }
            rows.rows_mut(begin, dof * samples).copy_from(&block);
        }
        // Terms have different units, so each is scaled separately.
        for column in bodies..count {
            let largest = rows.column(column).amax();
            if largest > 0.0 {
                rows.column_mut(column).unscale_mut(largest);
                factors[column] /= largest;
            }
        }
        Self { rows, factors }
    }
}

/// Additional length factor of the torque of a revolute joint compared with a force.
fn reach_of_torque(model: &Model, joint: usize, length: f64) -> f64 {
    if model.joints()[joint].is_rotary() { length } else { 1.0 }
}

/// Longest distance between consecutive joints, m; 1 if all are at one point. The position of the first joint is
/// irrelevant.
pub(super) fn longest_link_m(model: &Model) -> f64 {
    let links = model.tree_joints().iter().filter(|joint| joint.parent.is_some());
    let longest = links.map(|joint| joint.placement.translation.norm()).fold(0.0, f64::max);
    if longest > 0.0 { longest } else { 1.0 }
}

/// Regressor of some columns at the states of a motion, joint after joint.
pub(super) fn stacked(model: &Model, columns: Vec<Column>, motion: &JointMotion<'_>) -> DMatrix<f64> {
    let (dof, count, samples) = (model.dof(), columns.len(), motion.samples);
    let layout = PanelLayout::new(model, columns);
    let mut panels = Panels::default();
    regressor_panels(model, &mut BatchWorkspace::new(model), &layout, motion, &mut panels);
    let mut stacked = DMatrix::zeros(dof * samples, count);
    for joint in 0..dof {
        for (place, &column) in layout.joint_columns(joint).iter().enumerate() {
            let values = &panels.joint(joint)[place * samples..(place + 1) * samples];
            stacked.view_mut((joint * samples, column), (samples, 1)).copy_from_slice(values);
        }
    }
    stacked
}
