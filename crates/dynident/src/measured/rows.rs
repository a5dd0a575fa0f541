//! From a log to filtered rows of regressor and torque: the stream that both fitting and testing read.
//!
//! Samples flow in blocks: positions to motion, motion to regressor panels, panels and torque through the same low-pass and decimation, then to the caller. The
//! whole regressor is never stored. Reading runs beside computing where there is a second thread.

use crate::error::Error;
use crate::machine::Machine;
use crate::measured::motion_log::motion_stream;
use crate::progress::Progress;
use crate::study::{ParallelFilterSection, Study};
use dynident_dynamics::{BatchWorkspace, LawHistory, PanelLayout, Panels, regressor_panels_following};
use dynident_model::Model;
use dynident_model::laws::JointMotion;
use dynident_recording::{
    DecimationSettings, Decimator, FilterError, ImportReport, MotionBlock, MotionSettings, MotionStream,
};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Samples that are made into panels at a time: small enough for the cache, large enough to spread the filter's overhead.
pub(crate) const PANEL_SAMPLES: usize = 256;

/// Motion blocks that may wait between reader and computer.
const WAITING: usize = 3;

/// Filtered rows of one joint: base columns of its panel one after another, then its torque.
pub(crate) struct JointRows<'a> {
    pub(crate) joint: usize,
    pub(crate) rows: usize,
    pub(crate) panel: &'a [f64],
}

/// Unfiltered samples of all joints.
pub(crate) struct RawSamples<'a> {
    /// Uninterrupted piece of the log.
    pub(crate) segment: usize,
    pub(crate) rate_hz: f64,
    pub(crate) panels: &'a Panels,
}

/// What a caller does with a log's rows.
pub(crate) trait RowSink {
    /// Rows as they leave the parallel filter.
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), Error>;
    /// The same samples before the filter (panels with the torque as logged, or as smoothed with `smooth_torque`).
    fn raw(&mut self, samples: &RawSamples<'_>) -> Result<(), Error>;
}

/// What is known of a log once its rows have passed.
#[derive(Clone, Debug)]
pub(crate) struct Passed {
    pub(crate) report: ImportReport,
    /// Cut-off of the differentiator in force.
    pub(crate) motion_cutoff_hz: Option<f64>,
    /// Rate after decimation.
    pub(crate) filtered_rate_hz: f64,
    /// Gain one half of the parallel filter, if there is one.
    pub(crate) filter_cutoff_hz: Option<f64>,
    /// Filtered rows of each joint.
    pub(crate) filtered_rows: u64,
}

/// One log to be passed: everything but the sink.
pub(crate) struct Pass<'a> {
    pub(crate) study: &'a Study,
    pub(crate) machine: &'a Machine,
    /// The study's motion settings with the cut-off that is in force for all its logs.
    pub(crate) motion: &'a MotionSettings,
    pub(crate) index: usize,
    pub(crate) file: &'a Path,
    pub(crate) reader_thread: bool,
    /// Stop after about so many samples.
    pub(crate) most_samples: Option<u64>,
    pub(crate) progress: &'a dyn Progress,
}

impl Pass<'_> {
    /// Sends the log's rows to `sink`.
    pub(crate) fn run(&self, sink: &mut dyn RowSink) -> Result<Passed, Error> {
        let log = self.study.log_name(self.index);
        let failed = |source| Error::recording(&log, source);
        self.machine.check_temperature(self.study, self.index)?;
        let mut stream = motion_stream(self.study, self.machine, self.motion, self.index, self.file)?;
        let motion_cutoff_hz = self.motion.differentiator.cutoff_hz();
        let settings = decimation(&self.study.parallel_filter, stream.rate_hz(), motion_band_hz(self.motion));
        let (model, layout, log_place) = (self.machine.model(), self.machine.layout(), &self.machine.log_place);
        let mut computer = Computer::new(
            model,
            layout,
            log_place,
            stream.rate_hz(),
            settings.as_ref(),
            self.machine.load_parameters.clone(),
            self.progress,
        )
        .map_err(|source| Error::Filter { log: log.clone(), source })?;
        computer.torque_gains.clone_from(&self.machine.torque_gains);
        if self.reader_thread && self.most_samples.is_none() {
            read_beside(&mut stream, |block| computer.take(block, sink)).map_err(|error| error.named(&log))?;
        } else {
            let mut block = MotionBlock::default();
            let most = self.most_samples.unwrap_or(u64::MAX);
            while computer.samples < most && stream.next_block(&mut block).map_err(failed)? {
                computer.take(&block, sink)?;
            }
        }
        let (filtered_rows, samples) = (computer.filtered_rows, computer.samples);
        if filtered_rows == 0 {
            return Err(Error::NothingLeft { log, rows: samples, needed: computer.needed() });
        }
        let rate_hz = stream.rate_hz();
        let factor = settings.as_ref().map_or(1, |settings| settings.factor);
        let reduced = rate_hz / factor as f64;
        Ok(Passed {
            report: stream.report(),
            motion_cutoff_hz,
            filtered_rate_hz: reduced,
            filter_cutoff_hz: settings.map(|settings| settings.cutoff_hz.unwrap_or(0.4 * reduced)),
            filtered_rows,
        })
    }
}

