//! Cleaning of the rows of a log, before velocities and accelerations are computed.
//!
//! [`CleanRows`] reads two blocks ahead. It marks single torque samples that are far from their neighbours (`outliers`)
//! and torque that stays constant while its joint moves (`held`: repeated or saturated), so that no row of a fit uses
//! these samples. It replaces single spikes of a position (`spikes`), assigns each row its place on the clock, and
//! fills and marks holes that are short compared with the motion (`holes`). The report lists these corrections.

mod held;
mod holes;
mod outliers;
mod set_aside;
mod settings;
mod spikes;

pub use set_aside::{Reason, RejectedSamples};
pub use settings::CleaningSettings;
pub(crate) use spikes::replace_spikes;

use crate::clock::timeline::{Places, Timeline};
use crate::error::RecordingError;
use crate::log::{LogReader, RawBlock, RawBlocks};
use holes::{Filled, PastRows, fill, last_rows};
use set_aside::Tally;
use std::collections::VecDeque;

#[derive(Debug, Default)]
pub(crate) struct CleanBlock {
    pub(crate) raw: RawBlock,
    pub(crate) places: Places,
    /// For each joint, the rows whose torque is ignored, ascending.
    pub(crate) marked: Vec<Vec<usize>>,
}

#[derive(Debug)]
pub(crate) struct CleanRows {
    reader: RawBlocks,
    timeline: Timeline,
    /// Limits of the detection of invalid samples; `None` keeps all samples.
    limits: Option<CleaningSettings>,
    joints: usize,
    /// The block that was read but not cleaned yet.
    waiting: Option<RawBlock>,
    /// Blocks that were cleaned but not placed on the clock yet.
    cleaned: VecDeque<(RawBlock, Vec<Vec<usize>>)>,
    ended: bool,
    /// Last torques as logged, and last positions after cleaning.
    tail: [Vec<Vec<f64>>; 2],
    /// Smallest and largest torque of each joint, and the difference of its 95 % and 5 % quantiles.
    extremes: Vec<[f64; 2]>,
    spread: Vec<f64>,
    before: PastRows,
    tally: Tally,
    bridged: [u64; 2],
}

impl CleanRows {
    pub(crate) fn new(
        reader: LogReader,
        timeline: Timeline,
        joints: &[String],
        limits: Option<CleaningSettings>,
    ) -> Self {
        Self {
            reader: RawBlocks::new(reader),
            timeline,
            limits,
            joints: joints.len(),
            waiting: None,
            cleaned: VecDeque::new(),
            ended: false,
            tail: [vec![Vec::new(); joints.len()], vec![Vec::new(); joints.len()]],
            extremes: vec![[f64::INFINITY, f64::NEG_INFINITY]; joints.len()],
            spread: vec![0.0; joints.len()],
            before: PastRows::default(),
            tally: Tally::new(joints),
            bridged: [0; 2],
        }
    }

    /// Starts a separate thread that reads rows ahead.
    pub(crate) fn read_in_thread(self) -> Self {
        Self { reader: self.reader.in_thread(), ..self }
    }

    pub(crate) fn reader(&self) -> &RawBlocks {
        &self.reader
    }

    pub(crate) fn set_aside(&self) -> Vec<RejectedSamples> {
        self.tally.all()
    }

    /// Number of filled holes, and of the samples in them.
    pub(crate) fn bridged(&self) -> [u64; 2] {
        self.bridged
    }

    /// The next cleaned rows; `None` at the end of the log. `read` is called with every block as logged.
    pub(crate) fn next_block(&mut self, read: &mut dyn FnMut(&RawBlock)) -> Result<Option<CleanBlock>, RecordingError> {
        while self.cleaned.len() < 2 && !(self.ended && self.waiting.is_none()) {
            let next = self.read(read)?;
            if let Some(block) = core::mem::replace(&mut self.waiting, next) {
                let cleaned = self.clean(block);
                self.cleaned.push_back(cleaned);
            }
        }
        let Some((raw, marked)) = self.cleaned.pop_front() else { return Ok(None) };
        let next = self.cleaned.front().map(|(next, _)| next);
        let places = self.timeline.places(&raw, next);
        let block = if places.holes.is_empty() {
            CleanBlock { raw, places, marked }
        } else {
            let holes = places.holes.len() as u64;
            let Filled { raw, places, missing: filled, new_index } = fill(&self.before, &raw, &places, next);
            // A hole that could not be filled starts a new piece.
            self.bridged[0] += if filled.is_empty() { 0 } else { holes };
            self.bridged[1] += filled.len() as u64;
            let marked = marked.into_iter().map(|marked| {
                let mut rows: Vec<usize> = marked.into_iter().map(|row| new_index[row]).chain(filled.clone()).collect();
                rows.sort_unstable();
                rows
            });
            CleanBlock { marked: marked.collect(), raw, places }
        };
        self.before = last_rows(&block.raw, &block.places);
        Ok(Some(block))
    }

