//! `[[iteration.leg]]`: trajectories of which some joints are held, together in every run or one after another.

use super::section::{IterationSection, RobotChoice};
use super::trajectory::Trajectory;
use crate::design::DesignSection;
use crate::error::Error;
use crate::jobs::options::RunOptions;
use crate::simulate::section::SimulationSection;
use crate::study::Study;
use crate::study::StudyRobot;
use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_iteration::Leg;
use dynident_iteration::Robot;
use dynident_iteration::robot::{FolderRobot, ProcessRobot};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Spreads the seeds of legs that have an iteration each.
const SEED_OF_LEG: u64 = 0xd1b5_4a32_d192_ed03;

/// What becomes of several legs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LegOrder {
    /// Every run has all of them, and is identified from all.
    #[default]
    Together,
    /// Each has an iteration of its own, until that has settled or its runs are used up; what it has found is held in those after it. The paper's way: tip first.
    OneAfterAnother,
}

/// `[[iteration.leg]]`: one trajectory.
///
/// ```
/// let section: dynident::IterationSection = toml::from_str(
///     r#"
///     order = "one-after-another"
///     leg = [{ hold = { joint1 = 0.0 } }, { hold = { joint2 = 0.5 }, trajectory = "joint1.csv", windows = { joint1 = [[2.0, 8.0]] } }]
///     "#,
/// )?;
/// assert_eq!(section.leg[1].hold["joint2"], 0.5);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct LegSection {
    /// Joints that are held, and where, rad (m); none by default. Their torque does not count. Of a windowed design only the strokes of the other joints are run.
    pub hold: BTreeMap<String, f64>,
    /// Whether the simulator locks them (the default), or the controller has to hold them. A robot outside gets them as joints that are to rest.
    pub locked: bool,
    /// Its trajectory, in place of the study's.
    pub trajectory: Option<PathBuf>,
    /// Its design, in place of the study's `[design]`.
    pub design: Option<DesignSection>,
    /// For joints by name the times (from, to; s) that count; what the design says by default, or everything. Joints that are not named do not count then.
    pub windows: BTreeMap<String, Vec<[f64; 2]>>,
}

impl Default for LegSection {
    fn default() -> Self {
        Self { hold: BTreeMap::new(), locked: true, trajectory: None, design: None, windows: BTreeMap::new() }
    }
}

