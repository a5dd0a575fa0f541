//! Differentiation of the samples on the uniform clock, which are returned as blocks.

use super::MotionStream;
use crate::derivative::{Derivatives, Place, SampleRanges};
use crate::error::RecordingError;
use crate::motion::block::MotionBlock;
use crate::motion::marks::kept_runs;
use core::ops::Range;

/// Samples of a block, and the window of samples that the differentiator needs for them, as indices in `uniform`.
struct Span {
    given: Range<usize>,
    window: Range<usize>,
    /// Whether the segment ends with this block.
    is_last: bool,
}

impl Span {
    fn rows(&self) -> usize {
        self.given.len()
    }

    fn first_in_window(&self) -> usize {
        self.given.start - self.window.start
    }

    fn in_window(&self) -> Range<usize> {
        self.first_in_window()..self.given.end - self.window.start
    }
}

impl MotionStream {
    /// Differentiates and returns the samples up to `end` that were not returned yet; returns false if the trimming of
    /// ends removes all of them.
    pub(super) fn give(&mut self, block: &mut MotionBlock, end: usize, last: bool) -> Result<bool, RecordingError> {
        let context = self.context.unwrap_or(usize::MAX);
        let window_end = if last { self.uniform[0].len() } else { end + context };
        let from = self.done.max(self.trim.saturating_sub(self.passed as usize));
        let span = Span { given: from..end, window: self.done.saturating_sub(context)..window_end, is_last: last };
        let rows = span.rows();
        self.begin_block(block, &span);
        let mut marked = Vec::new();
        if rows > 0 {
            self.set_torques_aside(block, &span);
            self.ignore_torques(block);
            for values in &mut self.window {
                values.resize(span.window.len(), 0.0);
            }
            for joint in 0..self.joints.len() {
                marked.extend(self.differentiate(block, &span, joint)?);
                self.compare(&span, joint)?;
            }
        }
        self.done = end.max(self.done);
        self.forget(context);
        self.given += rows as u64;
        if marked.is_empty() {
            self.in_cut &= rows == 0;
            return Ok(rows > 0);
        }
        self.keep_unmarked(block, &marked, span.first_in_window());
        Ok(false)
    }

    fn begin_block(&self, block: &mut MotionBlock, span: &Span) {
        let (from, rows) = (span.given.start, span.rows());
        let rate = self.clock.rate_hz;
        block.rate_hz = rate;
        block.segment = self.segments + self.cuts;
        block.first_time_s = self.segmenter.first_time_s() + (self.passed as f64 + from as f64) / rate;
        block.rows = rows;
        block.joints = self.joints.len();
        let MotionBlock { q, dq, ddq, tau, tau_smooth, temperature_c, .. } = block;
        for values in [q, dq, ddq, tau, tau_smooth, temperature_c] {
            values.clear();
        }
        block.set_aside.clear();
        let total = (self.passed as usize + self.uniform[0].len()).max(1);
        let settled_from = if span.is_last { self.unsettled.min(total / 4) } else { self.unsettled };
        let first = self.passed as usize + from;
        block.unsettled = [settled_from.saturating_sub(first).min(rows), 0];
        if span.is_last {
            let settled_to = total - settled_from;
            block.unsettled[1] = (first + rows).saturating_sub(settled_to).min(rows);
        }
    }

    fn set_torques_aside(&mut self, block: &mut MotionBlock, span: &Span) {
        let (joints, rows) = (self.joints.len(), span.rows());
        let first = self.passed + span.given.start as u64;
        while self.set_aside.front().is_some_and(|(sample, _)| *sample < first) {
            self.set_aside.pop_front();
        }
        while let Some((sample, joint)) =
            self.set_aside.front().copied().filter(|(sample, _)| *sample < first + rows as u64)
        {
            block.set_aside.resize(joints * rows, false);
            block.set_aside[joint * rows + (sample - first) as usize] = true;
            self.set_aside.pop_front();
        }
    }

