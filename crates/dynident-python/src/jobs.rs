//! A job beside the interpreter: other threads of Python run on, Ctrl-C ends it, progress is heard.

use crate::callables::Thrown;
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

/// How often Ctrl-C is looked for and progress is told.
const PAUSE: Duration = Duration::from_millis(50);
/// Stack of a job's thread, as large as that of a program's own.
const STACK_BYTES: usize = 8 << 20;

/// What a job that nobody wants any more unwinds with.
struct Cancelled;

/// What a job and whoever waits for it share.
#[derive(Default)]
pub(crate) struct Watch {
    cancelled: AtomicBool,
    stage: Mutex<Option<(String, Option<u64>)>>,
    done: AtomicU64,
}

impl Watch {
    /// Whether nobody wants the job any more.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Leaves a job that nobody wants, past everything: no result of it is looked at.
    fn leave(&self) {
        if self.is_cancelled() {
            resume_unwind(Box::new(Cancelled));
        }
    }
}

impl Progress for Watch {
    fn begin(&self, stage: &str, total: Option<u64>) {
        self.leave();
        self.done.store(0, Ordering::Relaxed);
        if let Ok(mut current) = self.stage.lock() {
            *current = Some((stage.to_owned(), total));
        }
    }

    fn advance(&self, rows: u64) {
        self.leave();
        self.done.fetch_add(rows, Ordering::Relaxed);
    }

    fn end(&self) {
        self.leave();
        if let Ok(mut current) = self.stage.lock() {
            *current = None;
        }
    }
}

/// Threads that a job may take: as many as asked for, else as there are processors.
pub(crate) fn threads(asked: Option<usize>) -> usize {
    asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).max(1)
}

/// Calls `job` on this thread. Ctrl-C makes the function that it is given return true, and is raised afterwards.
pub(crate) fn interruptible<T>(py: Python<'_>, job: impl FnOnce(&dyn Fn() -> bool) -> Result<T, Error>) -> PyResult<T> {
    let interrupted = RefCell::new(None);
    let outcome = job(&|| {
        if let Err(interruption) = py.check_signals() {
            *interrupted.borrow_mut() = Some(interruption);
        }
        interrupted.borrow().is_some()
    });
    match interrupted.take() {
        Some(interruption) => Err(interruption),
        None => outcome.map_err(|error| errors::job(py, &error)),
    }
}

/// As [`run`], where Ctrl-C asks `stop` first and the job is waited for: a robot is not left moving. A second one
/// leaves it to itself.
pub(crate) fn run_to_its_stop<T: Send + 'static>(
    py: Python<'_>,
    threads: usize,
    stop: &StopSignal,
    work: impl FnOnce(&Watch) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    waited_for(py, threads, None, Some(stop), work)
}

/// Runs `work` on a thread of its own, with a pool of `threads` threads, while this one looks for Ctrl-C and tells
/// `progress(stage, done, total)` where it is.
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
    // One thread waits at a time, which a lock proves.
    let receive = Mutex::new(receive);
    let own = Arc::clone(&watch);
    let job = move || {
        let outcome =
            catch_unwind(AssertUnwindSafe(|| match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
                Ok(pool) => pool.install(|| work(&own)),
                // A system that refuses threads still gets its result.
                Err(_) => work(&own),
            }));
        // Nobody may be waiting any more.
        let _ = send.send(outcome);
    };
    std::thread::Builder::new().name("dynident".to_owned()).stack_size(STACK_BYTES).spawn(job)?;
    loop {
        let heard = py.detach(|| match receive.lock() {
            Ok(receive) => receive.recv_timeout(PAUSE),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match heard {
            Ok(Ok(outcome)) => {
                return interrupted.map_or_else(|| outcome.map_err(|error| errors::job(py, &error)), Err);
            }
            Ok(Err(panic)) if panic.is::<Cancelled>() => return Err(PyKeyboardInterrupt::new_err(())),
            // What code of Python raised; Ctrl-C before it counts more.
            Ok(Err(panic)) => match panic.downcast::<Thrown>() {
                Ok(thrown) => return Err(interrupted.unwrap_or(thrown.0)),
                Err(panic) => resume_unwind(panic),
            },
            // It ended without a word, which a thread does not do.
            Err(RecvTimeoutError::Disconnected) => {
                return Err(errors::Error::new_err("the job ended without a result"));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let told = py.check_signals().and_then(|()| tell(&watch, progress));
        if let Err(interruption) = told {
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

fn tell(watch: &Watch, progress: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    let Some(progress) = progress else { return Ok(()) };
    let stage = watch.stage.lock().ok().and_then(|stage| stage.clone());
    if let Some((name, total)) = stage {
        progress.call1((name, watch.done.load(Ordering::Relaxed), total))?;
    }
    Ok(())
}
