//! Run, identify, load the better model, run again: a study's whole iteration.

mod bound;
mod file;
mod report;
mod section;
mod trajectory;

pub use file::{ITERATIONS_SCHEMA, IterationParameter, IterationRun, IterationsFile};
pub use section::{IterationSection, PriorChoice, RobotChoice};
pub(crate) use trajectory::Trajectory;

use crate::error::Error;
use crate::job::{RunOptions, joint_names, study_name};
use crate::machine::{Machine, prior_parameters};
use crate::output::write_whole;
use crate::simulate::section::SimulatedTruth;
use crate::study::{Folders, Study};
use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_experiment::iteration::{
    IteratedMachine, Iteration, IterationError, IterationStatus, IterationStore, IterationTask, RunEstimate, RunRecord,
    iterate,
};
use dynident_experiment::robot::{FolderRobot, ProcessRobot};
use dynident_experiment::{ExperimentError, Robot, RobotRun};
use report::{RunTrace, TimeSpent};
use std::path::Path;
use std::time::Instant;

/// What hears of an iteration's progress.
pub struct IterationWatch<'a> {
    /// The search for the trajectory, if there is one.
    pub design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    /// Every new run.
    pub run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
}

/// Iterates a study's robot. What is found stands in `out`: `trajectory.json` (the trajectory at the controller's rate), `runs/run_k/` (each run whole or not at all), `iterations.json` after every
/// run and `report.html` in the end. With `resume`, runs that are there already are not made again: who is killed at any moment goes on to the same result.
///
/// # Errors
/// Files, study, settings, and files of another study's iteration in `out`. How the robot and the iteration did is in the file.
pub fn iterate_study(
    study: &Study,
    study_path: &Path,
    out: &Path,
    resume: bool,
    options: &RunOptions<'_>,
    watch: &mut IterationWatch<'_>,
) -> Result<IterationsFile, Error> {
    let wrong = |part: &str, why: &dyn core::fmt::Display| Error::study(study_path, format!("[{part}]: {why}"));
    let in_iteration = |error: IterationError| match error {
        IterationError::File { path, source } => Error::Output { path, source },
        IterationError::State { path, problem } => Error::Result { path, message: problem },
        other => wrong("iteration", &other),
    };
    let begin = Instant::now();
    let section = study.iteration.clone().unwrap_or_default();
    let simulation = study.simulation.clone().unwrap_or_default();
    let settings = section.settings(study).map_err(|why| Error::study(study_path, why))?;
    let folders = Folders::new(study, study_path, options.data.as_deref());
    let machine = Machine::new(study, study_path, &folders)?;
    let mut truth = match section.robot {
        RobotChoice::Simulation => Some(simulation.truth(&machine).map_err(|why| wrong("simulation", &why))?),
        _ => None,
    };
    let fingerprint = fingerprint(study, &machine, options);
    let store = IterationStore::open(out, &fingerprint, resume).map_err(in_iteration)?;
    let make = || Trajectory::of_study(study, study_path, &machine, simulation.rate_hz, options, watch.design);
    let trajectory = kept(&out.join("trajectory.json"), &fingerprint, resume, make)?;
    let prior = match section.prior {
        PriorChoice::Description => prior_parameters(&machine.model, &machine.laws),
        PriorChoice::None => vec![0.0; 10 * machine.model.dof() + machine.laws.len()],
    };
    let iterated = IteratedMachine::new(&machine.model, &machine.laws, Some(prior));
    let iterated = iterated.map_err(|why| wrong("iteration", &why))?;
    let leg = trajectory.leg(section.every_sample).map_err(|why| wrong("iteration", &why))?;
    let efforts = machine.model.joints().iter().map(|joint| joint.limits.effort.unwrap_or(f64::INFINITY)).collect();
    let torque_limits = simulation.effort_limits.then_some(efforts);
    let task = IterationTask { machine: iterated, legs: vec![leg], known: Vec::new(), torque_limits };
    let iteration = Iteration::new(task, settings).map_err(|why| wrong("iteration", &why))?;

    let mut outside = outside(&section.robot, &machine).map_err(|why| wrong("iteration.robot", &why))?;
    let true_values = truth.as_ref().map(|truth| truth.base_values.clone());
    let told = Told { study, study_path, machine: &machine, trajectory: &trajectory, truth: true_values };
    let windows = iteration.task().legs[0].windows();
    let bound = truth.as_ref().and_then(|_| bound::cramer_rao(&machine, &trajectory, &simulation.sensors, windows));
    let robot: &mut dyn Robot = match (&mut truth, &mut outside) {
        (Some(SimulatedTruth { robot, .. }), _) => robot,
        (None, Some(robot)) => robot.as_mut(),
        (None, None) => return Err(wrong("iteration.robot", &"there is no robot")),
    };
    let target = out.join("iterations.json");
    let mut so_far = store.records().map_err(in_iteration)?;
    let (designed_s, runs_before) = (begin.elapsed().as_secs_f64(), so_far.len());
    let mut unwritten = None;
    let run = &mut *watch.run;
    let outcome = iterate(&iteration, &mut [robot], Some(&store), &mut |record, runs| {
        so_far.push(record.clone());
        let going_on = IterationStatus::Waiting { reason: "for the next run".to_owned() };
        unwritten = write_file(&target, &told.file(&so_far, &going_on, bound.as_deref())).err();
        run(record, runs);
    });
    let outcome = outcome.map_err(in_iteration)?;
    if let Some(error) = unwritten {
        return Err(error);
    }
    let file = told.file(&outcome.runs, &outcome.status, bound.as_deref());
    write_file(&target, &file)?;
    let leg = &iteration.task().legs[0];
    let traces: Vec<RunTrace> =
        outcome.runs.iter().map(|record| RunTrace::new(record.run, &store, leg.reference(), &file.joints)).collect();
    let all_s = begin.elapsed().as_secs_f64();
    let time = TimeSpent { before_runs_s: designed_s, all_s, runs: outcome.runs.len() - runs_before };
    write_whole(&out.join("report.html"), report::iteration_report(&file, &traces, &time)?.as_bytes())?;
    Ok(file)
}

