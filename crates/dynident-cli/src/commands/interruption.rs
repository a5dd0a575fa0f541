//! Ctrl-C (and what else asks a program to end: SIGTERM, a terminal that goes away).

use crate::terminal;
use dynident::iteration::StopSignal;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Exit status of a program that was interrupted.
pub(crate) const STATUS: u8 = 130;

/// A Ctrl-C this soon after the first one is the same press: keyboards repeat a key that is held down, and a robot
/// needs some time to brake.
const SAME_PRESS: Duration = Duration::from_millis(500);

/// When Ctrl-C was pressed first.
static FIRST_PRESS: OnceLock<Instant> = OnceLock::new();

/// From now on the first Ctrl-C asks for a stop: searches end with the best, robots stop. A further one, at least 0.5 s
/// after the first, kills every program that serves a robot, with all its processes, and ends this one.
pub(crate) fn listen(stop: &StopSignal) {
    let stop = stop.clone();
    // Without a handler Ctrl-C ends the program as ever.
    let _ = ctrlc::set_handler(move || {
        let now = Instant::now();
        let first = *FIRST_PRESS.get_or_init(|| now);
        if first != now {
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
        stop.request();
    });
}

/// Whether Ctrl-C was pressed.
pub(crate) fn pressed() -> bool {
    FIRST_PRESS.get().is_some()
}
