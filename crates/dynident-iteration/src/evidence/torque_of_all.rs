//! The largest torque that a motion needs, over all models within the uncertainty of the parameters.

use crate::estimation::estimate::RunEstimate;
use crate::estimation::forecast::covariance;
use crate::evidence::prediction::covariance_root;
use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_excitation::Motion;
use dynident_simulation::Reference;
use nalgebra::{DMatrix, DMatrixView, DVector};

const SAMPLES_AT_ONCE: usize = 2048;

/// Approximate rate of the evaluated samples, Hz for an arm of 1.2 m; rigid-body torques change little between them.
const RATE_HZ: f64 = 500.0;

/// One-sided 95 % point of the standard normal distribution.
const NORMAL_95: f64 = 1.644_853_6;

#[derive(Clone, Debug)]
pub(crate) struct LargestTorque {
    /// Largest torque over all models in the 95 % ellipsoid of the parameters: `|wᵀθ| + √χ² √(wᵀ C w)`, which is the
    /// largest `|wᵀϑ|` with `(ϑ - θ)ᵀ C⁻¹ (ϑ - θ) ≤ χ²`. Also around the physically consistent model of the
    /// controllers.
    pub(crate) of_all: Vec<f64>,
    /// Largest excess over the torque by the model that the search uses.
    pub(crate) beyond_search: Vec<f64>,
}

/// Computes the largest torques along a trajectory. `searched` returns the torque by the model that the search uses,
/// joint-major along a motion.
pub(crate) fn largest_torque(
    robot: &ParametricModel,
    known: &RunEstimate,
    reference: &Reference,
    searched: &dyn Fn(&Motion) -> Vec<f64>,
) -> LargestTorque {
    let dof = robot.dof();
    let spread = covariance(known);
    let directions = (0..spread.nrows()).filter(|&k| spread[(k, k)] > 0.0).count();
    let width = chi_squared_95(directions).sqrt();
    let mut centres = vec![DVector::from_vec(known.values.clone())];
    centres.extend(known.possible.as_ref().map(|all| DVector::from_vec(robot.base().values(all))));
    let roots: Vec<DMatrix<f64>> =
        (0..dof).map(|joint| covariance_root(&spread, robot.layout().joint_columns(joint))).collect();
    let (mut workspace, mut panels) = (BatchWorkspace::new(robot.model()), Panels::default());
    let mut largest = LargestTorque { of_all: vec![0.0; dof], beyond_search: vec![0.0; dof] };
    let whole = reference.motion();
    let step = ((reference.rate_hz() / robot.model().characteristic_scale().round_hertz(RATE_HZ)) as usize).max(1);
    let samples: Vec<usize> = (0..whole.samples).step_by(step).collect();
    for some in samples.chunks(SAMPLES_AT_ONCE) {
        let part = samples_of(whole, some);
        regressor_panels(robot.model(), &mut workspace, robot.layout(), &part.view(), &mut panels);
        let of_search = searched(&part);
        for joint in 0..dof {
            let columns = robot.layout().joint_columns(joint);
            let rows =
                DMatrixView::from_slice(&panels.joint(joint)[..columns.len() * some.len()], some.len(), columns.len());
            let spreads = rows * roots[joint].transpose();
            let torques: Vec<DVector<f64>> = centres.iter().map(|theta| rows * theta.select_rows(columns)).collect();
            for sample in 0..some.len() {
                let middle = torques.iter().fold(0.0_f64, |most, tau| most.max(tau[sample].abs()));
                let all = middle + width * spreads.row(sample).norm();
                let beyond = all - of_search[joint * some.len() + sample].abs();
                largest.of_all[joint] = largest.of_all[joint].max(all);
                largest.beyond_search[joint] = largest.beyond_search[joint].max(beyond);
            }
        }
    }
    largest
}

pub(crate) fn samples_of(whole: &Motion, some: &[usize]) -> Motion {
    let mut part = Motion::default();
    part.reset(whole.joints, some.len());
    for joint in 0..whole.joints {
        let (to, from) = (part.of(joint), joint * whole.samples);
        for (to_values, values) in [(&mut part.q, &whole.q), (&mut part.dq, &whole.dq), (&mut part.ddq, &whole.ddq)] {
            to_values[to.clone()].iter_mut().zip(some).for_each(|(to, sample)| *to = values[from + sample]);
        }
    }
    part
}

/// The 95 % point of χ² with this number of degrees of freedom, by the Wilson-Hilferty approximation (Proc. Nat.
/// Acad. Sci. 17 (1931) 684). The error is at most 2.5 % from one degree of freedom on, and 0.1 % from ten on.
fn chi_squared_95(degrees_of_freedom: usize) -> f64 {
    if degrees_of_freedom == 0 {
        return 0.0;
    }
    let n = degrees_of_freedom as f64;
    let variance = 2.0 / (9.0 * n);
    n * (1.0 - variance + NORMAL_95 * variance.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::chi_squared_95;

    /// Abramowitz and Stegun, table 26.8.
    #[test]
    fn points_of_the_table() {
        for (degrees_of_freedom, value, within) in
            [(1, 3.84146, 0.025), (2, 5.99147, 0.01), (10, 18.3070, 1e-3), (50, 67.5048, 1e-3)]
        {
            let found = chi_squared_95(degrees_of_freedom);
            assert!((found / value - 1.0).abs() < within, "{degrees_of_freedom}: {found}");
        }
        assert_eq!(chi_squared_95(0), 0.0);
    }
}
