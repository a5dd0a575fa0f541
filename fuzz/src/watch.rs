//! Catches panics and reports hangs, with the input that caused them.

use std::cell::RefCell;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Limit of the processor time per input, s. Every input of the corpus takes less than a tenth of it.
const HANG_S: f64 = 60.0;
/// Clock ticks per second of the times in `/proc`, the same on every Linux.
const TICKS_PER_S: f64 = 100.0;

thread_local! {
    /// Message of the last panic of this thread.
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Current target and input of a thread.
struct Running {
    target: &'static str,
    input: Vec<u8>,
    /// Processor time of the process at the start of this input, see [`used_s`].
    begun_s: f64,
}

/// Monitors several threads.
pub(crate) struct Watch {
    found: PathBuf,
    running: Arc<Vec<Mutex<Option<Running>>>>,
}

impl Watch {
    /// Saves failed inputs to `found`. After a hang the input is saved and the program exits.
    pub(crate) fn new(found: &Path, threads: usize) -> Self {
        std::panic::set_hook(Box::new(|panic| PANIC.set(panic.to_string())));
        let running: Arc<Vec<Mutex<Option<Running>>>> = Arc::new((0..threads).map(|_| Mutex::new(None)).collect());
        let (watched, folder) = (Arc::clone(&running), found.to_owned());
        // All threads are always busy, so each uses an equal share of the processor time of the process.
        let hang_s = HANG_S * threads as f64;
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(Duration::from_secs(1));
                let used_s = used_s();
                for slot in watched.iter() {
                    let Ok(slot) = slot.lock() else { continue };
                    if let Some(running) = slot.as_ref().filter(|running| used_s - running.begun_s > hang_s) {
                        keep(&folder, running.target, &running.input, "takes more than a minute of processor time");
                        std::process::exit(1);
                    }
                }
            }
        });
        Self { found: found.to_owned(), running }
    }

    /// Returns whether the input was accepted, and whether it failed.
    pub(crate) fn run(
        &self,
        thread: usize,
        target: &'static str,
        input: &[u8],
        run: &mut dyn FnMut() -> bool,
    ) -> (bool, bool) {
        self.set(thread, Some(Running { target, input: input.to_vec(), begun_s: used_s() }));
        let outcome = catch_unwind(AssertUnwindSafe(run));
        self.set(thread, None);
        if let Ok(accepted) = outcome {
            return (accepted, false);
        }
        keep(&self.found, target, input, &PANIC.take());
        (false, true)
    }

    fn set(&self, thread: usize, now: Option<Running>) {
        if let Some(Ok(mut slot)) = self.running.get(thread).map(Mutex::lock) {
            *slot = now;
        }
    }
}

/// Returns the processor time of this process, s. Unlike wall time, it is not affected by other work on the machine.
/// If the system does not report it, returns the seconds since the first call.
fn used_s() -> f64 {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    let of_process = || {
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        // The name in brackets may contain spaces; user and system time are the 12th and 13th word after it.
        let mut words = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
        let mut ticks = || words.next()?.parse::<f64>().ok();
        Some((ticks()? + ticks()?) / TICKS_PER_S)
    };
    of_process().unwrap_or_else(|| FIRST.get_or_init(Instant::now).elapsed().as_secs_f64())
}

/// Saves an input and prints the reason.
fn keep(folder: &Path, target: &str, input: &[u8], why: &str) {
    let mut hasher = DefaultHasher::new();
    input.hash(&mut hasher);
    let path = folder.join(format!("{target}-{:016x}", hasher.finish()));
    let kept = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, input));
    let place = if kept.is_ok() { path.display().to_string() } else { "an input that could not be saved".to_owned() };
    crate::say(&format!("FAILED {target}: {place}: {why}"));
}
