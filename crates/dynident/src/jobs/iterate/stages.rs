//! Runs the stages of an iteration in sequence, with fixed parameters from earlier stages.

use super::files::ResultFiles;
use super::inputs::Inputs;
use super::job::Job;
use super::legs;
use super::model::{EndedStage, RobotFiles};
use super::plan::Plan;
use super::report::{Stage, merged};
use super::watch::{IterationWatch, StageSupervisor};
use crate::error::{Error, StudyError};
use crate::pages::run_trace::{RunName, RunTrace};
use crate::result::IterationsFile;
use dynident_iteration::{
    Iteration, IterationError, IterationOutcome, IterationStatus, IterationStore, Robot, RobotRun, RunEstimate,
    RunRecord, iterate_supervised,
};
use dynident_system::PermittedProgram;

/// Creates a robot with these joints.
pub type RobotMaker<'a> = &'a mut dyn FnMut(&[String]) -> Box<dyn Robot>;

pub(super) struct Stages<'a> {
    pub(super) job: Job<'a>,
    pub(super) inputs: &'a Inputs,
    pub(super) plan: &'a Plan<'a>,
    pub(super) files: &'a ResultFiles<'a>,
    pub(super) members: &'a [Vec<usize>],
    pub(super) stores: &'a [IterationStore],
    pub(super) program: Option<&'a PermittedProgram>,
}

pub(super) struct StageResults<'a> {
    pub(super) files: Vec<IterationsFile>,
    pub(super) traces: Vec<RunTrace>,
    /// Number of new runs, without runs of earlier calls.
    pub(super) runs_made: usize,
    pub(super) ended: Vec<EndedStage<'a>>,
    /// Error bar of each base parameter that a stage has determined.
    known_std: Vec<Option<f64>>,
    /// Base parameters that are fixed in later stages: column and value.
    known: Vec<(usize, f64)>,
}

#[derive(Clone, Copy)]
struct CurrentStage<'a> {
    iteration: &'a Iteration,
    /// Number of the trajectory from 1, if each trajectory has a separate iteration.
    leg: Option<usize>,
    legs: usize,
    store: &'a IterationStore,
}

