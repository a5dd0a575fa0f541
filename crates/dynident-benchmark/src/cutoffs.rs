//! The default cut-off compared with the best possible one: robots × motions × noise.
//!
//! Every run has a random Fourier motion, exact torque with friction, and white noise on positions and torque. The
//! error is that of the fitted model's torque on another random motion without noise: RMS over joints, each in units
//! of the standard deviation of its torque.

use crate::accuracy::BenchmarkError;
use crate::simulated_logs::{
    PANDA, PERIOD_S, SimulatedLog, SimulatedRobot, UR10, excitation, model_error, recording, torque, truth,
};
use dynident_dynamics::ParametricModel;
use dynident_estimation::{EstimateStatus, SplineMotionSettings};
use dynident_identification::estimators::Estimator;
use dynident_identification::{
    DiagnosisChoice, Execution, IdentificationError, IdentificationTask, Recording, RegressorModel, identify,
};
use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};

/// A cell of the table: a robot and the settings of its recordings.
#[derive(Clone, Copy, Debug)]
pub struct CutoffCell {
    /// The robot.
    pub robot: SimulatedRobot,
    /// Settings of the robot's recordings.
    pub log: SimulatedLog,
}

const fn cell(
    robot: SimulatedRobot,
    harmonics: usize,
    duration_s: f64,
    rate_hz: f64,
    position_noise_rad: f64,
    torque_noise: f64,
) -> CutoffCell {
    CutoffCell { robot, log: SimulatedLog { harmonics, duration_s, rate_hz, position_noise_rad, torque_noise } }
}

/// The registry: one line per robot and recording.
pub const CUTOFF_CELLS: &[CutoffCell] = &[
    cell(UR10, 5, 10.0, 500.0, 1e-5, 0.01),
    cell(UR10, 5, 10.0, 500.0, 1e-4, 0.01),
    cell(UR10, 5, 10.0, 500.0, 1e-3, 0.01),
    cell(UR10, 20, 10.0, 500.0, 1e-5, 0.01),
    cell(UR10, 20, 10.0, 500.0, 1e-4, 0.01),
    cell(UR10, 20, 10.0, 500.0, 1e-3, 0.01),
    cell(UR10, 5, 10.0, 125.0, 1e-4, 0.01),
    cell(UR10, 5, 60.0, 250.0, 3e-4, 0.03),
    cell(UR10, 20, 60.0, 250.0, 1e-4, 0.01),
    cell(PANDA, 5, 10.0, 1000.0, 1e-5, 0.01),
    cell(PANDA, 5, 10.0, 1000.0, 1e-4, 0.01),
    cell(PANDA, 5, 10.0, 1000.0, 1e-3, 0.01),
    cell(PANDA, 20, 30.0, 500.0, 1e-4, 0.03),
];

/// Compared cut-offs, relative to the cut-off from the position spectrum.
const CUTOFF_MULTIPLES: [f64; 9] = [0.5, 0.707, 1.0, 1.414, 2.0, 2.828, 4.0, 5.657, 8.0];
/// Index in `CUTOFF_MULTIPLES` of the cut-off from the position spectrum.
const SPECTRUM_INDEX: usize = 2;
/// Speed at which the smoothed Coulomb friction reaches 76 % of its final value, rad/s or m/s: the default of a
/// study.
const COULOMB_WIDTH: f64 = 0.02;

/// Torque errors of one cell, RMS over its runs, relative to the standard deviation of the torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutoffFigures {
    /// Cut-off from the position spectra, mean over the runs, Hz.
    pub spectrum_hz: f64,
    /// Error with the cut-off from the spectra.
    pub of_spectrum: f64,
    /// Error with the default cut-off.
    pub of_default: f64,
    /// Error if motion and parameters are estimated together without a cut-off, and the number of runs that did not
    /// converge; `None` if not computed.
    pub simultaneous: Option<(f64, usize)>,
    /// Error with the best cut-off, which is the same in all runs.
    pub best: f64,
    /// Best cut-off relative to that from the position spectra.
    pub best_multiple: f64,
}

impl CutoffFigures {
    /// Ratio of the error with the default cut-off to that with the best cut-off.
    pub fn default_over_best(&self) -> f64 {
        self.of_default / self.best
    }
}

/// Fits `runs` recordings of a cell with the default cut-off and with each compared one. If `simultaneous` is set, it
/// also estimates motion and parameters together.
///
/// # Errors
/// A robot, motion or recording that cannot be created, a default fit that fails.
pub fn cutoff_figures(cell: &CutoffCell, runs: u64, simultaneous: bool) -> Result<CutoffFigures, BenchmarkError> {
    let failed = |reason: String| BenchmarkError::Excitation { robot: cell.robot.name.to_owned(), reason };
    let (model, made) = (cell.robot.model().map_err(failed)?, &cell.log);
    let drive = DriveChoice {
        drive_inertia: false,
        viscous: true,
        coulomb: Some(CoulombShape::Smooth { width: COULOMB_WIDTH }),
        offset: true,
    };
    let robot = ParametricModel::new(model.clone(), terms_per_joint(&model, |_| drive));
    let robot = robot.map_err(|source| failed(source.to_string()))?;
    let regressor = RegressorModel::from(robot.clone());
    let (mut squares, mut spectrum_hz, mut of_default) = ([0.0; CUTOFF_MULTIPLES.len()], 0.0, 0.0);
    let (mut of_simultaneous, mut unsettled) = (0.0, 0);
    for run in 0..runs {
        let motion = excitation(&model, made.harmonics, made.duration_s, made.rate_hz, 10 + run).map_err(failed)?;
        let other = excitation(&model, made.harmonics, PERIOD_S, 100.0, 1000 + run).map_err(failed)?;
        let theta = truth(&regressor, &motion, |_| 1.0);
        let exact = torque(&regressor, &motion, &theta);
        let (log, asked_hz) = recording(made, &model, &motion, &exact, 77 + run).map_err(failed)?;
        let other_exact = torque(&regressor, &other, &theta);
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
            let predicted = torque(&regressor, &other, found.base_values());
            Ok((model_error(&other, &other_exact, &predicted), settled))
        };
        let error = |cutoff_hz| fitted(cutoff_hz, Estimator::Weighted).map(|(error, _)| error);
        if simultaneous {
            let (error, settled) = fitted(None, Estimator::SplineMotion(SplineMotionSettings::default()))?;
            of_simultaneous += error.powi(2) / runs as f64;
            unsettled += usize::from(!settled);
        }
        of_default += error(None)?.powi(2) / runs as f64;
        for (square, multiple) in squares.iter_mut().zip(CUTOFF_MULTIPLES) {
            // Filters that leave no rows or are impossible at this rate are excluded.
            let found = Some(multiple * asked_hz).filter(|hz| *hz < 0.45 * made.rate_hz).map(|hz| error(Some(hz)));
            *square += found.and_then(Result::ok).map_or(f64::INFINITY, |error| error.powi(2)) / runs as f64;
        }
    }
    let least = (0..squares.len()).min_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap_or(SPECTRUM_INDEX);
    Ok(CutoffFigures {
        spectrum_hz,
        of_spectrum: squares[SPECTRUM_INDEX].sqrt(),
        of_default: of_default.sqrt(),
        simultaneous: simultaneous.then(|| (of_simultaneous.sqrt(), unsettled)),
        best: squares[least].sqrt(),
        best_multiple: CUTOFF_MULTIPLES[least],
    })
}