/// The trajectory of each leg; the study's own is looked for once.
pub(super) fn trajectories(
    study: &Study,
    study_path: &Path,
    machine: &StudyRobot,
    rate_hz: f64,
    options: &RunOptions<'_>,
    watch: &(dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
) -> Result<Vec<Trajectory>, Error> {
    let of = |study: &Study| Trajectory::of_study(study, study_path, machine, rate_hz, options, watch);
    let section = study.iteration.clone().unwrap_or_default();
    if section.leg.is_empty() {
        return Ok(vec![of(study)?]);
    }
    let mut whole: Option<Trajectory> = None;
    let mut all = Vec::new();
    for leg in &section.leg {
        if leg.trajectory.is_some() || leg.design.is_some() {
            let mut own = study.clone();
            own.iteration.get_or_insert_default().trajectory.clone_from(&leg.trajectory);
            if leg.design.is_some() {
                own.design.clone_from(&leg.design);
            }
            all.push(of(&own)?);
            continue;
        }
        if whole.is_none() {
            whole = Some(of(study)?);
        }
        all.extend(whole.clone());
    }
    Ok(all)
}

impl IterationSection {
    /// The legs, as places among all, of each iteration.
    pub(super) fn stages(&self) -> Vec<Vec<usize>> {
        match self.order {
            LegOrder::OneAfterAnother if self.leg.len() > 1 => (0..self.leg.len()).map(|leg| vec![leg]).collect(),
            _ => vec![(0..self.leg.len().max(1)).collect()],
        }
    }

    /// Checks names and numbers of the legs.
    pub(super) fn check_legs(&self, machine: &StudyRobot) -> Result<(), String> {
        let names = machine.parametric.joint_names();
        for (number, leg) in (1..).zip(&self.leg) {
            let at = |what: &str| format!("leg {number}: {what}");
            if leg.trajectory.is_some() && leg.design.is_some() {
                return Err(at("give a trajectory or a design, not both"));
            }
            if let Some(other) = leg.hold.keys().chain(leg.windows.keys()).find(|name| !names.contains(name)) {
                return Err(at(&format!("there is no joint {other}; the robot has {}", names.join(", "))));
            }
            if let Some(both) = leg.hold.keys().find(|name| leg.windows.contains_key(*name)) {
                return Err(at(&format!("joint {both} is held: take it out of windows or of hold")));
            }
            if let Some((name, value)) = leg.hold.iter().find(|(_, value)| !value.is_finite()) {
                return Err(at(&format!("hold.{name} = {value}: give a position")));
            }
            if leg.hold.len() == names.len() {
                return Err(at("all joints are held: leave one that moves"));
            }
        }
        Ok(())
    }

    /// What is run, with held joints at rest and the times that count.
    pub(super) fn legs(&self, trajectories: &[Trajectory], machine: &StudyRobot) -> Result<Vec<Leg>, String> {
        let names = machine.parametric.joint_names();
        let free = [LegSection::default()];
        let sections = if self.leg.is_empty() { &free[..] } else { &self.leg[..] };
        if sections.len() != trajectories.len() {
            return Err("trajectory.json has other legs: remove it".to_owned());
        }
        let mut legs = Vec::new();
        for (section, trajectory) in sections.iter().zip(trajectories) {
            let held: Vec<Option<f64>> = names.iter().map(|name| section.hold.get(name).copied()).collect();
            let trajectory = trajectory.without(&held)?;
            let mut reference = trajectory.reference().map_err(|error| error.to_string())?;
            for (joint, held) in held.iter().enumerate() {
                if let Some(position) = held {
                    reference = reference.with_joint_held(joint, *position).map_err(|error| error.to_string())?;
                }
            }
            let everything = || vec![vec![[-1.0, reference.duration_s() + 1.0]]; names.len()];
            let mut windows = match &trajectory.windows {
                _ if !section.windows.is_empty() => {
                    Some(names.iter().map(|name| section.windows.get(name).cloned().unwrap_or_default()).collect())
                }
                Some(windows) if !self.every_sample => Some(windows.clone()),
                _ => (!section.hold.is_empty()).then(everything),
            };
            if let Some(windows) = &mut windows {
                windows.iter_mut().zip(&held).filter(|(_, held)| held.is_some()).for_each(|(own, _)| own.clear());
            }
            let leg = match windows {
                None => Leg::whole(reference),
                Some(windows) => Leg::windowed(reference, windows),
            };
            legs.push(leg.map_err(|error| error.to_string())?);
        }
        Ok(legs)
    }

    /// The robots of one iteration: the simulator for each of its legs, or the one outside.
    pub(super) fn robots(
        &self,
        simulation: &SimulationSection,
        machine: &StudyRobot,
        stage: usize,
        members: &[usize],
    ) -> Result<Vec<Box<dyn Robot>>, String> {
        let joints = machine.parametric.joint_names();
        let said = |error: dynident_simulation::SimulationError| error.to_string();
        Ok(match &self.robot {
            RobotChoice::Process(settings) => {
                vec![Box::new(ProcessRobot::new(settings.clone(), joints).map_err(said)?)]
            }
            RobotChoice::Folder(settings) => {
                let mut settings = settings.clone();
                if stage > 0 {
                    settings.folder = settings.folder.join(format!("leg_{}", stage + 1));
                }
                vec![Box::new(FolderRobot::new(settings, joints).map_err(said)?)]
            }
            RobotChoice::Simulation => {
                let mut simulation = simulation.clone();
                // Runs of every leg count from 1: their noise is not to be the same.
                simulation.sensors.seed ^= (stage as u64).wrapping_mul(SEED_OF_LEG);
                let mut robots: Vec<Box<dyn Robot>> = Vec::new();
                for &member in members {
                    let robot = simulation.truth(machine)?.robot;
                    let section = self.leg.get(member).filter(|leg| leg.locked && !leg.hold.is_empty());
                    robots.push(Box::new(match section {
                        Some(leg) => {
                            let held: Vec<String> = leg.hold.keys().cloned().collect();
                            robot.with_locked(&held).map_err(said)?
                        }
                        None => robot,
                    }));
                }
                robots
            }
        })
    }
}
