//! A study to the motion that should be recorded: the best of a family inside every limit, checked again, with a forecast.

mod check;
mod file;
mod forecast;
mod joined;
mod name_or_table;
mod optimiser;
mod pictures;
mod prepared;
mod prior;
mod section;
mod start_posture;
mod table;
mod windows;

pub use check::{check_log, check_trajectory};
pub use file::{DESIGN_SCHEMA, DesignFile, DirectionForecast, ParameterForecast};
pub use joined::JoinedChoice;
pub use optimiser::OptimiserChoice;
pub use prior::PriorSection;
pub use section::{CriterionChoice, DesignSection, FamilyChoice, TorqueNoise};
pub use start_posture::StartPosture;
pub(crate) use table::trajectory as trajectory_table;
pub use windows::{GivenStroke, StrokeFile, StrokeLimitFile, WindowedCondition, WindowedFile, WindowedProblem};

use crate::cpu_time::cpu_seconds;
use crate::error::Error;
use crate::job::RunOptions;
use crate::machine::Machine;
use crate::study::Study;
use core::ops::ControlFlow;
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_excitation::check::{CHECK_RATE_HZ, LimitReport, VIOLATION, check_limits};
use dynident_excitation::criteria::Criterion;
use dynident_excitation::families::StartingAt;
use dynident_excitation::limits::{LimitSet, Limits, diagnose};
use dynident_excitation::optimisers::{Generation, OptimiserError};
use dynident_excitation::{DesignProgress, DesignTask, Family, Motion, design, design_without_gradients, grid};
use prepared::{Judged, Prepared};
use std::path::Path;
use windows::{Windowed, step_wise};

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
    /// The search by generations, for optimisers that have them; empty for gradients.
    pub history: Vec<Generation>,
    family: Box<dyn Family>,
}

impl DesignOutcome {
    /// The family of the motion; its parameters are the file's.
    pub fn family(&self) -> &dyn Family {
        &*self.family
    }

    /// The times `0, 1/rate, ..` up to the end, which stands last even if the rate does not divide the duration, and the motion there; of a log with gaps that of its longest piece.
    pub fn sampled(&self, rate_hz: f64) -> (Vec<f64>, Motion) {
        let duration_s = self.family.duration_s();
        let steps = (duration_s * rate_hz - 1e-9).ceil().max(1.0) as usize;
        let times: Vec<f64> = (0..=steps).map(|k| (k as f64 / rate_hz).min(duration_s)).collect();
        let mut motion = Motion::default();
        self.family.motion(&self.file.parameters, &times, &mut motion);
        (times, motion)
    }

