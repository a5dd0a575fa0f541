//! A study to the motion that should be recorded: the best of a family inside every limit, checked again, with a forecast.

mod file;
mod forecast;
mod section;

pub use file::{DESIGN_SCHEMA, DesignFile, DirectionForecast, ParameterForecast};
pub use section::{CriterionChoice, DesignSection, FamilyChoice, TorqueNoise};

use crate::cpu_time::cpu_seconds;
use crate::error::Error;
use crate::job::{RunOptions, joint_names, study_name};
use crate::machine::Machine;
use crate::study::{CoulombChoice, Folders, Study};
use core::ops::ControlFlow;
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_excitation::check::{CHECK_RATE_HZ, LimitReport, VIOLATION, check_limits};
use dynident_excitation::criteria::{ConditionNumber, Criterion, DOptimal};
use dynident_excitation::limits::{LimitSet, Limits, diagnose};
use dynident_excitation::{DesignProgress, DesignTask, Family, Information, Motion, design, grid};
use forecast::named_forecast;
use nalgebra::DMatrix;
use std::path::Path;

/// The displacement, rad or m, that every joint must at least have the time for.
const LEAST_DISPLACEMENT: f64 = 0.05;

/// Rate of the diagnosis, Hz.
const DIAGNOSIS_RATE_HZ: f64 = 1000.0;

/// A finished design.
#[derive(Debug)]
pub struct DesignOutcome {
    /// What `design.json` holds.
    pub file: DesignFile,
    /// The machine.
    pub machine: Machine,
    /// The limits in force: the description's with the study's laid over them.
    pub limits: Limits,
    family: Box<dyn Family>,
}

impl DesignOutcome {
    /// The times `0, 1/rate, ..` up to the end, which stands last even if the rate does not divide the duration, and the motion there.
    pub fn sampled(&self, rate_hz: f64) -> (Vec<f64>, Motion) {
        let steps = (self.file.duration_s * rate_hz - 1e-9).ceil().max(1.0) as usize;
        let times: Vec<f64> = (0..=steps).map(|k| (k as f64 / rate_hz).min(self.file.duration_s)).collect();
        let mut motion = Motion::default();
        self.family.motion(&self.file.parameters, &times, &mut motion);
        (times, motion)
    }

    /// Torque along a motion by the prior inertial parameters, joint-major as the motion, Nm (N); `None` while a body's inertial is unknown.
    pub fn torque_nm(&self, motion: &Motion) -> Option<Vec<f64>> {
        let model = &self.machine.model;
        if !model.bodies_without_prior().is_empty() {
            return None;
        }
        let mut workspace = Workspace::new(model);
        let mut torque = vec![0.0; motion.joints * motion.samples];
        for sample in 0..motion.samples {
            let state = |values: &[f64]| -> Vec<f64> {
                (0..motion.joints).map(|joint| values[joint * motion.samples + sample]).collect()
            };
            let tau =
                inverse_dynamics(model, &mut workspace, &state(&motion.q), &state(&motion.dq), &state(&motion.ddq));
            for (joint, tau) in tau.iter().enumerate() {
                torque[joint * motion.samples + sample] = *tau;
            }
        }
        Some(torque)
    }
}