    fn read(&mut self, read: &mut dyn FnMut(&RawBlock)) -> Result<Option<RawBlock>, RecordingError> {
        let next = if self.ended { None } else { self.reader.next_block()? };
        self.ended = next.is_none();
        let Some(block) = next else { return Ok(None) };
        read(&block);
        for (joint, tau) in block.tau.iter().enumerate() {
            let [low, high] = &mut self.extremes[joint];
            for value in tau {
                (*low, *high) = (low.min(*value), high.max(*value));
            }
        }
        Ok(Some(block))
    }

    fn clean(&mut self, mut block: RawBlock) -> (RawBlock, Vec<Vec<usize>>) {
        let rows = block.rows();
        self.tally.rows += rows as u64;
        let mut marked = vec![Vec::new(); self.joints];
        let Some(limits) = &self.limits else { return (block, marked) };
        let next = self.waiting.as_ref();
        for (joint, marked) in marked.iter_mut().enumerate() {
            // Positions are cleaned first, because the test for held torque uses them.
            let joined = |tail: &[f64], own: &[f64], next: Option<&[f64]>, most: usize| -> Vec<f64> {
                let ahead = next.map_or(&[][..], |next| &next[..next.len().min(most)]);
                [tail, own, ahead].concat()
            };
            let [tau_tail, q_tail] = &mut self.tail;
            let next_q = next.map(|next| &next.q[joint][..]);
            let mut q = joined(&q_tail[joint], &block.q[joint], next_q, usize::MAX);
            let own = q_tail[joint].len()..q_tail[joint].len() + rows;
            let seen = own.end + held::MAX_WINDOW.min(q.len() - own.end);
            let spikes = replace_spikes(&mut q[..seen], own.clone(), limits);
            for &at in &spikes {
                let index = at - own.start;
                let old = core::mem::replace(&mut block.q[joint][index], q[at]);
                self.tally.add((joint, Reason::Spike), &block, index, [old, q[at]], 1);
            }

            let next_tau = next.map(|next| &next.tau[joint][..]);
            let tau = joined(&tau_tail[joint], &block.tau[joint], next_tau, usize::MAX);
            let spread = spread(tau[own.start.saturating_sub(held::MAX_WINDOW)..own.end].to_vec());
            self.spread[joint] = self.spread[joint].max(spread);
            let held_runs = held::held_runs(&tau, &q, self.extremes[joint], limits);
            let single = outliers::outliers(&tau[..seen], own.clone(), self.spread[joint], limits);
            marked.extend(single.iter().map(|at| at - own.start));
            for run in &held_runs {
                let unmeasured = run.unmeasured();
                let repeated = unmeasured.start.max(own.start)..run.to.min(own.end);
                marked.extend(repeated.clone().map(|at| at - own.start));
            }
            marked.sort_unstable();
            marked.dedup();
            keep_last(&mut tau_tail[joint], &block.tau[joint]);
            keep_last(&mut q_tail[joint], &block.q[joint]);
            if marked.is_empty() {
                continue;
            }
            let mut repaired = tau[own.start.saturating_sub(1)..seen].to_vec();
            let shift = own.start - own.start.saturating_sub(1);
            let places: Vec<usize> = marked.iter().map(|index| index + shift).collect();
            outliers::interpolate_marked(&mut repaired, &places);
            block.tau[joint].copy_from_slice(&repaired[shift..shift + rows]);
            for &at in &single {
                let index = at - own.start;
                let values = [tau[at], block.tau[joint][index]];
                self.tally.add((joint, Reason::Outlier), &block, index, values, 1);
            }
            for run in &held_runs {
                let unmeasured = run.unmeasured();
                let repeated = unmeasured.start.max(own.start)..run.to.min(own.end);
                if !repeated.is_empty() {
                    let begins = u64::from(unmeasured.start >= own.start);
                    let index = repeated.start - own.start;
                    let values = [tau[repeated.start]; 2];
                    let reason = if run.saturated { Reason::Saturated } else { Reason::Held };
                    self.tally.add_run((joint, reason), &block, index, values, (repeated.len() as u64, begins));
                }
            }
        }
        (block, marked)
    }
}

/// Difference of the 95 % and the 5 % quantile.
fn spread(mut values: Vec<f64>) -> f64 {
    let part = values.len() / 20;
    let above = values.len() - 1 - part;
    let (below, largest, _) = values.select_nth_unstable_by(above, f64::total_cmp);
    let largest = *largest;
    // With a single sample both quantiles are the same value.
    let smallest = if part < above { *below.select_nth_unstable_by(part, f64::total_cmp).1 } else { largest };
    largest - smallest
}

fn keep_last(tail: &mut Vec<f64>, own: &[f64]) {
    tail.extend_from_slice(own);
    let unneeded = tail.len().saturating_sub(held::MAX_WINDOW);
    tail.drain(..unneeded);
}
