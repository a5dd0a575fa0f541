//! What several estimators of one trial need: made when the first one asks, and not counted as its time.

use super::estimators::Trial;
use super::pipeline;
use super::rows::Rows;
use super::thread_time::thread_seconds;
use core::cell::{Cell, OnceCell};
use dynident_estimation::EstimationError;
use dynident_recording::MotionBlock;

/// One trial's shared work.
#[derive(Debug, Default)]
pub(super) struct TrialData<'a> {
    periodic: OnceCell<Option<Periodic<'a>>>,
    spent_s: Cell<f64>,
}

/// The motion as a Fourier series at the excitation's own frequencies, and all rows with it.
#[derive(Debug)]
struct Periodic<'a> {
    motion: MotionBlock,
    rows: Rows<'a>,
}

impl<'a> TrialData<'a> {
    /// Seconds spent here so far.
    pub(super) fn spent_s(&self) -> f64 {
        self.spent_s.get()
    }

    /// All rows with the Fourier series' motion, neither filtered nor decimated.
    pub(super) fn periodic(&self, trial: &Trial<'a>) -> Result<&Rows<'a>, EstimationError> {
        self.made(trial).map(|periodic| &periodic.rows)
    }

    /// Filtered rows with the Fourier series' motion.
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
        // A pipeline that fails is a failure of the estimator; the figure does not need the reason.
        self.periodic.get_or_init(made).as_ref().ok_or(EstimationError::Empty)
    }
}
