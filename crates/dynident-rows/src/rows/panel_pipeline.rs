//! Two-thread pipeline of a pass: one thread reads samples and computes panels, another filters them.

use super::samples::SamplePanels;
use crate::recording::LogError;
use core::borrow::Borrow;
use dynident_recording::MotionBlock;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Maximum number of panels in the queue.
const MAX_QUEUED_PANELS: usize = 4;

enum MakerOutput<B> {
    Panels(SamplePanels),
    /// A block whose panels were all sent already.
    Block(B),
}

/// Runs a pass in two threads with the same order of work as one thread.
///
/// A new thread takes blocks from `next` and computes their panels with `make`. `next` can reuse the memory of a
/// returned block; `make` returns the first sample of the next panel. A bounded queue limits the memory. The calling
/// thread passes each panel to `filter`. After the last panel of a block, it passes the block to `keep`, which returns
/// blocks that it does not store.
pub(super) fn pipelined_panels<B: Borrow<MotionBlock> + Send>(
    mut next: impl FnMut(Option<B>) -> Result<Option<B>, LogError> + Send,
    mut make: impl FnMut(&MotionBlock, usize, &mut SamplePanels) -> Result<usize, LogError> + Send,
    mut filter: impl FnMut(&SamplePanels) -> Result<(), LogError>,
    mut keep: impl FnMut(B) -> Option<B>,
) -> Result<(), LogError> {
    let (made_to, made): (SyncSender<MakerOutput<B>>, Receiver<MakerOutput<B>>) = sync_channel(MAX_QUEUED_PANELS);
    let (used_to, used) = sync_channel(MAX_QUEUED_PANELS + 1);
    let (unkept_to, unkept) = sync_channel(MAX_QUEUED_PANELS + 1);
    std::thread::scope(|scope| {
        let maker = scope.spawn(move || -> Result<(), LogError> {
            while let Some(block) = next(unkept.try_recv().ok())? {
                let mut from = 0;
                while from < block.borrow().rows {
                    let mut panels: SamplePanels = used.try_recv().unwrap_or_default();
                    from = make(block.borrow(), from, &mut panels)?;
                    if made_to.send(MakerOutput::Panels(panels)).is_err() {
                        // The filtering thread has stopped on an error.
                        return Ok(());
                    }
                }
                if made_to.send(MakerOutput::Block(block)).is_err() {
                    return Ok(());
                }
            }
            Ok(())
        });
        let mut outcome = Ok(());
        for made in made {
            // If the return channel is full, the memory of the block is released.
            match made {
                MakerOutput::Panels(panels) => {
                    outcome = filter(&panels);
                    drop(used_to.try_send(panels));
                }
                MakerOutput::Block(block) => drop(keep(block).map(|block| unkept_to.try_send(block))),
            }
            if outcome.is_err() {
                break;
            }
        }
        // The receiver is dropped at the end of the loop, so a blocked sender can finish.
        match maker.join() {
            Ok(made) => outcome.and(made),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
