//! A robot with true parameters, an excitation, and simulated recordings.
//!
//! The motion is given, not simulated: the excitation trajectory with the small smooth tracking error of a
//! velocity-proportional lag, `q = q_d - ε q̇_d`. Torque is exact inverse dynamics with friction plus noise. Without a
//! controller torque noise does not affect the motion.

use super::BenchmarkError;
use super::noise::NoiseLevel;
use super::robots::BenchmarkRobot;
use dynident_dynamics::{BatchWorkspace, PanelLayout, Panels, ParametricModel, regressor_panels};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::{Family, Motion};
use dynident_identification::RegressorModel;
use dynident_identification::estimators::FourierSeries;
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, JointMotion, TermAction, TorqueTerm, terms_per_joint};
use nalgebra::DMatrix;

/// Samples per second of a recording.
pub const RATE_HZ: f64 = 1000.0;
/// Length of a recording, s.
pub const DURATION_S: f64 = 10.0;
/// Number of harmonics of the excitation, 0.1 Hz apart.
pub const HARMONICS: usize = 20;
/// Frequencies of the excitation, which are known.
pub(super) const SERIES: FourierSeries = FourierSeries { period_s: DURATION_S, harmonics: HARMONICS };
/// Number of random trajectories, of which the most informative one is used.
const CANDIDATES: usize = 24;
/// Sampling rate at which candidates are compared, Hz.
const CANDIDATE_RATE_HZ: f64 = 20.0;
/// ε of the tracking error in the module documentation, s.
const TRACKING_LAG_S: f64 = 0.005;
/// Speed at which the smoothed Coulomb friction reaches 76 % of its final value, rad/s or m/s: the default of a
/// study.
const COULOMB_WIDTH: f64 = 0.02;
/// Speed limit of joints without limits, so that the excitation is finite.
const SPEED_RAD_S: f64 = 2.0;

/// A robot, its excitation, and its true parameters.
#[derive(Debug)]
pub struct Scenario {
    /// The robot's name.
    pub robot: &'static str,
    /// The robot.
    pub model: RegressorModel,
    /// Commanded motion.
    pub reference: Motion,
    pub(super) truth: Vec<f64>,
    pub(super) motion: Motion,
    pub(super) torque: Vec<f64>,
}

/// Simulated encoder and torque signals of one run, joint by joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Number of samples per joint.
    pub samples: usize,
    /// Positions, rad.
    pub q: Vec<f64>,
    /// Torques, Nm.
    pub tau: Vec<f64>,
}

impl Scenario {
    /// Creates the scenario of a robot; the same for every noise level and run of a seed.
    pub(super) fn new(robot: &BenchmarkRobot, seed: u64) -> Result<Self, BenchmarkError> {
        let model = robot.model()?;
        let drive = DriveChoice {
            drive_inertia: true,
            viscous: true,
            coulomb: Some(CoulombShape::Smooth { width: COULOMB_WIDTH }),
            offset: true,
        };
        let terms = terms_per_joint(&model, |_| drive);
        let made = ParametricModel::new(model, terms).map_err(|source| BenchmarkError::Excitation {
            robot: robot.name.to_owned(),
            reason: source.to_string(),
        })?;
        let parametric = RegressorModel::from(made);
        let (model, terms, layout) = (parametric.model(), parametric.terms(), parametric.layout());
        let (base, reference) = (parametric.base(), excitation(robot, model, layout, seed)?);
        let motion = followed(&reference);
        let mut parameters = model.parameter_vector();
        parameters.extend(vec![0.0; terms.len()]);
        let bodies_only = torque(model, layout, &motion, &base.values(&parameters));
        let first = parameters.len() - terms.len();
        for (term, value) in terms.iter().zip(&mut parameters[first..]) {
            let joint = term.joints()[0];
            *value = drive_value(term, &motion, &bodies_only[motion.of(joint)], joint);
        }
        let truth = base.values(&parameters);
        let torque = torque(model, layout, &motion, &truth);
        Ok(Self { robot: robot.name, model: parametric, reference, truth, motion, torque })
    }

