//! Search for the motion of a study.

use super::setup::DesignSetup;
use crate::error::{Error, StudyError};
use crate::result::WindowedFile;
use core::ops::ControlFlow;
use dynident_excitation::criteria::Criterion;
use dynident_excitation::families::WithStartPosture;
use dynident_excitation::limits::Relaxation;
use dynident_excitation::optimisers::{Generation, OptimiserError};
use dynident_excitation::{DesignProgress, DesignTask, Family, design, design_without_gradients, single_changes};
use std::path::Path;

/// Displacement, rad or m, by which every joint must be able to move within the duration.
const MIN_DISPLACEMENT: f64 = 0.05;

pub(super) struct SearchResult {
    pub(super) family: Box<dyn Family>,
    pub(super) parameters: Vec<f64>,
    /// Given start position of each joint, rad (m).
    pub(super) start_posture: Vec<Option<f64>>,
    /// Value of the criterion; `None` if the motion does not excite a parameter.
    pub(super) figure: Option<f64>,
    /// Largest limit violation in the search; zero for a step-wise design.
    pub(super) violation: f64,
    pub(super) windowed: Option<WindowedFile>,
    /// Generations of the search; empty for a search with gradients.
    pub(super) history: Vec<Generation>,
    pub(super) evaluations: usize,
    pub(super) seconds: f64,
}

impl SearchResult {
    pub(super) fn progress(&self, round: &'static str) -> DesignProgress {
        DesignProgress {
            round,
            value: self.figure.unwrap_or(f64::INFINITY),
            violation: self.violation,
            evaluations: self.evaluations as u64,
        }
    }
}

/// Search over all joints at once, with or without gradients.
pub(super) fn search(
    setup: &DesignSetup,
    study_path: &Path,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<SearchResult, Error> {
    let DesignSetup { section, robot, limits, .. } = setup;
    let model = robot.model();
    limits
        .check_duration(model, section.duration_s, MIN_DISPLACEMENT)
        .map_err(Error::section(study_path, "design.limits"))?;
    let family = section.family.family(model.dof(), section.duration_s);
    let mut family = family.map_err(Error::section(study_path, "design.family"))?;
    let mut start_posture = Vec::new();
    if let Some(start) = &section.start_posture {
        start_posture = start.of_joints(model, limits).map_err(Error::section(study_path, "design"))?;
        let starting = WithStartPosture::new(family, start_posture.clone());
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
            "use a richer family, combine it with another (kind = \"joined\"), or give [design.prior]",
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
        torque_std_nm: setup.criterion_std_nm(),
        prior: setup.prior.as_ref(),
    }
}

/// Searches for changes of single limits that would make another motion feasible, within the time limit of the
/// search. `watch` can stop it.
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
