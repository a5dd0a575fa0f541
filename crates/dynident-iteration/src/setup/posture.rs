use dynident_simulation::Reference;
use dynident_simulation::controllers::ControllerModel;
use nalgebra::DMatrix;

/// Mass matrix `M(q)` including the inertia of the drives, column by column as `τ(q, 0, e_j) - τ(q, 0, 0)`, kg m²
/// (kg).
pub(crate) fn inertia_matrix(model: &mut ControllerModel, q: &[f64]) -> DMatrix<f64> {
    let dof = q.len();
    let (zeros, mut unit) = (vec![0.0; dof], vec![0.0; dof]);
    let (mut still, mut tau) = (vec![0.0; dof], vec![0.0; dof]);
    model.reference_torque(q, &zeros, &zeros, &mut still);
    let mut matrix = DMatrix::zeros(dof, dof);
    for joint in 0..dof {
        unit[joint] = 1.0;
        model.reference_torque(q, &zeros, &unit, &mut tau);
        unit[joint] = 0.0;
        for row in 0..dof {
            matrix[(row, joint)] = tau[row] - still[row];
        }
    }
    // Makes the matrix exactly symmetric; both halves differ by rounding.
    0.5 * (&matrix + matrix.transpose())
}

pub(crate) fn at_sample(reference: &Reference, sample: usize) -> [Vec<f64>; 3] {
    let motion = reference.motion();
    [&motion.q, &motion.dq, &motion.ddq]
        .map(|values| (0..motion.joints).map(|joint| values[joint * motion.samples + sample]).collect())
}
