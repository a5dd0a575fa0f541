//! Inputs of a search or check: robot, limits, noise, prior and criterion of a study.

use super::limits_in_force::{LimitsFor, in_force, included, loaded};
use super::stopwatch::Stopwatch;
use super::{prior, table};
use crate::error::{Error, StudyError};
use crate::inputs::InputFiles;
use crate::jobs::options::RunOptions;
use crate::study::{CoulombChoice, CriterionChoice, DesignSection, Study, StudyFile, StudyRobot, TorqueNoise};
use dynident_excitation::criteria::{Criterion, DOptimal, Prediction};
use dynident_excitation::limits::{LimitSet, Limits, LimitsInForce};
use dynident_excitation::{Family, Information, Motion};
use dynident_model::Model;
use nalgebra::DMatrix;

const BLOCK_SAMPLES: usize = 4096;

pub(super) struct MotionInformation {
    /// Information matrix `Σ WᵀW` with unit torque noise, 1 Nm (N).
    pub(super) plain: DMatrix<f64>,
    /// Information matrix `Σ Wᵀ Σ⁻¹ W` with the torque noise of the study.
    pub(super) weighted: DMatrix<f64>,
}

pub(super) struct DesignSetup {
    pub(super) name: String,
    pub(super) section: DesignSection,
    pub(super) robot: StudyRobot,
    /// The robot with the payload of the motion.
    pub(super) loaded: Model,
    pub(super) limits: Limits,
    pub(super) set: LimitSet,
    pub(super) criteria: Vec<Box<dyn Criterion>>,
    pub(super) prior: Option<DMatrix<f64>>,
    pub(super) torque_std_nm: Vec<f64>,
    ones: Vec<f64>,
    pub(super) notes: Vec<String>,
    /// Assumed limits, and possible violations that are not checked.
    pub(super) assumed: Vec<String>,
    pub(super) not_checked: Vec<String>,
    pub(super) stopwatch: Stopwatch,
    /// State of the study's files before they were first read.
    pub(super) inputs: InputFiles,
}

impl DesignSetup {
    /// Prepares a search: smooth terms; the velocity of every joint must be limited.
    pub(super) fn for_search(study: StudyFile<'_>, options: &RunOptions<'_>) -> Result<Self, Error> {
        let mut notes = Vec::new();
        let smooth = smooth(&study, &mut notes);
        let setup = Self::new(study.with_study(&smooth), options, notes, LimitsFor::Search)?;
        bounded(&setup.robot, &setup.limits).map_err(Error::section(study.path, "design.limits"))?;
        Ok(setup)
    }

    /// Prepares the check of an existing motion with these start positions: terms as in the study.
    pub(super) fn for_check(study: StudyFile<'_>, options: &RunOptions<'_>, start: &[f64]) -> Result<Self, Error> {
        Self::new(study, options, Vec::new(), LimitsFor::Motion(start))
    }

    /// Prepares the check of a log: no assumed limits.
    pub(super) fn for_log(study: StudyFile<'_>, options: &RunOptions<'_>) -> Result<Self, Error> {
        Self::new(study, options, Vec::new(), LimitsFor::Log)
    }

    fn new(
        study: StudyFile<'_>,
        options: &RunOptions<'_>,
        mut notes: Vec<String>,
        purpose: LimitsFor<'_>,
    ) -> Result<Self, Error> {
        let stopwatch = Stopwatch::start();
        let section = study.design.clone().unwrap_or_default();
        section.validate().map_err(Error::section(study.path, "design"))?;
        let inputs = InputFiles::of(study, options.data.as_deref());
        let folders = study.folders(options.data.as_deref());
        let with_drives = prior::with_earlier_drives(&section.prior, &study, &folders)?;
        let study = study.with_study(&with_drives);
        let robot = study.robot_in(&folders)?;
        let LimitsInForce { limits, assumed, not_checked } = in_force(study, &folders, &robot, purpose)?;
        notes.extend(included(&limits, robot.model()));
        let loaded = loaded(study, &robot)?;
        let set = LimitSet::new(&limits, &loaded).map_err(Error::section(study.path, "design.limits"))?;
        let torque_std_nm = torque_std(&section, &robot, &mut notes).map_err(Error::section(study.path, "design"))?;
        let prior = prior::information(&section.prior, &robot, study.path, &folders, &mut notes)?;
        let criteria = match &section.criterion {
            CriterionChoice::Prediction { trajectory } => {
                let path = folders.find(trajectory, None)?;
                let task = table::trajectory(&path, &robot.parametric.joint_names(), &study.motion)?;
                notes.extend(task.note.map(|note| format!("task: {note}")));
                let samples = task.given.samples();
                let motion_at = |times: &[f64], out: &mut Motion| task.given.motion(&[], times, out);
                let sum = information(&robot, &torque_std_nm, task.given.times_s(), &motion_at);
                let criterion: Box<dyn Criterion> = Box::new(Prediction::new(sum / samples.samples as f64));
                // For the prediction criterion, the D-optimal motion is a better start than random parameters.
                vec![Box::new(DOptimal), criterion]
            }
            named => named.criteria().unwrap_or_default(),
        };
        Ok(Self {
            name: study.title(),
            ones: vec![1.0; robot.model().dof()],
            section,
            robot,
            loaded,
            limits,
            set,
            criteria,
            prior,
            torque_std_nm,
            notes,
            assumed,
            not_checked,
            stopwatch,
            inputs,
        })
    }

