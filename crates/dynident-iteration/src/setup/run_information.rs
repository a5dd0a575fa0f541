use dynident_dynamics::ParametricModel;
use dynident_excitation::{Information, Motion};
use dynident_simulation::Reference;
use nalgebra::DMatrix;

/// Maximum number of samples at which the information of a motion is evaluated, as an integral over time.
const MAX_SAMPLES: usize = 4_000;

/// Smallest assumed noise of a joint, Nm (N); simulated logs without noise have less.
const MIN_NOISE: f64 = 1e-9;

#[derive(Clone, Debug)]
pub(crate) struct RunNoise {
    /// Standard deviation of each joint's residual in the rows of the estimate, Nm (N).
    pub(crate) joint_sigma: Vec<f64>,
    pub(crate) rows_per_s: f64,
}

impl RunNoise {
    /// Creates the noise for a run of this duration (s) with this number of rows over all joints.
    pub(crate) fn new(joint_sigma: &[f64], rows: usize, duration_s: f64) -> Self {
        let joints = joint_sigma.len().max(1) as f64;
        let joint_sigma = joint_sigma.iter().map(|sigma| sigma.max(MIN_NOISE)).collect();
        Self { joint_sigma, rows_per_s: rows as f64 / joints / duration_s.max(f64::MIN_POSITIVE) }
    }
}

/// Information matrix `Σ_j W_jᵀ W_j / σ_j²` along a trajectory (W_j: regressor of joint j, σ_j: noise), in the base
/// columns of the robot with its terms, at the row rate of an estimate. It is assumed that the low-pass filter of
/// torque and columns does not change the motion.
pub(crate) fn run_information(robot: &ParametricModel, reference: &Reference, noise: &RunNoise) -> DMatrix<f64> {
    let whole = reference.motion();
    let step = whole.samples.div_ceil(MAX_SAMPLES).max(1);
    let mut part = Motion::default();
    part.reset(whole.joints, whole.samples.div_ceil(step));
    for joint in 0..whole.joints {
        let (to, from) = (part.of(joint), whole.of(joint));
        for (to_values, values) in [(&mut part.q, &whole.q), (&mut part.dq, &whole.dq), (&mut part.ddq, &whole.ddq)] {
            let every = values[from.clone()].iter().step_by(step);
            to_values[to.clone()].iter_mut().zip(every).for_each(|(to, value)| *to = *value);
        }
    }
    let weight = noise.rows_per_s * reference.duration_s() / part.samples.max(1) as f64;
    Information::new(robot.model(), robot.layout(), &noise.joint_sigma, None).of(&part, weight)
}
