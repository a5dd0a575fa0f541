//! The set of all inertial and friction parameters that has given base parameters and is nearest to the nominal values.

use super::problem::typical_length_m;
use dynident_dynamics::{Column, ParametricModel};
use dynident_model::{InertialParameters, Model};
use nalgebra::{DMatrix, DVector};

/// The parameters `π` with `B π = θ` (B maps parameters to base parameters) and the smallest weighted distance to the
/// nominal values: `π = π₀ + S Bᵀ (B S Bᵀ)⁻¹ (θ - B π₀)`.
///
/// The weights S are variances with the scale of a mass of 1 kg at the typical length of the robot's links. Torques
/// depend on θ alone, so all such sets predict the same torque. Masses and inertias of single bodies are therefore
/// **not** measured values.
pub fn nearest_to_nominal(robot: &ParametricModel, theta: &[f64]) -> Vec<f64> {
    let (model, base, prior) = (robot.model(), robot.base(), robot.nominal());
    let columns = base.all_columns();
    let count = base.count();
    let length = typical_length_m(model);
    let weight = |column: usize| -> f64 {
        let scale: f64 = match &columns[column] {
            Column::Body { parameter: 0, .. } => 1.0,
            Column::Body { parameter: 1..=3, .. } => length,
            Column::Body { .. } => length * length,
            Column::Term(term) if term.is_drive_inertia() => length * length,
            Column::Term(_) => 1.0,
        };
        scale * scale
    };
    let mut matrix = DMatrix::zeros(count, columns.len());
    for (b, &column) in base.independent().iter().enumerate() {
        matrix[(b, column)] = 1.0;
    }
    for (d, &column) in base.dependent().iter().enumerate() {
        matrix.column_mut(column).copy_from(&base.regrouping().column(d));
    }
    let weighted = DMatrix::from_fn(columns.len(), count, |c, b| weight(c) * matrix[(b, c)]);
    let gram = &matrix * &weighted;
    let gap = DVector::from_column_slice(theta) - DVector::from_vec(base.values(prior));
    // B has full row rank, because its independent columns form the identity matrix.
    let multipliers = gram.cholesky().map_or_else(|| gap.clone(), |factor| factor.solve(&gap));
    let change = weighted * multipliers;
    prior.iter().zip(change.iter()).map(|(prior, change)| prior + change).collect()
}

/// The bodies of a vector of all parameters.
pub fn inertials(model: &Model, parameters: &[f64]) -> Vec<InertialParameters> {
    let own = |body: usize| InertialParameters(core::array::from_fn(|k| parameters[10 * body + k]));
    (0..model.body_count()).map(own).collect()
}
