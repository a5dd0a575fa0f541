//! The default cut-off against the best that can be had with the truth in hand: robots × motions × noise.
//!
//! Every run has a random Fourier motion, exact torque with friction, white noise on positions and torque. The error is
//! that of the fitted model's torque on another random motion without noise: root mean square over joints, each in
//! units of its torque's spread.

use crate::accuracy::BenchmarkError;
use dynident_dynamics::{BatchWorkspace, PanelLayout, Panels, ParametricModel, regressor_panels};
use dynident_estimation::{EstimateStatus, SplineMotionSettings};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::{Family, Motion};
use dynident_identification::estimators::Estimator;
use dynident_identification::rows::predicted_torque;
use dynident_identification::{
    DiagnosisChoice, Execution, IdentificationError, IdentificationTask, Recording, RegressorModel, identify,
};
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, TermAction, TorqueTerm, terms_per_joint};
use dynident_model::{Model, read_urdf};
use dynident_recording::{JointSamples, Log, filter::cutoff};

/// A robot, its motions and its noise.
#[derive(Clone, Copy, Debug)]
pub struct CutoffCell {
    /// The robot.
    pub robot: &'static str,
    urdf: &'static str,
    /// Harmonics of 0.1 Hz.
    pub harmonics: usize,
    /// Length of a recording.
    pub duration_s: f64,
    /// Samples a second.
    pub rate_hz: f64,
    /// Standard deviation of the positions' white noise.
    pub position_noise_rad: f64,
    /// Standard deviation of a torque's white noise in units of its root mean square.
    pub torque_noise: f64,
}

const UR10: (&str, &str) = ("UR10", include_str!("../robots/ur10.urdf"));
const PANDA: (&str, &str) = ("Panda", include_str!("../robots/panda_arm7.urdf"));

const fn cell(
    (robot, urdf): (&'static str, &'static str),
    (harmonics, duration_s): (usize, f64),
    rate_hz: f64,
    (position_noise_rad, torque_noise): (f64, f64),
) -> CutoffCell {
    CutoffCell { robot, urdf, harmonics, duration_s, rate_hz, position_noise_rad, torque_noise }
}

/// The registry: one line for each cell.
pub const CUTOFF_CELLS: &[CutoffCell] = &[
    cell(UR10, (5, 10.0), 500.0, (1e-5, 0.01)),
    cell(UR10, (5, 10.0), 500.0, (1e-4, 0.01)),
    cell(UR10, (5, 10.0), 500.0, (1e-3, 0.01)),
    cell(UR10, (20, 10.0), 500.0, (1e-5, 0.01)),
    cell(UR10, (20, 10.0), 500.0, (1e-4, 0.01)),
    cell(UR10, (20, 10.0), 500.0, (1e-3, 0.01)),
    cell(UR10, (5, 10.0), 125.0, (1e-4, 0.01)),
    cell(UR10, (5, 60.0), 250.0, (3e-4, 0.03)),
    cell(UR10, (20, 60.0), 250.0, (1e-4, 0.01)),
    cell(PANDA, (5, 10.0), 1000.0, (1e-5, 0.01)),
    cell(PANDA, (5, 10.0), 1000.0, (1e-4, 0.01)),
    cell(PANDA, (5, 10.0), 1000.0, (1e-3, 0.01)),
    cell(PANDA, (20, 30.0), 500.0, (1e-4, 0.03)),
];

/// Candidates, in units of what the spectrum asks for.
const MULTIPLES: [f64; 9] = [0.5, 0.707, 1.0, 1.414, 2.0, 2.828, 4.0, 5.657, 8.0];
/// Place of what the spectra ask for.
const OF_SPECTRUM: usize = 2;
/// Seconds of the Fourier motion's period.
const PERIOD_S: f64 = 10.0;
/// Furthest position and highest speed of a joint, for those with wider limits or none.
const RANGE: f64 = 3.0;
const SPEED: f64 = 2.0;
/// Velocity at which Coulomb friction has reached 76 %: the study file's default.
const COULOMB_WIDTH: f64 = 0.02;

/// Errors of one cell, root mean square over its runs, as shares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutoffFigures {
    /// What the positions' spectra ask for, mean over the runs, Hz.
    pub spectrum_hz: f64,
    /// Error with that cut-off.
    pub of_spectrum: f64,
    /// Error of the default.
    pub of_default: f64,
    /// Error of motion and parameters at once, with no cut-off.
    pub of_simultaneous: f64,
    /// Runs in which that did not settle.
    pub unsettled: usize,
    /// Error of the best cut-off, the same in all runs.
    pub best: f64,
    /// The best cut-off in units of what the spectra ask for.
    pub best_multiple: f64,
}