/// Designs the motion that a study's `[design]` asks for (its defaults where the section is absent). `watch` hears how far the search is and may end it: the best so far is the result.
///
/// The laws are those of `[drive]`, with a smooth step for Coulomb friction. Limits are checked again at 10 kHz; a motion that breaks one is a result, with `feasible` false and a diagnosis.
///
/// # Errors
/// If the study, the description, the family's settings or the limits make no sense, or torque is limited without a prior.
pub fn design_study(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<DesignOutcome, Error> {
    let cpu_at_start = cpu_seconds();
    let section = study.design.clone().unwrap_or_default();
    let wrong = |part: &str, why: &dyn core::fmt::Display| Error::study(study_path, format!("[{part}]: {why}"));
    section.validate().map_err(|why| wrong("design", &why))?;
    let mut notes = Vec::new();
    let study = smooth(study, &mut notes);
    let machine = Machine::new(&study, study_path, &Folders::new(&study, study_path, options.data.as_deref()))?;
    let model = &machine.model;
    let limits = Limits::from_model(model).overlaid(&section.limits);
    let set = LimitSet::new(&limits, model).map_err(|why| wrong("design.limits", &why))?;
    bounded(&machine, &limits).map_err(|why| wrong("design.limits", &why))?;
    limits.check_duration(model, section.duration_s, LEAST_DISPLACEMENT).map_err(|why| wrong("design.limits", &why))?;
    let family = section.family.family(model.dof(), section.duration_s).map_err(|why| wrong("design.family", &why))?;
    let torque_std_nm = torque_std(&section, &machine, &mut notes).map_err(|why| wrong("design", &why))?;
    let ones = vec![1.0; model.dof()];

    let criteria = section.criterion.criteria();
    let criteria: Vec<&dyn Criterion> = criteria.iter().map(|criterion| &**criterion).collect();
    let task = DesignTask {
        family: &*family,
        criteria: &criteria,
        limits: &set,
        layout: &machine.layout,
        torque_std_nm: if section.criterion.of_regressor() { &ones } else { &torque_std_nm },
        prior: None,
    };
    let designed = design(&task, &section.search, watch).map_err(|why| wrong("design", &why))?;

    let motion_at = |times: &[f64], out: &mut Motion| family.motion(&designed.parameters, times, out);
    let reports = check_limits(&limits, model, section.duration_s, CHECK_RATE_HZ, motion_at)
        .map_err(|why| wrong("design.limits", &why))?;
    let feasible = reports.iter().all(|report| !report.violated);
    let diagnosis = if feasible { Vec::new() } else { sentences(&set, &section, &reports, &motion_at) };

    let rate_hz = section.search.rate_hz;
    let mut motion = Motion::default();
    motion_at(&grid(section.duration_s, (section.duration_s * rate_hz).round() as usize + 1), &mut motion);
    let plain = Information::new(model, &machine.layout, &ones, None).of(&motion, 1.0);
    let weighted = Information::new(model, &machine.layout, &torque_std_nm, None).of(&motion, 1.0);
    let log_det = |information: &DMatrix<f64>| DOptimal.figure(information).map(|figure| -figure);
    let condition = |scaled| ConditionNumber { scaled, ..ConditionNumber::default() }.figure(&plain);
    let (forecast, worst_directions) = named_forecast(&machine, &weighted);
    let file = DesignFile {
        schema: DESIGN_SCHEMA,
        name: study_name(&study, study_path),
        joints: joint_names(&machine),
        family: section.family.name(),
        family_settings: section.family.clone(),
        criterion: criteria.last().map_or("", |criterion| criterion.name()),
        criterion_figure: designed.figure,
        condition_number: condition(false),
        condition_number_scaled: condition(true),
        log_det: log_det(&plain),
        log_det_weighted: log_det(&weighted),
        base_columns: machine.base.count(),
        duration_s: section.duration_s,
        rate_hz,
        torque_std_nm,
        feasible,
        check_rate_hz: CHECK_RATE_HZ,
        limits: reports,
        forecast,
        worst_directions,
        evaluations: designed.evaluations,
        cpu_s: cpu_at_start.zip(cpu_seconds()).map(|(start, end)| end - start),
        seconds: designed.seconds,
        seed: section.search.seed,
        diagnosis,
        notes,
        parameters: designed.parameters,
    };
    Ok(DesignOutcome { file, machine, limits, family })
}

/// The study with smooth steps in place of signs: a sign has no slope to follow.
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
        notes.push(
            "Coulomb friction is designed for with a smooth step (coulomb_width) in place of the sign".to_owned(),
        );
    }
    study
}

/// That something bounds how fast each joint moves: without it the best motion is infinitely fast.
fn bounded(machine: &Machine, limits: &Limits) -> Result<(), String> {
    for joint in machine.model.joints() {
        let free = limits.of(&joint.name).is_none_or(|limit| {
            let rates = [limit.speed, limit.acceleration, limit.jerk, limit.torque, limit.power_w];
            rates.iter().all(Option::is_none)
        });
        if free {
            return Err(format!(
                "joint `{0}` has no limit of speed, acceleration, jerk, torque or power, so that the best motion would be infinitely fast; \
                 give one: joints = [{{ joint = \"{0}\", acceleration = ... }}]",
                joint.name
            ));
        }
    }
    Ok(())
}

/// Torque noise of every joint.
fn torque_std(section: &DesignSection, machine: &Machine, notes: &mut Vec<String>) -> Result<Vec<f64>, String> {
    let joints = machine.model.joints();
    match &section.torque_std_nm {
        Some(TorqueNoise::Same(std)) => Ok(vec![*std; joints.len()]),
        Some(TorqueNoise::Each(stds)) if stds.len() == joints.len() => Ok(stds.clone()),
        Some(TorqueNoise::Each(stds)) => {
            Err(format!("torque_std_nm has {} entries, the robot {} joints: give one each", stds.len(), joints.len()))
        }
        None => {
            notes.push(
                "torque noise is taken as 1 % of each effort limit (torque_std_nm), 1 Nm where there is none"
                    .to_owned(),
            );
            let of = |effort: Option<f64>| effort.filter(|effort| *effort > 0.0).map_or(1.0, |effort| 0.01 * effort);
            Ok(joints.iter().map(|joint| of(joint.limits.effort)).collect())
        }
    }
}

/// Why the motion is not feasible.
fn sentences(
    set: &LimitSet,
    section: &DesignSection,
    reports: &[LimitReport],
    motion_at: &dyn Fn(&[f64], &mut Motion),
) -> Vec<String> {
    let times = grid(section.duration_s, (section.duration_s * DIAGNOSIS_RATE_HZ).ceil() as usize + 1);
    let mut motion = Motion::default();
    motion_at(&times, &mut motion);
    let sentences = diagnose(set, &times, &motion).sentences();
    if !sentences.is_empty() {
        return sentences;
    }
    // Broken between the diagnosis' samples only.
    let broken = reports.iter().filter(|report| report.violated).map(|report| {
        let excess = 100.0 * (report.worst_ratio - 1.0).max(VIOLATION);
        format!("The {} limit of `{}` is exceeded by {excess:.4} % at {:.4} s.", report.kind, report.joint, report.at_s)
    });
    broken.collect()
}
