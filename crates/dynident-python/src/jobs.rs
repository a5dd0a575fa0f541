//! Jobs in a separate thread: other Python threads continue, Ctrl-C ends the job, progress is reported.

use crate::callables::RaisedError;
use crate::errors;
use dynident::iteration::StopSignal;
use dynident::{Error, Progress};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Interval of the check for Ctrl-C and of progress reports.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Stack size of a job's thread, as large as that of a main thread.
const STACK_BYTES: usize = 8 << 20;

struct Cancelled;

#[derive(Default)]
pub(crate) struct Watch {
    cancelled: AtomicBool,
    stage: Mutex<Option<(String, Option<u64>)>>,
    done: AtomicU64,
}

impl Watch {
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Shows a stage with an unknown total; `done` grows.
    pub(crate) fn show(&self, stage: &str, done: u64) {
        if let Ok(mut current) = self.stage.lock()
            && current.as_ref().is_none_or(|(known, _)| known != stage)
        {
            *current = Some((stage.to_owned(), None));
        }
        self.done.store(done, Ordering::Relaxed);
    }

    fn unwind_if_cancelled(&self) {
        if self.is_cancelled() {
            resume_unwind(Box::new(Cancelled));
        }
    }
}

impl Progress for Watch {
    fn begin(&self, stage: &str, total: Option<u64>) {
        self.unwind_if_cancelled();
        self.done.store(0, Ordering::Relaxed);
        if let Ok(mut current) = self.stage.lock() {
            *current = Some((stage.to_owned(), total));
        }
    }

    fn advance(&self, rows: u64) {
        self.unwind_if_cancelled();
        self.done.fetch_add(rows, Ordering::Relaxed);
    }

    fn end(&self) {
        self.unwind_if_cancelled();
        if let Ok(mut current) = self.stage.lock() {
            *current = None;
        }
    }
}

/// Threads per processor beyond which more threads only cost time; results do not depend on their number.
const MAX_THREADS_PER_PROCESSOR: usize = 4;

pub(crate) fn threads(asked: Option<usize>) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    asked.unwrap_or(processors).clamp(1, MAX_THREADS_PER_PROCESSOR * processors)
}

/// Calls `job` on this thread. After Ctrl-C the function that it receives returns true, and the interruption is raised
/// afterwards.
pub(crate) fn interruptible<T, E: Into<Error>>(
    py: Python<'_>,
    job: impl FnOnce(&dyn Fn() -> bool) -> Result<T, E>,
) -> PyResult<T> {
    let interrupted = RefCell::new(None);
    let outcome = job(&|| {
        if let Err(interruption) = py.check_signals() {
            *interrupted.borrow_mut() = Some(interruption);
        }
        interrupted.borrow().is_some()
    });
    match interrupted.take() {
        Some(interruption) => Err(interruption),
        None => outcome.map_err(|error| errors::job(py, &error.into())),
    }
}

/// As [`run`], but Ctrl-C first requests `stop` and waits for the job, so that the robot is not left moving. A second
/// Ctrl-C abandons the job.
pub(crate) fn run_to_its_stop<T: Send + 'static>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    stop: &StopSignal,
    work: impl FnOnce(&Watch) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    waited_for(py, threads, progress, Some(stop), work)
}

/// Runs `work` on a separate thread, with a pool of `threads` threads, while this one checks for Ctrl-C and calls
/// `progress(stage, done, total)`.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    waited_for(py, threads, progress, None, work)
}

fn waited_for<T: Send + 'static>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    stop: Option<&StopSignal>,
    work: impl FnOnce(&Watch) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let mut interrupted = None;
    let watch = Arc::new(Watch::default());
    let (send, receive) = channel();
    // The lock makes the receiver shareable; only one thread waits at a time.
    let receive = Mutex::new(receive);
    let own = Arc::clone(&watch);
    let job = move || {
        let outcome =
            catch_unwind(AssertUnwindSafe(|| match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
                Ok(pool) => pool.install(|| work(&own)),
                // Without threads the job runs here.
                Err(_) => work(&own),
            }));
        // The receiver may have been dropped.
        let _ = send.send(outcome);
    };
    std::thread::Builder::new().name("dynident".to_owned()).stack_size(STACK_BYTES).spawn(job)?;
    loop {
        let heard = py.detach(|| match receive.lock() {
            Ok(receive) => receive.recv_timeout(POLL_INTERVAL),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match heard {
            Ok(Ok(outcome)) => {
                return interrupted.map_or_else(|| outcome.map_err(|error| errors::job(py, &error)), Err);
            }
            Ok(Err(panic)) if panic.is::<Cancelled>() => return Err(PyKeyboardInterrupt::new_err(())),
            // An exception of Python code; an earlier Ctrl-C has priority.
            Ok(Err(panic)) => match panic.downcast::<RaisedError>() {
                Ok(thrown) => return Err(interrupted.unwrap_or(thrown.0)),
                Err(panic) => resume_unwind(panic),
            },
            // The thread ended without a result, which should not occur.
            Err(RecvTimeoutError::Disconnected) => {
                return Err(errors::Error::new_err("the job ended without a result"));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let outcome = py.check_signals().and_then(|()| report(&watch, progress));
        if let Err(interruption) = outcome {
            if let (Some(stop), None) = (stop, &interrupted) {
                stop.request();
                interrupted = Some(interruption);
                continue;
            }
            watch.cancelled.store(true, Ordering::Relaxed);
            return Err(interruption);
        }
    }
}

fn report(watch: &Watch, progress: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    let Some(progress) = progress else { return Ok(()) };
    let stage = watch.stage.lock().ok().and_then(|stage| stage.clone());
    if let Some((name, total)) = stage {
        progress.call1((name, watch.done.load(Ordering::Relaxed), total))?;
    }
    Ok(())
}
