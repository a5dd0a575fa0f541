//! Base parameters of robots with coupled joints. The structural rule is valid for the joints of a tree. A degree of
//! freedom that moves several joints measures sums of their columns, so here dependencies are found from regressors
//! at random states. Friction is separate, as in the structural rule: it does not combine with other columns, and
//! each of its functions of the motion is one condition.

use super::numerical::ScaledRegressors;
use super::structural::friction_conditions;
use crate::independent_columns::{IndependentColumns, independent_regressor_columns};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;
use nalgebra::DMatrix;

/// Fixed, so that the same robot always has the same base parameters.
const SEED: u64 = 1;

/// Splits all columns (bodies, then terms); shares below `tolerance` are treated as zero.
pub(super) fn independent_columns(model: &Model, terms: &[TorqueTerm], tolerance: f64) -> IndependentColumns {
    let ScaledRegressors { mut rows, factors } = ScaledRegressors::new(model, terms, SEED);
    let first_term = model.inertial_count();
    let is_friction = |column: usize| column >= first_term && !terms[column - first_term].functions().is_empty();
    for column in (0..rows.ncols()).filter(|&column| is_friction(column)) {
        rows.column_mut(column).fill(0.0);
    }
    let friction = friction_conditions(terms);
    let mut all = DMatrix::zeros(rows.nrows() + friction.len(), rows.ncols());
    all.rows_mut(0, rows.nrows()).copy_from(&rows);
    for (k, condition) in friction.iter().enumerate() {
        let mut row = all.row_mut(all.nrows() - friction.len() + k);
        row.columns_mut(first_term, terms.len()).tr_copy_from(condition);
    }
    let mut split = independent_regressor_columns(&all, tolerance);
    // Undo the scaling; friction columns were not scaled.
    let factor = |column: usize| if is_friction(column) { 1.0 } else { factors[column] };
    for (d, &dependent) in split.dependent.iter().enumerate() {
        for (b, &base) in split.independent.iter().enumerate() {
            split.regrouping[(b, d)] *= factor(base) / factor(dependent);
        }
    }
    split
}
