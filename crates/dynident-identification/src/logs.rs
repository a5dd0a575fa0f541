//! The recordings of a task with the filters in force: what every pass over them needs.

use crate::execution::Execution;
use crate::recording::{LogError, Recording, Role};
use crate::regressor_model::RegressorModel;
use crate::rows::{KeptLog, LogPass, ParallelFilterSettings};
use dynident_model::Model;
use dynident_recording::MotionSettings;
use std::sync::OnceLock;

/// The recordings of a task and the filters in force. A log that fits into memory is read and
/// differentiated once, however many passes there are.
#[derive(Debug)]
pub struct Logs<'a> {
    /// All recordings, whatever their role.
    pub recordings: &'a [Recording],
    /// The motion settings with one cut-off for all logs.
    pub motion: MotionSettings,
    /// The low-pass and decimation that torque and regressor go through alike.
    pub filter: &'a ParallelFilterSettings,
    /// How the job runs.
    pub execution: Execution<'a>,
    kept: Vec<OnceLock<KeptLog>>,
}

impl<'a> Logs<'a> {
    /// Decides on one cut-off for all logs: that of `settings`; or the one that a finished model was made with; or the
    /// highest that any of the logs `deciding` asks for. A model and its test must not differ in their filters.
    ///
    /// # Errors
    /// Logs that cannot be read.
    pub fn new(
        model: &Model,
        recordings: &'a [Recording],
        (settings, filter): (&MotionSettings, &'a ParallelFilterSettings),
        deciding: &[usize],
        cutoff_of_model_hz: Option<f64>,
        execution: Execution<'a>,
    ) -> Result<Self, LogError> {
        let mut motion = settings.clone();
        if let Some(cutoff_hz) = cutoff_of_model_hz {
            motion.differentiator = motion.differentiator.with_cutoff(cutoff_hz);
        }
        if motion.differentiator.wants_cutoff() {
            let mut highest = 0.0_f64;
            for &index in deciding {
                if let Some(stream) = recordings[index].open(model, settings)? {
                    highest = highest.max(stream.cutoff().cutoff_hz);
                }
            }
            if highest > 0.0 {
                motion.differentiator = motion.differentiator.with_cutoff(highest);
            }
        }
        let kept = recordings.iter().map(|_| OnceLock::new()).collect();
        Ok(Self { recordings, motion, filter, execution, kept })
    }

    /// Places of the recordings with this role.
    pub fn of_role(&self, role: Role) -> Vec<usize> {
        of_role(self.recordings, role)
    }

    /// A pass over recording number `index`.
    pub fn pass<'p>(&'p self, model: &'p RegressorModel, index: usize) -> LogPass<'p> {
        LogPass {
            recording: &self.recordings[index],
            model,
            motion: &self.motion,
            filter: self.filter,
            reader_thread: false,
            most_samples: None,
            progress: self.execution.progress,
            kept: Some(&self.kept[index]),
        }
    }

    /// Begins a stage over some recordings.
    pub(crate) fn begin(&self, stage: &str, indices: &[usize]) {
        let rows = indices.iter().map(|&index| self.recordings[index].estimated_rows()).sum();
        self.execution.progress.begin(stage, rows);
    }

    /// Ends a stage.
    pub(crate) fn end(&self) {
        self.execution.progress.end();
    }
}

/// Places of the recordings with this role.
pub(crate) fn of_role(recordings: &[Recording], role: Role) -> Vec<usize> {
    (0..recordings.len()).filter(|&index| recordings[index].role == role).collect()
}
