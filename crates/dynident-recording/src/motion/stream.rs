//! Conversion of a log to positions q, velocities dq, accelerations ddq and torque on a uniform clock, block by block.

mod giving;

use super::block::{MotionBlock, MotionSettings, unsettled_samples};
use super::opening::Opening;
use super::torque_lag::TorqueShift;
use crate::cleaning::{CleanBlock, CleanRows};
use crate::clock::Clock;
use crate::clock::segments::{PlacedRows, Segmenter};
use crate::clock::timeline::Timeline;
use crate::derivative::Differentiator;
use crate::error::{FilterError, RecordingError};
use crate::filter::CutoffChoice;
use crate::log::{IgnoredTorque, Log, LogFormat, LogReader, Quantity, RawBlock};
use crate::reference::Reference;
use crate::report::channels::ChannelCheck;
use crate::report::comparison::Comparison;
use crate::report::steps::TimeCheck;
use crate::report::{ImportReport, ReportSettings};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

/// Minimum number of rows in a [`MotionBlock`], except the last one of a segment.
const MIN_CHUNK_ROWS: usize = 8192;
/// If a log has no uninterrupted piece and fewer rows than this number per backward step, it is reported as not ordered
/// by time.
const MIN_ROWS_PER_BACKWARD_STEP: u64 = 10;

/// Converts a log to a motion. The memory does not grow with the length of the log, unless the differentiator needs the
/// whole log.
///
/// When the stream is opened, a limited first part of the log is read to determine clock, rate and cut-off, once for
/// all passes over a [`Log`] and its clones. [`next_block`](Self::next_block) then reads the log from its start.
#[derive(Debug)]
pub struct MotionStream {
    rows_in: CleanRows,
    clean: CleanBlock,
    clean_at: usize,
    joints: Vec<String>,
    clock: Clock,
    cutoff: CutoffChoice,
    cutoff_in_use_hz: f64,
    position_noise: Vec<f64>,
    differentiator: Box<dyn Differentiator>,
    smooth_torque: bool,
    torque_shift: TorqueShift,
    trim: usize,
    /// Number of samples at the ends of a piece whose motion depends on extrapolated samples.
    unsettled: usize,
    /// Number of samples that are needed on either side of a block; `None` for the whole segment.
    context: Option<usize>,
    segmenter: Segmenter,
    /// Channels on the uniform clock: positions, torques, logged velocities, logged accelerations, temperatures.
    uniform: Vec<Vec<f64>>,
    /// Number of samples in `uniform` that were already returned and are kept because the next block needs them.
    done: usize,
    /// Number of samples of the segment that are no longer in `uniform`.
    passed: u64,
    /// Samples of the segment whose torque is ignored: index in the segment and joint, ascending.
    set_aside: VecDeque<(u64, usize)>,
    /// Intervals whose torque is ignored.
    ignored_torque: Vec<IgnoredTorque>,
    ended: bool,
    segments: usize,
    short_segments: [u64; 2],
    longest_short: usize,
    rows: u64,
    /// Number of rows per new value, for positions and for torques.
    rows_to_a_value: [Option<u64>; 2],
    time_check: TimeCheck,
    report_limits: ReportSettings,
    checks: Vec<ChannelCheck>,
    velocity: Vec<Comparison>,
    acceleration: Vec<Comparison>,
    window: [Vec<f64>; 4],
    /// Blocks between omitted samples that were not returned yet.
    waiting: VecDeque<MotionBlock>,
    /// Number of cuts where the differentiator is not valid; `in_cut` states whether the last sample was omitted.
    cuts: usize,
    in_cut: bool,
    unmapped: u64,
    given: u64,
}

impl MotionStream {
    /// Starts a pass over the log with the main file `file`, as [`new`](Self::new) for [`Log::file`].
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn open(
        format: &LogFormat,
        file: &Path,
        joints: &[String],
        settings: &MotionSettings,
    ) -> Result<Self, RecordingError> {
        Self::new(&Log::file(file, format.clone(), joints), settings)
    }

    /// Starts a pass over `log` and determines clock and cut-off.
    ///
    /// # Errors
    /// If settings or format are invalid, the log cannot be read, or it does not determine a rate.
    pub fn new(log: &Log, settings: &MotionSettings) -> Result<Self, RecordingError> {
        Self::following(log, settings, None)
    }

