//! Step-wise design over time windows (*Iterative Identification of Robot Dynamic Parameters Based on Logistic
//! Function*, equations 9, 10 and 17 to 19), solved with the study's optimiser and compared with the optimum.

use super::search::SearchResult;
use crate::error::{Expected, StudyError};
use crate::result::{StrokeFile, StrokeLimitFile, WindowedFile};
use crate::study::{DesignSection, FamilyChoice, GivenStroke, OptimiserChoice, StudyRobot, WindowedCondition};
use core::ops::ControlFlow;
use dynident_excitation::families::{SplicedLogisticSettings, Step, StepWiseLogistic};
use dynident_excitation::limits::Limits;
use dynident_excitation::optimisers::{
    BinaryGeneticSettings, CmaEsSettings, Generation, Progress, binary_genetic, cma_es,
};
use dynident_excitation::step_wise::{StepWiseJoint, StepWiseProblem, Stroke, StrokeConstants, gravity_across};
use dynident_excitation::{DesignProgress, Family};
use std::time::Instant;

const STARTS_PER_JOINT: usize = 4;

/// Position limit of a joint without position limits, rad: larger than any amplitude range.
const UNLIMITED_RAD: f64 = 1e6;

pub(crate) fn step_wise(
    section: &DesignSection,
    windowed: &WindowedCondition,
    robot: &StudyRobot,
    limits: &Limits,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<SearchResult, StudyError> {
    let begun = Instant::now();
    let settings = spliced_settings(section)?;
    let dof = robot.model().dof();
    settings.validate(dof, section.duration_s)?;
    let offsets = settings.offsets.clone().unwrap_or_else(|| vec![0.0; dof]);
    let names: Vec<String> = match &windowed.joints {
        Some(joints) => joints.clone(),
        None => robot.model().joints().iter().rev().map(|joint| joint.name.clone()).collect(),
    };
    let problem = problem(section, windowed, robot, limits, settings, &offsets, &names)?;
    problem.validate()?;

    let late = || section.search.time_limit_s.is_some_and(|limit| begun.elapsed().as_secs_f64() > limit);
    let stop = |round: &'static str, progress: &Progress<'_>| {
        let progress = DesignProgress {
            round,
            value: progress.value,
            violation: progress.violation,
            evaluations: progress.evaluations as u64,
        };
        if watch(&progress).is_break() || late() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    // The optimum is computed with every design; it takes about 0.1 s.
    let (x, evaluations) =
        problem.gradient_solution(section.search.seed, STARTS_PER_JOINT, |_| ControlFlow::Continue(()))?;
    let optimum = FoundStrokes { x, evaluations, optimiser: section.optimiser.name(), history: Vec::new() };
    let found = if section.parameters.is_empty() {
        searched(section, &problem, &optimum, stop)?
    } else {
        let x = given(&section.parameters, &names)?;
        FoundStrokes { x, evaluations: 0, optimiser: "given", history: Vec::new() }
    };

    let motion = StrokeMotion { problem: &problem, settings, offsets: &offsets, robot };
    let strokes = problem.strokes(&found.x);
    let family = motion.family(&strokes)?;
    debug_assert_eq!(family.joints(), dof);
    let file = motion.file(windowed, &found, &optimum.x);
    Ok(SearchResult {
        family: Box::new(family),
        parameters: strokes.iter().flat_map(|stroke| [stroke.amplitude_rad, stroke.steepness_per_s]).collect(),
        start_posture: Vec::new(),
        figure: Some(file.condition_sum),
        violation: 0.0,
        windowed: Some(file),
        history: found.history,
        evaluations: found.evaluations,
        seconds: begun.elapsed().as_secs_f64(),
    })
}

/// Settings of the family. Only `spliced-logistic` has moves with mid-points, around which windows can be placed.
fn spliced_settings(section: &DesignSection) -> Result<&SplicedLogisticSettings, StudyError> {
    let FamilyChoice::SplicedLogistic(settings) = &section.family else {
        let fix = "the criterion windowed-condition needs kind = \"spliced-logistic\", whose strokes have mid-points";
        return Err(StudyError::conflict(format!("family.kind = \"{}\"", section.family.name()), fix));
    };
    if settings.periods_s.is_some() {
        let fix = "with windowed-condition each period follows from period_times_omega; remove periods_s";
        return Err(StudyError::conflict("family.periods_s", fix));
    }
    Ok(settings)
}

/// The moves (strokes) of a design as the vector of unknowns, with the statistics of the search.
#[derive(Clone)]
struct FoundStrokes {
    x: Vec<f64>,
    evaluations: usize,
    optimiser: &'static str,
    history: Vec<Generation>,
}

/// The moves that the study's optimiser found; `optimum` contains those of the gradient method.
fn searched(
    section: &DesignSection,
    problem: &StepWiseProblem,
    optimum: &FoundStrokes,
    stop: impl Fn(&'static str, &Progress<'_>) -> ControlFlow<()>,
) -> Result<FoundStrokes, StudyError> {
    let (seed, bounds) = (section.search.seed, problem.bounds());
    let mut history = Vec::new();
    let (x, evaluations) = match &section.optimiser {
        OptimiserChoice::Gradient => return Ok(optimum.clone()),
        OptimiserChoice::Genetic(own) => {
            let own = BinaryGeneticSettings { seed, ..own.clone() };
            let mut hear = |progress: &Progress<'_>| stop("generations", progress);
            let result = binary_genetic(|x| problem.fitness(x), &bounds, &own, &mut hear);
            let result = result.map_err(StudyError::at("optimiser"))?;
            history = result.history;
            (result.best, result.evaluations)
        }
        OptimiserChoice::CmaEs(own) => {
            let own = CmaEsSettings { seed, ..own.clone() };
            let start: Vec<f64> = bounds.iter().map(|[low, high]| f64::midpoint(*low, *high)).collect();
            let steps: Vec<f64> = bounds.iter().map(|[low, high]| 0.3 * (high - low)).collect();
            let mut hear = |progress: &Progress<'_>| {
                let value = progress.value;
                history.push(Generation { best: value, best_so_far: value, mean: value });
                stop("generations", progress)
            };
            let result = cma_es(|x| problem.graded_fitness(x), &start, &steps, &bounds, &own, &mut hear);
            let result = result.map_err(StudyError::at("optimiser"))?;
            (result.best, result.evaluations)
        }
    };
    Ok(FoundStrokes { x, evaluations, optimiser: section.optimiser.name(), history })
}

struct StrokeMotion<'a> {
    problem: &'a StepWiseProblem,
    settings: &'a SplicedLogisticSettings,
    /// Start position of each joint, rad (m).
    offsets: &'a [f64],
    robot: &'a StudyRobot,
}

