//! What a person sees of a search for a trajectory, and how it is stopped.

use crate::commands::Context;
use crate::terminal;
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};

/// Set by the first Ctrl-C: the search ends with its best motion.
static STOP: AtomicBool = AtomicBool::new(false);

/// A line that says how far a search is.
pub(crate) struct Search {
    line: Option<ProgressBar>,
}

impl Search {
    /// Shows a line to people who watch; the first Ctrl-C ends the search and keeps the best, the second ends the
    /// program.
    pub(crate) fn new(context: &Context) -> Self {
        // Without a handler Ctrl-C ends the program as ever.
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
        Self { line: (!context.quiet && terminal::watched()).then(line) }
    }

    /// Hears of the search, and ends it if that was asked for.
    pub(crate) fn hear(&self, at: &DesignProgress) -> ControlFlow<()> {
        if let Some(line) = &self.line {
            line.set_message(state(at));
            line.tick();
        }
        if Self::stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Whether Ctrl-C was pressed.
    pub(crate) fn stopped() -> bool {
        STOP.load(Ordering::Relaxed)
    }

    /// Clears the line.
    pub(crate) fn end(self) {
        if let Some(line) = self.line {
            line.finish_and_clear();
        }
    }
}

/// The line that a person watches.
fn line() -> ProgressBar {
    let line = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {wide_msg}") {
        line.set_style(style);
    }
    line
}

fn state(at: &DesignProgress) -> String {
    let limits = if at.violation <= 1e-6 {
        "inside all limits".to_owned()
    } else {
        format!("{:.2} % over a limit", 100.0 * at.violation)
    };
    format!("{}: criterion {:.4}, {limits}; Ctrl-C keeps the best", at.round, at.value)
}
