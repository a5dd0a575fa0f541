//! Invalid samples of a block of a motion.

use core::ops::Range;
use dynident_recording::MotionBlock;
use std::borrow::Cow;

/// Marks of invalid samples among `from .. from + samples` for the joint at `place`: invalid torque, and samples whose
/// motion the differentiator extrapolated at an end of a piece. Empty if all are valid.
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

/// Samples of a panel without the end effects of the differentiator, as indices in the panel of `samples` samples from
/// sample `from` of the block.
pub(super) fn settled(block: &MotionBlock, from: usize, samples: usize) -> Range<usize> {
    let [begin, end] = block.unsettled;
    let inside = begin..block.rows.saturating_sub(end);
    let clamped = |row: usize| row.clamp(from, from + samples) - from;
    clamped(inside.start)..clamped(inside.end).max(clamped(inside.start))
}