impl StrokeMotion<'_> {
    fn family(&self, strokes: &[Stroke]) -> Result<StepWiseLogistic, StudyError> {
        let steps = self.problem.joints.iter().zip(strokes).map(|(joint, stroke)| Step {
            joint: joint.joint,
            period_s: self.settings.period_times_omega / stroke.steepness_per_s,
        });
        Ok(StepWiseLogistic::new(self.offsets, &steps.collect::<Vec<_>>(), self.settings)?)
    }

    /// Content of the result file. The optimum is included if it keeps all limits.
    fn file(&self, windowed: &WindowedCondition, found: &FoundStrokes, optimum: &[f64]) -> WindowedFile {
        let problem = self.problem;
        let strokes = problem.strokes(&found.x);
        let condition_sum = problem.condition_numbers(&strokes).iter().sum();
        let optimum_strokes = self.stroke_files(&problem.strokes(optimum));
        let inside = optimum_strokes.iter().flat_map(|stroke| &stroke.limits).all(|limit| limit.kept);
        let best = inside.then(|| problem.fitness(optimum));
        WindowedFile {
            problem: windowed.problem,
            optimiser: found.optimiser.to_owned(),
            fitness: problem.fitness(&found.x),
            condition_sum,
            optimum: best,
            above_optimum_percent: best.map(|best| 100.0 * (condition_sum / best - 1.0)),
            strokes: self.stroke_files(&strokes),
            optimum_strokes: if inside { optimum_strokes } else { Vec::new() },
        }
    }

    fn stroke_files(&self, strokes: &[Stroke]) -> Vec<StrokeFile> {
        let Self { problem, settings, offsets, robot } = *self;
        let conditions = problem.condition_numbers(strokes);
        let one = |place: usize| {
            let (stroke, joint) = (&strokes[place], problem.joints[place].joint);
            let limits = problem.limits(place, stroke).into_iter();
            let limits = limits.filter(|limit| limit.limit < UNLIMITED_RAD).map(|limit| StrokeLimitFile {
                quantity: limit.quantity,
                value: limit.value,
                limit: limit.limit,
                excess_percent: 100.0 * limit.excess(),
                kept: limit.kept(),
            });
            StrokeFile {
                joint: robot.model().joints()[joint].name.clone(),
                amplitude_rad: stroke.amplitude_rad,
                steepness_per_s: stroke.steepness_per_s,
                offset_rad: offsets[joint],
                period_s: settings.period_times_omega / stroke.steepness_per_s,
                window_s: stroke.window_s,
                condition_number: conditions[place],
                limits: limits.collect(),
            }
        };
        (0..strokes.len()).map(one).collect()
    }
}