    /// Torque noise that the criterion uses, Nm (N).
    pub(super) fn criterion_std_nm(&self) -> &[f64] {
        if self.section.criterion.ignores_torque_noise() { &self.ones } else { &self.torque_std_nm }
    }

    pub(super) fn information(&self, times: &[f64], motion_at: &dyn Fn(&[f64], &mut Motion)) -> MotionInformation {
        let [plain, weighted] =
            [&self.ones, &self.torque_std_nm].map(|std| information(&self.robot, std, times, motion_at));
        MotionInformation { plain, weighted }
    }

    pub(super) fn criterion(&self) -> &'static str {
        self.criteria.last().map_or("", |criterion| criterion.name())
    }

    pub(super) fn figure(&self, MotionInformation { plain, weighted }: &MotionInformation) -> Option<f64> {
        let criterion = self.criteria.last()?;
        match &self.prior {
            _ if self.section.criterion.ignores_torque_noise() => criterion.figure(plain),
            Some(prior) => criterion.figure(&(prior + weighted)),
            None => criterion.figure(weighted),
        }
    }
}

/// Information of a motion at `times`, computed in blocks.
fn information(
    robot: &StudyRobot,
    torque_std_nm: &[f64],
    times: &[f64],
    motion_at: &dyn Fn(&[f64], &mut Motion),
) -> DMatrix<f64> {
    let count = robot.layout().columns().len();
    let mut gatherer = Information::new(robot.model(), robot.layout(), torque_std_nm, None);
    let (mut sum, mut motion) = (DMatrix::zeros(count, count), Motion::default());
    for times in times.chunks(BLOCK_SAMPLES) {
        motion_at(times, &mut motion);
        sum += gatherer.of(&motion, 1.0);
    }
    sum
}

/// Replaces unsmoothed sign functions by smoothed ones, because a sign function has no gradient.
fn smooth(study: &Study, notes: &mut Vec<String>) -> Study {
    let mut study = study.clone();
    let mut changed = false;
    let choices = core::iter::once(Some(&mut study.drive.coulomb))
        .chain(study.drive.joints.values_mut().map(|joint| joint.coulomb.as_mut()))
        .chain(study.coupling.iter_mut().map(|coupling| coupling.coulomb.as_mut()));
    for choice in choices.flatten().filter(|choice| **choice == CoulombChoice::Sign) {
        *choice = CoulombChoice::Smooth;
        changed = true;
    }
    if changed {
        notes
            .push("the design uses a smooth step (coulomb_width) for Coulomb friction in place of the sign".to_owned());
    }
    study
}

/// Checks that the velocity of every joint is limited; otherwise the optimum is infinitely fast.
fn bounded(robot: &StudyRobot, limits: &Limits) -> Result<(), StudyError> {
    for joint in robot.model().joints() {
        let free = limits.of(&joint.name).is_none_or(|limit| {
            let rates = [limit.speed, limit.acceleration, limit.jerk, limit.torque, limit.power_w];
            rates.iter().all(Option::is_none)
        });
        if free {
            return Err(StudyError::Unbounded { joint: joint.name.clone() });
        }
    }
    Ok(())
}

fn torque_std(section: &DesignSection, robot: &StudyRobot, notes: &mut Vec<String>) -> Result<Vec<f64>, StudyError> {
    let joints = robot.model().joints();
    match &section.torque_std_nm {
        Some(TorqueNoise::Same(std)) => Ok(vec![*std; joints.len()]),
        Some(TorqueNoise::Each(stds)) if stds.len() == joints.len() => Ok(stds.clone()),
        Some(TorqueNoise::Each(stds)) => {
            let (found, expected) = (stds.len(), joints.len());
            Err(StudyError::Length { key: "torque_std_nm", found, expected })
        }
        None => {
            notes.push(
                "torque noise (torque_std_nm) is not stated: assumed as 1 % of each effort limit, 1 Nm without an effort limit"
                    .to_owned(),
            );
            let of = |effort: Option<f64>| effort.filter(|effort| *effort > 0.0).map_or(1.0, |effort| 0.01 * effort);
            Ok(joints.iter().map(|joint| of(joint.limits.effort)).collect())
        }
    }
}
