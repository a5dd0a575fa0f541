//! One simulated experiment, the answer of an estimator, and data that several estimators of a trial share: computed
//! on first use, and excluded from the estimator's time.

use super::pipeline;
use super::rows::Rows;
use super::scenario::{Record, Scenario};
use super::thread_time::thread_seconds;
use core::cell::{Cell, OnceCell};
use dynident_estimation::EstimationError;
use dynident_recording::MotionBlock;

/// Input of an estimator: one simulated experiment.
#[derive(Debug)]
pub struct Trial<'a> {
    /// The robot and its excitation. Estimators may use the model's structure and the reference motion, but not the
    /// true parameters.
    pub scenario: &'a Scenario,
    /// Signals of encoders and torque sensors.
    pub record: &'a Record,
    /// Motion of the recording by the default differentiator with the automatic cut-off.
    pub motion: &'a MotionBlock,
    /// Automatic cut-off, Hz.
    pub cutoff_hz: f64,
    /// Rows of the regression, filtered as in `identify`.
    pub rows: &'a Rows<'a>,
    /// Start of an iterative estimator: the true base parameters with 15 % Gaussian error.
    pub start: &'a [f64],
    /// Nominal model: every body's ten true parameters times a common factor with 15 % Gaussian error, without
    /// friction and drives.
    pub prior: &'a [f64],
    pub(super) shared: &'a TrialData<'a>,
}

/// The result of an estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Values of the base parameters.
    pub values: Vec<f64>,
    /// Half-width of each value's 95 % interval; `None` if the estimator gives no error bars.
    pub half_width_95: Option<Vec<f64>>,
    /// False if the iterations did not converge, which is a failure.
    pub converged: bool,
}

#[derive(Debug, Default)]
pub(super) struct TrialData<'a> {
    periodic: OnceCell<Option<Periodic<'a>>>,
    spent_s: Cell<f64>,
}

/// The motion as a Fourier series at the excitation's frequencies, and all rows with it.
#[derive(Debug)]
struct Periodic<'a> {
    motion: MotionBlock,
    rows: Rows<'a>,
}

impl<'a> TrialData<'a> {
    /// Total processor time for shared data, s.
    pub(super) fn spent_s(&self) -> f64 {
        self.spent_s.get()
    }

    /// All rows with the Fourier series' motion, neither filtered nor decimated.
    pub(super) fn periodic(&self, trial: &Trial<'a>) -> Result<&Rows<'a>, EstimationError> {
        self.made(trial).map(|periodic| &periodic.rows)
    }

    pub(super) fn periodic_filtered(&self, trial: &Trial<'a>) -> Result<Rows<'a>, EstimationError> {
        let motion = &self.made(trial)?.motion;
        let started_s = thread_seconds();
        let rows = Rows::new(trial.scenario, motion, Some(trial.cutoff_hz));
        self.spent_s.set(self.spent_s.get() + thread_seconds() - started_s);
        rows.map_err(|_| EstimationError::Empty)
    }

    fn made(&self, trial: &Trial<'a>) -> Result<&Periodic<'a>, EstimationError> {
        let made = || {
            let started_s = thread_seconds();
            let motion = pipeline::periodic(trial.record).ok();
            let rows = motion.and_then(|motion| {
                let rows = Rows::new(trial.scenario, &motion, None).ok()?;
                Some(Periodic { motion, rows })
            });
            self.spent_s.set(self.spent_s.get() + thread_seconds() - started_s);
            rows
        };
        // A failing pipeline is a failure of the estimator; its reason is not needed.
        self.periodic.get_or_init(made).as_ref().ok_or(EstimationError::Empty)
    }
}