impl CutoffFigures {
    /// The default's error over that of the best cut-off.
    pub fn default_over_best(&self) -> f64 {
        self.of_default / self.best
    }
}

/// Fits `runs` recordings of a cell with the default cut-off and with each of a ladder.
///
/// # Errors
/// A robot, motion or recording that cannot be made, a default fit that fails.
pub fn cutoff_figures(cell: &CutoffCell, runs: u64) -> Result<CutoffFigures, BenchmarkError> {
    let failed = |reason: String| BenchmarkError::Excitation { robot: cell.robot.to_owned(), reason };
    let model = read_urdf(cell.urdf).map_err(|source| failed(source.to_string()))?.model;
    let drive = DriveChoice {
        drive_inertia: false,
        viscous: true,
        coulomb: Some(CoulombShape::Smooth { width: COULOMB_WIDTH }),
        offset: true,
    };
    let robot = ParametricModel::new(model.clone(), terms_per_joint(&model, |_| drive));
    let robot = robot.map_err(|source| failed(source.to_string()))?;
    let regressor = RegressorModel::from(robot.clone());
    let (mut squares, mut spectrum_hz, mut of_default) = ([0.0; MULTIPLES.len()], 0.0, 0.0);
    let (mut of_simultaneous, mut unsettled) = (0.0, 0);
    for run in 0..runs {
        let motion = excitation(&model, cell, (cell.duration_s, cell.rate_hz), 10 + run).map_err(failed)?;
        let other = excitation(&model, cell, (PERIOD_S, 100.0), 1000 + run).map_err(failed)?;
        let theta = truth(&regressor, &motion);
        let (log, asked_hz) = recording(cell, &regressor, &motion, &theta, 77 + run).map_err(failed)?;
        spectrum_hz += asked_hz / runs as f64;
        let fitted = |cutoff_hz: Option<f64>, estimator: Estimator| -> Result<(f64, bool), IdentificationError> {
            let mut task = IdentificationTask::new(robot.clone(), vec![Recording::training("run", log.clone())]);
            task.settings.diagnosis = DiagnosisChoice::Never;
            task.settings.consistency = None;
            task.settings.estimation.estimator = estimator;
            if let Some(cutoff_hz) = cutoff_hz {
                task.settings.motion.differentiator = task.settings.motion.differentiator.with_cutoff(cutoff_hz);
            }
            let found = identify(&task, Execution::default())?;
            let settled = found.estimate().status != EstimateStatus::IterationLimit;
            Ok((model_error(&regressor, &other, &theta, found.base_values()), settled))
        };
        let error = |cutoff_hz| fitted(cutoff_hz, Estimator::Weighted).map(|(error, _)| error);
        let (error_of_all, settled) = fitted(None, Estimator::SplineMotion(SplineMotionSettings::default()))?;
        of_simultaneous += error_of_all.powi(2) / runs as f64;
        unsettled += usize::from(!settled);
        of_default += error(None)?.powi(2) / runs as f64;
        for (square, multiple) in squares.iter_mut().zip(MULTIPLES) {
            // A filter that leaves no rows, or that does not exist at this rate, is no candidate.
            let found = Some(multiple * asked_hz).filter(|hz| *hz < 0.45 * cell.rate_hz).map(|hz| error(Some(hz)));
            *square += found.and_then(Result::ok).map_or(f64::INFINITY, |error| error.powi(2)) / runs as f64;
        }
    }
    let least = (0..squares.len()).min_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap_or(OF_SPECTRUM);
    Ok(CutoffFigures {
        spectrum_hz,
        of_spectrum: squares[OF_SPECTRUM].sqrt(),
        of_default: of_default.sqrt(),
        of_simultaneous: of_simultaneous.sqrt(),
        unsettled,
        best: squares[least].sqrt(),
        best_multiple: MULTIPLES[least],
    })
}

