//! The torque that an estimate predicts along a trajectory, for the display of a running motion.

use crate::estimation::estimate::RunEstimate;
use crate::estimation::forecast::covariance;
use crate::evidence::prediction::{HALF_WIDTH_95_SIGMAS, covariance_root};
use crate::evidence::torque_of_all::samples_of;
use crate::robot::ExpectedTorque;
use dynident_dynamics::{BatchWorkspace, Panels, ParametricModel, regressor_panels};
use dynident_simulation::Reference;
use nalgebra::{DMatrixView, DVector};

/// Maximum number of times; the display draws lines between them.
const MAX_TIMES: usize = 600;

/// Computes `w(t)ᵀ θ` and the band `1.96 √(w(t)ᵀ C w(t) + σ²)` along the trajectory for each joint, with the base
/// parameters θ, their covariance C, and the standard deviation σ of the joint's residual.
pub(crate) fn expected_torque(robot: &ParametricModel, known: &RunEstimate, reference: &Reference) -> ExpectedTorque {
    let whole = reference.motion();
    let step = whole.samples.div_ceil(MAX_TIMES).max(1);
    let samples: Vec<usize> = (0..whole.samples).step_by(step).collect();
    let part = samples_of(whole, &samples);
    let (mut workspace, mut panels) = (BatchWorkspace::new(robot.model()), Panels::default());
    regressor_panels(robot.model(), &mut workspace, robot.layout(), &part.view(), &mut panels);
    let spread = covariance(known);
    let theta = DVector::from_vec(known.values.clone());
    let mut expected = ExpectedTorque {
        times_s: samples.iter().map(|sample| *sample as f64 / reference.rate_hz()).collect(),
        ..ExpectedTorque::default()
    };
    for joint in 0..robot.dof() {
        let columns = robot.layout().joint_columns(joint);
        let values = &panels.joint(joint)[..columns.len() * samples.len()];
        let rows = DMatrixView::from_slice(values, samples.len(), columns.len());
        let torque = rows * theta.select_rows(columns);
        let spreads = rows * covariance_root(&spread, columns).transpose();
        let sigma = known.joint_sigma.get(joint).copied().unwrap_or(0.0);
        let half = |sample: usize| HALF_WIDTH_95_SIGMAS * (spreads.row(sample).norm_squared() + sigma * sigma).sqrt();
        expected.torque.push(torque.iter().copied().collect());
        expected.half_width_95.push((0..samples.len()).map(half).collect());
    }
    expected
}