    pub(super) fn record(&self, noise: &NoiseLevel, random: &mut Random) -> Record {
        let samples = self.motion.samples;
        let position_std = noise.position_std_deg.to_radians();
        let mut q: Vec<f64> = self.motion.q.iter().map(|q| q + position_std * random.normal()).collect();
        if let Some(steps) = noise.encoder_steps {
            let step = core::f64::consts::TAU / f64::from(steps);
            for q in &mut q {
                *q = (*q / step).round() * step;
            }
        }
        let mut tau = self.torque.clone();
        let fresh = noise.torque_std_nm * (1.0 - noise.torque_correlation.powi(2)).sqrt();
        for joint in tau.chunks_exact_mut(samples) {
            let mut error = noise.torque_std_nm * random.normal();
            for tau in joint {
                *tau += error;
                if noise.outlier_share > 0.0 && random.uniform(0.0, 1.0) < noise.outlier_share {
                    let sign = if random.uniform(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 };
                    *tau += sign * noise.outlier_size * noise.torque_std_nm;
                }
                error = noise.torque_correlation * error + fresh * random.normal();
            }
        }
        Record { samples, q, tau }
    }

    /// Nominal model: bodies with a wrong density, without drives and friction.
    pub(super) fn prior(&self, random: &mut Random, spread: f64) -> Vec<f64> {
        let mut prior = self.model.model().parameter_vector();
        for body in prior.chunks_exact_mut(10) {
            // Lower limit, so that masses remain positive.
            let factor = (1.0 + spread * random.normal()).max(0.25);
            for value in body {
                *value *= factor;
            }
        }
        prior.extend(vec![0.0; self.model.terms().len()]);
        prior
    }

    /// Cramér-Rao bound of every base parameter's standard deviation: the diagonal of `(Σ_j Y_jᵀ Ω⁻¹ Y_j)^(-1/2)` for
    /// exactly known motion and torque noise of covariance Ω (AR(1), whitened by `y_t - ρ y_{t-1}`). It ignores
    /// position noise, so it is valid for every estimator but not quite reachable. Outliers are ignored because they
    /// can be rejected.
    pub(super) fn bound(&self, noise: &NoiseLevel) -> Option<Vec<f64>> {
        let (count, samples) = (self.truth.len(), self.motion.samples);
        let mut panels = Panels::default();
        let mut workspace = BatchWorkspace::new(self.model.model());
        regressor_panels(self.model.model(), &mut workspace, self.model.layout(), &self.motion.view(), &mut panels);
        let rho = noise.torque_correlation;
        let fresh = noise.torque_std_nm * (1.0 - rho * rho).sqrt();
        let mut information = DMatrix::<f64>::zeros(count, count);
        for joint in 0..self.model.model().dof() {
            let columns = self.model.layout().joint_columns(joint);
            let whitened: Vec<Vec<f64>> = panels.joint(joint)[..columns.len() * samples]
                .chunks_exact(samples)
                .map(|y| {
                    let first = core::iter::once(y[0] / noise.torque_std_nm);
                    first.chain(y.windows(2).map(|pair| (pair[1] - rho * pair[0]) / fresh)).collect()
                })
                .collect();
            for (a, &row) in columns.iter().enumerate() {
                for (b, &column) in columns.iter().enumerate().take(a + 1) {
                    let product: f64 = whitened[a].iter().zip(&whitened[b]).map(|(x, y)| x * y).sum();
                    information[(row, column)] += product;
                    if a != b {
                        information[(column, row)] += product;
                    }
                }
            }
        }
        // Scaled to a unit diagonal, because units of parameters differ widely.
        let scale: Vec<f64> = information.diagonal().iter().map(|x| x.sqrt()).collect();
        let scaled = DMatrix::from_fn(count, count, |i, j| information[(i, j)] / (scale[i] * scale[j]));
        let inverse = scaled.cholesky()?.inverse();
        Some((0..count).map(|i| inverse[(i, i)].sqrt() / scale[i]).collect())
    }
}

/// Drive parameters relative to the RMS torque of inertia and gravity: viscous and Coulomb friction of 15 % each,
/// drive inertia of 20 %, an offset of 3 %.
fn drive_value(term: &TorqueTerm, motion: &Motion, bodies: &[f64], joint: usize) -> f64 {
    let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
    // Joints without torque of the bodies (a last link about its own axis) also have friction.
    let torque = rms(bodies).max(0.5);
    match term.action() {
        TermAction::Damping { .. } => 0.15 * torque / rms(&motion.dq[motion.of(joint)]),
        TermAction::Inertia { .. } => 0.20 * torque / rms(&motion.ddq[motion.of(joint)]),
        TermAction::Friction(_) | TermAction::Hysteresis => 0.15 * torque,
        TermAction::Constant | TermAction::Temperature | TermAction::State(_) => 0.03 * torque,
    }
}

