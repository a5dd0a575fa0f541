//! Recordings of a task with the filters in use: the input of every pass.

use crate::execution::Execution;
use crate::recording::{LogError, Recording, Role};
use crate::regressor_model::RegressorModel;
use crate::rows::{KeptLog, LogPass, ParallelFilterSettings, motion_band_hz};
use dynident_model::Model;
use dynident_recording::filter::CutoffChoice;
use dynident_recording::{FilterError, MotionSettings};
use std::sync::{Arc, OnceLock};

/// Maximum lag that a study can state, s, for an arm of usual size. It permits two recorders that were started by hand,
/// but rejects milliseconds that were written as seconds.
const MAX_STATED_LAG_S: f64 = 2.5;

/// Number of rows above which the row count of a log is estimated instead of counted.
const MAX_COUNTED_ROWS: u64 = 200_000;
/// Maximum number of rows of one joint, over all recordings, in passes with torque above the frequency band of the
/// motion.
const MAX_ROWS_ABOVE_MOTION_BAND: f64 = 20_000.0;
/// Ratio of torque cut-off to motion cut-off if the rate of the recordings is unknown.
const DEFAULT_TORQUE_BAND_RATIO: f64 = 8.0;

/// Cut-off and noise of one log, from the spectra of its positions.
#[derive(Clone, Debug)]
pub struct LogSpectrum {
    /// Index of the recording.
    pub index: usize,
    /// Sample rate, hertz.
    pub rate_hz: f64,
    /// Suggested cut-off.
    pub choice: CutoffChoice,
    /// Standard deviation of the noise of one sample, joints in the order of the log.
    pub position_noise: Vec<f64>,
}

/// Settings that define the rows.
#[derive(Clone, Copy, Debug)]
pub struct RowSettings<'a> {
    /// Differentiation of positions.
    pub motion: &'a MotionSettings,
    /// Filter of torque and regressor.
    pub parallel_filter: &'a ParallelFilterSettings,
}

/// Recordings of a task with the filters that are applied to them. Each log that fits into memory is read and
/// differentiated only once.
#[derive(Clone, Debug)]
pub struct Logs<'a> {
    /// All recordings of any role.
    pub recordings: &'a [Recording],
    /// Motion settings with one cut-off for all logs.
    pub motion: MotionSettings,
    /// Low-pass and decimation of torque and regressor.
    pub filter: ParallelFilterSettings,
    /// Threads and progress of the job.
    pub execution: Execution<'a>,
    /// Stored motion of each recording; empty if passes store nothing.
    kept: Arc<Vec<OnceLock<KeptLog>>>,
    /// All recordings, with excerpts in place of long ones; empty without excerpts.
    excerpts: Arc<Vec<Recording>>,
    /// Spectra of the logs that decide on an automatic cut-off.
    spectra: Vec<LogSpectrum>,
    /// Cut-off from the spectrum of the motion, hertz, if the fit uses another one.
    motion_hz: Option<f64>,
    /// Cut-off from which the parallel filter is derived, hertz; `None` for the cut-off of the motion.
    torque_hz: Option<f64>,
}

impl<'a> Logs<'a> {
    /// Selects one cut-off for all logs: the cut-off in the settings, that of a finished model, or the highest that the
    /// spectra of the logs `deciding` suggest. A model and its test must use the same filters.
    ///
    /// # Errors
    /// A log cannot be read, or a stated lag is too long for a robot of this size.
    pub fn new(
        model: &Model,
        recordings: &'a [Recording],
        settings: RowSettings<'_>,
        deciding: &[usize],
        cutoff_of_model_hz: Option<f64>,
        execution: Execution<'a>,
    ) -> Result<Self, LogError> {
        let RowSettings { motion: settings, parallel_filter } = settings;
        let longest_s = model.characteristic_scale().seconds(MAX_STATED_LAG_S);
        let stated = settings.torque_lag_s.as_ref();
        let mut stated = (0..model.dof()).filter_map(|joint| stated.and_then(|lags| lags.at(joint)));
        if let Some(value) = stated.find(|lag_s| lag_s.abs() > longest_s) {
            let fix = "give seconds; the maximum is 2.5 s for an arm of 1.2 m and scales with the robot's characteristic time";
            let source = FilterError::Setting { name: "torque_lag_s", value, fix };
            let log = recordings.first().map_or("", |recording| &recording.name);
            return Err(LogError::recording(log, source.into()));
        }
        let mut motion = settings.clone();
        if let Some(cutoff_hz) = cutoff_of_model_hz {
            motion.differentiator = motion.differentiator.with_cutoff(cutoff_hz);
        }
        let mut spectra = Vec::new();
        if motion.differentiator.wants_cutoff() {
            for &index in deciding {
                if let Some(stream) = recordings[index].open(model, settings)? {
                    let rate_hz = stream.rate_hz();
                    let (choice, position_noise) = match &recordings[index].whole {
                        Some(whole) => (whole.cutoff.clone(), whole.position_noise.clone()),
                        None => (stream.cutoff().clone(), stream.position_noise().to_vec()),
                    };
                    spectra.push(LogSpectrum { index, rate_hz, choice, position_noise });
                }
            }
            let highest = spectra.iter().map(|log| log.choice.cutoff_hz).fold(0.0, f64::max);
            if highest > 0.0 {
                motion.differentiator = motion.differentiator.with_cutoff(highest);
            }
        }
        let kept = unread(recordings);
        let excerpts = Arc::default();
        let filter = parallel_filter.clone();
        Ok(Self { recordings, motion, filter, execution, kept, excerpts, spectra, motion_hz: None, torque_hz: None })
    }

