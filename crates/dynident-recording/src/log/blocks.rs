//! Reads the blocks of a log one after another, optionally in a separate thread.

use super::reader::{LinesDropped, LogReader, RawBlock};
use crate::error::RecordingError;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

/// Capacity of the queue. It is large enough that neither thread waits for a slow block of the other.
const QUEUE_BLOCKS: usize = 4;

#[derive(Debug)]
enum Source {
    Inline(Box<LogReader>),
    Thread { blocks: Receiver<Read>, thread: Option<JoinHandle<()>> },
}

/// A block or the end of the log, and the rows omitted so far.
type Read = (Result<Option<RawBlock>, RecordingError>, LinesDropped);

#[derive(Debug)]
pub(crate) struct RawBlocks {
    label: String,
    source: Source,
    dropped: LinesDropped,
}

impl RawBlocks {
    pub(crate) fn new(reader: LogReader) -> Self {
        let label = reader.label().to_owned();
        Self { label, source: Source::Inline(Box::new(reader)), dropped: LinesDropped::default() }
    }

    /// Starts a separate thread that reads ahead.
    pub(crate) fn in_thread(self) -> Self {
        let Source::Inline(mut reader) = self.source else { return self };
        let (give, blocks) = sync_channel(QUEUE_BLOCKS);
        let thread = std::thread::spawn(move || {
            loop {
                let read = next_of(&mut reader);
                let is_last = !matches!(read, Ok(Some(_)));
                // The receiver no longer exists if the pass ended before the log.
                if give.send((read, reader.dropped().clone())).is_err() || is_last {
                    return;
                }
            }
        });
        Self { source: Source::Thread { blocks, thread: Some(thread) }, ..self }
    }

    /// The next rows; `None` at the end.
    ///
    /// # Errors
    /// Errors of [`LogReader::next_block`].
    pub(crate) fn next_block(&mut self) -> Result<Option<RawBlock>, RecordingError> {
        let (read, dropped) = match &mut self.source {
            Source::Inline(reader) => (next_of(reader), reader.dropped().clone()),
            Source::Thread { blocks, thread } => {
                let Ok(read) = blocks.recv() else {
                    if let Some(Err(panic)) = thread.take().map(JoinHandle::join) {
                        std::panic::resume_unwind(panic);
                    }
                    return Ok(None);
                };
                read
            }
        };
        self.dropped = dropped;
        read
    }

    pub(crate) fn label(&self) -> &str {
        &self.label
    }

    pub(crate) fn dropped(&self) -> &LinesDropped {
        &self.dropped
    }
}

fn next_of(reader: &mut LogReader) -> Result<Option<RawBlock>, RecordingError> {
    let mut block = RawBlock::default();
    Ok(reader.next_block(&mut block)?.then_some(block))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::JointSamples;

    #[test]
    fn a_thread_reads_the_same_blocks() {
        let mut q: Vec<f64> = (0..20_000).map(f64::from).collect();
        q[7] = f64::NAN;
        let samples = JointSamples::at_rate(10.0, vec![q.clone()], vec![q]);
        let mut log = samples.into_log("log", &["elbow".to_owned()]).unwrap();
        log.format.missing = crate::log::Missing::Drop;
        let blocks = || RawBlocks::new(LogReader::open(&log).unwrap());
        let (mut here, mut in_thread) = (blocks(), blocks().in_thread());
        loop {
            let (one, other) = (here.next_block().unwrap(), in_thread.next_block().unwrap());
            assert_eq!(one, other);
            if one.is_none() {
                break;
            }
        }
        assert_eq!((here.dropped(), here.dropped().missing), (in_thread.dropped(), 1));
        assert_eq!(in_thread.next_block().unwrap(), None);
        // A pass that ends before the log does not leave a waiting thread.
        drop(blocks().in_thread());
    }
}
