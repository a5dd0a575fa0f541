//! Remarks on runs, motions and logs for the page of an iteration.

use super::run_figures::{last_good, run_name};
use crate::result::{IterationRun, IterationsFile, UnmetConditionEntry};
use dynident_report::{Cell, Heading, Report, Table, Text, Tone, short};

/// Explanation of held-out runs.
const HELD_OUT: &str = "Validation motion, run with the newest model in the controller: percentage of each joint's torque inside the 95 % band of the prediction. The result of the iteration uses the last one.";

/// Explanation of forecasts.
const FORECASTS: &str = "Largest error bars: root mean square of the error bars along the ten least known directions before the run, in terms of the torque uncertainty over the workspace.";

/// Adds the unmet conditions of convergence, with suggested fixes.
pub(super) fn unmet_conditions(page: &mut Report, file: &IterationsFile) {
    let point = |unmet: &UnmetConditionEntry| (Tone::Warning, format!("{}. Remedy: {}.", unmet.message, unmet.remedy));
    section(page, "Unmet conditions", file.unmet.iter().map(point).collect());
}

pub(super) fn run_remarks(page: &mut Report, file: &IterationsFile) {
    let rejected = |run: &IterationRun| Some(format!("run {}: {}", run_name(run), run.reason.as_ref()?));
    list(page, of_runs(file, Tone::Warning, rejected));
    let lowered = file.lowered_bandwidths_sentence().map(|sentence| (Tone::Plain, sentence));
    let oscillating = file.oscillation_sentences().into_iter().map(|sentence| (Tone::Warning, sentence));
    list(page, lowered.into_iter().chain(oscillating).collect());
}

pub(super) fn motion_remarks(page: &mut Report, file: &IterationsFile) {
    let forecast = |run: &IterationRun| Some(format!("run {}: {}", run_name(run), run.forecast.as_ref()?.sentence()));
    let mut forecasts = of_runs(file, Tone::Plain, forecast);
    forecasts.extend(
        file.declined
            .iter()
            .map(|forecast| (Tone::Plain, format!("a further run was not worthwhile: {}", forecast.sentence()))),
    );
    explained(page, "Forecasts of the motions", FORECASTS, forecasts);
    let warm_up = |run: &IterationRun| {
        Some(format!("before run {}: {}", run_name(run), run.warm_up.as_ref()?.sentence(&file.joints)))
    };
    section(page, "Warm-up", of_runs(file, Tone::Plain, warm_up));
    let held_out = |run: &IterationRun| {
        Some(format!("after run {}: {}", run_name(run), run.held_out.as_ref()?.sentence(&file.joints)))
    };
    explained(page, "The held-out motion", HELD_OUT, of_runs(file, Tone::Plain, held_out));
}

/// Adds offsets of runs, the evidence of the last log, and the differentiators.
pub(super) fn log_remarks(page: &mut Report, file: &IterationsFile) {
    let offsets = last_good(file).and_then(|run| run.run_offsets_sentence(&file.joints));
    section(page, "Offsets of runs", offsets.map(|sentence| (Tone::Plain, sentence)).into_iter().collect());
    if let Some(shown) = last_shown(file) {
        page.add(Heading::new("Evidence of the last log"));
        page.add(shown);
    }
    let differentiator =
        |run: &IterationRun| Some(format!("run {}: {}", run_name(run), run.differentiator.as_ref()?.sentence()));
    let points = of_runs(file, Tone::Plain, differentiator);
    section(page, "Differentiation of positions", points);
}

/// One entry for each run with a remark.
fn of_runs(file: &IterationsFile, tone: Tone, point: impl Fn(&IterationRun) -> Option<String>) -> Vec<(Tone, String)> {
    file.runs.iter().filter_map(point).map(|point| (tone, point)).collect()
}

fn list(page: &mut Report, points: Vec<(Tone, String)>) {
    if !points.is_empty() {
        page.add(Text { paragraphs: Vec::new(), points });
    }
}

fn section(page: &mut Report, heading: &str, points: Vec<(Tone, String)>) {
    if !points.is_empty() {
        page.add(Heading::new(heading));
        list(page, points);
    }
}

fn explained(page: &mut Report, heading: &str, explanation: &str, points: Vec<(Tone, String)>) {
    if !points.is_empty() {
        page.add(Heading::new(heading));
        page.add(Text { paragraphs: vec![explanation.to_owned()], points });
    }
}

/// Evidence for the result of the iteration, joint by joint, from the last run that has it.
fn last_shown(file: &IterationsFile) -> Option<Table> {
    let run = file.runs.iter().rfind(|run| run.evidence.is_some())?;
    let optional = |value: Option<String>| Cell::from(value.unwrap_or_else(|| "–".to_owned()));
    let columns = [
        "joint",
        "tracking error, rad (m)",
        "expected error",
        "at the torque limit",
        "torque lag, ms",
        "compensated lag, ms",
        "predicted inside the 95 % band",
    ];
    let evidence = run.evidence.as_ref()?;
    let delay = evidence.feedback_delay_s.map_or_else(String::new, |delay_s| {
        format!("; the tracking error corresponds to a feedback delay of {} ms", short(1e3 * delay_s, 3))
    });
    let mut table = Table::new(format!("Run {}", run_name(run)), columns).note(format!(
        "expected error: due to noise, friction and delay, computed if tracking exceeds the tolerance{delay}; predicted: with the model from earlier accepted runs",
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