    /// As [`new`](Self::new), with the commanded motion for a differentiator that needs it. The joints of `reference`
    /// are in the order of the log.
    ///
    /// If the differentiator is not valid for a joint at some samples, these samples are omitted for all joints and the
    /// piece is divided; the report contains their number.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn following(
        log: &Log,
        settings: &MotionSettings,
        reference: Option<&Arc<Reference>>,
    ) -> Result<Self, RecordingError> {
        settings.validate()?;
        Self::begin(log, settings, |cutoff| settings.differentiator.build_following(cutoff.cutoff_hz, reference))
    }

    /// As [`new`](Self::new), with a differentiator of the caller instead of the one in the settings.
    ///
    /// `build` gets the cut-off that is estimated from the data.
    ///
    /// # Errors
    /// As [`new`](Self::new), and errors of `build`.
    pub fn with_differentiator(
        log: &Log,
        settings: &MotionSettings,
        build: impl FnOnce(&CutoffChoice) -> Result<Box<dyn Differentiator>, FilterError>,
    ) -> Result<Self, RecordingError> {
        settings.validate()?;
        Self::begin(log, settings, build)
    }

    fn begin(
        log: &Log,
        settings: &MotionSettings,
        build: impl FnOnce(&CutoffChoice) -> Result<Box<dyn Differentiator>, FilterError>,
    ) -> Result<Self, RecordingError> {
        let opening = Opening::of(log, settings)?;
        let differentiator = build(&opening.cutoff)?;
        Self::opened(log, settings, &opening, differentiator)
    }

    fn opened(
        log: &Log,
        settings: &MotionSettings,
        opening: &Opening,
        differentiator: Box<dyn Differentiator>,
    ) -> Result<Self, RecordingError> {
        let Log { format, joints, .. } = log;
        let (clock, cutoff) = (opening.clock.clone(), opening.cutoff.clone());
        let cutoff_in_use_hz = settings.differentiator.cutoff_hz().unwrap_or(cutoff.cutoff_hz);
        let limits = &settings.limits.cleaning;
        let bridged = if format.bridge_gaps { limits.hole_periods * clock.rate_hz / cutoff.cutoff_hz } else { 0.0 };
        let timeline = Timeline::new(&clock, format.max_gap_steps, bridged);
        let comparisons = |group: bool| -> Vec<Comparison> {
            joints.iter().filter(|_| group).map(|joint| Comparison::new(joint)).collect()
        };
        let (velocity, acceleration) =
            (comparisons(format.velocity.is_some()), comparisons(format.acceleration.is_some()));
        let temperature = if format.temperature.is_some() { joints.len() } else { 0 };
        let torque_shift = TorqueShift::new(settings.torque_lags_s(joints.len())?.into_iter(), clock.rate_hz);
        let context = differentiator.context_samples(clock.rate_hz);
        let unsettled = unsettled_samples(clock.rate_hz, cutoff_in_use_hz).min(context.unwrap_or(0));
        let channels = 2 * joints.len() + velocity.len() + acceleration.len() + temperature;
        Ok(Self {
            rows_in: CleanRows::new(
                LogReader::open(log)?,
                timeline,
                joints,
                (!settings.keep_outliers).then(|| limits.clone()),
            ),
            clean: CleanBlock::default(),
            clean_at: 0,
            joints: joints.clone(),
            trim: (settings.trim_s * clock.rate_hz).round() as usize,
            context: context.map(|samples| samples.max(torque_shift.reach())),
            unsettled,
            segmenter: Segmenter::new(channels),
            cutoff_in_use_hz,
            time_check: TimeCheck::new(clock.median_step_s),
            position_noise: opening.noise.beyond(cutoff_in_use_hz),
            // Copied rows are omitted, so the remaining rows do not repeat values.
            rows_to_a_value: if clock.repeats_rows { [None; 2] } else { opening.rows_to_a_value },
            clock,
            cutoff,
            differentiator,
            smooth_torque: settings.smooth_torque,
            torque_shift,
            uniform: vec![Vec::new(); channels],
            done: 0,
            passed: 0,
            set_aside: VecDeque::new(),
            ignored_torque: log.ignored_torque.clone(),
            ended: false,
            segments: 0,
            short_segments: [0; 2],
            longest_short: 0,
            rows: 0,
            report_limits: settings.limits.report,
            checks: channel_checks(log, opening, settings.limits.report),
            velocity,
            acceleration,
            window: Default::default(),
            waiting: VecDeque::new(),
            cuts: 0,
            in_cut: false,
            unmapped: 0,
            given: 0,
        })
    }

    /// Reads rows ahead in a separate thread. The result is bit-identical.
    #[must_use]
    pub fn read_beside(self) -> Self {
        Self { rows_in: self.rows_in.read_in_thread(), ..self }
    }

    /// Omits statistics of the log's columns from the [`report`](Self::report). Computing them takes time, and a second
    /// pass over the same log does not use them.
    #[must_use]
    pub fn without_channels(self) -> Self {
        Self { checks: Vec::new(), ..self }
    }

    /// Sample rate of the motion, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.clock.rate_hz
    }

    /// The cut-off estimated from the data; used unless the settings contain one.
    pub fn cutoff(&self) -> &CutoffChoice {
        &self.cutoff
    }

    /// Standard deviation of the white position noise in one sample, for each joint: see
    /// [`position_noise()`](crate::position_noise()).
    pub fn position_noise(&self) -> &[f64] {
        &self.position_noise
    }

    /// Writes the next samples to `block`; returns false (and an empty block) at the end.
    ///
    /// # Errors
    /// If the log cannot be read further, or no piece of it is long enough for the filter.
    pub fn next_block(&mut self, block: &mut MotionBlock) -> Result<bool, RecordingError> {
        loop {
            if let Some(next) = self.waiting.pop_front() {
                *block = next;
                return Ok(true);
            }
            let available = self.uniform[0].len();
            if let Some(context) = self.context
                && available >= self.done + self.chunk() + context.max(self.trim)
            {
                let end = self.done + self.chunk();
                if self.give(block, end, false)? {
                    return Ok(true);
                }
                continue;
            }
            if self.segmenter.closed() || self.ended {
                let given = self.close_segment(block)?;
                if given {
                    return Ok(true);
                }
                if self.waiting.is_empty() && self.ended && self.clean_at >= self.clean.raw.rows() {
                    return self.finish(block);
                }
                continue;
            }
            self.feed()?;
        }
    }

    fn finish(&self, block: &mut MotionBlock) -> Result<bool, RecordingError> {
        *block = MotionBlock { rate_hz: self.clock.rate_hz, joints: self.joints.len(), ..MotionBlock::default() };
        let backward = self.time_check.backward;
        if self.segments == 0 && MIN_ROWS_PER_BACKWARD_STEP * backward > self.rows {
            let log = self.rows_in.reader().label().to_owned();
            return Err(RecordingError::Unordered { log, backward, rows: self.rows });
        }
        if self.segments == 0 {
            return Err(RecordingError::TooShort {
                log: self.rows_in.reader().label().to_owned(),
                found: self.longest_short,
                needed: self.needed(),
                method: self.differentiator.name(),
            });
        }
        if self.given == 0 && self.unmapped > 0 {
            return Err(RecordingError::NotFollowed {
                log: self.rows_in.reader().label().to_owned(),
                method: self.differentiator.name(),
                samples: self.unmapped,
            });
        }
        Ok(false)
    }

    /// Minimum length of a piece, samples.
    fn needed(&self) -> usize {
        self.differentiator.minimum_samples().max(2 * self.trim + 1)
    }

    fn chunk(&self) -> usize {
        MIN_CHUNK_ROWS.max(3 * self.context.unwrap_or(0))
    }

    /// Moves raw rows to the uniform clock, until the raw block or the segment ends.
    fn feed(&mut self) -> Result<(), RecordingError> {
        if self.clean_at >= self.clean.raw.rows() {
            self.clean_at = 0;
            let Self { rows_in, rows, time_check, checks, .. } = self;
            let mut read = |raw: &RawBlock| {
                *rows += raw.rows() as u64;
                let mut gaps = Vec::new();
                for (place, (row, time_s)) in raw.row.iter().zip(&raw.time_s).enumerate() {
                    if time_check.add(*row, *time_s) {
                        gaps.push(place);
                    }
                }
                // In the order of LogFormat::groups.
                let logged = raw.q.iter().chain(&raw.dq).chain(&raw.ddq).chain(&raw.tau).chain(&raw.temperature_c);
                for (check, values) in checks.iter_mut().zip(logged) {
                    let mut from = 0;
                    for &gap in &gaps {
                        check.add(&values[from..gap]);
                        check.begin_piece();
                        from = gap;
                    }
                    check.add(&values[from..]);
                }
            };
            let next = rows_in.next_block(&mut read)?;
            self.ended = next.is_none();
            self.clean = next.unwrap_or_default();
            if self.ended {
                self.segmenter.close(&mut self.uniform);
                return Ok(());
            }
        }
        let CleanBlock { raw, places, marked } = &self.clean;
        let rows = PlacedRows { time_s: &raw.time_s, steps: &places.steps, begins: &places.begins };
        let from = self.clean_at;
        self.clean_at = self.segmenter.feed(rows, from, &mut self.uniform, || {
            raw.q.iter().chain(&raw.tau).chain(&raw.dq).chain(&raw.ddq).chain(&raw.temperature_c)
        });
        let mut grid = Vec::new();
        for (joint, marked) in marked.iter().enumerate() {
            let first = marked.partition_point(|row| *row < from);
            for row in marked[first..].iter().take_while(|row| **row < self.clean_at) {
                let place = self.segmenter.place_in_piece(places.steps[*row]);
                grid.extend(self.torque_shift.rows_of_mark(joint, place).map(|sample| (sample, joint)));
            }
        }
        if !grid.is_empty() {
            grid.extend(self.set_aside.drain(..));
            grid.sort_unstable();
            grid.dedup();
            self.set_aside.extend(grid);
        }
        Ok(())
    }

    fn close_segment(&mut self, block: &mut MotionBlock) -> Result<bool, RecordingError> {
        let available = self.uniform[0].len();
        let total = self.passed + available as u64;
        let mut given = false;
        if available > 0 {
            if total < self.needed() as u64 {
                self.short_segments[0] += 1;
                self.short_segments[1] += total;
                self.longest_short = self.longest_short.max(total as usize);
            } else {
                let end = available.saturating_sub(self.trim);
                given = self.give(block, end, true)?;
                self.segments += 1;
            }
        }
        self.uniform.iter_mut().for_each(Vec::clear);
        self.set_aside.clear();
        self.done = 0;
        self.passed = 0;
        self.in_cut = false;
        self.segmenter.reopen();
        Ok(given)
    }

    /// The findings so far; complete once [`next_block`](Self::next_block) has returned false.
    pub fn report(&self) -> ImportReport {
        let cutoff_hz = self.cutoff_in_use_hz;
        let mut report = ImportReport {
            file: self.rows_in.reader().label().to_owned(),
            rows: self.rows,
            rate_hz: self.clock.rate_hz,
            clock: self.clock.clone(),
            steps: self.time_check.steps(),
            gap_count: self.time_check.gap_count,
            gaps: self.time_check.gaps.clone(),
            duplicate_stamps: self.time_check.duplicates,
            backward_stamps: self.time_check.backward,
            crowded_samples: self.segmenter.crowded(),
            dropped: self.rows_in.reader().dropped().clone(),
            segments: self.segments,
            short_segments: self.short_segments,
            unmapped_samples: self.unmapped,
            rows_to_a_position: self.rows_to_a_value[0],
            rows_to_a_torque: self.rows_to_a_value[1],
            set_aside: self.rows_in.set_aside(),
            bridged: self.rows_in.bridged(),
            channels: self.checks.iter().map(ChannelCheck::report).collect(),
            velocity: self.velocity.iter().map(|c| c.report(self.clock.rate_hz, cutoff_hz)).collect(),
            acceleration: self.acceleration.iter().map(|c| c.report(self.clock.rate_hz, cutoff_hz)).collect(),
            cutoff: self.cutoff.clone(),
            position_noise: self.position_noise.clone(),
            findings: Vec::new(),
        };
        report.find(&self.report_limits);
        report
    }
}

fn channel_checks(log: &Log, opening: &Opening, limits: ReportSettings) -> Vec<ChannelCheck> {
    let mut checks = Vec::new();
    // Commands are not part of the motion.
    for (quantity, _) in log.format.groups().into_iter().filter(|(quantity, _)| *quantity != Quantity::Command) {
        for (index, joint) in log.joints.iter().enumerate() {
            let mut check = ChannelCheck::new(quantity, joint, limits);
            check.quantisation_step = match quantity {
                Quantity::Position => opening.position_steps[index],
                Quantity::Torque => opening.torque_steps[index],
                Quantity::Velocity | Quantity::Acceleration | Quantity::Temperature | Quantity::Command => None,
            };
            checks.push(check);
        }
    }
    checks
}