fn problem(
    section: &DesignSection,
    windowed: &WindowedCondition,
    robot: &StudyRobot,
    limits: &Limits,
    settings: &SplicedLogisticSettings,
    offsets: &[f64],
    names: &[String],
) -> Result<StepWiseProblem, StudyError> {
    let model = robot.model();
    let mut joints = Vec::with_capacity(names.len());
    for (place, name) in names.iter().enumerate() {
        let joint = model.joint_index(name).ok_or_else(|| StudyError::Unknown {
            key: "criterion.joints",
            what: "joint",
            name: name.clone(),
            known: robot.parametric.joint_names(),
        })?;
        if names[..place].contains(name) {
            let what = "criterion.joints:".to_owned();
            return Err(StudyError::Twice { what, name: name.clone(), fix: "name it once" });
        }
        let gravity = gravity_across(model, joint, offsets).map_err(StudyError::at("criterion.joints"))?;
        let missing = |limit| StudyError::NoStrokeLimit { joint: name.clone(), limit };
        let limit = limits.of(name).ok_or_else(|| missing("speed or acceleration"))?;
        let h = offsets[joint];
        let reach = match limit.position {
            Some([lower, upper]) if lower <= h && h < upper => upper - h,
            Some(limits_rad) => {
                return Err(StudyError::StrokeStart { joint: name.clone(), offset_rad: h, limits_rad });
            }
            None => UNLIMITED_RAD,
        };
        let constants = StrokeConstants {
            gravity,
            rate_hz: section.search.rate_hz,
            period_times_steepness: settings.period_times_omega,
            position_limit_rad: reach,
            speed_limit: limit.speed.ok_or_else(|| missing("speed"))?,
            acceleration_limit: limit.acceleration.ok_or_else(|| missing("acceleration"))?,
            rest_limit: windowed.rest_limit,
            penalty: windowed.penalty,
            amplitude_range: windowed.amplitude_range,
            steepness_range: windowed.steepness_range,
            window_range: windowed.window_range,
        };
        joints.push(StepWiseJoint { joint, constants });
    }
    if joints.is_empty() {
        return Err(StudyError::conflict(
            "criterion.joints",
            "list the joints that move, or remove the key for all joints",
        ));
    }
    Ok(StepWiseProblem { joints })
}

fn given(strokes: &[GivenStroke], names: &[String]) -> Result<Vec<f64>, StudyError> {
    if let Some(stroke) = strokes.iter().find(|stroke| !names.contains(&stroke.joint)) {
        let (what, name, known) = ("joint that moves", stroke.joint.clone(), names.to_vec());
        return Err(StudyError::Unknown { key: "parameters", what, name, known });
    }
    let mut x = Vec::with_capacity(3 * names.len());
    for name in names {
        let mut own = strokes.iter().filter(|stroke| stroke.joint == *name);
        let (Some(stroke), None) = (own.next(), own.next()) else {
            return Err(StudyError::missing("parameters", format!("give one stroke for joint `{name}`")));
        };
        for (key, value) in [
            ("amplitude_rad", stroke.amplitude_rad),
            ("steepness_per_s", stroke.steepness_per_s),
            ("window_s", stroke.window_s),
        ] {
            Expected::Range(1e-3, 1e3).check(format!("parameters of joint `{name}`: {key}"), value)?;
            x.push(value);
        }
    }
    Ok(x)
}
