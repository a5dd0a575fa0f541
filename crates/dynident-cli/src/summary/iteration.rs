use super::text::{table, wrapped};
use dynident::result::IterationRun;
use dynident::{IterationsFile, SimulationFile};
use std::path::Path;

const MAX_PARAMETERS: usize = 20;

pub(crate) fn iteration(file: &IterationsFile, out: &Path) -> String {
    let runs = file.runs.len();
    let mut text = wrapped(&format!("{}: {} ({runs} runs of {:.1} s)", file.name, file.reason, file.duration_s), 4);
    text.push('\n');
    let header = ["run", "controller", "tracking", "change", "error", "verdict"].map(str::to_owned);
    let rows = file.runs.iter().enumerate().map(|(place, run)| row(run, place.checked_sub(1).map(|k| &file.runs[k])));
    text += &table(&header, 2..5, rows.collect());
    text += "  tracking: largest tracking error, rad (m); change: largest change of a\n  parameter, in error bars; error: largest, if the truth is known; both for the\n  joint fit of all good runs up to this one\n\n";
    text += &run_remarks(file);
    text += &verdict_remarks(file);
    text += &parameters(file);
    if let Some(why) = &file.no_result {
        text += &wrapped(&format!("No result.json: {why}"), 4);
    }
    let robot = if file.base_parameters.is_empty() {
        ""
    } else {
        ", and the identified robot: result.json, identification.html, controller.json and its robot description"
    };
    text += &wrapped(
        &format!("Written: {}, {}{robot}", out.join("iterations.json").display(), out.join("report.html").display()),
        4,
    );
    text
}

/// Notes on single runs: rejected runs, reduced bandwidths, oscillations, warm-ups, held-out motions and forecasts.
fn run_remarks(file: &IterationsFile) -> String {
    let mut text = String::new();
    for run in file.runs.iter().filter(|run| !run.accepted) {
        if let Some(reason) = &run.reason {
            text += &wrapped(&format!("run {} was rejected: {reason}", run.run), 4);
        }
    }
    if let Some(sentence) = file.lowered_bandwidths_sentence() {
        text += &wrapped(&format!("NOTE: {sentence}."), 4);
    }
    for sentence in file.oscillation_sentences() {
        text += &wrapped(&format!("WARNING: {sentence}."), 4);
    }
    for run in &file.runs {
        if let Some(warm_up) = &run.warm_up {
            text += &wrapped(&format!("Before run {}: {}.", run.run, warm_up.sentence(&file.joints)), 4);
        }
    }
    for run in &file.runs {
        if let Some(held_out) = &run.held_out {
            text += &wrapped(&format!("After run {}: {}.", run.run, held_out.sentence(&file.joints)), 4);
        }
    }
    for run in &file.runs {
        if let Some(forecast) = &run.forecast {
            text += &wrapped(&format!("Run {}: {}.", run.run, forecast.sentence()), 4);
        }
    }
    text
}

/// Notes on the iteration as a whole: progress, errors, missing checks and conditions that were not met.
fn verdict_remarks(file: &IterationsFile) -> String {
    let mut text = String::new();
    if let Some(forecast) = &file.declined {
        text += &wrapped(&format!("A further run would add too little: {}.", forecast.sentence()), 4);
    }
    if let Some(improvement) = file.tracking_improvement {
        text += &wrapped(&format!("Tracking error reduced by a factor of {improvement:.1}."), 4);
    }
    let last_evidence = file.runs.iter().rev().find_map(|run| run.evidence.as_ref());
    if let Some(delay_s) = last_evidence.and_then(|evidence| evidence.feedback_delay_s) {
        text += &wrapped(
            &format!(
                "A feedback delay of {:.1} ms in the controller causes most of the tracking error.",
                1e3 * delay_s
            ),
            4,
        );
    }
    if let Some(ratio) = file.error_over_bound {
        text += &wrapped(
            &format!("Last estimate: error over the Cramér-Rao bound {ratio:.2} (root mean square over parameters)."),
            4,
        );
    }
    if let Some(sentence) =
        file.runs.iter().rfind(|run| run.accepted).and_then(|run| run.run_offsets_sentence(&file.joints))
    {
        text += &wrapped(&format!("NOTE: {sentence}."), 4);
    }
    for what in file.unchecked_torque() {
        text += &wrapped(&format!("NOT checked: {what}."), 4);
    }
    for unmet in &file.unmet {
        text += &wrapped(&format!("UNMET: {}. Suggested fix: {}.", unmet.message, unmet.remedy), 4);
    }
    text
}

fn parameters(file: &IterationsFile) -> String {
    if file.base_parameters.is_empty() {
        return String::new();
    }
    let mut text = "\nEstimate from all good runs (+- 95 %):\n".to_owned();
    let rows = file.base_parameters.iter().take(MAX_PARAMETERS).map(|one| {
        let bar = if one.excited { format!("{:.2e}", one.bar_95()) } else { "not excited".to_owned() };
        vec![super::text::name(&one.symbol), format!("{:.5}", one.value), bar, one.unit.clone()]
    });
    text += &table(&["parameter", "value", "+-", "unit"].map(str::to_owned), 1..3, rows.collect());
    if file.base_parameters.len() > MAX_PARAMETERS {
        text += &wrapped(
            &format!("and {} more, in result.json and report.html", file.base_parameters.len() - MAX_PARAMETERS),
            4,
        );
    }
    text.push('\n');
    text
}

fn row(run: &IterationRun, before: Option<&IterationRun>) -> Vec<String> {
    let tracking = run.max_tracking_error_rad.iter().fold(0.0_f64, |most, error| most.max(*error));
    let change = before.filter(|before| before.known().len() == run.known().len() && !run.known().is_empty());
    let change = change.map(|before| {
        let pairs = run.known().iter().zip(before.known());
        let each = pairs.filter_map(|(new, old)| {
            let bar = new.std?.hypot(old.std?);
            (bar > 0.0).then(|| (new.value - old.value).abs() / bar)
        });
        each.fold(0.0, f64::max)
    });
    let errors = run.known().iter().filter_map(|parameter| parameter.error.map(f64::abs));
    let error = errors.fold(None, |most: Option<f64>, error| Some(most.map_or(error, |most| most.max(error))));
    let damped = if run.damping < 1.0 { format!(" ({:.3} step)", run.damping) } else { String::new() };
    let dash = || "-".to_owned();
    vec![
        run.run.to_string(),
        format!("{}{damped}", run.controller),
        format!("{tracking:.2e}"),
        change.map_or_else(dash, |change| format!("{change:.1}")),
        error.map_or_else(dash, |error| format!("{error:.2e}")),
        if run.accepted { "good".to_owned() } else { "rejected".to_owned() },
    ]
}

pub(crate) fn simulation(file: &SimulationFile, out: &Path) -> String {
    let mut text = wrapped(
        &format!(
            "{}: {}, {} samples at {} Hz under {}",
            file.name, file.status, file.samples, file.rate_hz, file.controller
        ),
        4,
    );
    text.push('\n');
    let header = ["joint", "tracking error", "torque cut"].map(str::to_owned);
    let rows = file.joints.iter().zip(&file.max_tracking_error_rad).zip(&file.saturated_samples);
    let rows =
        rows.map(|((joint, error), cut)| vec![super::text::name(joint), format!("{error:.2e}"), cut.to_string()]);
    text += &table(&header, 1..3, rows.collect());
    text += "  tracking error: largest, rad (m); torque cut: samples at the effort limit\n\n";
    text += &wrapped(&format!("Written: {}, {}", out.join("log.csv").display(), out.join("truth.json").display()), 4);
    text
}
