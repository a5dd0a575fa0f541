//! The recordings of a task with the filters in force: what every pass over them needs.

use crate::execution::Execution;
use crate::recording::{LogError, Recording, Role};
use crate::regressor_model::RegressorModel;
use crate::rows::{KeptLog, LogPass, ParallelFilterSettings, motion_band_hz};
use dynident_model::Model;
use dynident_recording::filter::CutoffChoice;
use dynident_recording::{FilterError, MotionSettings};
use std::sync::{Arc, OnceLock};

/// Longest lag that can be stated, seconds of a usual arm: two recorders that were started by hand, and no milliseconds
/// that are taken for seconds.
const LONGEST_STATED_LAG_S: f64 = 2.5;

/// Rows of a log that is not counted before it is needed.
const LONG_LOG_ROWS: u64 = 200_000;
/// Rows of a joint that are kept above the motion's band, at most, all recordings together; ...
const MOST_BEYOND_MOTION: f64 = 20_000.0;
/// ... and where the rate of the recordings was not asked for so many times those within it.
const BEYOND_MOTION: f64 = 8.0;

/// What the positions of one log say about its noise.
#[derive(Clone, Debug)]
pub struct LogSpectrum {
    /// Number of the recording.
    pub index: usize,
    /// Samples a second.
    pub rate_hz: f64,
    /// The cut-off that they suggest.
    pub choice: CutoffChoice,
    /// Standard deviation of the noise of one sample, in the log's order of joints.
    pub position_noise: Vec<f64>,
}

/// The settings that make rows of positions and torques.
#[derive(Clone, Copy, Debug)]
pub struct RowSettings<'a> {
    /// From positions to velocities and accelerations.
    pub motion: &'a MotionSettings,
    /// The filter of torque and regressor.
    pub parallel_filter: &'a ParallelFilterSettings,
}

/// The recordings of a task and the filters in force. A log that fits into memory is read and
/// differentiated once, however many passes there are.
#[derive(Clone, Debug)]
pub struct Logs<'a> {
    /// All recordings, whatever their role.
    pub recordings: &'a [Recording],
    /// The motion settings with one cut-off for all logs.
    pub motion: MotionSettings,
    /// The low-pass and decimation that torque and regressor go through alike.
    pub filter: ParallelFilterSettings,
    /// How the job runs.
    pub execution: Execution<'a>,
    /// Empty where nothing is kept between passes.
    kept: Arc<Vec<OnceLock<KeptLog>>>,
    /// The same recordings with excerpts of long ones; empty where there are none.
    excerpts: Arc<Vec<Recording>>,
    /// What the spectra of the deciding logs say, where the cut-off was left to them.
    spectra: Vec<LogSpectrum>,
    /// The cut-off of the torque's motion band, where the fit has another.
    motion_hz: Option<f64>,
    /// The cut-off that the parallel filter follows, where it is not the motion's.
    torque_hz: Option<f64>,
}