impl<'a> Stages<'a> {
    /// Runs the stages until one ends the iteration; each uses the parameters of earlier stages.
    pub(super) fn run(
        &self,
        watch: &mut IterationWatch<'_>,
        mut own_robot: Option<RobotMaker<'_>>,
    ) -> Result<StageResults<'a>, Error> {
        let in_section = |why: StudyError| self.job.section_error(why);
        let mut results = StageResults::empty(self.inputs.robot.layout().columns().len());
        for (number, members) in self.members.iter().enumerate() {
            let iteration = self.plan.iteration(members, &results.known).map_err(in_section)?;
            let mut robots = self.robots(number, members, &mut own_robot).map_err(in_section)?;
            let store = &self.stores[number];
            let leg = (self.members.len() > 1).then_some(number + 1);
            let stage = CurrentStage { iteration: &iteration, leg, legs: members.len(), store };
            let earlier = store.records().map_err(|error| self.job.iteration_error(error))?;
            let runs_before = earlier.len();
            let outcome = self.run_stage(&stage, &mut robots, watch, earlier, &results)?;
            results.runs_made += outcome.runs.len() - runs_before;
            self.report(&stage, &outcome, &mut results).map_err(|error| self.job.iteration_error(error))?;
            results.ended.push(EndedStage { records: outcome.runs.clone(), iteration, store });
            let last = outcome.runs.iter().rev().find(|record| record.accepted).and_then(RunRecord::knowledge);
            match last {
                Some(last) if !ends_iteration(&outcome.status) => results.fix_parameters(last),
                _ => break,
            }
        }
        Ok(results)
    }

    fn robots(
        &self,
        stage: usize,
        members: &[usize],
        own_robot: &mut Option<RobotMaker<'_>>,
    ) -> Result<Vec<Box<dyn Robot>>, StudyError> {
        let Inputs { section, simulation, robot, .. } = self.inputs;
        let coupling = &self.job.study.coupling;
        let mut robots = legs::robots(section, simulation, coupling, robot, stage, members, self.program)?;
        robots.extend(own_robot.iter_mut().map(|make| make(&robot.parametric.joint_names())));
        Ok(robots)
    }

    /// Makes the runs of a stage and writes `iterations.json` after each.
    fn run_stage(
        &self,
        stage: &CurrentStage<'_>,
        robots: &mut [Box<dyn Robot>],
        watch: &mut IterationWatch<'_>,
        mut records: Vec<RunRecord>,
        results: &StageResults<'_>,
    ) -> Result<IterationOutcome, Error> {
        let mut robots: Vec<&mut dyn Robot> = robots.iter_mut().map(|robot| &mut **robot as &mut dyn Robot).collect();
        let mut unwritten = None;
        let run = &mut *watch.run;
        let mut made = |record: &RunRecord, runs: &[RobotRun]| {
            records.push(record.clone());
            unwritten = self.write_progress(stage, &records, results).err();
            run(record, runs);
        };
        let mut watched =
            StageSupervisor { stop: &watch.stop, allow: &mut watch.allow, made: &mut made, observer: watch.observer };
        let outcome = iterate_supervised(stage.iteration, &mut robots, Some(stage.store), &mut watched);
        let outcome = outcome.map_err(|error| self.job.iteration_error(error))?;
        unwritten.map_or(Ok(outcome), Err)
    }

    fn write_progress(
        &self,
        stage: &CurrentStage<'_>,
        records: &[RunRecord],
        results: &StageResults<'_>,
    ) -> Result<(), Error> {
        let robot = stage.iteration.robot(records).map_err(|error| self.job.iteration_error(error))?;
        let status = IterationStatus::Waiting { reason: "for the next run".to_owned() };
        let now = self.plan.report.file(&Stage {
            leg: stage.leg,
            robot: &robot,
            records,
            status: &status,
            shortfalls: &[],
            declined: None,
            known_std: &results.known_std,
        });
        let all: Vec<IterationsFile> = results.files.iter().cloned().chain([now]).collect();
        merged(all).map_or(Ok(()), |file| self.files.write(&file, None, RobotFiles::none()))
    }

    fn report(
        &self,
        stage: &CurrentStage<'_>,
        outcome: &IterationOutcome,
        results: &mut StageResults<'_>,
    ) -> Result<(), IterationError> {
        let robot = stage.iteration.robot(&outcome.runs)?;
        results.files.push(self.plan.report.file(&Stage {
            leg: stage.leg,
            robot: &robot,
            records: &outcome.runs,
            status: &outcome.status,
            shortfalls: &outcome.shortfalls,
            declined: outcome.declined.as_ref(),
            known_std: &results.known_std,
        }));
        let joints = self.inputs.robot.parametric.joint_names();
        for record in &outcome.runs {
            for (place, own) in stage.iteration.legs_of(record)?.iter().enumerate() {
                let leg = stage.leg.or((stage.legs > 1).then_some(place + 1));
                let name = RunName { run: record.run, leg, place };
                results.traces.push(RunTrace::new(name, stage.store, own.reference(), &joints));
            }
        }
        Ok(())
    }
}

impl StageResults<'_> {
    fn empty(columns: usize) -> Self {
        Self {
            files: Vec::new(),
            traces: Vec::new(),
            runs_made: 0,
            ended: Vec::new(),
            known_std: vec![None; columns],
            known: Vec::new(),
        }
    }

    /// Fixes the parameters that this estimate is the first to determine.
    fn fix_parameters(&mut self, estimate: &RunEstimate) {
        let determined = self.known_std.len().min(estimate.values.len());
        for column in (0..determined).filter(|column| !estimate.fixed.contains(column)) {
            if self.known_std[column].is_none() {
                self.known_std[column] = Some(estimate.std[column]);
                self.known.push((column, estimate.values[column]));
            }
        }
    }
}

fn ends_iteration(status: &IterationStatus) -> bool {
    match status {
        IterationStatus::Refused { .. } | IterationStatus::Waiting { .. } | IterationStatus::Interrupted { .. } => true,
        IterationStatus::Converged | IterationStatus::Settled | IterationStatus::RunsUsedUp => false,
    }
}
