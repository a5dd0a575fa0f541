//! Remarks on the page of an iteration: on its runs, their motions and their logs.

use super::run_figures::{last_good, run_name};
use crate::result::{IterationRun, IterationsFile, UnmetCondition};
use dynident_report::{Cell, Heading, Report, Table, Text, Tone, short};

/// Explains the figures of held-out runs.
const HELD_OUT: &str = "A motion that is never fitted, run under the controller with the newest model: how much of each joint's torque lies inside the 95 % band of what that model says. The verdict rests on the last.";

/// Explains the figures of forecasts.
const FORECASTS: &str = "The worst bars: root mean square of the error bars along the ten directions that were known worst before the run, measured by the torque that they leave uncertain wherever the arm may be.";

/// Adds what prevents convergence, with what would help.
pub(super) fn unmet_conditions(page: &mut Report, file: &IterationsFile) {
    let point =
        |unmet: &UnmetCondition| (Tone::Warning, format!("{}. What would help: {}.", unmet.message, unmet.remedy));
    section(page, "What is not met", file.unmet.iter().map(point).collect());
}

/// Adds rejected runs, lowered bandwidths and oscillations.
pub(super) fn run_remarks(page: &mut Report, file: &IterationsFile) {
    let rejected = |run: &IterationRun| Some(format!("run {}: {}", run_name(run), run.reason.as_ref()?));
    list(page, of_runs(file, Tone::Warning, rejected));
    let lowered = file.lowered_bandwidths_sentence().map(|sentence| (Tone::Plain, sentence));
    let oscillating = file.oscillation_sentences().into_iter().map(|sentence| (Tone::Warning, sentence));
    list(page, lowered.into_iter().chain(oscillating).collect());
}

/// Adds forecasts, warm-ups and held-out motions.
pub(super) fn motion_remarks(page: &mut Report, file: &IterationsFile) {
    let forecast = |run: &IterationRun| Some(format!("run {}: {}", run_name(run), run.forecast.as_ref()?.sentence()));
    let mut forecasts = of_runs(file, Tone::Plain, forecast);
    forecasts.extend(
        file.declined
            .iter()
            .map(|forecast| (Tone::Plain, format!("a further run was not worth it: {}", forecast.sentence()))),
    );
    explained(page, "What the motions were to bring", FORECASTS, forecasts);
    let warm_up = |run: &IterationRun| {
        Some(format!("before run {}: {}", run_name(run), run.warm_up.as_ref()?.sentence(&file.joints)))
    };
    section(page, "Warm-up", of_runs(file, Tone::Plain, warm_up));
    let held_out = |run: &IterationRun| {
        Some(format!("after run {}: {}", run_name(run), run.held_out.as_ref()?.sentence(&file.joints)))
    };
    explained(page, "The held-out motion", HELD_OUT, of_runs(file, Tone::Plain, held_out));
}

/// Adds offsets of single runs, the evidence of the last log, and the differentiators.
pub(super) fn log_remarks(page: &mut Report, file: &IterationsFile) {
    let offsets = last_good(file).and_then(|run| run.run_offsets_sentence(&file.joints));
    section(page, "Offsets of single runs", offsets.map(|sentence| (Tone::Plain, sentence)).into_iter().collect());
    if let Some(shown) = last_shown(file) {
        page.add(Heading::new("What the last log shows"));
        page.add(shown);
    }
    let differentiator =
        |run: &IterationRun| Some(format!("run {}: {}", run_name(run), run.differentiator.as_ref()?.sentence()));
    let points = of_runs(file, Tone::Plain, differentiator);
    section(page, "From positions to velocities and accelerations", points);
}

/// A point for each run with something to report.
fn of_runs(file: &IterationsFile, tone: Tone, point: impl Fn(&IterationRun) -> Option<String>) -> Vec<(Tone, String)> {
    file.runs.iter().filter_map(point).map(|point| (tone, point)).collect()
}

/// Adds points, if there are any.
fn list(page: &mut Report, points: Vec<(Tone, String)>) {
    if !points.is_empty() {
        page.add(Text { paragraphs: Vec::new(), points });
    }
}

/// Adds points under a heading, if there are any.
fn section(page: &mut Report, heading: &str, points: Vec<(Tone, String)>) {
    if !points.is_empty() {
        page.add(Heading::new(heading));
        list(page, points);
    }
}

/// Adds points under a heading and an explanation, if there are any.
fn explained(page: &mut Report, heading: &str, explanation: &str, points: Vec<(Tone, String)>) {
    if !points.is_empty() {
        page.add(Heading::new(heading));
        page.add(Text { paragraphs: vec![explanation.to_owned()], points });
    }
}

/// Joint by joint what the verdict rests on, of the last run whose log shows it.
fn last_shown(file: &IterationsFile) -> Option<Table> {
    let run = file.runs.iter().rfind(|run| run.evidence.is_some())?;
    let optional = |value: Option<String>| Cell::from(value.unwrap_or_else(|| "–".to_owned()));
    let columns = [
        "joint",
        "tracking error, rad (m)",
        "its floor",
        "at the torque limit",
        "torque after motion, ms",
        "of it taken off, ms",
        "predicted inside the 95 % band",
    ];
    let evidence = run.evidence.as_ref()?;
    let delay = evidence.feedback_delay_s.map_or_else(String::new, |delay_s| {
        format!("; the tracking error is that of a controller which sees positions {} ms late", short(1e3 * delay_s, 3))
    });
    let mut table = Table::new(format!("Run {}", run_name(run)), columns).note(format!(
        "floor: what noise, friction and delay explain, looked for where tracking is beyond the tolerance{delay}; predicted: by the model of the good runs before it",
    ));
    for (joint, (name, shown)) in file.joints.iter().zip(&evidence.joints).enumerate() {
        let lag = run.torque_lags.get(joint).copied().flatten();
        table = table.rows([vec![
            Cell::from(name),
            Cell::from(short(run.max_tracking_error_rad[joint], 3)),
            optional(shown.tracking_floor_rad.map(|floor| short(floor, 3))),
            optional(shown.clipping.map(|clipping| format!("{} %", short(100.0 * clipping.share, 3)))),
            optional(lag.map(|lag| format!("{:.2} ± {:.2}", 1e3 * lag.lag_s, 1e3 * lag.half_width_95_s))),
            optional(lag.filter(|lag| lag.taken_off_s != 0.0).map(|lag| format!("{:.2}", 1e3 * lag.taken_off_s))),
            optional(shown.prediction.map(|prediction| format!("{} %", short(100.0 * prediction.inside, 3)))),
        ]]);
    }
    Some(table)
}
