//! A simulated robot runs a study's trajectory under a controller.

pub(crate) mod section;

use crate::error::Error;
use crate::iterate::Trajectory;
use crate::jobs::options::{RunOptions, study_name};
use crate::study::StudyRobot;
use crate::study::{Folders, Study};
use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_iteration::{Robot, RobotStatus, RunRequest};
use dynident_simulation::controllers::JointPdSettings;
use dynident_simulation::{ControllerModel, ControllerSettings};
use serde::Serialize;
use std::path::Path;

/// Schema of `truth.json`.
pub const SIMULATION_SCHEMA: &str = "dynident/simulation/1";

/// What `truth.json` holds.
#[derive(Clone, Debug, Serialize)]
pub struct SimulationFile {
    /// [`SIMULATION_SCHEMA`].
    pub schema: &'static str,
    /// Name of the study.
    pub name: String,
    /// The controller.
    pub controller: &'static str,
    /// How the run ended.
    pub status: RobotStatus,
    /// Whether it reached the trajectory's end.
    pub done: bool,
    /// Names of the joints, in the order of the log's columns.
    pub joints: Vec<String>,
    /// Samples of the log.
    pub samples: usize,
    /// Samples a second of the log.
    pub rate_hz: f64,
    /// For each joint the largest true distance from the trajectory, rad (m).
    pub max_tracking_error_rad: Vec<f64>,
    /// For each joint how many samples had their torque cut to its limit.
    pub saturated_samples: Vec<usize>,
    /// True bodies: ten parameters each.
    pub bodies: Vec<BodyTruth>,
    /// True parameters of the laws.
    pub laws: Vec<ParameterTruth>,
    /// True base parameters.
    pub base_parameters: Vec<ParameterTruth>,
}

/// A body as it truly is.
#[derive(Clone, Debug, Serialize)]
pub struct BodyTruth {
    /// Its name.
    pub name: String,
    /// m, m·rx, m·ry, m·rz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link frame's origin; kg, kg m, kg m².
    pub parameters: Vec<f64>,
}

/// A parameter as it truly is.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterTruth {
    /// What it is.
    pub expression: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
}

/// A finished simulation.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// What `truth.json` holds.
    pub file: SimulationFile,
    /// The log: `t_s, q1.., tau1..`.
    pub log: String,
}

/// Runs a study's trajectory (`[iteration] trajectory`, or its `[design]`) on the robot of `[simulation]` under `[controller]` (joint PD by default), whose model is the description.
///
/// # Errors
/// Files, study and settings. A run that stops early is a result.
pub fn simulate_study(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    watch: &(dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
) -> Result<Simulation, Error> {
    let wrong = |part: &str, why: &dyn core::fmt::Display| Error::study(study_path, format!("[{part}]: {why}"));
    let simulation = study.simulation.clone().unwrap_or_default();
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let machine = StudyRobot::new(study, study_path, &folders)?;
    let mut truth = simulation.truth(&machine).map_err(|why| wrong("simulation", &why))?;
    let controller = study
        .controller
        .clone()
        .unwrap_or_else(|| ControllerSettings::JointPd(JointPdSettings { kp: 100.0.into(), kd: 20.0.into() }));
    controller.validate(machine.model().dof()).map_err(|why| wrong("controller", &why))?;
    let trajectory = Trajectory::of_study(study, study_path, &machine, simulation.rate_hz, options, watch)?;
    let reference = trajectory.reference().map_err(|why| wrong("iteration", &why))?;
    let prior = machine.nominal().to_vec();
    let model = ControllerModel::from_parameters(machine.model(), machine.laws(), &prior)
        .map_err(|why| wrong("controller", &why))?;
    let request = RunRequest { run: 1, reference: &reference, controller: &controller, model: Some(&model) };
    let run = truth.robot.run(&request).map_err(|why| wrong("simulation", &why))?;
    let own = |values: &[f64], expressions: Vec<String>, units: Vec<&'static str>| {
        let named = expressions.into_iter().zip(units).zip(values);
        named.map(|((expression, unit), &value)| ParameterTruth { expression, value, unit }).collect()
    };
    let bodies = machine.model().bodies().iter().zip(truth.parameters.chunks_exact(10));
    let (max_error, saturated) = run
        .truth
        .as_ref()
        .map_or_else(|| (Vec::new(), Vec::new()), |truth| (truth.max_error.clone(), truth.saturated.clone()));
    let file = SimulationFile {
        schema: SIMULATION_SCHEMA,
        name: study_name(study, study_path),
        controller: controller.name(),
        done: run.status.is_done(),
        status: run.status,
        joints: machine.parametric.joint_names(),
        samples: run.record.samples,
        rate_hz: run.record.rate_hz,
        max_tracking_error_rad: max_error,
        saturated_samples: saturated,
        bodies: bodies
            .map(|(body, own)| BodyTruth { name: body.name().to_owned(), parameters: own.to_vec() })
            .collect(),
        laws: own(
            &truth.parameters[10 * machine.model().dof()..],
            machine.laws().iter().map(dynident_model::laws::Law::symbol).collect(),
            machine.laws().iter().map(dynident_model::laws::Law::unit).collect(),
        ),
        base_parameters: own(
            &truth.base_values,
            machine.base().expressions(),
            machine.layout().columns().iter().map(dynident_dynamics::Column::unit).collect(),
        ),
    };
    Ok(Simulation { file, log: run.record.csv() })
}
