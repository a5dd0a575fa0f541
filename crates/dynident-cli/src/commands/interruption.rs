//! Ctrl-C (and what else asks a program to end: SIGTERM, a terminal that goes away).

use crate::terminal;
use dynident::Error;
use dynident::iteration::StopSignal;
use std::cell::Cell;
use std::sync::{Mutex, Once, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Exit status of a program that was interrupted.
pub(crate) const STATUS: u8 = 130;

/// A Ctrl-C this soon after the first one is the same press: keyboards repeat a key that is held down, and a robot
/// needs some time to brake.
const SAME_PRESS: Duration = Duration::from_millis(500);

/// When Ctrl-C was pressed first.
static FIRST_PRESS: OnceLock<Instant> = OnceLock::new();
/// Who hears of Ctrl-C.
static STOP: Mutex<Option<StopSignal>> = Mutex::new(None);

/// From now on the first Ctrl-C asks for a stop: searches end with the best, robots stop. A further one, at least 0.5 s
/// after the first, kills every program that serves a robot, with all its processes, and ends this one.
pub(crate) fn listen(stop: &StopSignal) {
    static HANDLER: Once = Once::new();
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = Some(stop.clone());
    // Without a handler Ctrl-C ends the program as usual.
    HANDLER.call_once(|| drop(ctrlc::set_handler(on_ctrl_c)));
}

fn on_ctrl_c() {
    // Nobody listens any more.
    let Some(stop) = STOP.lock().unwrap_or_else(PoisonError::into_inner).clone() else {
        std::process::exit(i32::from(STATUS));
    };
    let now = Instant::now();
    let first = *FIRST_PRESS.get_or_init(|| now);
    if first == now {
        stop.request();
        return;
    }
    if now.duration_since(first) < SAME_PRESS {
        return;
    }
    if stop.kill_robots() {
        terminal::remark(
            "the robot's program was killed before it said that the robot stands: nobody knows whether it \
             does, look at it before anything else",
        );
    }
    std::process::exit(i32::from(STATUS));
}

/// Calls `job`, which may run a program to its end. Ctrl-C stops that program with all its processes, and then ends the
/// command.
pub(crate) fn while_program_runs<R>(job: impl FnOnce(&dyn Fn() -> bool) -> Result<R, Error>) -> Result<R, Error> {
    let begun = Cell::new(false);
    let is_stopped = || {
        // A file that needs no program leaves Ctrl-C as it is.
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

/// Whether Ctrl-C was pressed.
pub(crate) fn pressed() -> bool {
    FIRST_PRESS.get().is_some()
}
