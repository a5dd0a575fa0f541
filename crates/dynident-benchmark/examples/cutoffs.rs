//! The default cut-off against the best that can be had with the truth in hand: robots × motions × noise.
//!
//! ```text
//! cargo run --release -p dynident-benchmark --example cutoffs -- [RUNS] [ROWS]
//! ```
//!
//! Every run has a random Fourier motion, exact torque with friction, white noise on positions and torque. The error is
//! that of the fitted model's torque on another random motion without noise: root mean square over joints, each in
//! percent of its torque's spread. "Best" is the cut-off (in steps of √2 about what the spectrum asks for) whose error
//! over all runs of the row is least.

#![allow(clippy::print_stdout, reason = "printing a table is what this program is for")]

use dynident_dynamics::{BatchWorkspace, PanelLayout, Panels, ParametricModel, regressor_panels};
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::{Family, Motion};
use dynident_identification::rows::predicted_torque;
use dynident_identification::{
    DiagnosisChoice, Execution, IdentificationError, IdentificationTask, Recording, RegressorModel, identify,
};
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, TermAction, TorqueTerm, terms_per_joint};
use dynident_model::{Model, read_urdf};
use dynident_recording::{JointSamples, Log, filter::cutoff};
use std::error::Error;

/// One row of the table.
struct Cell {
    robot: &'static str,
    urdf: &'static str,
    harmonics: usize,
    duration_s: f64,
    rate_hz: f64,
    position_noise_rad: f64,
    /// In units of the joint torque's root mean square.
    torque_noise: f64,
}

const UR10: (&str, &str) = ("UR10", include_str!("../robots/ur10.urdf"));
const PANDA: (&str, &str) = ("Panda", include_str!("../robots/panda_arm7.urdf"));

const fn cell(
    (robot, urdf): (&'static str, &'static str),
    (harmonics, duration_s): (usize, f64),
    rate_hz: f64,
    (position_noise_rad, torque_noise): (f64, f64),
) -> Cell {
    Cell { robot, urdf, harmonics, duration_s, rate_hz, position_noise_rad, torque_noise }
}

const CELLS: &[Cell] = &[
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
/// Seconds of the Fourier motion's period.
const PERIOD_S: f64 = 10.0;
/// Furthest position and highest speed of a joint, for those with wider limits or none.
const RANGE: f64 = 3.0;
const SPEED: f64 = 2.0;
/// Velocity at which Coulomb friction has reached 76 %: the study file's default.
const COULOMB_WIDTH: f64 = 0.02;

fn main() -> Result<(), Box<dyn Error>> {
    let runs: u64 = std::env::args().nth(1).map_or(Ok(8), |text| text.parse())?;
    let rows: usize = std::env::args().nth(2).map_or(Ok(CELLS.len()), |text| text.parse())?;
    println!(
        "| robot | harmonics | length, s | rate, Hz | position noise, rad | spectrum asks for, Hz | its error, % | default, % | best, % | at, times | default over best |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for cell in CELLS.iter().take(rows) {
        println!("{}", row(cell, runs)?);
    }
    Ok(())
}

fn row(cell: &Cell, runs: u64) -> Result<String, Box<dyn Error>> {
    let model = read_urdf(cell.urdf)?.model;
    let drive = DriveChoice {
        drive_inertia: false,
        viscous: true,
        coulomb: Some(CoulombShape::Smooth { width: COULOMB_WIDTH }),
        offset: true,
    };
    let robot = ParametricModel::new(model.clone(), terms_per_joint(&model, |_| drive))?;
    let regressor = RegressorModel::from(robot.clone());
    let (mut squares, mut spectrum_hz) = ([0.0; MULTIPLES.len()], 0.0);
    let mut of_default = 0.0;
    for run in 0..runs {
        let motion = excitation(&model, cell, (cell.duration_s, cell.rate_hz), 10 + run)?;
        let other = excitation(&model, cell, (PERIOD_S, 100.0), 1000 + run)?;
        let theta = truth(&regressor, &motion);
        let (log, asked_hz) = recording(cell, &regressor, &motion, &theta, 77 + run)?;
        spectrum_hz += asked_hz / runs as f64;
        let error = |cutoff_hz: Option<f64>| -> Result<f64, IdentificationError> {
            let mut task = IdentificationTask::new(robot.clone(), vec![Recording::training("run", log.clone())]);
            task.settings.diagnosis = DiagnosisChoice::Never;
            task.settings.consistency = None;
            if let Some(cutoff_hz) = cutoff_hz {
                task.settings.motion.differentiator = task.settings.motion.differentiator.with_cutoff(cutoff_hz);
            }
            let found = identify(&task, Execution::default())?;
            Ok(model_error(&regressor, &other, &theta, found.base_values()))
        };
        of_default += error(None)?.powi(2) / runs as f64;
        for (square, multiple) in squares.iter_mut().zip(MULTIPLES) {
            // A filter that leaves no rows, or that does not exist at this rate, is no candidate.
            let found = Some(multiple * asked_hz).filter(|hz| *hz < 0.45 * cell.rate_hz).map(|hz| error(Some(hz)));
            *square += found.and_then(Result::ok).map_or(f64::INFINITY, |error| error.powi(2)) / runs as f64;
        }
    }
    let best = (0..squares.len()).min_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap_or(2);
    let percent = |square: f64| 100.0 * square.sqrt();
    Ok(format!(
        "| {} | {} | {} | {} | {:.0e} | {spectrum_hz:.1} | {:.2} | {:.2} | {:.2} | {:.1} | {:.2} |",
        cell.robot,
        cell.harmonics,
        cell.duration_s,
        cell.rate_hz,
        cell.position_noise_rad,
        percent(squares[2]),
        percent(of_default),
        percent(squares[best]),
        MULTIPLES[best],
        (of_default / squares[best]).sqrt()
    ))
}

/// A random Fourier motion within the robot's ranges and speeds.
fn excitation(
    model: &Model,
    cell: &Cell,
    (duration_s, rate_hz): (f64, f64),
    seed: u64,
) -> Result<Motion, Box<dyn Error>> {
    let settings = FourierSettings { harmonics: cell.harmonics, ..FourierSettings::default() };
    let family = Fourier::new(model.dof(), PERIOD_S, &settings)?;
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
    cell: &Cell,
    regressor: &RegressorModel,
    motion: &Motion,
    theta: &[f64],
    seed: u64,
) -> Result<(Log, f64), Box<dyn Error>> {
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
    Ok((JointSamples::at_rate(cell.rate_hz, q, tau).into_log("run", &regressor.joint_names())?, asked_hz))
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