    /// Replaces the cut-off if it is automatic. Held-out errors still use the frequency band of the previous cut-off.
    #[must_use]
    pub fn with_cutoff(mut self, settings: &MotionSettings, cutoff_hz: f64) -> Self {
        let motion_hz = self.motion_hz.or_else(|| motion_band_hz(&self.motion));
        if motion_band_hz(&self.motion) == Some(cutoff_hz) {
            return self;
        }
        self.motion_hz = motion_hz.filter(|motion_hz| *motion_hz != cutoff_hz);
        self.motion.differentiator = settings.differentiator.clone().with_cutoff(cutoff_hz);
        self.kept = unread(self.recordings);
        self
    }

    /// Applies a selected cut-off, if there is one.
    #[must_use]
    pub fn with_chosen_cutoff(self, settings: &MotionSettings, cutoff_hz: Option<f64>) -> Self {
        match cutoff_hz {
            Some(cutoff_hz) => self.with_cutoff(settings, cutoff_hz),
            None => self,
        }
    }

    /// Applies the same filters to other recordings, for example recordings with fewer rows.
    #[must_use]
    pub fn with_recordings<'b>(&self, recordings: &'b [Recording]) -> Logs<'b>
    where
        'a: 'b,
    {
        let kept = unread(recordings);
        Logs { recordings, kept, excerpts: Arc::default(), ..self.clone() }
    }

    /// Shares the motions that `other` has stored, if recordings and motion settings are the same.
    #[must_use]
    pub fn with_motion_of(mut self, other: &Self) -> Self {
        if self.motion == other.motion && core::ptr::eq(self.recordings, other.recordings) {
            self.kept = Arc::clone(&other.kept);
        }
        self
    }

    /// Adds [excerpts](crate::excerpts) for [passes that need only some instants](Self::pass_for_instants).
    #[must_use]
    pub fn with_excerpts(mut self, excerpts: Arc<Vec<Recording>>) -> Self {
        self.excerpts = excerpts;
        self
    }

    /// Excerpts of [`with_excerpts`](Self::with_excerpts); empty by default.
    pub fn excerpts(&self) -> Arc<Vec<Recording>> {
        Arc::clone(&self.excerpts)
    }

    /// Makes every pass read the files again. This is slower, but the memory does not grow with the length of a log.
    #[must_use]
    pub fn without_keeping(mut self) -> Self {
        self.kept = Arc::default();
        self
    }

    /// Sets the cut-off of the frequency band of held-out errors, hertz; `None` for the cut-off of the fit.
    #[must_use]
    pub fn with_motion_band(mut self, motion_hz: Option<f64>) -> Self {
        self.motion_hz = motion_hz;
        self
    }

    /// Raises the cut-off of the parallel filter, with as many rows as a pass handles within a second. The filter
    /// normally removes torque above the frequency band of the motion. But friction changes within milliseconds at a
    /// reversal, so most of the information about this change is above that band.
    ///
    /// # Errors
    /// A recording cannot be read.
    pub fn with_torque_beyond_motion(&self, model: &RegressorModel) -> Result<Self, LogError> {
        let Some(motion_hz) = motion_band_hz(&self.motion) else { return Ok(self.clone()) };
        let mut rows = 0.0;
        for log in &self.spectra {
            let share = (ParallelFilterSettings::rows_per_s(motion_hz) / log.rate_hz).min(1.0);
            rows += self.rows_of(model, log.index)? * share;
        }
        let times = if rows > 0.0 { (MAX_ROWS_ABOVE_MOTION_BAND / rows).max(1.0) } else { DEFAULT_TORQUE_BAND_RATIO };
        // Powers of two, because the number of rows of a long text file is only an estimate.
        let times = times.log2().floor().exp2();
        Ok(Self { torque_hz: Some(times * motion_hz), ..self.clone() })
    }

    /// Counts the rows of a recording, and stores its motion for the next pass; estimates the number for a long log.
    fn rows_of(&self, model: &RegressorModel, index: usize) -> Result<f64, LogError> {
        let estimated = self.recordings[index].estimated_rows();
        if let Some(estimated) = estimated.filter(|rows| *rows > MAX_COUNTED_ROWS) {
            return Ok(estimated as f64);
        }
        let mut rows = 0;
        let pass = LogPass { reader_thread: self.execution.parallel(), ..self.pass(model, index) };
        pass.each_block(&mut |block| {
            rows += block.rows;
            Ok(())
        })?;
        Ok(rows as f64)
    }

    /// Cut-off from the spectra of the motion, hertz; `None` if the fit uses this cut-off.
    pub fn motion_hz(&self) -> Option<f64> {
        self.motion_hz
    }

    /// Cut-off from the spectra of the motion, hertz, if the settings leave both this cut-off and the parallel filter
    /// automatic.
    pub fn automatic_cutoff_hz(&self) -> Option<f64> {
        let filter = &self.filter;
        let is_automatic = filter.enabled && filter.factor.is_none() && filter.cutoff_hz.is_none();
        let motion_hz = self.motion_hz().or_else(|| motion_band_hz(&self.motion));
        motion_hz.filter(|_| is_automatic && !self.spectra().is_empty())
    }

    /// Spectra of the logs that decided on the cut-off; empty if the settings state the cut-off.
    pub fn spectra(&self) -> &[LogSpectrum] {
        &self.spectra
    }

    /// Indices of the recordings with this role.
    pub fn of_role(&self, role: Role) -> Vec<usize> {
        of_role(self.recordings, role)
    }

    /// A pass over recording `index`.
    pub fn pass<'p>(&'p self, model: &'p RegressorModel, index: usize) -> LogPass<'p> {
        LogPass {
            recording: &self.recordings[index],
            model,
            motion: &self.motion,
            filter: &self.filter,
            torque_hz: self.torque_hz,
            reader_thread: false,
            most_samples: None,
            progress: self.execution.progress,
            kept: self.kept.get(index),
        }
    }

    /// A pass that needs only some instants of recording `index`. It reads the excerpt, if there is one and the motion
    /// is not in memory, so that a long log is not read again.
    pub fn pass_for_instants<'p>(&'p self, model: &'p RegressorModel, index: usize) -> LogPass<'p> {
        let pass = self.pass(model, index);
        let is_kept = pass.kept.is_some_and(|kept| kept.get().is_some());
        match self.excerpts.get(index) {
            Some(recording) if recording.whole.is_some() && !is_kept => LogPass { recording, kept: None, ..pass },
            _ => pass,
        }
    }

    /// Reports the beginning of a stage that processes these recordings.
    pub fn begin(&self, stage: &str, indices: &[usize]) {
        let rows = indices.iter().map(|&index| self.recordings[index].estimated_rows()).sum();
        self.execution.progress.begin(stage, rows);
    }

    /// Reports the end of the stage.
    pub fn end(&self) {
        self.execution.progress.end();
    }
}

