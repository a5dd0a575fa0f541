//! Two halves of a pass beside each other: one thread reads samples and makes their panels, another filters them.

use super::samples::SamplePanels;
use crate::recording::LogError;
use core::borrow::Borrow;
use dynident_recording::MotionBlock;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Panels that may wait between the two.
const WAITING: usize = 4;

/// What the first half gives to the second.
enum Made<B> {
    Panels(SamplePanels),
    /// A block all of whose panels have gone before.
    Block(B),
}

/// Takes blocks of `next` (which may use the memory of one that is not needed any more), makes their panels by `make`
/// (from a sample on; it returns where the next begin) on a thread of its own, at most so many ahead that memory is
/// bounded, and gives each to `filter` here; behind its last panels the block itself to `keep`, which returns blocks
/// that it does not keep. The order of work is the same as without the thread.
///
/// # Errors
/// The first of either side.
pub(super) fn panels_beside<B: Borrow<MotionBlock> + Send>(
    mut next: impl FnMut(Option<B>) -> Result<Option<B>, LogError> + Send,
    mut make: impl FnMut(&MotionBlock, usize, &mut SamplePanels) -> Result<usize, LogError> + Send,
    mut filter: impl FnMut(&SamplePanels) -> Result<(), LogError>,
    mut keep: impl FnMut(B) -> Option<B>,
) -> Result<(), LogError> {
    let (made_to, made): (SyncSender<Made<B>>, Receiver<Made<B>>) = sync_channel(WAITING);
    let (used_to, used) = sync_channel(WAITING + 1);
    let (unkept_to, unkept) = sync_channel(WAITING + 1);
    std::thread::scope(|scope| {
        let maker = scope.spawn(move || -> Result<(), LogError> {
            while let Some(block) = next(unkept.try_recv().ok())? {
                let mut from = 0;
                while from < block.borrow().rows {
                    let mut panels: SamplePanels = used.try_recv().unwrap_or_default();
                    from = make(block.borrow(), from, &mut panels)?;
                    if made_to.send(Made::Panels(panels)).is_err() {
                        // The filtering side has stopped on an error of its own.
                        return Ok(());
                    }
                }
                if made_to.send(Made::Block(block)).is_err() {
                    return Ok(());
                }
            }
            Ok(())
        });
        let mut outcome = Ok(());
        for made in made {
            // A full channel back only means that the memory is dropped.
            match made {
                Made::Panels(panels) => {
                    outcome = filter(&panels);
                    drop(used_to.try_send(panels));
                }
                Made::Block(block) => drop(keep(block).map(|block| unkept_to.try_send(block))),
            }
            if outcome.is_err() {
                break;
            }
        }
        // Dropping the receiver (above, by the loop) lets a blocked maker go on to its end.
        match maker.join() {
            Ok(made) => outcome.and(made),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
