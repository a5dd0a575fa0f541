//! Reading beside computing: motion blocks from a thread of their own.

use crate::recording::LogError;
use dynident_recording::{MotionBlock, MotionStream, RecordingError};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Motion blocks that may wait between reader and computer.
const WAITING: usize = 3;

/// An error on either side of the channel.
pub(crate) enum Side {
    Reading(RecordingError),
    Computing(LogError),
}

impl Side {
    pub(crate) fn named(self, log: &str) -> LogError {
        match self {
            Self::Reading(source) => LogError::recording(log, source),
            Self::Computing(error) => error,
        }
    }
}

/// Reads on a thread of its own, at most so many blocks ahead that memory is bounded; `take` returns blocks that it
/// does not keep. The order of work is the same as without the thread.
pub(crate) fn read_beside(
    stream: &mut MotionStream,
    mut take: impl FnMut(MotionBlock) -> Result<Option<MotionBlock>, LogError>,
) -> Result<(), Side> {
    let (full_to, full): (SyncSender<MotionBlock>, Receiver<MotionBlock>) = sync_channel(WAITING);
    let (empty_to, empty) = sync_channel(WAITING + 1);
    std::thread::scope(|scope| {
        let reader = scope.spawn(move || {
            loop {
                let mut block: MotionBlock = empty.try_recv().unwrap_or_default();
                if !stream.next_block(&mut block)? {
                    return Ok(());
                }
                if full_to.send(block).is_err() {
                    // The computing side has stopped on an error of its own.
                    return Ok(());
                }
            }
        });
        let mut outcome = Ok(());
        for block in full {
            match take(block) {
                // A full return channel only means that the block is dropped.
                Ok(Some(block)) => drop(empty_to.try_send(block)),
                Ok(None) => {}
                Err(error) => {
                    outcome = Err(Side::Computing(error));
                    break;
                }
            }
        }
        // Dropping the receiver (above, by the loop) lets a blocked reader go on to its end.
        match reader.join() {
            Ok(read) => outcome.and(read.map_err(Side::Reading)),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