    /// Marks the torques in the time intervals that the log ignores.
    fn ignore_torques(&self, block: &mut MotionBlock) {
        let rows = block.rows;
        for ignored in &self.ignored_torque {
            for &joint in &ignored.joints {
                let first_s = block.first_time_s + self.torque_shift.of(joint) / block.rate_hz;
                let inside = ignored.rows(first_s, block.rate_hz, rows);
                if joint < block.joints && !inside.is_empty() {
                    block.set_aside.resize(block.joints * rows, false);
                    block.set_aside[joint * rows..(joint + 1) * rows][inside].fill(true);
                }
            }
        }
    }

    /// Adds the motion, torque and temperature of a joint to a block. Returns the samples for which the differentiator
    /// is not valid, as indices in the window.
    fn differentiate(
        &mut self,
        block: &mut MotionBlock,
        span: &Span,
        joint: usize,
    ) -> Result<SampleRanges, RecordingError> {
        let (joints, rows, rate) = (self.joints.len(), span.rows(), self.clock.rate_hz);
        let [q, dq, ddq, other] = &mut self.window;
        let signal = &self.uniform[joint][span.window.clone()];
        let before = self.passed as f64 + span.window.start as f64;
        let first_time_s = self.segmenter.first_time_s() + before / rate;
        let place = Place { rate_hz: rate, joint, first_time_s };
        let marked = self.differentiator.differentiate_at(place, signal, Derivatives { q, dq, ddq })?;
        block.q.extend_from_slice(&q[span.in_window()]);
        block.dq.extend_from_slice(&dq[span.in_window()]);
        block.ddq.extend_from_slice(&ddq[span.in_window()]);
        let tau = &self.uniform[joints + joint];
        for row in self.torque_shift.append(joint, tau, span.given.clone(), &mut block.tau) {
            block.set_aside.resize(joints * rows, false);
            block.set_aside[joint * rows + row] = true;
        }
        if self.smooth_torque {
            self.differentiator.smooth(rate, &tau[span.window.clone()], other)?;
            self.torque_shift.append(joint, other, span.in_window(), &mut block.tau_smooth);
        }
        let first = 2 * joints + self.velocity.len() + self.acceleration.len();
        if let Some(temperature) = self.uniform.get(first + joint) {
            block.temperature_c.extend_from_slice(&temperature[span.given.clone()]);
        }
        Ok(marked)
    }

    fn compare(&mut self, span: &Span, joint: usize) -> Result<(), RecordingError> {
        let rate = self.clock.rate_hz;
        let [_, dq, ddq, other] = &mut self.window;
        let channel = 2 * self.joints.len() + joint;
        if let Some(comparison) = self.velocity.get_mut(joint) {
            self.differentiator.smooth(rate, &self.uniform[channel][span.window.clone()], other)?;
            comparison.add(&dq[span.in_window()], &other[span.in_window()]);
        }
        if let Some(comparison) = self.acceleration.get_mut(joint) {
            let channel = channel + self.velocity.len();
            self.differentiator.smooth(rate, &self.uniform[channel][span.window.clone()], other)?;
            comparison.add(&ddq[span.in_window()], &other[span.in_window()]);
        }
        Ok(())
    }

    fn forget(&mut self, context: usize) {
        let unneeded = self.done.saturating_sub(context);
        if unneeded > 0 {
            self.uniform.iter_mut().for_each(|channel| drop(channel.drain(..unneeded)));
            self.done -= unneeded;
            self.passed += unneeded as u64;
        }
    }

    /// Omits the marked samples; the other samples become separate pieces. `first` is the index of the block's first
    /// row in the window to which the marks belong.
    fn keep_unmarked(&mut self, block: &MotionBlock, marked: &[Range<usize>], first: usize) {
        let runs = kept_runs(marked, first, block.rows);
        let kept: usize = runs.iter().map(ExactSizeIterator::len).sum();
        self.unmapped += (block.rows - kept) as u64;
        self.given -= (block.rows - kept) as u64;
        for run in &runs {
            // A range that begins at the block's start continues the previous piece.
            self.cuts += usize::from(run.start > 0 || self.in_cut);
            let mut kept = block.part(run.clone());
            kept.segment = self.segments + self.cuts;
            self.waiting.push_back(kept);
            self.in_cut = run.end < block.rows;
        }
        self.in_cut |= runs.is_empty() && block.rows > 0;
    }
}
