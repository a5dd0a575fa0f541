use crate::terminal;
use dynident::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Delay until the progress bar appears, and update interval of a stage that reports no progress.
const BAR_DELAY: Duration = Duration::from_secs(1);

/// Template of the progress line for a stage with unknown progress.
const WITHOUT_ROWS: &str = "{msg} {spinner} {elapsed}";

/// Template of the progress line for a stage with an unknown total.
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

/// Interval of the progress lines without a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// Progress without a terminal: a line every five seconds, also in a stage that reports no progress.
pub(crate) struct Lines {
    stage: Arc<Mutex<Option<LineStage>>>,
    printer: Option<(Sender<()>, JoinHandle<()>)>,
}

struct LineStage {
    name: String,
    total: Option<u64>,
    done: u64,
    started: Instant,
}

impl LineStage {
    fn line(&self) -> String {
        let seconds = self.started.elapsed().as_secs();
        let part = match self.total {
            Some(total) if total > 0 => format!(", {:.0} %", 100.0 * self.done as f64 / total as f64),
            _ if self.done > 0 => format!(", {} rows", self.done),
            _ => String::new(),
        };
        format!("{}{part}, {seconds} s", self.name)
    }
}

impl Lines {
    pub(crate) fn new(print: fn(&str)) -> Self {
        Self::every(LINE_INTERVAL, print)
    }

    fn every(interval: Duration, print: impl Fn(&str) + Send + 'static) -> Self {
        let stage: Arc<Mutex<Option<LineStage>>> = Arc::default();
        let (stop, stopped) = mpsc::channel();
        let shown = Arc::clone(&stage);
        let printer = std::thread::Builder::new().spawn(move || {
            while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(interval) {
                let line = shown.lock().ok().and_then(|stage| stage.as_ref().map(LineStage::line));
                if let Some(line) = line {
                    print(&line);
                }
            }
        });
        // Without a thread nothing is printed.
        Self { stage, printer: printer.ok().map(|printer| (stop, printer)) }
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        if let Some((stop, printer)) = self.printer.take() {
            drop(stop);
            let _ = printer.join();
        }
    }
}

impl Progress for Lines {
    fn begin(&self, stage: &str, total: Option<u64>) {
        if let Ok(mut current) = self.stage.lock() {
            *current = Some(LineStage { name: stage.to_owned(), total, done: 0, started: Instant::now() });
        }
    }

    fn advance(&self, rows: u64) {
        if let Ok(mut current) = self.stage.lock()
            && let Some(stage) = current.as_mut()
        {
            stage.done += rows;
        }
    }

    fn end(&self) {
        if let Ok(mut current) = self.stage.lock() {
            *current = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Bar, Lines};
    use dynident::Progress;
    use std::sync::mpsc;
    use std::time::Duration;

    #[test]
    fn lines_appear_regularly_and_end_with_the_stage() {
        let (send, lines) = mpsc::channel();
        let progress = Lines::every(Duration::from_millis(5), move |line| drop(send.send(line.to_owned())));
        progress.begin("2 of 5: fit", Some(200));
        progress.advance(50);
        let next = || lines.recv_timeout(Duration::from_secs(60)).unwrap();
        // A line can precede the first rows.
        let line = (0..1000).map(|_| next()).find(|line| line.contains("25 %")).unwrap();
        assert_eq!(line, "2 of 5: fit, 25 %, 0 s");
        progress.begin("3 of 5: silent", None);
        assert_eq!((0..1000).map(|_| next()).find(|line| line.starts_with('3')).unwrap(), "3 of 5: silent, 0 s");
        progress.end();
        drop(progress);
        // The thread has ended.
        assert!(lines.iter().all(|line| line.starts_with("3 of 5")));
    }

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