impl<'a> Logs<'a> {
    /// Decides on one cut-off for all logs: that of `settings`; or the one that a finished model was made with; or the
    /// highest that any of the logs `deciding` asks for. A model and its test must not differ in their filters.
    ///
    /// # Errors
    /// Logs that cannot be read; a stated lag that no drive of such a robot has.
    pub fn new(
        model: &Model,
        recordings: &'a [Recording],
        settings: RowSettings<'_>,
        deciding: &[usize],
        cutoff_of_model_hz: Option<f64>,
        execution: Execution<'a>,
    ) -> Result<Self, LogError> {
        let RowSettings { motion: settings, parallel_filter } = settings;
        let longest_s = model.own_scale().seconds(LONGEST_STATED_LAG_S);
        let stated = settings.torque_lag_s.as_ref();
        let mut stated = (0..model.dof()).filter_map(|joint| stated.and_then(|lags| lags.at(joint)));
        if let Some(value) = stated.find(|lag_s| lag_s.abs() > longest_s) {
            let fix = "give seconds, at most two and a half own seconds of the robot (2.5 s of an arm of 1.2 m)";
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

    /// The same with the cut-off `cutoff_hz` where it was left to the data; held-out figures stay those of the motion's
    /// own band, which the cut-off so far stands for.
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

    /// The same with a cut-off that was chosen, or as it is.
    #[must_use]
    pub fn with_chosen_cutoff(self, settings: &MotionSettings, cutoff_hz: Option<f64>) -> Self {
        match cutoff_hz {
            Some(cutoff_hz) => self.with_cutoff(settings, cutoff_hz),
            None => self,
        }
    }

    /// The same with what `other` has kept of the same recordings, where both have the same motion.
    #[must_use]
    pub fn with_motion_of(mut self, other: &Self) -> Self {
        if self.motion == other.motion && core::ptr::eq(self.recordings, other.recordings) {
            self.kept = Arc::clone(&other.kept);
        }
        self
    }

    /// The same with [excerpts](crate::excerpt) for [looks at some instants](Self::pass_for_instants).
    #[must_use]
    pub fn with_excerpts(mut self, excerpts: Arc<Vec<Recording>>) -> Self {
        self.excerpts = excerpts;
        self
    }

    /// What was given to [`with_excerpts`](Self::with_excerpts); empty where nothing was.
    pub fn excerpts(&self) -> Arc<Vec<Recording>> {
        Arc::clone(&self.excerpts)
    }

    /// The same with every pass reading anew: slower, in memory that does not grow with the length of a log.
    #[must_use]
    pub fn without_keeping(mut self) -> Self {
        self.kept = Arc::default();
        self
    }

    /// The same with held-out figures for the band that a motion cut-off of `motion_hz` makes; `None` for that of the
    /// fit.
    #[must_use]
    pub fn with_motion_band(mut self, motion_hz: Option<f64>) -> Self {
        self.motion_hz = motion_hz;
        self
    }

    /// The same motion with rows of the torque above its band: as many as a pass takes in fractions of a second. The
    /// parallel filter follows the motion's cut-off, and a step that friction passes within milliseconds has most of
    /// what it says about its width above that.
    ///
    /// # Errors
    /// A recording that cannot be read.
    pub fn with_torque_beyond_motion(&self, model: &RegressorModel) -> Result<Self, LogError> {
        let Some(motion_hz) = motion_band_hz(&self.motion) else { return Ok(self.clone()) };
        let mut rows = 0.0;
        for log in &self.spectra {
            let share = (ParallelFilterSettings::rows_per_s(motion_hz) / log.rate_hz).min(1.0);
            rows += self.rows_of(model, log.index)? * share;
        }
        let times = if rows > 0.0 { (MOST_BEYOND_MOTION / rows).max(1.0) } else { BEYOND_MOTION };
        // By factors of two: the rows of a long text file are only estimated.
        let times = times.log2().floor().exp2();
        Ok(Self { torque_hz: Some(times * motion_hz), ..self.clone() })
    }

    /// Rows of a recording: counted, which keeps its motion for the next pass, or of a long one estimated.
    fn rows_of(&self, model: &RegressorModel, index: usize) -> Result<f64, LogError> {
        let estimated = self.recordings[index].estimated_rows();
        if let Some(estimated) = estimated.filter(|rows| *rows > LONG_LOG_ROWS) {
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

    /// What the spectra alone ask for; none where the fit has that cut-off too.
    pub fn motion_hz(&self) -> Option<f64> {
        self.motion_hz
    }

    /// The cut-off that the spectra suggest, if both the cut-off and the parallel filter are left to the data; hertz.
    pub fn automatic_cutoff_hz(&self) -> Option<f64> {
        let filter = &self.filter;
        let is_automatic = filter.enabled && filter.factor.is_none() && filter.cutoff_hz.is_none();
        let motion_hz = self.motion_hz().or_else(|| motion_band_hz(&self.motion));
        motion_hz.filter(|_| is_automatic && !self.spectra().is_empty())
    }

    /// What the spectra of the deciding logs say; empty where the cut-off was given.
    pub fn spectra(&self) -> &[LogSpectrum] {
        &self.spectra
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
            filter: &self.filter,
            torque_hz: self.torque_hz,
            reader_thread: false,
            most_samples: None,
            progress: self.execution.progress,
            kept: self.kept.get(index),
        }
    }

    /// A pass that is asked for some instants of recording number `index`: of one whose motion is not kept over its
    /// excerpt, where it has one, so that a long log is not read again.
    pub fn pass_for_instants<'p>(&'p self, model: &'p RegressorModel, index: usize) -> LogPass<'p> {
        let pass = self.pass(model, index);
        let is_kept = pass.kept.is_some_and(|kept| kept.get().is_some());
        match self.excerpts.get(index) {
            Some(recording) if recording.whole.is_some() && !is_kept => LogPass { recording, kept: None, ..pass },
            _ => pass,
        }
    }

    /// Begins a stage over some recordings.
    pub fn begin(&self, stage: &str, indices: &[usize]) {
        let rows = indices.iter().map(|&index| self.recordings[index].estimated_rows()).sum();
        self.execution.progress.begin(stage, rows);
    }

    /// Ends a stage.
    pub fn end(&self) {
        self.execution.progress.end();
    }
}

/// A place for the motion of every recording.
fn unread(recordings: &[Recording]) -> Arc<Vec<OnceLock<KeptLog>>> {
    Arc::new(recordings.iter().map(|_| OnceLock::new()).collect())
}

/// Places of the recordings with this role.
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
    fn instants_of_a_long_log_that_is_not_kept_are_of_its_excerpt() {
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
        // Once the motion of all rows is at hand these are as good, and more.
        let all = rows_of(logs.pass(&model, 0));
        assert!(all > 440_000 && rows_of(logs.pass_for_instants(&model, 0)) == all, "{all}");
        assert_eq!(rows_of(logs.without_keeping().pass_for_instants(&model, 0)), of_excerpt);
    }
}
