//! The trajectories of an iteration (legs): their references, stages and robots.

use super::trajectory::Trajectory;
use crate::error::{Error, StudyError};
use crate::jobs::options::RunOptions;
use crate::study::{
    CouplingSection, IterationSection, LegSection, RobotChoice, SimulationSection, Study, StudyFile, StudyRobot,
};
use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_iteration::Robot;
use dynident_iteration::robot::{FolderRobot, ProcessRobot};
use dynident_iteration::{HeldOutMotion, Leg};
use dynident_simulation::controllers::ControllerModel;
use dynident_system::PermittedProgram;

/// Decorrelates the noise of trajectories with separate iterations.
const SEED_STEP_PER_LEG: u64 = 0xd1b5_4a32_d192_ed03;

/// The reference of each trajectory (leg). The study's motion is designed once, and again for each known payload.
pub(super) fn trajectories(
    study: StudyFile<'_>,
    robot: &StudyRobot,
    rate_hz: f64,
    options: &RunOptions<'_>,
    watch: &(dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
) -> Result<Vec<Trajectory>, Error> {
    let of = |own: &Study| Trajectory::of_study(study.with_study(own), robot, rate_hz, options, watch);
    let section = study.iteration.clone().unwrap_or_default();
    if section.leg.is_empty() {
        return Ok(vec![of(&study)?]);
    }
    let mut whole: Option<Trajectory> = None;
    let mut all = Vec::new();
    for leg in &section.leg {
        // Torque limits depend on a known payload, so its motion is designed separately.
        let is_known = |name: &String| study.payload.iter().any(|one| one.name == *name && one.known().is_some());
        let load = leg.payload.as_ref().filter(|name| is_known(name));
        if leg.trajectory.is_some() || leg.design.is_some() || load.is_some() {
            let mut own = study.study.clone();
            if leg.trajectory.is_some() || leg.design.is_some() {
                own.iteration.get_or_insert_default().trajectory.clone_from(&leg.trajectory);
            }
            if leg.design.is_some() {
                own.design.clone_from(&leg.design);
            }
            if let (Some(design), Some(load)) = (&mut own.design, load) {
                design.payload = Some(load.clone());
            }
            all.push(of(&own)?);
            continue;
        }
        if whole.is_none() {
            whole = Some(of(&study)?);
        }
        all.extend(whole.clone());
    }
    Ok(all)
}

/// The trajectories (legs) with their references and time windows.
pub(super) fn legs(
    section: &IterationSection,
    trajectories: &[Trajectory],
    robot: &StudyRobot,
) -> Result<Vec<Leg>, StudyError> {
    let names = robot.parametric.joint_names();
    let free = [LegSection::default()];
    let sections = if section.leg.is_empty() { &free[..] } else { &section.leg[..] };
    if sections.len() != trajectories.len() {
        return Err(StudyError::conflict(
            "trajectory.json",
            "its legs differ from those of the study: remove the file",
        ));
    }
    let mut legs = Vec::new();
    for (leg, trajectory) in sections.iter().zip(trajectories) {
        let held: Vec<Option<f64>> = names.iter().map(|name| leg.hold.get(name).copied()).collect();
        let trajectory = trajectory.without(&held)?;
        let mut reference = trajectory.reference()?;
        for (joint, held) in held.iter().enumerate() {
            if let Some(position) = held {
                reference = reference.with_joint_held(joint, *position)?;
            }
        }
        let everything = || vec![vec![[-1.0, reference.duration_s() + 1.0]]; names.len()];
        let mut windows = match &trajectory.windows {
            _ if !leg.windows.is_empty() => {
                Some(names.iter().map(|name| leg.windows.get(name).cloned().unwrap_or_default()).collect())
            }
            Some(windows) if !section.every_sample => Some(windows.clone()),
            _ => (!leg.hold.is_empty()).then(everything),
        };
        if let Some(windows) = &mut windows {
            windows.iter_mut().zip(&held).filter(|(_, held)| held.is_some()).for_each(|(own, _)| own.clear());
        }
        let placed = match windows {
            None => Leg::whole(reference),
            Some(windows) => Leg::windowed(reference, windows),
        };
        legs.push(placed?.with_payload(leg.payload.clone()));
    }
    Ok(legs)
}

/// The held-out motion along a trajectory.
pub(super) fn held_out_motion(
    section: &IterationSection,
    trajectory: &Trajectory,
) -> Result<HeldOutMotion, StudyError> {
    let every = section.held_out.as_ref().and_then(|own| own.every);
    Ok(HeldOutMotion { leg: Leg::whole(trajectory.reference()?)?, every })
}

/// Robots of one iteration: one simulator per trajectory, or the external robot (`program` is the permitted program
/// of the study); empty for a robot of the caller.
pub(super) fn robots(
    section: &IterationSection,
    simulation: &SimulationSection,
    coupling: &[CouplingSection],
    robot: &StudyRobot,
    stage: usize,
    members: &[usize],
    program: Option<&PermittedProgram>,
) -> Result<Vec<Box<dyn Robot>>, StudyError> {
    let joints = robot.parametric.joint_names();
    Ok(match &section.robot {
        RobotChoice::Process(settings) => {
            let robot = |program: &PermittedProgram| ProcessRobot::new(settings.clone(), joints, program.clone());
            program.map(robot).transpose()?.into_iter().map(|robot| Box::new(robot) as Box<dyn Robot>).collect()
        }
        RobotChoice::Folder(settings) => {
            let mut settings = settings.clone();
            if stage > 0 {
                settings.folder = settings.folder.join(format!("leg_{}", stage + 1));
            }
            // The prior model is used to detect a wrong torque unit; without it the torques are not compared.
            let prior = ControllerModel::from_parameters(robot.model(), robot.terms(), robot.nominal()).ok();
            vec![Box::new(FolderRobot::new(settings, joints)?.with_prior(prior))]
        }
        RobotChoice::Function => Vec::new(),
        RobotChoice::Simulation => {
            let mut simulation = simulation.clone();
            // The numbers of runs start at 1 for every separately iterated trajectory, but the noise must differ.
            simulation.sensors.seed ^= (stage as u64).wrapping_mul(SEED_STEP_PER_LEG);
            let mut robots: Vec<Box<dyn Robot>> = Vec::new();
            for &member in members {
                let robot = simulation.truth(coupling, robot)?.robot;
                let leg = section.leg.get(member).filter(|leg| leg.locked && !leg.hold.is_empty());
                robots.push(Box::new(match leg {
                    Some(leg) => {
                        let held: Vec<String> = leg.hold.keys().cloned().collect();
                        robot.with_locked(&held)?
                    }
                    None => robot,
                }));
            }
            robots
        }
    })
}
