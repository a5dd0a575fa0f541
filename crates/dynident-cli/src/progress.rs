//! A progress bar with the time left, once a stage takes longer than a second.

use dynident::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// How long a stage runs before its bar shows.
const PATIENCE: Duration = Duration::from_secs(1);

/// Shows the stage that runs, on standard error.
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
        if self.bar.is_none() && self.started.elapsed() >= PATIENCE {
            let bar = self.total.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
            let template = if self.total.is_some() {
                "{msg} {wide_bar} {percent} %  {eta} left"
            } else {
                "{msg} {spinner} {human_pos} rows  {elapsed}"
            };
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style);
            }
            bar.set_message(self.name.clone());
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
            *current = Some(Stage { name: stage.to_owned(), total, done: 0, started: Instant::now(), bar: None });
        }
    }

    fn advance(&self, rows: u64) {
        if let Ok(mut current) = self.stage.lock()
            && let Some(stage) = current.as_mut()
        {
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
