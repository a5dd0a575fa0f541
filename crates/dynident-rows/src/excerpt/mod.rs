//! What a long log is chosen from: an excerpt of bounded length, at a rate that its motion needs.
//!
//! Drives, cut-off, friction and lag are chosen in dozens of passes, and what a choice gains from more rows fades long
//! before an hour of recording has passed. So the choices of long recordings are made on an excerpt: first every n-th
//! row behind a low-pass, as far as the motion lets the rate fall, which keeps all that the rows say; then, of what is
//! still long, pieces spread evenly over the log ([`Pieces`](pieces::Pieces)). Numbers are made of all rows: with the
//! choices at hand a long log is read once.

mod pieces;

use crate::execution::Execution;
use crate::logs::RowSettings;
use crate::recording::{LogError, Recording, Samples, Whole};
use dynident_recording::{
    DecimationSettings, Decimator, Derivatives, Differentiator, FilterError, JointSamples, Log, MotionBlock,
    MotionSettings, MotionStream, Place, RecordingError, SampleRanges,
};
use pieces::Pieces;

/// Rows of all training recordings together from which on an excerpt is made, and which it has at most: at 1 kHz two to
/// three minutes, several times the length of the public recordings.
const LONG: u64 = 200_000;
/// Samples of an excerpt in a period of the cut-off that the positions ask for, at least. Steps of friction are far
/// shorter than the motion's periods: with 100 samples in one the Stribeck effect of a simulated arm was not told any
/// more where all samples tell it, with 400 it was.
const SAMPLES_IN_PERIOD: f64 = 400.0;
/// The low-pass before samples are left out passes frequencies below 0.4 of the rate that remains.
const HALF_GAIN: f64 = 0.45;
const TRANSITION: f64 = 0.1;
/// Recordings of no more rows are kept whole, and of longer ones at least as many rows.
const LEAST: u64 = 20_000;
/// Periods of the cut-off in a piece, at least: filters feel its ends for one or two.
const PERIODS_IN_PIECE: f64 = 30.0;
/// Where more of an excerpt's rows than this would be left out because some joint's torque does not count there, there
/// is none: it would say less of the other joints.
const MOST_LEFT_OUT: f64 = 0.1;

/// The recordings of a task with excerpts in place of the long ones among `training`. `None` if they are not long
/// together, if nothing is left to choose (`has_choices`: drive inertia or friction are left to the logs), and if a
/// setting is a number of samples: the factor of the parallel filter, or a differentiator that has no cut-off or follows
/// a commanded motion.
///
/// # Errors
/// Recordings that cannot be read.
pub fn excerpts(
    recordings: &[Recording],
    settings: RowSettings<'_>,
    has_choices: bool,
    training: &[usize],
    execution: Execution<'_>,
) -> Result<Option<Vec<Recording>>, LogError> {
    let differentiator = &settings.motion.differentiator;
    let has_cutoff = differentiator.wants_cutoff() || differentiator.cutoff_hz().is_some();
    if !has_cutoff || differentiator.reference().is_some() || settings.parallel_filter.factor.is_some() {
        return Ok(None);
    }
    if !differentiator.wants_cutoff() && settings.motion.torque_lag_s.is_some() && !has_choices {
        return Ok(None);
    }
    let rows = |index: usize| recordings[index].estimated_rows().unwrap_or(0);
    let all: u64 = training.iter().map(|&index| rows(index)).sum();
    if all <= LONG {
        return Ok(None);
    }
    let mut found = recordings.to_vec();
    let mut changed = false;
    for &index in training {
        let share = ((LONG as f64 * rows(index) as f64 / all as f64) as u64).max(LEAST) as usize;
        if let Samples::Log(log) = &recordings[index].samples
            && rows(index) > LEAST
            && let Some((excerpt, whole)) =
                excerpt(&recordings[index], log, settings.motion, share, execution.parallel())?
        {
            found[index].samples = Samples::Log(Box::new(excerpt));
            found[index].whole = Some(whole);
            changed = true;
        }
    }
    Ok(changed.then_some(found))
}

/// At most about `most` rows of a log, read `beside` by a thread of its own or here; `None` where too many of them
/// would be left out.
fn excerpt(
    recording: &Recording,
    log: &Log,
    settings: &MotionSettings,
    most: usize,
    beside: bool,
) -> Result<Option<(Log, Whole)>, LogError> {
    let named = |source: RecordingError| LogError::recording(&recording.name, source);
    // Logged velocities and accelerations are for comparison only; lag and ends are for the passes that come.
    let mut read = log.clone();
    (read.format.velocity, read.format.acceleration) = (None, None);
    let motion = MotionSettings { keep_outliers: settings.keep_outliers, ..MotionSettings::default() };
    let build = |_: &_| -> Result<Box<dyn Differentiator>, FilterError> { Ok(Box::new(AsLogged)) };
    let stream = MotionStream::with_differentiator(&read, &motion, build).map_err(named)?.without_channels();
    let mut stream = if beside { stream.read_beside() } else { stream };
    let given_hz = settings.differentiator.cutoff_hz().unwrap_or(0.0);
    let needed_hz = SAMPLES_IN_PERIOD * stream.cutoff().cutoff_hz.max(given_hz);
    let factor = ((stream.rate_hz() / needed_hz) as usize).clamp(1, 1000);
    let piece_s = PERIODS_IN_PIECE / stream.cutoff().cutoff_hz;
    let least = (piece_s * stream.rate_hz() / factor as f64) as usize;

    let mut thinning = Thinning::new(factor, Pieces::new(most, least));
    let mut block = MotionBlock::default();
    while stream.next_block(&mut block).map_err(named)? {
        thinning.take(&block).map_err(|source| LogError::recording(&recording.name, source.into()))?;
    }
    let rows = thinning.rows as u64;
    let Some(samples) = thinning.samples(log.joints.len(), log.format.temperature.is_some()) else { return Ok(None) };
    let mut excerpt = samples.into_log(&log.source().label(), &log.joints).map_err(named)?;
    excerpt.format.bridge_gaps = log.format.bridge_gaps;
    // White noise of the log, thinned out below a low-pass.
    let thinned = |noise: &f64| noise / (factor as f64).sqrt();
    let position_noise = stream.position_noise().iter().map(thinned).collect();
    Ok(Some((excerpt, Whole { rows, cutoff: stream.cutoff().clone(), position_noise })))
}

