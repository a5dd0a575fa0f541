use crate::commands::{Context, interruption};
use crate::terminal;
use core::ops::ControlFlow;
use dynident::excitation::DesignProgress;
use indicatif::{ProgressBar, ProgressStyle};

/// Reaction to Ctrl-C during a search.
#[derive(Clone, Copy)]
pub(crate) enum OnInterrupt {
    KeepsBest,
    EndsCommand,
}

impl OnInterrupt {
    fn words(self) -> &'static str {
        match self {
            Self::KeepsBest => "Ctrl-C keeps the best",
            Self::EndsCommand => "Ctrl-C ends the command without this motion",
        }
    }
}

pub(crate) struct Search {
    line: Option<ProgressBar>,
    on_interrupt: OnInterrupt,
}

impl Search {
    /// Shows a progress line on a terminal. The search ends after Ctrl-C.
    pub(crate) fn new(context: &Context, on_interrupt: OnInterrupt) -> Self {
        Self { line: (!context.quiet && terminal::watched()).then(line), on_interrupt }
    }

    /// Updates the progress line, and ends the search if requested.
    pub(crate) fn hear(&self, at: &DesignProgress) -> ControlFlow<()> {
        if let Some(line) = &self.line {
            line.set_message(state(at, self.on_interrupt));
            line.tick();
        }
        if interruption::pressed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    pub(crate) fn end(self) {
        if let Some(line) = self.line {
            line.finish_and_clear();
        }
    }
}

fn line() -> ProgressBar {
    let line = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {wide_msg}") {
        line.set_style(style);
    }
    line
}

fn state(at: &DesignProgress, on_interrupt: OnInterrupt) -> String {
    let words = on_interrupt.words();
    if !at.value.is_finite() {
        return format!("{}; {words}", at.round);
    }
    let limits = if at.violation <= 1e-6 {
        "inside all limits".to_owned()
    } else {
        format!("{:.2} % over a limit", 100.0 * at.violation)
    };
    format!("{}: criterion {:.4}, {limits}; {words}", at.round, at.value)
}

#[cfg(test)]
mod tests {
    use super::{DesignProgress, OnInterrupt, state};

    #[test]
    fn only_a_search_that_keeps_its_best_promises_it() {
        let at = DesignProgress { round: "search", value: 1.5, violation: 0.02, evaluations: 7 };
        let line = state(&at, OnInterrupt::KeepsBest);
        assert_eq!(line, "search: criterion 1.5000, 2.00 % over a limit; Ctrl-C keeps the best");
        let first = DesignProgress { round: "starts", value: f64::INFINITY, ..at };
        assert_eq!(state(&first, OnInterrupt::EndsCommand), "starts; Ctrl-C ends the command without this motion");
    }
}