/// The frequency below which the whole motion lies; unknown for methods without a cut-off, and where only the deviation from a reference has one.
pub(crate) fn motion_band_hz(motion: &MotionSettings) -> Option<f64> {
    let way = &motion.differentiator;
    way.cutoff_hz().filter(|_| way.reference().is_none())
}

/// The study's motion settings with one cut-off for all logs: the user's; or the one that a finished model was made with; or the highest that any of the training logs asks
/// for. A model and its test must not differ in their filters.
pub(crate) fn motion_in_force(
    study: &Study,
    machine: &Machine,
    files: &[PathBuf],
    training: &[usize],
    of_model_hz: Option<f64>,
) -> Result<MotionSettings, Error> {
    let mut motion = study.motion.clone();
    if let Some(of_model_hz) = of_model_hz {
        motion.differentiator = motion.differentiator.with_cutoff(of_model_hz);
    }
    if !motion.differentiator.wants_cutoff() {
        return Ok(motion);
    }
    let mut highest = 0.0_f64;
    for &index in training {
        let stream = motion_stream(study, machine, &study.motion, index, &files[index])?;
        highest = highest.max(stream.cutoff().cutoff_hz);
    }
    motion.differentiator = motion.differentiator.with_cutoff(highest);
    Ok(motion)
}

/// The parallel filter in force at this rate.
pub(crate) fn decimation(
    section: &ParallelFilterSection,
    rate_hz: f64,
    motion_cutoff_hz: Option<f64>,
) -> Option<DecimationSettings> {
    if !section.enabled {
        return None;
    }
    // The motion's cut-off is twice the motion's highest frequency; with seven eighths of it per Nyquist band the filter's gain of one half lies at 0.7 of the cut-off, above all
    // motion. It takes the same from torque and regressor, so it costs no bias.
    let automatic =
        motion_cutoff_hz.map_or(1, |cutoff| (rate_hz / (1.75 * cutoff)).floor().clamp(1.0, 1000.0) as usize);
    let factor = section.factor.unwrap_or(automatic);
    (factor > 1 || section.cutoff_hz.is_some()).then(|| DecimationSettings {
        factor,
        cutoff_hz: section.cutoff_hz,
        stop_band_db: section.stop_band_db,
        ..DecimationSettings::default()
    })
}

/// Some samples of a block's positions, velocities and accelerations, joints in the model's order.
pub(crate) fn in_model_order(
    block: &MotionBlock,
    log_place: &[usize],
    from: usize,
    samples: usize,
    motion: &mut [Vec<f64>; 3],
) {
    for (to, source) in motion.iter_mut().zip([&block.q, &block.dq, &block.ddq]) {
        to.clear();
        for &place in log_place {
            to.extend_from_slice(&block.joint(source, place)[from..from + samples]);
        }
    }
}

/// Turns motion blocks into rows.
pub(crate) struct Computer<'a> {
    model: &'a Model,
    layout: &'a PanelLayout,
    log_place: &'a [usize],
    progress: &'a dyn Progress,
    workspace: BatchWorkspace,
    panels: Panels,
    history: LawHistory,
    decimators: Option<Vec<Decimator>>,
    torque_gains: Vec<f64>,
    temperature_c: Vec<f64>,
    segment: usize,
    motion: [Vec<f64>; 3],
    out: Vec<f64>,
    filtered_rows: u64,
    samples: u64,
}

impl<'a> Computer<'a> {
    /// For samples at `rate_hz`, joint `j` of the model standing at place `log_place[j]` of the motion.
    pub(crate) fn new(
        model: &'a Model,
        layout: &'a PanelLayout,
        log_place: &'a [usize],
        rate_hz: f64,
        settings: Option<&DecimationSettings>,
        load_parameters: Option<Vec<f64>>,
        progress: &'a dyn Progress,
    ) -> Result<Self, FilterError> {
        let decimators = settings
            .map(|settings| {
                (0..model.dof())
                    .map(|joint| Decimator::new(settings, rate_hz, layout.joint_columns(joint).len() + 1))
                    .collect::<Result<Vec<_>, _>>()
            })
            .transpose()?;
        Ok(Self {
            model,
            layout,
            log_place,
            progress,
            workspace: BatchWorkspace::new(model),
            panels: Panels::default(),
            history: LawHistory::new(load_parameters),
            decimators,
            torque_gains: Vec::new(),
            temperature_c: Vec::new(),
            segment: 0,
            motion: [Vec::new(), Vec::new(), Vec::new()],
            out: Vec::new(),
            filtered_rows: 0,
            samples: 0,
        })
    }