fn torque(model: &Model, layout: &PanelLayout, motion: &Motion, theta: &[f64]) -> Vec<f64> {
    let (mut panels, mut workspace) = (Panels::default(), BatchWorkspace::new(model));
    regressor_panels(model, &mut workspace, layout, &motion.view(), &mut panels);
    let mut tau = Vec::with_capacity(motion.q.len());
    let mut buffer = Vec::new();
    for joint in 0..model.dof() {
        let columns = layout.joint_columns(joint);
        dynident_identification::rows::predicted_torque(
            panels.joint(joint),
            motion.samples,
            columns,
            theta,
            &mut buffer,
        );
        tau.extend_from_slice(&buffer);
    }
    tau
}

/// `q = q_d - ε q̇_d` and its exact derivatives.
fn followed(reference: &Motion) -> Motion {
    let late = |value: &[f64], rate: &[f64]| value.iter().zip(rate).map(|(x, dx)| x - TRACKING_LAG_S * dx).collect();
    let (q, dq) = (late(&reference.q, &reference.dq), late(&reference.dq, &reference.ddq));
    let ddq = late(&reference.ddq, &reference.dddq);
    Motion { samples: reference.samples, joints: reference.joints, q, dq, ddq, dddq: reference.dddq.clone() }
}

/// The random Fourier series with the largest `log det` of its information matrix among several: not optimised, but
/// not worse than the excitation of a usual user.
fn excitation(
    robot: &BenchmarkRobot,
    model: &Model,
    layout: &PanelLayout,
    seed: u64,
) -> Result<Motion, BenchmarkError> {
    let settings = FourierSettings { harmonics: HARMONICS, ..FourierSettings::default() };
    let family = Fourier::new(model.dof(), DURATION_S, &settings)
        .map_err(|source| BenchmarkError::Excitation { robot: robot.name.to_owned(), reason: source.to_string() })?;
    let limits = model.joints().iter().map(|joint| joint.limits);
    let ranges: Vec<[f64; 2]> = limits
        .clone()
        .map(|limits| [limits.lower.unwrap_or(f64::NEG_INFINITY), limits.upper.unwrap_or(f64::INFINITY)])
        .collect();
    let speeds: Vec<f64> = limits.map(|limits| limits.velocity.unwrap_or(SPEED_RAD_S)).collect();
    let times = |rate_hz: f64| -> Vec<f64> {
        (0..=(DURATION_S * rate_hz) as usize).map(|sample| sample as f64 / rate_hz).collect()
    };
    let mut random = Random::new(seed);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let (mut motion, mut panels, mut workspace) = (Motion::default(), Panels::default(), BatchWorkspace::new(model));
    let coarse = times(CANDIDATE_RATE_HZ);
    for _ in 0..CANDIDATES {
        let parameters = family.random(&ranges, &speeds, &mut random);
        family.motion(&parameters, &coarse, &mut motion);
        let JointMotion { samples, .. } = motion.view();
        regressor_panels(model, &mut workspace, layout, &motion.view(), &mut panels);
        let mut information = DMatrix::<f64>::zeros(layout.columns().len(), layout.columns().len());
        for joint in 0..model.dof() {
            let columns = layout.joint_columns(joint);
            let panel =
                DMatrix::from_column_slice(samples, columns.len(), &panels.joint(joint)[..samples * columns.len()]);
            let own = panel.tr_mul(&panel);
            for (a, &row) in columns.iter().enumerate() {
                for (b, &column) in columns.iter().enumerate() {
                    information[(row, column)] += own[(a, b)];
                }
            }
        }
        let log_det = information
            .cholesky()
            .map_or(f64::NEG_INFINITY, |factor| factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>());
        if best.as_ref().is_none_or(|(value, _)| log_det > *value) {
            best = Some((log_det, parameters));
        }
    }
    let Some((_, parameters)) = best.filter(|(value, _)| value.is_finite()) else {
        let reason = "no random trajectory excites all base parameters".to_owned();
        return Err(BenchmarkError::Excitation { robot: robot.name.to_owned(), reason });
    };
    family.motion(&parameters, &times(RATE_HZ), &mut motion);
    Ok(motion)
}
