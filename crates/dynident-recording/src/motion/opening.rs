//! Properties of a log that are estimated from its first rows: clock, cut-off, position noise.

use super::block::{ImportLimits, MotionSettings};
use crate::cleaning::replace_spikes;
use crate::clock::segments::{PlacedRows, Segmenter};
use crate::clock::timeline::Timeline;
use crate::clock::{Clock, clock};
use crate::error::RecordingError;
use crate::filter::NoiseSpectra;
use crate::filter::cutoff::{CutoffChoice, MAX_CUTOFF_SAMPLES, cutoff_within};
use crate::log::{Log, LogReader, RawBlock};
use crate::quantisation::quantisation_step;
use crate::report::rows_to_a_value;
use std::sync::Arc;

#[derive(Debug)]
pub(super) struct Opening {
    pub(super) clock: Clock,
    pub(super) cutoff: CutoffChoice,
    pub(super) noise: NoiseSpectra,
    /// Quantisation steps of positions and torques, joint by joint.
    pub(super) position_steps: Vec<Option<f64>>,
    pub(super) torque_steps: Vec<Option<f64>>,
    /// Number of rows per new position, and per new torque, if a recorder repeats values.
    pub(super) rows_to_a_value: [Option<u64>; 2],
}

impl Opening {
    /// Estimates these properties for `log`; its first rows are read only once for all passes.
    ///
    /// # Errors
    /// If the log has no torque, the rows cannot be read, or they do not determine a rate.
    pub(super) fn of(log: &Log, settings: &MotionSettings) -> Result<Arc<Self>, RecordingError> {
        log.format.require_torque()?;
        let MotionSettings { keep_outliers, limits, .. } = settings;
        log.found_once(&(*keep_outliers, limits.clone()), || Self::read(log, *keep_outliers, limits))
    }

    fn read(log: &Log, keep_outliers: bool, limits: &ImportLimits) -> Result<Self, RecordingError> {
        let format = &log.format;
        let (mut first, time_label) = FirstRows::of(log)?;
        let rows_to_a_value = [&first.q, &first.tau].map(|channels| rows_to_a_value(channels));
        if !keep_outliers {
            for q in &mut first.q {
                let rows = 0..q.len();
                replace_spikes(q, rows, &limits.cleaning);
            }
        }
        let clock = match format.rate_hz {
            Some(rate_hz) => Clock {
                rate_hz,
                uniform: true,
                median_step_s: rate_hz.recip(),
                repeats_rows: false,
                misfit_uniform: None,
                misfit_stamps: None,
                drift_steps: None,
                smoothing_rows: 0,
                evidence: "even spacing: the rate is given, the log has no stamps".to_owned(),
            },
            None => clock(format.clock, &first.time_s, &first.row, &first.q, format.max_gap_steps, &limits.clock)
                .map_err(|reason| RecordingError::NoRate { log: log.source().label(), column: time_label, reason })?,
        };
        let longest = first.longest_segment(Timeline::new(&clock, format.max_gap_steps, 0.0));
        let steps = |columns: &[Vec<f64>]| columns.iter().map(|values| quantisation_step(values)).collect();
        Ok(Self {
            cutoff: cutoff_within(&longest, clock.rate_hz, &limits.cutoff),
            noise: NoiseSpectra::of(&longest, clock.rate_hz),
            position_steps: steps(&first.q),
            torque_steps: steps(&first.tau),
            rows_to_a_value,
            clock,
        })
    }
}

/// The first [`MAX_CUTOFF_SAMPLES`] rows of a log, or a few more.
struct FirstRows {
    row: Vec<u64>,
    time_s: Vec<f64>,
    q: Vec<Vec<f64>>,
    tau: Vec<Vec<f64>>,
}

impl FirstRows {
    /// The first rows, and the name of the time column for messages.
    fn of(log: &Log) -> Result<(Self, String), RecordingError> {
        let mut reader = LogReader::open(log)?;
        let columns = || vec![Vec::new(); log.joints.len()];
        let mut first = Self { row: Vec::new(), time_s: Vec::new(), q: columns(), tau: columns() };
        let mut raw = RawBlock::default();
        while first.row.len() < MAX_CUTOFF_SAMPLES && reader.next_block(&mut raw)? {
            first.row.extend_from_slice(&raw.row);
            first.time_s.extend_from_slice(&raw.time_s);
            for (all, block) in first.q.iter_mut().zip(&raw.q).chain(first.tau.iter_mut().zip(&raw.tau)) {
                all.extend_from_slice(block);
            }
        }
        Ok((first, reader.time_label()))
    }

    /// Positions of the longest uninterrupted piece, on the uniform clock.
    fn longest_segment(&self, mut timeline: Timeline) -> Vec<Vec<f64>> {
        let joints = self.q.len();
        let rows = RawBlock { row: self.row.clone(), time_s: self.time_s.clone(), ..RawBlock::default() };
        let places = timeline.places(&rows, None);
        let rows = PlacedRows { time_s: &self.time_s, steps: &places.steps, begins: &places.begins };
        let mut segmenter = Segmenter::new(joints);
        let mut longest = vec![Vec::new(); joints];
        let mut at = 0;
        while at < self.row.len() {
            let mut piece = vec![Vec::new(); joints];
            at = segmenter.feed(rows, at, &mut piece, || self.q.iter());
            segmenter.close(&mut piece);
            segmenter.reopen();
            if piece.first().map_or(0, Vec::len) > longest.first().map_or(0, Vec::len) {
                longest = piece;
            }
        }
        longest
    }
}
