//! Ctrl-C, and other requests to end the program (SIGTERM, closing of the terminal).

use crate::terminal;
use dynident::iteration::StopSignal;
use std::cell::Cell;
use std::sync::{Mutex, Once, OnceLock, PoisonError};
use std::time::{Duration, Instant};

pub(crate) const STATUS: u8 = 130;

/// A second Ctrl-C within this time is ignored, because held keys repeat, and a robot needs some time to brake.
const REPEAT_INTERVAL: Duration = Duration::from_millis(500);

static FIRST_PRESS: OnceLock<Instant> = OnceLock::new();
/// The signal that Ctrl-C sets.
static STOP: Mutex<Option<StopSignal>> = Mutex::new(None);

/// Handles Ctrl-C from now on: the first one requests a stop (searches end with their best result, robots stop). A
/// further one, at least 0.5 s after the first, kills every robot program with all its processes, and ends this
/// program.
pub(crate) fn listen(stop: &StopSignal) {
    static HANDLER: Once = Once::new();
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = Some(stop.clone());
    // Without a handler Ctrl-C ends the program as usual.
    HANDLER.call_once(|| drop(ctrlc::set_handler(on_ctrl_c)));
}

fn on_ctrl_c() {
    // No stop signal is registered any more.
    let Some(stop) = STOP.lock().unwrap_or_else(PoisonError::into_inner).clone() else {
        std::process::exit(i32::from(STATUS));
    };
    let now = Instant::now();
    let first = *FIRST_PRESS.get_or_init(|| now);
    if first == now {
        stop.request();
        return;
    }
    if now.duration_since(first) < REPEAT_INTERVAL {
        return;
    }
    if stop.kill_robots() {
        terminal::remark(
            "the robot's program was killed before it confirmed the stop: the robot may still be moving, \
             check it first",
        );
    }
    std::process::exit(i32::from(STATUS));
}

/// Calls `job`, which may run a program. Ctrl-C then stops that program with all its processes and ends this command.
pub(crate) fn while_program_runs<R>(job: impl FnOnce(&dyn Fn() -> bool) -> R) -> R {
    let begun = Cell::new(false);
    let is_stopped = || {
        // Without a program Ctrl-C works as usual.
        if !begun.replace(true) {
            listen(&StopSignal::default());
        }
        pressed()
    };
    let outcome = job(&is_stopped);
    if begun.get() {
        if pressed() {
            std::process::exit(i32::from(STATUS));
        }
        *STOP.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
    outcome
}

pub(crate) fn pressed() -> bool {
    FIRST_PRESS.get().is_some()
}
