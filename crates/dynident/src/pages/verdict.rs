//! Beginning of the report of an identification: verdict and key figures.

use super::torque_words::{
    consistency_words, dead_torques, format_error_words, joint_error_words, percent_words, poorly_known_words,
};
use crate::result::{
    BaseParameterResult, FormatError, JointError, POORLY_KNOWN_PERCENT, ResultFile, TorqueErrorSettings,
};
use dynident_report::{KeyFigures, Text, Tone, short};

/// Maximum number of held-out logs in the first sentence and in the key figures.
const MAX_LOGS: usize = 3;

/// Text that answers three questions: is the model good and for what, what is poorly determined, and what should be
/// done next.
pub(super) fn verdict(r: &ResultFile) -> Text {
    let settings = &r.thresholds.errors;
    let mut text = Text::new(headline(r));
    let problems = r.problem_lines();
    let is_usable = problems.is_empty() && r.physical.consistent;
    if !is_usable {
        text = text.point(Tone::Bad, "Do not load it into a robot before these points are settled:");
    }
    for problem in problems {
        text = text.point(Tone::Bad, problem);
    }
    if is_usable {
        let error = r.validation.first().and_then(|log| log.exported().relative_error_percent);
        let (tone, condition) = match error.map(|error| rating(error, settings)) {
            Some(Tone::Good) => (Tone::Good, ""),
            Some(_) => (Tone::Warning, " if this error is small enough for you"),
            None => (Tone::Plain, ""),
        };
        text = text.point(
            tone,
            format!(
                "Use it for motion like the recorded one{condition}, in a controller or simulator: every body is \
                 physically possible. Do not use it for other payloads, or for the mass of a single link."
            ),
        );
    }
    let weak = r.weak_joints();
    if !weak.is_empty() {
        let words = joint_error_words(&weak, &str::to_owned);
        text = text.point(Tone::Warning, format!("Much worse at single joints: {words}."));
    }
    let formats = formats(r);
    let worse: Vec<&FormatError> = formats.iter().filter(|format| format.is_worse).collect();
    if !worse.is_empty() {
        let is_bad = rating(worse[0].relative_error_percent, settings) == Tone::Bad;
        let tone = if is_bad { Tone::Bad } else { Tone::Warning };
        let words = format_error_words(&worse);
        text = text.point(tone, format!("Exported files that lack some friction or drive terms are worse: {words}."));
    }
    let all = r.base_parameters.len();
    let poor = r.poorly_known();
    let count: usize = poor.iter().map(|kind| kind.count).sum();
    if count == 0 {
        let tone = if is_usable { Tone::Good } else { Tone::Plain };
        return text.point(tone, format!("All {all} parameters are known to {POORLY_KNOWN_PERCENT} %."));
    }
    text = text.point(
        Tone::Warning,
        format!(
            "{count} of {all} parameters are poorly known (error bar above {POORLY_KNOWN_PERCENT} % of the value): {}. \
             Motion like the recorded one hardly needs them; other motion and payloads do.",
            poorly_known_words(&poor)
        ),
    );
    text.point(Tone::Plain, next_step(r, is_usable))
}

/// Held-out error with its frequency band, and the error of the robot description.
fn headline(r: &ResultFile) -> String {
    let Some(first) = r.validation.first() else {
        return "No log was held out, so the error of this model on other motion is not known.".to_owned();
    };
    let errors: Vec<String> = r
        .validation
        .iter()
        .filter_map(|log| Some((log, log.exported().relative_error_percent?)))
        .take(MAX_LOGS)
        .map(|(log, error)| {
            let name = if r.validation.len() > 1 { format!(" ({})", log.log) } else { String::new() };
            format!("{}{name}", percent_words(error))
        })
        .collect();
    if errors.is_empty() {
        return "The held-out log has no torque, so the error of this model is not known.".to_owned();
    }
    let band = r.held_out_band_hz(first).map(|hz| format!(", both filtered below {}\u{a0}Hz", short(hz, 2)));
    let raw = first.exported_raw().and_then(|raw| raw.relative_error_percent);
    let raw = raw.map(|percent| format!("; without this filter {}", percent_words(percent)));
    let filter = match (band, raw) {
        (Some(band), Some(raw)) => band + &raw,
        (Some(band), None) => band,
        (None, _) => String::new(),
    };
    let described = first.prior.as_ref().and_then(|prior| prior.relative_error_percent);
    let described = described
        .map_or_else(String::new, |error| format!(" The robot description predicts it to {}.", percent_words(error)));
    format!(
        "This model predicts the torque of motion that was not used for the fit to {} (root mean square error relative \
         to the torque{filter}).{described}",
        errors.join(", ")
    )
}

fn next_step(r: &ResultFile, is_usable: bool) -> String {
    let dead = dead_torques(r);
    if !dead.is_empty() {
        return format!(
            "Next: find out why the torque of {} is zero (recorder, driver, or a joint without torque measurement). \
             Design another motion only after that.",
            dead.join(", ")
        );
    }
    if !is_usable {
        return "Next: correct the points above, and identify again.".to_owned();
    }
    let study = r.provenance.as_ref().and_then(|origin| origin.study.as_ref());
    let study = study.map_or("STUDY.toml", |study| study.file.as_str());
    format!(
        "Next: `dynident design {study} --out design` finds a motion that measures them; record it and identify again."
    )
}

