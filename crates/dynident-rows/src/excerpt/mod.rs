//! Excerpts of long logs for model selection.
//!
//! Dynident selects drive inertia, cut-off, friction and lag in dozens of passes over the logs. After some minutes of
//! recording, more rows improve this selection little. It therefore uses an excerpt of bounded length. First the rate
//! is reduced (a low-pass, then every n-th row) as far as the motion allows. If the excerpt is still too long, it keeps
//! pieces that are spread evenly over the log ([`Pieces`](pieces::Pieces)). The final fit uses all rows and reads a
//! long log once.

mod pieces;

use crate::execution::Execution;
use crate::logs::RowSettings;
use crate::recording::{LogError, Recording, Samples, Whole};
use dynident_recording::{
    DecimationSettings, Decimator, Derivatives, Differentiator, FilterError, JointSamples, Log, MotionBlock,
    MotionSettings, MotionStream, Place, RecordingError, SampleRanges,
};
use pieces::Pieces;

/// Largest total number of training rows that are used without an excerpt; also the maximum size of an excerpt. At
/// 1 kHz this is about three minutes, several times the length of the public recordings.
const MAX_TOTAL_ROWS: u64 = 200_000;
/// Minimum number of samples of an excerpt per period of the positions' cut-off frequency. The change of friction at a
/// reversal is much shorter than this period: with 100 samples, the Stribeck effect of a simulated arm was no longer
/// identifiable; with 400 samples it was.
const MIN_SAMPLES_PER_PERIOD: f64 = 400.0;
/// Half-gain frequency of the low-pass before decimation, relative to the decimated rate. Frequencies below 0.4 of that
/// rate pass unchanged.
const HALF_GAIN_RATIO: f64 = 0.45;
const TRANSITION_RATIO: f64 = 0.1;
/// Minimum number of rows kept of each log; shorter logs are kept whole.
const MIN_ROWS_PER_LOG: u64 = 20_000;
/// Minimum length of a piece in periods of the cut-off; the filters' end effects last one or two periods.
const MIN_PERIODS_PER_PIECE: f64 = 30.0;
/// Maximum share of rows in which the torque of some joint is invalid. Above it no excerpt is made, because an excerpt
/// drops such rows for all joints.
const MAX_REJECTED_RATIO: f64 = 0.1;

/// Replaces the long recordings among `training` by excerpts. `None` if their total length is small, if there is
/// nothing to select (`has_choices` states whether drive inertia or friction is automatic), or if a setting depends on
/// the sample rate: the decimation factor of the parallel filter, or a differentiator without a cut-off or with a
/// reference.
///
/// # Errors
/// A recording cannot be read.
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
    if all <= MAX_TOTAL_ROWS {
        return Ok(None);
    }
    let mut found = recordings.to_vec();
    let mut changed = false;
    for &index in training {
        let share = ((MAX_TOTAL_ROWS as f64 * rows(index) as f64 / all as f64) as u64).max(MIN_ROWS_PER_LOG) as usize;
        if let Samples::Log(log) = &recordings[index].samples
            && rows(index) > MIN_ROWS_PER_LOG
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

/// Excerpt of about `most` rows of a log. If `beside` is true, a separate thread reads the log. `None` if too many rows
/// are invalid.
fn excerpt(
    recording: &Recording,
    log: &Log,
    settings: &MotionSettings,
    most: usize,
    beside: bool,
) -> Result<Option<(Log, Whole)>, LogError> {
    let named = |source: RecordingError| LogError::recording(&recording.name, source);
    // Logged velocities and accelerations are only used for comparison. Lag and ends of the log are treated in later
    // passes.
    let mut read = log.clone();
    (read.format.velocity, read.format.acceleration) = (None, None);
    let (keep_outliers, limits) = (settings.keep_outliers, settings.limits.clone());
    let motion = MotionSettings { keep_outliers, limits, ..MotionSettings::default() };
    let build = |_: &_| -> Result<Box<dyn Differentiator>, FilterError> { Ok(Box::new(AsLogged)) };
    let stream = MotionStream::with_differentiator(&read, &motion, build).map_err(named)?.without_channels();
    let mut stream = if beside { stream.read_beside() } else { stream };
    let given_hz = settings.differentiator.cutoff_hz().unwrap_or(0.0);
    let needed_hz = MIN_SAMPLES_PER_PERIOD * stream.cutoff().cutoff_hz.max(given_hz);
    let factor = ((stream.rate_hz() / needed_hz) as usize).clamp(1, 1000);
    let piece_s = MIN_PERIODS_PER_PIECE / stream.cutoff().cutoff_hz;
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
    // White noise of the log after the low-pass.
    let thinned = |noise: &f64| noise / (factor as f64).sqrt();
    let position_noise = stream.position_noise().iter().map(thinned).collect();
    Ok(Some((excerpt, Whole { rows, cutoff: stream.cutoff().clone(), position_noise })))
}

struct Thinning {
    factor: usize,
    pieces: Pieces,
    segment: Option<usize>,
    /// Filter of positions, torques and temperatures, and the time of the first sample of the segment.
    decimator: Option<(Decimator, f64)>,
    /// For each sample of the segment from `first_marked` on, whether the torque of some joint is invalid.
    marked: Vec<bool>,
    first_marked: usize,
    produced: u64,
    panel: Vec<f64>,
    out: Vec<f64>,
    rows: usize,
    rejected: usize,
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
            rejected: 0,
        }
    }

    fn take(&mut self, block: &MotionBlock) -> Result<(), FilterError> {
        let columns = (block.q.len() + block.tau.len() + block.temperature_c.len()) / block.rows.max(1);
        if self.segment != Some(block.segment) || self.decimator.is_none() {
            let reduced_hz = block.rate_hz / self.factor as f64;
            let filter = DecimationSettings {
                factor: self.factor,
                cutoff_hz: (self.factor > 1).then_some(HALF_GAIN_RATIO * reduced_hz),
                transition_hz: (self.factor > 1).then_some(TRANSITION_RATIO * reduced_hz),
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
            // A row represents the samples nearest to it. It is valid if at least half of these samples are valid.
            let from = centre.saturating_sub(self.factor / 2).max(self.first_marked) - self.first_marked;
            let nearest = &self.marked[from..(centre + self.factor / 2 + 1 - self.first_marked).min(self.marked.len())];
            if 2 * nearest.iter().filter(|marked| **marked).count() > nearest.len() {
                self.rejected += 1;
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

    /// Samples of the excerpt; `None` if too many rows were rejected.
    fn samples(self, joints: usize, has_temperature: bool) -> Option<JointSamples> {
        if self.rejected as f64 > MAX_REJECTED_RATIO * self.rows as f64 {
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

/// Returns positions on the uniform clock, with zero derivatives.
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
