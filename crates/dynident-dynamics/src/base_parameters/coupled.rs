//! Base parameters where joints follow others. The structure of a tree says which columns a joint's torque tells; a
//! degree of freedom that moves several joints feels sums of these, whose dependencies are those of regressors at
//! random states. Friction stays apart, as in the structural rule: it mixes with nothing, and each of its functions
//! of the motion is one condition.

use super::numerical::stacked_regressors;
use super::structural::friction_conditions;
use crate::independent_columns::{IndependentColumns, independent_regressor_columns};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;
use nalgebra::DMatrix;

/// The states are the same every time, so that the same robot has the same base parameters.
const SEED: u64 = 1;

/// The split of all columns (bodies, then terms), where a share below `tolerance` counts as none.
pub(super) fn independent_columns(model: &Model, terms: &[TorqueTerm], tolerance: f64) -> IndependentColumns {
    let mut rows = stacked_regressors(model, terms, SEED);
    let first_term = model.inertial_count();
    for (place, term) in terms.iter().enumerate() {
        if !term.functions().is_empty() {
            rows.column_mut(first_term + place).fill(0.0);
        }
    }
    let friction = friction_conditions(terms);
    // Beside rows that are one entry each, torques count as much in any unit.
    let largest = rows.amax();
    let mut all = DMatrix::zeros(rows.nrows() + friction.len(), rows.ncols());
    all.rows_mut(0, rows.nrows()).copy_from(&if largest > 0.0 { rows / largest } else { rows });
    for (k, condition) in friction.iter().enumerate() {
        let mut row = all.row_mut(all.nrows() - friction.len() + k);
        row.columns_mut(first_term, terms.len()).tr_copy_from(condition);
    }
    independent_regressor_columns(&all, tolerance)
}
