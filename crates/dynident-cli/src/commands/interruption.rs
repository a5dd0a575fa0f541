//! Ctrl-C (and what else asks a program to end: SIGTERM, a terminal that goes away).

use crate::terminal;
use dynident::iteration::StopSignal;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit status of a program that was interrupted.
pub(crate) const STATUS: u8 = 130;

/// Set by the first Ctrl-C.
static PRESSED: AtomicBool = AtomicBool::new(false);

/// From now on the first Ctrl-C asks for a stop: searches end with the best, robots stop. The second kills every
/// program that serves a robot, with all its processes, and ends this one.
pub(crate) fn listen(stop: &StopSignal) {
    let stop = stop.clone();
    // Without a handler Ctrl-C ends the program as ever.
    let _ = ctrlc::set_handler(move || {
        if PRESSED.swap(true, Ordering::SeqCst) {
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
    PRESSED.load(Ordering::SeqCst)
}
