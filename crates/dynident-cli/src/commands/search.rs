//! What a person sees of a search for a trajectory.

use crate::commands::{Context, interruption};
use crate::terminal;
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use indicatif::{ProgressBar, ProgressStyle};

/// A line that says how far a search is.
pub(crate) struct Search {
    line: Option<ProgressBar>,
}

impl Search {
    /// Shows a line to people who watch. Once Ctrl-C was pressed the search ends with its best.
    pub(crate) fn new(context: &Context) -> Self {
        Self { line: (!context.quiet && terminal::watched()).then(line) }
    }

    /// Hears of the search, and ends it if that was asked for.
    pub(crate) fn hear(&self, at: &DesignProgress) -> ControlFlow<()> {
        if let Some(line) = &self.line {
            line.set_message(state(at));
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

fn state(at: &DesignProgress) -> String {
    let limits = if at.violation <= 1e-6 {
        "inside all limits".to_owned()
    } else {
        format!("{:.2} % over a limit", 100.0 * at.violation)
    };
    format!("{}: criterion {:.4}, {limits}; Ctrl-C keeps the best", at.round, at.value)
}
