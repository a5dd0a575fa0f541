//! Invalid samples of a block of a motion.

use core::ops::Range;
use dynident_recording::MotionBlock;
use std::borrow::Cow;

/// For each sample of `from .. from + samples`, whether it is invalid for the joint at `place`. Invalid are samples
/// with invalid torque, and samples at an end of a piece whose motion the differentiator extrapolated. Empty if all are
/// valid.
pub fn set_aside(block: &MotionBlock, place: usize, from: usize, samples: usize) -> Cow<'_, [bool]> {
    let first = place * block.rows + from;
    let marked = block.set_aside.get(first..first + samples).unwrap_or_default();
    let settled = settled(block, from, samples);
    if settled.len() == samples {
        return Cow::Borrowed(marked);
    }
    let is_marked = |row: usize| marked.get(row).copied().unwrap_or(false) || !settled.contains(&row);
    Cow::Owned((0..samples).map(is_marked).collect())
}

/// Samples of a panel that are free of end effects of the differentiator, as indices in the panel. The panel contains
/// `samples` samples from sample `from` of the block.
pub(super) fn settled(block: &MotionBlock, from: usize, samples: usize) -> Range<usize> {
    let [begin, end] = block.unsettled;
    let inside = begin..block.rows.saturating_sub(end);
    let clamped = |row: usize| row.clamp(from, from + samples) - from;
    clamped(inside.start)..clamped(inside.end).max(clamped(inside.start))
}