fn unread(recordings: &[Recording]) -> Arc<Vec<OnceLock<KeptLog>>> {
    Arc::new(recordings.iter().map(|_| OnceLock::new()).collect())
}

/// Indices of the recordings with this role.
pub fn of_role(recordings: &[Recording], role: Role) -> Vec<usize> {
    (0..recordings.len()).filter(|&index| recordings[index].role == role).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excerpt::excerpts;
    use dynident_dynamics::ParametricModel;
    use dynident_recording::JointSamples;

    #[test]
    fn instants_of_a_long_log_come_from_its_excerpt() {
        let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/planar2r.urdf");
        let model = RegressorModel::from(
            ParametricModel::new(dynident_model::load_robot(robot).unwrap().model, Vec::new()).unwrap(),
        );
        let rows = 450_000;
        let columns = |scale: f64| -> Vec<Vec<f64>> {
            let wave = |joint: usize, row: usize| scale * (0.9e-3 * row as f64 + joint as f64).sin();
            (0..model.dof()).map(|joint| (0..rows).map(|row| wave(joint, row)).collect()).collect()
        };
        let samples = JointSamples::at_rate(1000.0, columns(1.0), columns(10.0));
        let recordings = vec![Recording::training("log", samples.into_log("log", &model.joint_names()).unwrap())];
        let (motion, parallel_filter) = (MotionSettings::default(), ParallelFilterSettings::default());
        let settings = RowSettings { motion: &motion, parallel_filter: &parallel_filter };
        let execution = Execution::default();
        let made = excerpts(&recordings, settings, true, &[0], execution).unwrap().unwrap();
        let logs = Logs::new(model.model(), &recordings, settings, &[0], None, execution).unwrap();
        let logs = logs.with_excerpts(Arc::new(made));
        let rows_of = |pass: LogPass<'_>| {
            let mut rows = 0;
            pass.each_block(&mut |block| {
                rows += block.rows;
                Ok(())
            })
            .unwrap();
            rows
        };
        let of_excerpt = rows_of(logs.pass_for_instants(&model, 0));
        assert!((50_000..=200_000).contains(&of_excerpt), "{of_excerpt}");
        // Once the whole motion is stored, the pass uses all of its rows.
        let all = rows_of(logs.pass(&model, 0));
        assert!(all > 440_000 && rows_of(logs.pass_for_instants(&model, 0)) == all, "{all}");
        assert_eq!(rows_of(logs.without_keeping().pass_for_instants(&model, 0)), of_excerpt);
    }
}