/// Errors of the export formats on the first held-out log.
fn formats(r: &ResultFile) -> Vec<FormatError> {
    r.validation.first().map_or_else(Vec::new, |log| r.format_errors(log))
}

pub(super) fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{}\u{a0}%", short(value, 3)))
}

/// Rating of a held-out error.
fn rating(percent: f64, settings: &TorqueErrorSettings) -> Tone {
    match percent {
        good if good <= settings.max_good_percent => Tone::Good,
        fair if fair <= settings.max_fair_percent => Tone::Warning,
        _ => Tone::Bad,
    }
}

/// Key figures: errors, the worst joint, export formats, and what is known of the parameters, each with a rating.
pub(super) fn key_figures(r: &ResultFile) -> KeyFigures {
    let settings = &r.thresholds.errors;
    // A green mark next to a problem would be misleading.
    let is_good = r.problems.is_empty() && r.method.is_settled();
    let careful = |tone: Tone| if tone == Tone::Good && !is_good { Tone::Plain } else { tone };
    let rated = |percent: Option<f64>| careful(percent.map_or(Tone::Plain, |percent| rating(percent, settings)));
    let mut figures = KeyFigures::new();
    for log in r.validation.iter().take(MAX_LOGS) {
        let prior = log.prior.as_ref().and_then(|prior| prior.relative_error_percent);
        let prior = prior.map_or_else(String::new, |prior| format!("; robot description {}", percent(Some(prior))));
        let error = log.exported().relative_error_percent;
        figures = figures.judged("held-out torque error", percent(error), format!("{}{prior}", log.log), rated(error));
    }
    if r.validation.is_empty() {
        figures = figures.judged("held-out torque error", "–", "no held-out log", Tone::Warning);
    }
    let is_weak = |joint: &JointError| r.weak_joints().iter().any(|weak| weak.name == joint.name);
    let worst = r.validation.first().and_then(|log| r.joint_errors(log).into_iter().next());
    if let Some(joint) = worst {
        let small = if joint.is_small { "; its torque is small" } else { "" };
        let note = format!("{}: {}\u{a0}{}{small}", joint.name, short(joint.rmse, 2), joint.unit);
        let tone = match rating(joint.relative_error_percent, settings) {
            Tone::Bad if joint.is_small => Tone::Warning,
            _ if !is_weak(&joint) => Tone::Good,
            tone => tone,
        };
        figures =
            figures.judged("worst joint, held out", percent(Some(joint.relative_error_percent)), note, careful(tone));
    }
    let formats = formats(r);
    if let Some(worst) = formats.first() {
        let (value, note) =
            (percent(Some(worst.relative_error_percent)), format_error_words(&formats.iter().collect::<Vec<_>>()));
        let tone = match rated(Some(worst.relative_error_percent)) {
            Tone::Good if worst.is_worse => Tone::Warning,
            tone => tone,
        };
        figures = figures.judged("worst export format", value, note, tone);
    }
    let fit = r.training.physical.as_ref().map_or(r.training.relative_error_percent, |own| own.relative_error_percent);
    figures = figures.judged(
        "error of the fit",
        percent(fit),
        format!("{} rows per joint after filtering", r.training.samples),
        rated(fit),
    );
    let physical = if r.physical.consistent { ("yes", careful(Tone::Good)) } else { ("no", Tone::Bad) };
    let (known, tone) = known_parameters(r);
    let all = r.base_parameters.len();
    let within = r.base_parameters.iter().filter(|parameter| !parameter.is_poorly_known()).count();
    figures
        .judged(
            format!("parameters within {POORLY_KNOWN_PERCENT} %"),
            format!("{within} of {all}"),
            known,
            careful(tone),
        )
        .judged("physically consistent", physical.0, "", physical.1)
}

/// How well the base parameters are known, with a rating.
fn known_parameters(r: &ResultFile) -> (String, Tone) {
    let within = |percent: f64| {
        let bars = r.base_parameters.iter().filter_map(BaseParameterResult::relative_half_width_percent);
        bars.filter(|bar| *bar <= percent).count()
    };
    let all = r.base_parameters.len();
    let excited = r.base_parameters.iter().filter(|parameter| parameter.excited).count();
    let vague = excited - within(100.0).min(excited);
    let mut known = vec![format!("{} within 10 %", within(10.0))];
    if vague > 0 {
        known.push(format!("{vague} with error bars larger than the value"));
    }
    if excited < all {
        known.push(format!("{} not excited", all - excited));
    }
    if !r.method.is_settled() {
        known.push("NOT converged".to_owned());
    }
    let is_doubtful = vague > 0 || excited < all || !r.method.is_settled();
    (known.join("; "), if is_doubtful { Tone::Warning } else { Tone::Good })
}

/// Describes which model the figures show, and whether it differs significantly from the unconstrained estimate.
pub(super) fn model_description(r: &ResultFile) -> Text {
    if r.physical.fit.is_none() {
        return Text::new("All figures use the unconstrained estimate, because there is no physically consistent set.");
    }
    let words = consistency_words(r).map_or_else(String::new, |words| format!("; {words}"));
    Text::new(format!(
        "Figures and plots of held-out logs use the exported, physically consistent model{words}. The unconstrained \
         estimate is listed for comparison."
    ))
}