    /// Torque along a motion by the prior inertial parameters, joint-major as the motion, Nm (N); `None` while a body's inertial is unknown.
    pub fn torque_nm(&self, motion: &Motion) -> Option<Vec<f64>> {
        let model = self.machine.model();
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
/// If the study, the description, the family's settings, the start, the prior, the task or the limits make no sense, or torque is limited without a prior.
pub fn design_study(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<DesignOutcome, Error> {
    let cpu_at_start = cpu_seconds();
    let wrong = |part: &str, why: &dyn core::fmt::Display| Error::study(study_path, format!("[{part}]: {why}"));
    let mut prepared = Prepared::for_search(study, study_path, options)?;
    let found = match &prepared.section.criterion {
        CriterionChoice::WindowedCondition(windowed) => {
            let found = step_wise(&prepared.section, windowed, &prepared.machine, &prepared.limits, watch)
                .map_err(|why| wrong("design", &why))?;
            prepared.notes.push(WINDOWED.to_owned());
            Found::from(found)
        }
        _ => searched(&prepared, &wrong, watch)?,
    };
    let Prepared { section, machine, limits, set, .. } = &prepared;
    let duration_s = found.family.duration_s();
    let motion_at = |times: &[f64], out: &mut Motion| found.family.motion(&found.parameters, times, out);
    let reports = check_limits(limits, machine.model(), duration_s, CHECK_RATE_HZ, motion_at)
        .map_err(|why| wrong("design.limits", &why))?;
    let inside = reports.iter().all(|report| !report.violated);
    let mut diagnosis = if inside { Vec::new() } else { sentences(set, duration_s, &reports, &motion_at) };
    diagnosis.extend(found.windowed.iter().flat_map(WindowedFile::sentences));
    let rate_hz = section.search.rate_hz;
    let times = grid(duration_s, (duration_s * rate_hz).round() as usize + 1);
    let [plain, weighted] = prepared.informations(&times, &motion_at);
    let judged = Judged {
        family: if found.windowed.is_some() { found.family.name() } else { section.family.name() },
        family_settings: Some(section.family.clone()),
        given: None,
        parameters: found.parameters,
        start_posture: found.start_posture,
        optimiser: found.windowed.as_ref().map_or(section.optimiser.name(), |windowed| windowed.optimiser),
        criterion: if found.windowed.is_some() { "windowed-condition" } else { prepared.criterion() },
        figure: found.figure,
        windowed: found.windowed,
        history: found.history,
        plain,
        weighted,
        duration_s,
        rate_hz,
        reports,
        check_rate_hz: CHECK_RATE_HZ,
        check_of: "the motion itself",
        diagnosis,
        evaluations: found.evaluations,
        seconds: found.seconds,
        cpu_at_start,
    };
    Ok(prepared.outcome(judged, found.family))
}

/// What a windowed design leaves to the check.
const WINDOWED: &str = "the strokes are chosen by position, speed and acceleration of their joints; limits of jerk, torque, power and place are checked on the whole motion afterwards";

/// What a search has found.
struct Found {
    family: Box<dyn Family>,
    parameters: Vec<f64>,
    start_posture: Vec<Option<f64>>,
    figure: Option<f64>,
    windowed: Option<WindowedFile>,
    history: Vec<Generation>,
    evaluations: usize,
    seconds: f64,
}

impl From<Windowed> for Found {
    fn from(found: Windowed) -> Self {
        Self {
            family: Box::new(found.family),
            parameters: found.parameters,
            start_posture: Vec::new(),
            figure: Some(found.file.condition_sum),
            windowed: Some(found.file),
            history: found.history,
            evaluations: found.evaluations,
            seconds: found.seconds,
        }
    }
}

/// The search for the ordinary problem: all joints at once, by gradients or without.
fn searched(
    prepared: &Prepared,
    wrong: &dyn Fn(&str, &dyn core::fmt::Display) -> Error,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<Found, Error> {
    let Prepared { section, machine, limits, set, .. } = prepared;
    let model = machine.model();
    limits.check_duration(model, section.duration_s, LEAST_DISPLACEMENT).map_err(|why| wrong("design.limits", &why))?;
    let mut family =
        section.family.family(model.dof(), section.duration_s).map_err(|why| wrong("design.family", &why))?;
    let mut start_posture = Vec::new();
    if let Some(start) = &section.start_posture {
        start_posture = start.of_joints(model, limits).map_err(|why| wrong("design", &why))?;
        family = Box::new(StartingAt::new(family, start_posture.clone()).map_err(|why| wrong("design", &why))?);
    }
    let criteria: Vec<&dyn Criterion> = prepared.criteria.iter().map(|criterion| &**criterion).collect();
    let task = DesignTask {
        family: &*family,
        criteria: &criteria,
        limits: set,
        layout: machine.layout(),
        torque_std_nm: prepared.counted_std_nm(),
        prior: prepared.prior.as_ref(),
    };
    let (designed, history) = match section.optimiser.derivative_free() {
        Some(optimiser) => design_without_gradients(&task, &section.search, &optimiser, watch),
        None => design(&task, &section.search, watch).map(|designed| (designed, Vec::new())),
    }
    .map_err(|why| match why {
        OptimiserError::Start => wrong(
            "design.family",
            &"no motion of this family excites every parameter, or none can be computed: take a richer family, join it with another, or give [design.prior]",
        ),
        why => wrong("design", &why),
    })?;
    Ok(Found {
        parameters: designed.parameters,
        start_posture,
        figure: designed.figure,
        windowed: None,
        history,
        evaluations: designed.evaluations,
        seconds: designed.seconds,
        family,
    })
}

/// Why the motion is not feasible.
fn sentences(
    set: &LimitSet,
    duration_s: f64,
    reports: &[LimitReport],
    motion_at: &dyn Fn(&[f64], &mut Motion),
) -> Vec<String> {
    let times = grid(duration_s, (duration_s * DIAGNOSIS_RATE_HZ).ceil() as usize + 1);
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
