//! The numerical rank of regressors at random states: the cross-check of the structural base parameters.

use crate::independent_columns::independent_regressor_columns;
use crate::regressor_panels::{Column, PanelLayout, Panels, all_columns, regressor_panels};
use crate::workspace::BatchWorkspace;
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_model::terms::{JointMotion, TorqueTerm};
use nalgebra::DMatrix;

/// What random states say about the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct NumericalRank {
    /// Independent columns by the same left-to-right rule, ascending.
    pub independent: Vec<usize>,
    /// Smallest share of a column that counted as independent.
    pub weakest_independent: f64,
    /// Largest share of a column that counted as dependent.
    pub strongest_dependent: f64,
}

/// Stacks regressors of `2 · columns / dof + 10` random states (positions within ±π rad or ±1 m, velocities within ±2,
/// accelerations within ±5) and splits their columns at `tolerance`. Deterministic in `seed`.
pub fn numerical_rank(model: &Model, terms: &[TorqueTerm], seed: u64, tolerance: f64) -> NumericalRank {
    let split = independent_regressor_columns(&stacked_regressors(model, terms, seed), tolerance);
    NumericalRank {
        independent: split.independent,
        weakest_independent: split.weakest_independent,
        strongest_dependent: split.strongest_dependent,
    }
}

/// Regressors at random states under one another: rows of joint after joint, all columns.
pub(super) fn stacked_regressors(model: &Model, terms: &[TorqueTerm], seed: u64) -> DMatrix<f64> {
    let columns = all_columns(model, terms);
    let (dof, count) = (model.dof(), columns.len());
    let samples = 2 * count / dof.max(1) + 10;
    let mut random = Random::new(seed);
    let mut states = |range: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..dof * samples).map(|k| random.uniform(-1.0, 1.0) * range(k / samples)).collect()
    };
    let q = states(&|joint| if model.joints()[joint].turns() { core::f64::consts::PI } else { 1.0 });
    let (dq, ddq) = (states(&|_| 2.0), states(&|_| 5.0));
    stacked(model, columns, &JointMotion { samples, q: &q, dq: &dq, ddq: &ddq })
}

/// The regressor of some columns at the states of a motion: rows of joint after joint.
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
