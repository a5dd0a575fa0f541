//! `simulate`: a simulated robot runs a study's trajectory under a controller.

use crate::error::Error;
use crate::inputs::InputFiles;
use crate::jobs::iterate::Trajectory;
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::motion_provenance;
use crate::result::{BodyTruth, ParameterTruth, SIMULATION_SCHEMA, SimulationFile};
use crate::study::{Study, StudyFile};
use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_iteration::{Robot, RunRequest};
use dynident_simulation::controllers::JointPdSettings;
use dynident_simulation::{ControllerModel, ControllerSettings};
use std::path::Path;

/// A finished simulation.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// Content of `truth.json`.
    pub file: SimulationFile,
    /// The log as a table: `t_s, q1.., tau1..`.
    pub log: String,
}

/// Runs a study's trajectory (`[iteration] trajectory`, or its `[design]`) on the robot of `[simulation]` under
/// `[controller]` (joint PD by default); the controller's model is the robot description.
///
/// # Errors
/// Invalid files, study or settings. A run that stops early is a result.
pub fn simulate_study(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    watch: &(dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
) -> Result<Simulation, Error> {
    let study = StudyFile::new(study, study_path);
    let simulation = study.simulation.clone().unwrap_or_default();
    let files = InputFiles::of(study, options.data.as_deref());
    let folders = study.folders(options.data.as_deref());
    let robot = study.robot_in(&folders)?;
    let mut truth = simulation.truth(&study.coupling, &robot).map_err(Error::section(study.path, "simulation"))?;
    let controller = study
        .controller
        .clone()
        .unwrap_or_else(|| ControllerSettings::JointPd(JointPdSettings { kp: 100.0.into(), kd: 20.0.into() }));
    controller.validate(robot.model().dof()).map_err(Error::section(study.path, "controller"))?;
    let trajectory = Trajectory::of_study(study, &robot, simulation.rate_hz, options, watch)?;
    let reference = trajectory.reference().map_err(Error::section(study.path, "iteration"))?;
    let prior = robot.nominal().to_vec();
    let model = ControllerModel::from_parameters(robot.model(), robot.terms(), &prior)
        .map_err(Error::section(study.path, "controller"))?;
    let request = RunRequest { model: Some(&model), ..RunRequest::new(1, &reference, &controller) };
    let run = truth.robot.run(&request).map_err(Error::section(study.path, "simulation"))?;

    let own = |values: &[f64], expressions: Vec<String>, units: Vec<String>| {
        let named = expressions.into_iter().zip(units).zip(values);
        named.map(|((expression, unit), &value)| ParameterTruth { expression, value, unit }).collect()
    };
    let bodies = robot.model().bodies().iter().zip(truth.parameters.chunks_exact(10));
    let (max_error, saturated) = run
        .truth
        .as_ref()
        .map_or_else(|| (Vec::new(), Vec::new()), |truth| (truth.max_error.clone(), truth.saturated.clone()));
    let file = SimulationFile {
        schema: SIMULATION_SCHEMA.to_owned(),
        name: study.title(),
        provenance: Some(motion_provenance(study, options.data.as_deref(), &[])?),
        controller: controller.name().to_owned(),
        done: run.status.is_done(),
        status: run.status,
        joints: robot.parametric.joint_names(),
        samples: run.record.samples,
        rate_hz: run.record.rate_hz,
        max_tracking_error_rad: max_error,
        saturated_samples: saturated,
        bodies: bodies
            .map(|(body, own)| BodyTruth { name: body.name().to_owned(), parameters: own.to_vec() })
            .collect(),
        terms: own(
            &truth.parameters[robot.model().inertial_count()..],
            truth.terms.iter().map(dynident_model::terms::TorqueTerm::symbol).collect(),
            truth.terms.iter().map(|term| term.unit().to_owned()).collect(),
        ),
        base_parameters: own(
            &truth.base_values,
            robot.base().expressions(),
            robot.layout().columns().iter().map(|column| column.unit().to_owned()).collect(),
        ),
    };
    files.unchanged()?;
    Ok(Simulation { file, log: run.record.csv() })
}