/// A random Fourier motion within the robot's ranges and speeds.
fn excitation(
    model: &Model,
    cell: &CutoffCell,
    (duration_s, rate_hz): (f64, f64),
    seed: u64,
) -> Result<Motion, String> {
    let settings = FourierSettings { harmonics: cell.harmonics, ..FourierSettings::default() };
    let family = Fourier::new(model.dof(), PERIOD_S, &settings).map_err(|source| source.to_string())?;
    let limits = || model.joints().iter().map(|joint| joint.limits);
    let ranges: Vec<[f64; 2]> = limits()
        .map(|limits| [limits.lower.unwrap_or(-RANGE).max(-RANGE), limits.upper.unwrap_or(RANGE).min(RANGE)])
        .collect();
    let speeds: Vec<f64> = limits().map(|limits| limits.velocity.unwrap_or(SPEED).min(SPEED)).collect();
    let parameters = family.random(&ranges, &speeds, &mut Random::new(seed));
    let times: Vec<f64> = (0..=(duration_s * rate_hz) as usize).map(|sample| sample as f64 / rate_hz).collect();
    let mut motion = Motion::default();
    family.motion(&parameters, &times, &mut motion);
    Ok(motion)
}

/// The description's bodies, friction and offsets in proportion to what the bodies ask of the joint.
fn truth(regressor: &RegressorModel, motion: &Motion) -> Vec<f64> {
    let mut parameters = regressor.model().parameter_vector();
    let first = parameters.len();
    parameters.resize(first + regressor.terms().len(), 0.0);
    let bodies = torque(regressor, motion, &regressor.base().values(&parameters));
    let value = |term: &TorqueTerm| {
        let own = motion.of(term.joints()[0]);
        let torque = rms(&bodies[own.clone()]).max(0.5);
        match term.action() {
            TermAction::Damping { .. } => 0.15 * torque / rms(&motion.dq[own]),
            TermAction::Friction(_) => 0.15 * torque,
            _ => 0.03 * torque,
        }
    };
    for (parameter, term) in parameters[first..].iter_mut().zip(regressor.terms()) {
        *parameter = value(term);
    }
    regressor.base().values(&parameters)
}

/// What encoders and torque sensors say of a motion, and the cut-off that the positions' spectra ask for.
fn recording(
    cell: &CutoffCell,
    regressor: &RegressorModel,
    motion: &Motion,
    theta: &[f64],
    seed: u64,
) -> Result<(Log, f64), String> {
    let mut random = Random::new(seed);
    let dof = regressor.dof();
    let mut noisy = |values: &[f64], sigma: f64| -> Vec<f64> {
        values.iter().map(|value| value + sigma * random.normal()).collect()
    };
    let exact = torque(regressor, motion, theta);
    let q: Vec<Vec<f64>> = (0..dof).map(|joint| noisy(&motion.q[motion.of(joint)], cell.position_noise_rad)).collect();
    let tau: Vec<Vec<f64>> = (0..dof)
        .map(|joint| {
            let own = &exact[motion.of(joint)];
            noisy(own, cell.torque_noise * rms(own))
        })
        .collect();
    let asked_hz = cutoff(&q, cell.rate_hz).cutoff_hz;
    let log = JointSamples::at_rate(cell.rate_hz, q, tau).into_log("run", &regressor.joint_names());
    log.map(|log| (log, asked_hz)).map_err(|source| source.to_string())
}

/// Root mean square over joints of the error of the predicted torque, each in units of its torque's spread.
fn model_error(regressor: &RegressorModel, motion: &Motion, theta: &[f64], found: &[f64]) -> f64 {
    let difference: Vec<f64> = theta.iter().zip(found).map(|(known, found)| found - known).collect();
    let (exact, error) = (torque(regressor, motion, theta), torque(regressor, motion, &difference));
    let joints = (0..regressor.dof()).map(|joint| {
        let own = &exact[motion.of(joint)];
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let spread = rms(&own.iter().map(|tau| tau - mean).collect::<Vec<_>>());
        (rms(&error[motion.of(joint)]) / spread).powi(2)
    });
    (joints.sum::<f64>() / regressor.dof() as f64).sqrt()
}

/// Torque of base parameters on a motion, joint-major.
fn torque(regressor: &RegressorModel, motion: &Motion, theta: &[f64]) -> Vec<f64> {
    let (model, layout): (&Model, &PanelLayout) = (regressor.model(), regressor.layout());
    let (mut panels, mut workspace) = (Panels::default(), BatchWorkspace::new(model));
    regressor_panels(model, &mut workspace, layout, &motion.view(), &mut panels);
    let (mut all, mut own) = (Vec::with_capacity(motion.q.len()), Vec::new());
    for joint in 0..model.dof() {
        predicted_torque(panels.joint(joint), motion.samples, layout.joint_columns(joint), theta, &mut own);
        all.extend_from_slice(&own);
    }
    all
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}
