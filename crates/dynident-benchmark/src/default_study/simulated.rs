//! One recording of a case, with its true values.

use super::cases::DefaultCase;
use crate::friction_truths::{FrictionTruth, MIN_DETECTABLE_STD, usual_drive};
use crate::simulated_logs::{
    PERIOD_S, model_error, panels, random_series, rms, sampled, torque, truth, unexplained_torque,
};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::EstimationError;
use dynident_excitation::Motion;
use dynident_excitation::families::Fourier;
use dynident_identification::RegressorModel;
use dynident_model::sample::Random;

use dynident_model::terms::{TorqueTerm, terms_per_joint};
use dynident_model::{InertialParameters, Mat3, Model, Transform, Vec3};
use dynident_recording::{JointSamples, Log, filter::cutoff};
use fnv::FnvHasher;
use nalgebra::DMatrix;
use std::hash::Hasher;

/// Number of random series, of which the most informative one is used.
const CANDIDATES: usize = 24;
/// Sampling rate at which they are compared, Hz.
const CANDIDATE_RATE_HZ: f64 = 20.0;
/// Sampling rate of the motion on which models are tested, Hz.
const TEST_RATE_HZ: f64 = 100.0;
/// Maximum relative deviation of a body's mass from the robot description.
const MAX_MASS_DEVIATION: f64 = 0.25;
/// Maximum shift of a body from its place in the robot description, m (each axis).
const MAX_POSITION_DEVIATION_M: f64 = 0.02;
const OUTLIER_STD: f64 = 20.0;

/// The robot of a case: with the default terms, and with the true terms.
pub(super) struct CaseRobot {
    /// Robot description with viscous and smooth Coulomb friction and an offset at every joint: the start of a study
    /// without keys.
    pub(super) described: ParametricModel,
    /// Robot description with the true laws and constants.
    pub(super) with_true_laws: ParametricModel,
}

impl CaseRobot {
    pub(super) fn new(case: &DefaultCase) -> Result<Self, String> {
        let model = case.robot.model()?;
        let terms = terms_per_joint(&model, |joint| usual_drive(&model, joint));
        let laws = (0..model.dof()).flat_map(|joint| case.friction.of(joint).terms(joint)).collect();
        let with = |terms| ParametricModel::new(model.clone(), terms).map_err(|source| source.to_string());
        Ok(Self { described: with(terms)?, with_true_laws: with(laws)? })
    }
}

pub(super) struct Simulated {
    /// The true robot, with the torque that its friction depends on.
    pub(super) regressor: RegressorModel,
    pub(super) theta: Vec<f64>,
    pub(super) log: Log,
    /// Cut-off from the position spectra, Hz.
    pub(super) asked_hz: f64,
    pub(super) motion: Motion,
    pub(super) torque_std: Vec<f64>,
    exact: Vec<f64>,
    other: Motion,
    other_exact: Vec<f64>,
}

impl Simulated {
    pub(super) fn new(case: &DefaultCase, robot: &CaseRobot, run: u64) -> Result<Self, String> {
        let described = robot.described.model();
        let random = |what: &str| Random::new(seed(&format!("{} {run} {what}", case.label())));
        let bodies = true_bodies(described, &mut random("bodies"));
        let arm = described.with_inertials(&bodies).map_err(|source| source.to_string())?;
        let laws = robot.with_true_laws.terms().to_vec();
        let regressor = ParametricModel::new(arm, laws).map_err(|source| source.to_string())?;
        let regressor = RegressorModel::from(regressor);
        // The transmitted torque is that of the bodies only.
        let mut bodies = regressor.model().parameter_vector();
        bodies.resize(bodies.len() + regressor.terms().len(), 0.0);
        let load = regressor.base().values(&bodies);
        let regressor = regressor.clone().with_load_of(&regressor, &load);

        let (duration_s, rate_hz) = (case.motion.duration_s, case.motion.rate_hz);
        let (family, parameters) = designed(described, &robot.described, case.motion.harmonics, &mut random("motion"))?;
        let motion = sampled(&family, &parameters, duration_s, rate_hz, 0.0);
        let before = sampled(&family, &parameters, duration_s, rate_hz, case.lag_s);
        let share = |term: &TorqueTerm| term.own_joint().map_or(1.0, |joint| case.friction.of(joint).share(term));
        let theta = truth(&regressor, &motion, share);
        let exact = torque(&regressor, &before, &theta);
        let (family, parameters) = random_series(described, case.motion.harmonics, &mut random("test"))?;
        let other = sampled(&family, &parameters, PERIOD_S, TEST_RATE_HZ, 0.0);
        let other_exact = torque(&regressor, &other, &theta);

        let joints = 0..described.dof();
        let torque_std: Vec<f64> =
            joints.clone().map(|joint| case.noise.torque * rms(&exact[motion.of(joint)])).collect();
        let mut noise = random("noise");
        let q: Vec<Vec<f64>> =
            joints.clone().map(|joint| encoded(case, &motion.q[motion.of(joint)], &mut noise)).collect();
        let tau: Vec<Vec<f64>> =
            joints.map(|joint| measured(case, &exact[motion.of(joint)], torque_std[joint], &mut noise)).collect();
        let asked_hz = cutoff(&q, case.motion.rate_hz).cutoff_hz;
        let names = robot.described.joint_names();
        let log = JointSamples::at_rate(case.motion.rate_hz, q, tau).into_log("run", &names);
        let log = log.map_err(|source| source.to_string())?;
        Ok(Self { regressor, theta, log, asked_hz, motion, torque_std, exact, other, other_exact })
    }

    /// Error of a model's torque on the test motion, relative to the standard deviation of the torque.
    pub(super) fn error(&self, model: &RegressorModel, theta: &[f64]) -> f64 {
        model_error(&self.other, &self.other_exact, &torque(model, &self.other, theta))
    }

