//! Data that all stages of an iteration share: robot, trajectories, settings and report.

use super::inputs::Inputs;
use super::job::Job;
use super::report::IterationReport;
use super::trajectories::Trajectories;
use super::{bound, legs};
use crate::error::{Error, StudyError};
use crate::jobs::design::{MotionFamily, limits_of, motion_family};
use crate::jobs::provenance::motion_provenance;
use crate::study::{PriorChoice, SimulationSection, StudyRobot};
use dynident_dynamics::ParametricModel;
use dynident_excitation::limits::Limits;
use dynident_iteration::{HeldOutMotion, Iteration, IterationSettings, IterationTask, Leg, MotionPlanner, Redesign};
use std::sync::Arc;

pub(super) struct Plan<'a> {
    /// The robot with its prior parameters.
    prior: ParametricModel,
    legs: Vec<Leg>,
    settings: IterationSettings,
    torque_limits: Option<Vec<f64>>,
    planner: Option<Arc<dyn MotionPlanner>>,
    held_out: Option<HeldOutMotion>,
    pub(super) report: IterationReport<'a>,
}

impl<'a> Plan<'a> {
    pub(super) fn of(job: &Job<'a>, inputs: &'a Inputs, trajectories: &Trajectories) -> Result<Self, Error> {
        let Inputs { section, simulation, robot, truth, .. } = inputs;
        let Job { study, options, .. } = *job;
        let in_section = |why: StudyError| job.section_error(why);
        let prior = prior(inputs).map_err(in_section)?;
        let legs = legs::legs(section, &trajectories.trajectories, robot).map_err(in_section)?;
        let references: Vec<_> = legs.iter().map(Leg::reference).collect();
        let limits = match section.home {
            Some(_) => limits_of(study, &inputs.folders, robot)?,
            None => Limits::default(),
        };
        let (settings, lowered) =
            section.guarded(inputs.settings.clone(), &study, limits, robot, &references).map_err(in_section)?;
        let has_bound = section.stages().len() == 1 && truth.is_some();
        let data = options.data.as_deref();
        let report = IterationReport {
            study,
            // Runs take hours, so files could change after they were read and hashed.
            provenance: inputs.files.while_unchanged(|| motion_provenance(study, data, &[]))?,
            robot,
            duration_s: legs.iter().map(|leg| leg.reference().duration_s()).sum(),
            truth: truth.as_ref().map(|truth| truth.base_values.clone()),
            bound: if has_bound { bound::cramer_rao(robot, &legs, &simulation.sensors) } else { None },
            sensors: &simulation.sensors,
            lowered,
        };
        let planner = planner(job, inputs, &legs)?;
        let held_out = trajectories.held_out.as_ref().map(|trajectory| legs::held_out_motion(section, trajectory));
        let held_out = held_out.transpose().map_err(in_section)?;
        let torque_limits = torque_limits(simulation, robot, truth.is_some());
        Ok(Self { prior, legs, settings, torque_limits, planner, held_out, report })
    }

    pub(super) fn iteration(&self, members: &[usize], known: &[(usize, f64)]) -> Result<Iteration, StudyError> {
        let task = IterationTask {
            robot: self.prior.clone(),
            legs: members.iter().map(|&leg| self.legs[leg].clone()).collect(),
            known: known.to_vec(),
            torque_limits: self.torque_limits.clone(),
        };
        let iteration = Iteration::new(task, self.settings.clone())?;
        let iteration = match &self.planner {
            Some(planner) => iteration.with_planner(Arc::clone(planner)),
            None => iteration,
        };
        Ok(match &self.held_out {
            Some(motion) => iteration.with_held_out(motion.clone())?,
            None => iteration,
        })
    }
}

fn prior(inputs: &Inputs) -> Result<ParametricModel, StudyError> {
    let robot = &inputs.robot;
    Ok(match inputs.section.prior {
        PriorChoice::Description => robot.parametric.clone(),
        PriorChoice::None => robot.parametric.clone().with_nominal(vec![0.0; robot.nominal().len()])?,
    })
}

/// Planner of the next motion; `None` unless `[iteration]` requests a redesign.
fn planner(job: &Job<'_>, inputs: &Inputs, legs: &[Leg]) -> Result<Option<Arc<dyn MotionPlanner>>, Error> {
    let settings = inputs.section.redesign(&job.study).map_err(|why| job.section_error(why))?;
    let Some(settings) = settings else { return Ok(None) };
    let MotionFamily { family, limits, search } = motion_family(job.study, job.options)?;
    let planner = Redesign::new(family, limits, search, settings.clone(), &legs[0]);
    Ok(Some(Arc::new(planner.map_err(|why| job.section_error(why.into()))?)))
}

/// Torque limit of each joint, Nm (N): the given limit of the simulated robot, otherwise that of the robot
/// description.
fn torque_limits(simulation: &SimulationSection, robot: &StudyRobot, simulated: bool) -> Option<Vec<f64>> {
    let dof = robot.model().dof();
    if let Some(stated) = simulation.limits.torque.as_ref().filter(|_| simulated) {
        return Some((0..dof).map(|joint| stated.of(joint)).collect());
    }
    let efforts = robot.model().joints().iter().map(|joint| joint.limits.effort.unwrap_or(f64::INFINITY));
    simulation.effort_limits.then(|| efforts.collect())
}
