//! What several estimators of one trial need: made when the first one asks, and not counted as its time.

use super::BenchmarkError;
use super::estimators::Trial;
use super::pipeline;
use super::rows::Rows;
use crate::cpu_time::thread_seconds;
use core::cell::{Cell, OnceCell};
use dynident_estimation::{EstimationError, LinearProblem};
use dynident_recording::MotionBlock;

/// The motion as a Fourier series at the excitation's own frequencies, and all rows with it.
#[derive(Debug)]
pub(super) struct Periodic<'a> {
    pub(super) motion: MotionBlock,
    pub(super) rows: Rows<'a>,
    pub(super) problem: LinearProblem,
}

/// One trial's shared work.
#[derive(Debug, Default)]
pub(super) struct Shared<'a> {
    periodic: OnceCell<Option<Periodic<'a>>>,
    spent_s: Cell<f64>,
}

impl<'a> Shared<'a> {
    /// Seconds spent here so far.
    pub(super) fn spent_s(&self) -> f64 {
        self.spent_s.get()
    }

    /// The Fourier series' motion with all rows.
    pub(super) fn periodic(&self, trial: &Trial<'a>) -> Result<&Periodic<'a>, EstimationError> {
        let made = || {
            let started_s = thread_seconds();
            let found = periodic(trial).ok();
            self.spent_s.set(self.spent_s.get() + thread_seconds() - started_s);
            found
        };
        // A pipeline that fails is a failure of the estimator; the figure does not need the reason.
        self.periodic.get_or_init(made).as_ref().ok_or(EstimationError::Empty)
    }

    /// The Fourier series' motion with filtered rows.
    pub(super) fn periodic_filtered(&self, trial: &Trial<'a>) -> Result<LinearProblem, EstimationError> {
        let motion = &self.periodic(trial)?.motion;
        let started_s = thread_seconds();
        let rows = Rows::new(trial.scenario, motion, Some(trial.cutoff_hz)).map_err(|_| EstimationError::Empty)?;
        let problem = rows.problem();
        self.spent_s.set(self.spent_s.get() + thread_seconds() - started_s);
        problem
    }
}

fn periodic<'a>(trial: &Trial<'a>) -> Result<Periodic<'a>, BenchmarkError> {
    let failed = |source| BenchmarkError::Filter { robot: trial.scenario.robot.to_owned(), source };
    let motion = pipeline::periodic(trial.record).map_err(failed)?;
    let rows = Rows::new(trial.scenario, &motion, None)?;
    let estimation = |source| BenchmarkError::Estimation { robot: trial.scenario.robot.to_owned(), source };
    let problem = rows.problem().map_err(estimation)?;
    Ok(Periodic { motion, rows, problem })
}