    /// True value of a base parameter; `None` if the true robot has no such column.
    pub(super) fn true_value(&self, column: &Column) -> Option<f64> {
        let symbol = column.symbol();
        let place = self.regressor.layout().columns().iter().position(|own| own.symbol() == symbol);
        place.map(|place| self.theta[place])
    }

    /// Joints whose friction law can be distinguished from viscous and Coulomb friction (for a joint with only these:
    /// from viscous friction alone), because the residual of the best fit without the law exceeds the noise.
    pub(super) fn tellable(&self, case: &DefaultCase, robot: &CaseRobot) -> Result<Vec<bool>, EstimationError> {
        let is_left = |term: &&TorqueTerm| {
            term.own_joint().is_none_or(|joint| {
                let truth = case.friction.of(joint);
                truth != FrictionTruth::Plain || !truth.is_distinguished_by(term)
            })
        };
        let rest = robot.described.terms().iter().filter(is_left).cloned().collect();
        let without = robot.described.with_terms(rest).map_err(|_| EstimationError::Empty)?;
        let without = RegressorModel::from(without);
        // Correlated noise reduces the effective number of samples.
        let correlation = colour(case);
        let lasting = ((1.0 + correlation) / (1.0 - correlation)).sqrt();
        let left = unexplained_torque(&without, &self.motion, &self.exact)?;
        let is_beyond = |(left, std): (f64, &f64)| left > MIN_DETECTABLE_STD * lasting * std;
        Ok(left.into_iter().zip(&self.torque_std).map(is_beyond).collect())
    }
}

/// Correlation of the torque's noise at successive samples.
pub(super) fn colour(case: &DefaultCase) -> f64 {
    let (colour_s, step_s) = (case.noise.torque_colour_s, case.motion.rate_hz.recip());
    if colour_s > 0.0 { (-step_s / colour_s).exp() } else { 0.0 }
}

/// Bodies with changed mass and position, moved as a whole, so they remain physically consistent.
fn true_bodies(described: &Model, random: &mut Random) -> Vec<InertialParameters> {
    let off = |body: &InertialParameters, random: &mut Random| {
        let place = Vec3(core::array::from_fn(|_| random.uniform(-MAX_POSITION_DEVIATION_M, MAX_POSITION_DEVIATION_M)));
        let factor = 1.0 + random.uniform(-MAX_MASS_DEVIATION, MAX_MASS_DEVIATION);
        let moved = body.expressed_in(&Transform { rotation: Mat3::IDENTITY, translation: place });
        InertialParameters(moved.0.map(|parameter| factor * parameter))
    };
    described.inertials().iter().map(|body| off(body, random)).collect()
}

/// The random Fourier series with the largest determinant of its information matrix among several: not optimised, but
/// not an unlucky choice.
fn designed(
    model: &Model,
    robot: &ParametricModel,
    harmonics: usize,
    random: &mut Random,
) -> Result<(Fourier, Vec<f64>), String> {
    let regressor = RegressorModel::from(robot.clone());
    let layout = regressor.layout();
    let count = layout.columns().len();
    let mut best: Option<(f64, Fourier, Vec<f64>)> = None;
    for _ in 0..CANDIDATES {
        let (family, parameters) = random_series(model, harmonics, random)?;
        let motion = sampled(&family, &parameters, PERIOD_S, CANDIDATE_RATE_HZ, 0.0);
        let panels = panels(&regressor, &motion);
        let mut information = DMatrix::<f64>::zeros(count, count);
        for joint in 0..model.dof() {
            let columns = layout.joint_columns(joint);
            let rows = &panels.joint(joint)[..motion.samples * columns.len()];
            let panel = DMatrix::from_column_slice(motion.samples, columns.len(), rows);
            let own = panel.tr_mul(&panel);
            for (a, &row) in columns.iter().enumerate() {
                for (b, &column) in columns.iter().enumerate() {
                    information[(row, column)] += own[(a, b)];
                }
            }
        }
        let factor = information.cholesky();
        let log_det = factor.map(|factor| factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>());
        if let Some(log_det) = log_det.filter(|value| best.as_ref().is_none_or(|(least, ..)| value > least)) {
            best = Some((log_det, family, parameters));
        }
    }
    let none = || "no random motion excites all base parameters".to_owned();
    best.map(|(_, family, parameters)| (family, parameters)).ok_or_else(none)
}

fn encoded(case: &DefaultCase, q: &[f64], random: &mut Random) -> Vec<f64> {
    let step = case.noise.encoder_bits.map(|bits| core::f64::consts::TAU / 2.0_f64.powi(bits));
    let mut of = |q: &f64| {
        let noisy = q + case.noise.position_rad * random.normal();
        step.map_or(noisy, |step| (noisy / step).round() * step)
    };
    q.iter().map(&mut of).collect()
}

fn measured(case: &DefaultCase, exact: &[f64], std: f64, random: &mut Random) -> Vec<f64> {
    let correlation = colour(case);
    let fresh = std * (1.0 - correlation * correlation).sqrt();
    let mut error = std * random.normal();
    let mut of = |tau: &f64| {
        let mut value = tau + error;
        if case.noise.outlier_share > 0.0 && random.uniform(0.0, 1.0) < case.noise.outlier_share {
            value += OUTLIER_STD * std * if random.uniform(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 };
        }
        error = correlation * error + fresh * random.normal();
        value
    };
    exact.iter().map(&mut of).collect()
}

/// FNV-1a hash: a seed from text, the same on every computer.
fn seed(words: &str) -> u64 {
    let mut hasher = FnvHasher::default();
    hasher.write(words.as_bytes());
    hasher.finish()
}