/// Rows at a lower rate.
struct Thinning {
    factor: usize,
    pieces: Pieces,
    segment: Option<usize>,
    /// One for positions, torques and temperatures, and the time of the segment's first sample.
    decimator: Option<(Decimator, f64)>,
    /// Samples of the segment in which some joint's torque does not count, from sample `first_marked` on.
    marked: Vec<bool>,
    first_marked: usize,
    /// Rows of the segment that have come out.
    produced: u64,
    panel: Vec<f64>,
    out: Vec<f64>,
    rows: usize,
    left_out: usize,
}

impl Thinning {
    fn new(factor: usize, pieces: Pieces) -> Self {
        Self {
            factor,
            pieces,
            segment: None,
            decimator: None,
            marked: Vec::new(),
            first_marked: 0,
            produced: 0,
            panel: Vec::new(),
            out: Vec::new(),
            rows: 0,
            left_out: 0,
        }
    }

    /// The next samples of a log.
    fn take(&mut self, block: &MotionBlock) -> Result<(), FilterError> {
        let columns = (block.q.len() + block.tau.len() + block.temperature_c.len()) / block.rows.max(1);
        if self.segment != Some(block.segment) || self.decimator.is_none() {
            let reduced_hz = block.rate_hz / self.factor as f64;
            let filter = DecimationSettings {
                factor: self.factor,
                cutoff_hz: (self.factor > 1).then_some(HALF_GAIN * reduced_hz),
                transition_hz: (self.factor > 1).then_some(TRANSITION * reduced_hz),
                ..DecimationSettings::default()
            };
            self.decimator = Some((Decimator::new(&filter, block.rate_hz, columns)?, block.first_time_s));
            self.segment = Some(block.segment);
            self.pieces.begin();
            self.marked.clear();
            (self.first_marked, self.produced) = (0, 0);
        }
        let Some((decimator, first_time_s)) = &mut self.decimator else { return Ok(()) };
        self.marked.extend((0..block.rows).map(|row| {
            !block.set_aside.is_empty() && (0..block.joints).any(|joint| block.set_aside[joint * block.rows + row])
        }));
        self.panel.clear();
        for values in [&block.q, &block.tau, &block.temperature_c] {
            self.panel.extend_from_slice(values);
        }
        let produced = decimator.push(&self.panel, block.rows, &mut self.out);
        let mut centre = 0;
        for row in 0..produced {
            centre = decimator.input_row(self.produced) as usize;
            self.produced += 1;
            self.rows += 1;
            // A row stands for the samples nearest to it, and counts where at least half of them do.
            let from = centre.saturating_sub(self.factor / 2).max(self.first_marked) - self.first_marked;
            let nearest = &self.marked[from..(centre + self.factor / 2 + 1 - self.first_marked).min(self.marked.len())];
            if 2 * nearest.iter().filter(|marked| **marked).count() > nearest.len() {
                self.left_out += 1;
                continue;
            }
            let time_s = *first_time_s + centre as f64 / block.rate_hz;
            self.pieces.push(time_s, (0..columns).map(|column| self.out[column * produced + row]));
        }
        if produced > 0 {
            let passed = centre.saturating_sub(self.factor).saturating_sub(self.first_marked);
            self.marked.drain(..passed.min(self.marked.len()));
            self.first_marked += passed;
        }
        Ok(())
    }

    /// What has come out, joint by joint; `None` where too many rows had to be left out.
    fn samples(self, joints: usize, has_temperature: bool) -> Option<JointSamples> {
        if self.left_out as f64 > MOST_LEFT_OUT * self.rows as f64 {
            return None;
        }
        let (time_s, mut columns) = self.pieces.columns();
        if columns.len() < 2 * joints {
            return None;
        }
        let temperature_c = columns.split_off(2 * joints);
        let tau = columns.split_off(joints);
        let temperature_c = if has_temperature { temperature_c } else { Vec::new() };
        Some(JointSamples { temperature_c, ..JointSamples::at_times(time_s, columns, tau) })
    }
}

/// Positions as they are on the uniform clock, and no derivatives.
#[derive(Debug)]
struct AsLogged;

impl Differentiator for AsLogged {
    fn name(&self) -> &'static str {
        "as logged"
    }

    fn minimum_samples(&self) -> usize {
        1
    }

    fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
        Some(0)
    }

    fn differentiate_at(&self, _place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        out.q[..q.len()].copy_from_slice(q);
        out.dq[..q.len()].fill(0.0);
        out.ddq[..q.len()].fill(0.0);
        Ok(Vec::new())
    }
}
