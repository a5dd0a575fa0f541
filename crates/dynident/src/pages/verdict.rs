//! Beginning of the report of an identification: verdict and key figures.

use crate::result::{BaseParameterResult, ResultFile};
use dynident_estimation::ValidationReport;
use dynident_identification::examination::LogValidation;
use dynident_report::{KeyFigures, Text, Tone, short};

/// A parameter is poorly determined if its error bar exceeds this percentage of its value.
const POORLY_KNOWN_PERCENT: f64 = 30.0;

/// Text that answers three questions: is the model good, what is poorly determined, and what should be done next.
pub(super) fn verdict(r: &ResultFile) -> Text {
    let held_out = r.validation.first().map(|log| exported_report(log).relative_error_percent);
    let first = match held_out {
        Some(Some(error)) => {
            let described = r.validation.first().and_then(|log| log.prior.as_ref()?.relative_error_percent);
            let described = described.map_or_else(String::new, |error| {
                format!(" The robot description predicts it to {} %.", short(error, 3))
            });
            format!(
                "This model predicts the torque of motion that was not used for the fit to {} % (root mean square error \
                 relative to the torque).{described}",
                short(error, 3)
            )
        }
        Some(None) => "The held-out log has no torque, so the error of this model is not known.".to_owned(),
        None => "No log was held out, so the error of this model on other motion is not known.".to_owned(),
    };
    let mut text = Text::new(first);
    if r.problems.is_empty() && r.physical.consistent {
        text = text
            .point(Tone::Good, "It can be loaded into a controller or simulator: every body is physically possible.");
    } else {
        text = text.point(Tone::Bad, "Do not load it into a robot before these points are settled:");
    }
    for problem in &r.problems {
        text = text.point(Tone::Bad, problem);
    }
    let poor = |p: &&BaseParameterResult| p.relative_half_width_percent().is_none_or(|bar| bar > POORLY_KNOWN_PERCENT);
    let count = r.base_parameters.iter().filter(poor).count();
    let all = r.base_parameters.len();
    if count == 0 {
        let tone = if r.problems.is_empty() { Tone::Good } else { Tone::Plain };
        return text.point(tone, format!("All {all} parameters are known to {POORLY_KNOWN_PERCENT} %."));
    }
    let study = r.provenance.as_ref().and_then(|origin| origin.study.as_ref());
    let study = study.map_or("STUDY.toml", |study| study.file.as_str());
    text.point(
        Tone::Warning,
        format!(
            "{count} of {all} parameters are poorly known: their error bar is above {POORLY_KNOWN_PERCENT} % of the value. \
             The torque of motion like the recorded one hardly depends on them."
        ),
    )
    .point(
        Tone::Plain,
        format!("Next: `dynident design {study} --out design` finds a motion that measures them; record it and identify again."),
    )
}

pub(super) fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{}\u{a0}%", short(value, 3)))
}

pub(super) fn key_figures(r: &ResultFile) -> KeyFigures {
    let mut figures = KeyFigures::new();
    for log in r.validation.iter().take(3) {
        let prior = log.prior.as_ref().and_then(|prior| prior.relative_error_percent);
        let mut note = log.log.clone();
        if log.physical.is_some() {
            note = format!("{note}; unconstrained estimate {}", percent(log.model.relative_error_percent));
        }
        if prior.is_some() {
            note = format!("{note}; robot description {}", percent(prior));
        }
        figures = figures.figure("held-out torque error", percent(exported_report(log).relative_error_percent), note);
    }
    if r.validation.is_empty() {
        figures = figures.judged("held-out torque error", "–", "no held-out log", Tone::Warning);
    }
    // A green mark next to a problem would be misleading.
    let good = if r.problems.is_empty() && r.method.is_settled() { Tone::Good } else { Tone::Plain };
    let all = r.base_parameters.len();
    let within = |percent: f64| {
        let bar = |p: &&BaseParameterResult| p.relative_half_width_percent().is_some_and(|bar| bar <= percent);
        r.base_parameters.iter().filter(bar).count()
    };
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
    let tone = if vague > 0 || excited < all || !r.method.is_settled() { Tone::Warning } else { good };
    let physical = if r.physical.consistent { ("yes", good) } else { ("no", Tone::Bad) };
    let fit = r.training.physical.as_ref().map_or(r.training.relative_error_percent, |own| own.relative_error_percent);
    figures
        .figure("error of the fit", percent(fit), format!("{} rows of the filtered logs", r.training.samples))
        .judged("parameters within 30 %", format!("{} of {all}", within(30.0)), known.join("; "), tone)
        .figure(
            "condition number",
            short(r.method.condition_number_scaled, 3),
            "of the regressor, with columns of unit length",
        )
        .judged("physically consistent", physical.0, "", physical.1)
        .figure("computing time", format!("{} s", short(r.timings_s.total, 3)), "")
}

/// Errors of the exported model: those of the physically consistent model, or of the estimate if there is none.
pub(super) fn exported_report(log: &LogValidation) -> &ValidationReport {
    log.physical.as_ref().unwrap_or(&log.model)
}

/// Describes which model the figures show, and whether it differs significantly from the unconstrained estimate.
pub(super) fn model_description(r: &ResultFile) -> Text {
    let Some(fit) = &r.physical.fit else {
        return Text::new("All figures use the unconstrained estimate, because there is no physically consistent set.");
    };
    let figures = "Figures and plots of held-out logs use the physically consistent model, which is the exported one; \
                   the unconstrained estimate is listed for comparison.";
    let Some(test) = fit.difference else { return Text::new(figures) };
    let numbers = format!("F test, p = {}", short(test.p_value, 2));
    let (tone, verdict) = if test.is_significant {
        (Tone::Warning, "The two differ significantly: no physically consistent model explains these logs completely")
    } else {
        (Tone::Plain, "The two do not differ significantly")
    };
    Text::new(figures).point(tone, format!("{verdict} ({numbers})."))
}
