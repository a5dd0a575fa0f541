//! The search for the motion that a study asks for.

use super::setup::DesignSetup;
use crate::error::{Error, StudyError};
use crate::result::WindowedFile;
use core::ops::ControlFlow;
use dynident_excitation::criteria::Criterion;
use dynident_excitation::families::StartingAt;
use dynident_excitation::limits::Relaxation;
use dynident_excitation::optimisers::{Generation, OptimiserError};
use dynident_excitation::{DesignProgress, DesignTask, Family, design, design_without_gradients, single_changes};
use std::path::Path;

/// The displacement, rad or m, that every joint must at least have the time for.
const LEAST_DISPLACEMENT: f64 = 0.05;

/// The best motion of a search.
pub(super) struct SearchResult {
    /// The family of the motion.
    pub(super) family: Box<dyn Family>,
    /// Its parameters.
    pub(super) parameters: Vec<f64>,
    /// Where the study lets each joint start, rad (m).
    pub(super) start_posture: Vec<Option<f64>>,
    /// The criterion's figure; none where a parameter is not excited.
    pub(super) figure: Option<f64>,
    /// Largest violation of a limit by the search; zero of a windowed design.
    pub(super) violation: f64,
    /// The strokes of a windowed design.
    pub(super) windowed: Option<WindowedFile>,
    /// The search by generations, for optimisers that have them.
    pub(super) history: Vec<Generation>,
    /// Evaluations of criterion, limits and gradient.
    pub(super) evaluations: usize,
    /// Seconds by the clock.
    pub(super) seconds: f64,
}

impl SearchResult {
    /// What is reported after the search.
    pub(super) fn progress(&self, round: &'static str) -> DesignProgress {
        DesignProgress {
            round,
            value: self.figure.unwrap_or(f64::INFINITY),
            violation: self.violation,
            evaluations: self.evaluations as u64,
        }
    }
}

/// The search for the ordinary problem: all joints at once, by gradients or without.
pub(super) fn search(
    setup: &DesignSetup,
    study_path: &Path,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<SearchResult, Error> {
    let DesignSetup { section, robot, limits, .. } = setup;
    let model = robot.model();
    limits
        .check_duration(model, section.duration_s, LEAST_DISPLACEMENT)
        .map_err(Error::section(study_path, "design.limits"))?;
    let family = section.family.family(model.dof(), section.duration_s);
    let mut family = family.map_err(Error::section(study_path, "design.family"))?;
    let mut start_posture = Vec::new();
    if let Some(start) = &section.start_posture {
        start_posture = start.of_joints(model, limits).map_err(Error::section(study_path, "design"))?;
        let starting = StartingAt::new(family, start_posture.clone());
        family = Box::new(starting.map_err(Error::section(study_path, "design"))?);
    }
    let criteria: Vec<&dyn Criterion> = setup.criteria.iter().map(|criterion| &**criterion).collect();
    let task = task(setup, &*family, &criteria);
    let (best, history) = match section.optimiser.derivative_free() {
        Some(optimiser) => design_without_gradients(&task, &section.search, &optimiser, watch),
        None => design(&task, &section.search, watch).map(|best| (best, Vec::new())),
    }
    .map_err(|why| match why {
        OptimiserError::Start => Error::section(study_path, "design.family")(StudyError::missing(
            "no motion of this family excites every parameter, or none can be computed",
            "take a richer family, join it with another, or give [design.prior]",
        )),
        why => Error::section(study_path, "design")(why),
    })?;
    Ok(SearchResult {
        parameters: best.parameters,
        start_posture,
        figure: best.figure,
        violation: best.violation,
        windowed: None,
        history,
        evaluations: best.evaluations,
        seconds: best.seconds,
        family,
    })
}

fn task<'a>(setup: &'a DesignSetup, family: &'a dyn Family, criteria: &'a [&'a dyn Criterion]) -> DesignTask<'a> {
    DesignTask {
        family,
        criteria,
        limits: &setup.set,
        layout: setup.robot.layout(),
        torque_std_nm: setup.counted_std_nm(),
        prior: setup.prior.as_ref(),
    }
}

/// Changes of a single limit with which another motion than the one found would be possible; within the time limit's
/// own length where there is one. `watch` may end the search for them.
pub(super) fn changes(
    setup: &DesignSetup,
    study_path: &Path,
    found: &SearchResult,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<Vec<Relaxation>, Error> {
    let criteria: Vec<&dyn Criterion> = setup.criteria.iter().map(|criterion| &**criterion).collect();
    let settings = &setup.section.search;
    let progress = found.progress("changes of limits");
    let late = || settings.time_limit_s.is_some_and(|limit| setup.stopwatch.started.elapsed().as_secs_f64() > limit);
    let over = || watch(&progress).is_break() || late();
    single_changes(&task(setup, &*found.family, &criteria), settings, &found.parameters, &over)
        .map_err(Error::section(study_path, "design"))
}
