use crate::terminal;
use dynident::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Delay of the bar, and update interval of a stage without progress.
const BAR_DELAY: Duration = Duration::from_secs(1);

/// Template for a stage without known progress.
const WITHOUT_ROWS: &str = "{msg} {spinner} {elapsed}";

/// Template for a stage with an unknown total.
const WITH_ROWS: &str = "{msg} {spinner} {human_pos} rows  {elapsed}";

#[derive(Default)]
pub(crate) struct Bar {
    stage: Mutex<Option<Stage>>,
}

struct Stage {
    name: String,
    total: Option<u64>,
    done: u64,
    started: Instant,
    bar: Option<ProgressBar>,
}

impl Stage {
    fn show(&mut self) {
        if self.bar.is_none() && self.started.elapsed() >= BAR_DELAY {
            let bar = self.total.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
            let template = if self.total.is_some() { "{msg} {wide_bar} {percent} %  {eta} left" } else { WITH_ROWS };
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style);
            }
            bar.set_message(terminal::readable(&self.name));
            bar.reset_elapsed();
            self.bar = Some(bar);
        }
        if let Some(bar) = &self.bar {
            bar.set_position(self.done.min(self.total.unwrap_or(u64::MAX)));
        }
    }
}

impl Progress for Bar {
    fn begin(&self, stage: &str, total: Option<u64>) {
        if let Ok(mut current) = self.stage.lock() {
            // A stage of unknown size may report no progress, so a timer draws its line.
            let bar = total.is_none().then(|| {
                let bar = ProgressBar::new_spinner().with_message(terminal::readable(stage));
                if let Ok(style) = ProgressStyle::with_template(WITHOUT_ROWS) {
                    bar.set_style(style);
                }
                bar.enable_steady_tick(BAR_DELAY);
                bar
            });
            *current = Some(Stage { name: stage.to_owned(), total, done: 0, started: Instant::now(), bar });
        }
    }

    fn advance(&self, rows: u64) {
        if let Ok(mut current) = self.stage.lock()
            && let Some(stage) = current.as_mut()
        {
            if stage.done == 0
                && stage.total.is_none()
                && let (Some(bar), Ok(style)) = (&stage.bar, ProgressStyle::with_template(WITH_ROWS))
            {
                bar.set_style(style);
            }
            stage.done += rows;
            stage.show();
        }
    }

    fn end(&self) {
        if let Ok(mut current) = self.stage.lock()
            && let Some(bar) = current.take().and_then(|stage| stage.bar)
        {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Bar;
    use dynident::Progress;

    #[test]
    fn a_stage_that_says_nothing_has_its_line() {
        let bar = Bar::default();
        let shown = || bar.stage.lock().is_ok_and(|stage| stage.as_ref().is_some_and(|stage| stage.bar.is_some()));
        bar.begin("1 of 5: a long one", None);
        assert!(shown());
        bar.advance(10);
        assert!(shown());
        bar.end();
        assert!(!shown());
        // The bar of a stage of known size appears after a second.
        bar.begin("rows", Some(1000));
        bar.advance(10);
        assert!(!shown());
    }
}
