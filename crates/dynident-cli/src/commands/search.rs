//! What a person sees of a search for a trajectory.

use crate::commands::{Context, interruption};
use crate::terminal;
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use indicatif::{ProgressBar, ProgressStyle};

/// A line that says how far a search is.
pub(crate) struct Search {
    line: Option<ProgressBar>,
    /// The effect of Ctrl-C, for the line.
    interruption: &'static str,
}

/// Ctrl-C ends the search, and the command goes on with the best motion so far.
pub(crate) const KEEPS_THE_BEST: &str = "Ctrl-C keeps the best";
/// Ctrl-C ends the command; the motion so far is discarded.
pub(crate) const ENDS_THE_COMMAND: &str = "Ctrl-C ends the command";

impl Search {
    /// Shows a line to people who watch. Once Ctrl-C was pressed the search ends with its best.
    pub(crate) fn new(context: &Context, interruption: &'static str) -> Self {
        Self { line: (!context.quiet && terminal::watched()).then(line), interruption }
    }

    /// Hears of the search, and ends it if that was asked for.
    pub(crate) fn hear(&self, at: &DesignProgress) -> ControlFlow<()> {
        if let Some(line) = &self.line {
            line.set_message(state(at, self.interruption));
            line.tick();
        }
        if interruption::pressed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
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

fn state(at: &DesignProgress, interruption: &str) -> String {
    let limits = if at.violation <= 1e-6 {
        "inside all limits".to_owned()
    } else {
        format!("{:.2} % over a limit", 100.0 * at.violation)
    };
    format!("{}: criterion {:.4}, {limits}; {interruption}", at.round, at.value)
}