    /// Samples that the first filtered row needs.
    fn needed(&self) -> usize {
        self.decimators.as_ref().and_then(|all| all.first()).map_or(1, Decimator::length)
    }

    /// Makes the rows of the next samples.
    pub(crate) fn take(&mut self, block: &MotionBlock, sink: &mut dyn RowSink) -> Result<(), Error> {
        if block.segment != self.segment {
            self.segment = block.segment;
            self.history.restart();
            self.decimators.iter_mut().flatten().for_each(|decimator| {
                decimator.finish();
            });
        }
        let (model, layout, log_place) = (self.model, self.layout, self.log_place);
        for from in (0..block.rows).step_by(PANEL_SAMPLES) {
            let samples = PANEL_SAMPLES.min(block.rows - from);
            in_model_order(block, log_place, from, samples, &mut self.motion);
            let [q, dq, ddq] = &self.motion;
            let motion = JointMotion { samples, q, dq, ddq };
            if !block.temperature_c.is_empty() {
                self.temperature_c.clear();
                for &place in log_place {
                    let temperature = block.joint(&block.temperature_c, place);
                    self.temperature_c.extend_from_slice(&temperature[from..from + samples]);
                }
                self.history.set_temperature(&self.temperature_c);
            }
            regressor_panels_following(
                model,
                &mut self.workspace,
                layout,
                &motion,
                &mut self.history,
                &mut self.panels,
            );
            for (joint, &place) in log_place.iter().enumerate() {
                let tau = &block.joint(block.fitted_tau(), place)[from..from + samples];
                let torque = self.panels.torque_mut(joint);
                torque.copy_from_slice(tau);
                if let Some(gain) = self.torque_gains.get(joint) {
                    for torque in torque {
                        *torque *= gain;
                    }
                }
            }
            sink.raw(&RawSamples { segment: block.segment, rate_hz: block.rate_hz, panels: &self.panels })?;
            let mut rows = samples;
            for joint in 0..model.dof() {
                let panel = self.panels.joint(joint);
                let panel = match &mut self.decimators {
                    Some(decimators) => {
                        rows = decimators[joint].push(panel, samples, &mut self.out);
                        &self.out[..]
                    }
                    None => panel,
                };
                if rows > 0 {
                    sink.filtered(&JointRows { joint, rows, panel })?;
                }
            }
            self.filtered_rows += rows as u64;
            self.samples += samples as u64;
            self.progress.advance(samples as u64);
        }
        Ok(())
    }
}

/// An error on either side of the channel.
enum Side {
    Reading(dynident_recording::RecordingError),
    Computing(Error),
}

impl Side {
    fn named(self, log: &str) -> Error {
        match self {
            Self::Reading(source) => Error::recording(log, source),
            Self::Computing(error) => error,
        }
    }
}

/// Reads on a thread of its own; blocks go round so that memory is bounded. The order of work is the same as without the thread.
fn read_beside(stream: &mut MotionStream, mut take: impl FnMut(&MotionBlock) -> Result<(), Error>) -> Result<(), Side> {
    let (full_to, full): (SyncSender<MotionBlock>, Receiver<MotionBlock>) = sync_channel(WAITING);
    let (empty_to, empty) = sync_channel(WAITING + 1);
    std::thread::scope(|scope| {
        let reader = scope.spawn(move || {
            loop {
                let mut block: MotionBlock = empty.try_recv().unwrap_or_default();
                if !stream.next_block(&mut block)? {
                    return Ok(());
                }
                if full_to.send(block).is_err() {
                    // The computing side has stopped on an error of its own.
                    return Ok(());
                }
            }
        });
        let mut outcome = Ok(());
        for block in full {
            outcome = take(&block).map_err(Side::Computing);
            if outcome.is_err() {
                break;
            }
            // A full return channel only means that the block is dropped.
            let _ = empty_to.try_send(block);
        }
        // Dropping the receiver (above, by the loop) lets a blocked reader go on to its end.
        match reader.join() {
            Ok(read) => outcome.and(read.map_err(Side::Reading)),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// Rows of the files together, from their sizes and the length of their first lines; for progress bars only.
pub(crate) fn estimated_rows<'a>(files: impl IntoIterator<Item = &'a Path>) -> Option<u64> {
    use std::io::Read;
    let rows_of = |file: &Path| -> Option<u64> {
        let size = std::fs::metadata(file).ok()?.len();
        let mut head = Vec::new();
        std::fs::File::open(file).ok()?.take(1 << 16).read_to_end(&mut head).ok()?;
        let lines = head.split(|byte| *byte == b'\n').count().max(2) - 1;
        Some(size * lines as u64 / (head.len() as u64).max(1))
    };
    files.into_iter().map(rows_of).sum()
}