/// The robot outside that a study names.
fn outside(choice: &RobotChoice, machine: &Machine) -> Result<Option<Box<dyn Robot>>, ExperimentError> {
    let joints = joint_names(machine);
    Ok(match choice {
        RobotChoice::Simulation => None,
        RobotChoice::Process(settings) => Some(Box::new(ProcessRobot::new(settings.clone(), joints)?)),
        RobotChoice::Folder(settings) => Some(Box::new(FolderRobot::new(settings.clone(), joints)?)),
    })
}

fn write_file(path: &Path, file: &IterationsFile) -> Result<(), Error> {
    let bytes = serde_json::to_vec_pretty(file)
        .map_err(|error| Error::Result { path: path.to_owned(), message: error.to_string() })?;
    write_whole(path, &bytes)
}

/// Everything that runs depend on, in one number: study, robot, and the version of the program (FNV-1a, 64 bits).
fn fingerprint(study: &Study, machine: &Machine, options: &RunOptions<'_>) -> String {
    let text = format!("{study:?} {:?} {:?} {}", machine.model, options.data, env!("CARGO_PKG_VERSION"));
    let hash = text
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("{hash:016x}")
}

/// The trajectory of an earlier call, or a new one, which is kept before anything is run.
fn kept(
    path: &Path,
    fingerprint: &str,
    resume: bool,
    make: impl FnOnce() -> Result<Trajectory, Error>,
) -> Result<Trajectory, Error> {
    #[derive(serde::Serialize, serde::Deserialize)]
    struct Kept {
        fingerprint: String,
        trajectory: Trajectory,
    }
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    if resume && path.is_file() {
        let text = std::fs::read(path).map_err(|source| Error::File { path: path.to_owned(), source })?;
        let kept: Kept = serde_json::from_slice(&text)
            .map_err(|error| wrong(format!("is no trajectory of an iteration ({error}): remove it")))?;
        if kept.fingerprint == fingerprint {
            return Ok(kept.trajectory);
        }
        return Err(wrong(
            "belongs to an iteration with other settings: take --fresh, or give another --out".to_owned(),
        ));
    }
    let trajectory = make()?;
    let kept = Kept { fingerprint: fingerprint.to_owned(), trajectory };
    let bytes = serde_json::to_vec(&kept).map_err(|error| wrong(error.to_string()))?;
    write_whole(path, &bytes)?;
    Ok(kept.trajectory)
}

/// The newest run before `record` whose machine its controller had.
fn model_of_run(record: &RunRecord, records: &[RunRecord]) -> Option<usize> {
    let model = record.controller.model.as_ref()?;
    let told = |before: &&RunRecord| {
        before.run < record.run
            && before.estimate.as_ref().and_then(RunEstimate::for_controller).as_ref() == Some(model)
    };
    records.iter().rfind(told).map(|before| before.run)
}

/// What the file is made from.
struct Told<'a> {
    study: &'a Study,
    study_path: &'a Path,
    machine: &'a Machine,
    trajectory: &'a Trajectory,
    truth: Option<Vec<f64>>,
}

impl Told<'_> {
    fn file(&self, records: &[RunRecord], status: &IterationStatus, bound: Option<&[f64]>) -> IterationsFile {
        let columns = self.machine.layout.columns();
        let expressions = self.machine.base.expressions();
        let parameters = |record: &RunRecord| {
            let Some(estimate) = &record.estimate else { return Vec::new() };
            let one = |k: usize| IterationParameter {
                symbol: columns[k].symbol(),
                expression: expressions[k].clone(),
                unit: columns[k].unit(),
                value: estimate.values[k],
                std: (!estimate.fixed.contains(&k)).then_some(estimate.std[k]),
                error: self.truth.as_ref().map(|truth| estimate.values[k] - truth[k]),
            };
            (0..columns.len()).map(one).collect()
        };
        let runs: Vec<IterationRun> = records
            .iter()
            .map(|record| IterationRun {
                run: record.run,
                controller: record.controller.name.clone(),
                model_based: record.controller.model.is_some(),
                model_of_run: model_of_run(record, records),
                damping: record.controller.damping,
                stiffness: record.controller.stiffness,
                accepted: record.accepted,
                outcome: record.outcome.clone(),
                reason: record.reason.clone(),
                max_tracking_error_rad: record.max_tracking_error_rad.clone(),
                parameters: parameters(record),
            })
            .collect();
        let good: Vec<&RunRecord> = records.iter().filter(|record| record.accepted).collect();
        let tracking_improvement = match good[..] {
            [first, .., last] if last.tracking_error() > 0.0 => Some(first.tracking_error() / last.tracking_error()),
            _ => None,
        };
        let last = good.last().and_then(|record| record.estimate.as_ref());
        let error_over_bound = last.zip(self.truth.as_ref()).zip(bound).and_then(|((estimate, truth), bound)| {
            let ratios: Vec<f64> = (0..bound.len())
                .filter(|&k| bound[k] > 0.0 && !estimate.fixed.contains(&k))
                .map(|k| ((estimate.values[k] - truth[k]) / bound[k]).powi(2))
                .collect();
            (!ratios.is_empty()).then(|| (ratios.iter().sum::<f64>() / ratios.len() as f64).sqrt())
        });
        IterationsFile {
            schema: ITERATIONS_SCHEMA,
            name: study_name(self.study, self.study_path),
            converged: status.is_converged(),
            status: match status {
                IterationStatus::Converged => "converged",
                IterationStatus::RunsUsedUp => "runs-used-up",
                IterationStatus::Refused { .. } => "refused",
                IterationStatus::Waiting { .. } => "waiting",
            },
            reason: status.to_string(),
            joints: joint_names(self.machine),
            duration_s: (self.trajectory.samples.max(1) - 1) as f64 / self.trajectory.rate_hz,
            runs,
            tracking_improvement,
            error_over_bound,
            bound: bound.map(<[f64]>::to_vec),
            possible_parameters: last.and_then(|estimate| estimate.possible.clone()),
        }
    }
}
