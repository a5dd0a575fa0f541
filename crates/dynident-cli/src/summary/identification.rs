use super::findings::{problems, warnings};
use super::noise::noise;
use super::text::{WIDTH, listed, name, percent, shortened, table, with_deviation, wrapped};
use super::validation::residuals;
use core::fmt::Write;
use dynident::ResultFile;
use dynident::identification::consistent::ParameterInterval;
use dynident::identification::examination::{LagKind, LogValidation};
use dynident::identification::friction::FrictionCandidate;
use dynident::result::{BaseParameterResult, LogSummary, POORLY_KNOWN_PERCENT};
use std::path::Path;

/// Maximum number of base parameters shown; the file contains all.
const MAX_SHOWN: usize = 6;
/// Maximum number of held-out logs for which the table shows RMS values and the errors of the prior.
const MAX_DETAILED_LOGS: usize = 2;
const MIN_REPORTED_RATIO: f64 = 1.5;
/// Maximum number of held-out logs for which the table has one column each.
const MAX_LOG_COLUMNS: usize = 5;
const EXPRESSION_COLUMNS: usize = 44;

pub(crate) fn identification(r: &ResultFile, out: &Path, models: &[&str]) -> String {
    let mut text = wrapped(&r.name, 2);
    let _ = writeln!(
        text,
        "{} joints, {} base parameters, {}\n",
        r.robot.dof,
        r.base_parameters.len(),
        estimator(&r.method.estimator)
    );
    let against = problems(r);
    if !against.is_empty() {
        let _ = writeln!(text, "{against}");
    }
    text += &headline(r);
    text.push('\n');
    let found = warnings(&r.logs);
    if !found.is_empty() {
        let _ = writeln!(text, "{found}");
    }
    text += &differences(r);
    text += &noise(r);
    text += &joints(r);
    for log in &r.validation {
        text += &residuals(log, &r.thresholds.errors);
    }
    text += &lags(r);
    text += &between_logs(r);
    text += &super::load::loads(r);
    text += &drives(r);
    text.push('\n');
    if !r.friction_choice.is_empty() {
        text += &friction(r);
        text.push('\n');
    }
    text += &parameters(r);
    text.push('\n');
    text += &physics(r);
    if let Some(intervals) = &r.possible_intervals {
        text += &masses(intervals);
    }
    text.push('\n');
    for log in &r.logs {
        text += &wrapped(&data(log), 4);
    }
    let others = [&["report.html"], models].concat().join(", ");
    let _ = writeln!(text, "\nwrote {}, {others} in {:.2} s", out.join("result.json").display(), r.timings_s.total);
    if let Some(reason) = &r.no_urdf {
        text += &wrapped(&format!("no identified.urdf: {reason}"), 2);
    }
    if let Some(reason) = &r.no_mjcf {
        text += &wrapped(&format!("no identified.xml: {reason}"), 2);
    }
    if let Some(reason) = &r.no_sdf {
        text += &wrapped(&format!("no identified.sdf: {reason}"), 2);
    }
    text
}

/// Lists the bodies whose identified values differ from the robot description.
fn differences(r: &ResultFile) -> String {
    let words = dynident::difference_words(r);
    if words.is_empty() { String::new() } else { wrapped(&format!("{}.", words.join(". ")), 2) }
}

fn estimator(name: &str) -> String {
    match name {
        "instrumental" => "instrumental variables".to_owned(),
        "maximum-likelihood" => "maximum likelihood".to_owned(),
        "didim" | "clie" | "cloe" => format!("{} with the simulated closed loop", name.to_uppercase()),
        "huber" | "tukey" => format!("reweighted least squares ({name})"),
        other => format!("{other} least squares"),
    }
}

fn headline(r: &ResultFile) -> String {
    let fitted = r.training.physical.as_ref();
    let fit = percent(fitted.map_or(r.training.relative_error_percent, |fitted| fitted.relative_error_percent));
    if r.validation.is_empty() {
        return wrapped(
            &format!(
                "No log was held out: the error of {fit}\u{a0}% is that of the fit, not of a prediction. \
                 Set the role of a log (or a part of one) to \"validate\"."
            ),
            0,
        ) + &beside(r);
    }
    let mut text = String::new();
    for (number, log) in r.validation.iter().enumerate() {
        let prior =
            prior_of(log, None).map_or(String::new(), |p| format!("; robot description {}\u{a0}%", percent(Some(p))));
        let error = percent(log.exported().relative_error_percent);
        let without = without_events(log);
        text += &wrapped(
            &format!(
                "held-out torque error {error}\u{a0}%{without} on [{}] {}{} (fit {fit}\u{a0}%{prior})",
                number + 1,
                log.log,
                own_offsets(log)
            ),
            2,
        );
    }
    text += &weak_joints(r);
    text += &bands(r);
    text += &beside(r);
    text + &super::forms::forms(r)
}

/// The part of a held-out log from which the offsets of this log were determined.
fn own_offsets(log: &LogValidation) -> String {
    log.own_offsets.as_ref().map_or_else(String::new, |own| {
        format!(" after {:.1}\u{a0}s; the rows before determine the torque offsets of this log", own.fitted_s[1])
    })
}

/// The error without the time intervals of clear events, if there are any.
fn without_events(log: &LogValidation) -> String {
    let Some(rest) = &log.without_events else { return String::new() };
    let error = percent(rest.physical.as_ref().unwrap_or(&rest.model).relative_error_percent);
    let places: Vec<String> = rest.left_out_s.iter().map(|[from, to]| format!("{from:.2} to {to:.2}\u{a0}s")).collect();
    format!(
        " ({error}\u{a0}% without the events at {}, {:.1}\u{a0}% of the rows)",
        places.join(", "),
        100.0 * rest.left_out_share
    )
}

/// The joints with much larger errors than all joints together.
fn weak_joints(r: &ResultFile) -> String {
    let weak = r.weak_joints();
    if weak.is_empty() {
        return String::new();
    }
    wrapped(&format!("much worse at single joints: {}", dynident::joint_error_words(&weak, &name)), 2)
}

/// The frequency bands of fit and validation, and the error without a filter.
fn bands(r: &ResultFile) -> String {
    let band = r.validation.first().and_then(|log| Some((log, r.held_out_band_hz(log)?)));
    let Some((log, band_hz)) = band else { return String::new() };
    let in_force = r.method.motion.differentiator.cutoff_hz().filter(|_| r.method.motion_hz.is_some());
    let positions =
        in_force.map_or_else(String::new, |cutoff_hz| format!("positions filtered at {cutoff_hz:.1}\u{a0}Hz; "));
    let raw = log.exported_raw().map_or_else(String::new, |raw| {
        format!("; without this filter {}\u{a0}%", percent(raw.relative_error_percent))
    });
    wrapped(&format!("{positions}held-out errors: torque filtered below {band_hz:.1}\u{a0}Hz{raw}"), 2)
}

/// The unconstrained estimate compared with the physically consistent model that is written, and whether they differ
/// significantly.
fn beside(r: &ResultFile) -> String {
    if r.physical.fit.is_none() {
        return String::new();
    }
    let free = |log: &LogValidation| format!("{}\u{a0}%", percent(log.model.relative_error_percent));
    let mut errors: Vec<String> = r.validation.iter().take(MAX_LOG_COLUMNS).map(free).collect();
    if errors.is_empty() {
        errors.push(format!("{}\u{a0}%", percent(r.training.relative_error_percent)));
    }
    let verdict = dynident::consistency_words(r).map_or_else(String::new, |words| format!("; {words}"));
    wrapped(
        &format!(
            "  errors of the exported, physically consistent model{verdict}; unconstrained estimate: {}",
            errors.join(", ")
        ),
        4,
    )
}

fn prior_of(log: &LogValidation, joint: Option<usize>) -> Option<f64> {
    let prior = log.prior.as_ref()?;
    joint.map_or(prior.relative_error_percent, |j| prior.joints[j].relative_error_percent)
}

fn joints(r: &ResultFile) -> String {
    let logs = &r.validation[..r.validation.len().min(MAX_LOG_COLUMNS)];
    let detailed = logs.len() <= MAX_DETAILED_LOGS;
    let mut header = vec!["torque error".to_owned(), "fit %".to_owned()];
    for number in 1..=logs.len() {
        header.push(format!("[{number}] %"));
        if detailed {
            header.extend([format!("[{number}] Nm"), "prior %".to_owned()]);
        }
    }
    let row = |joint: Option<usize>| {
        let (all, joints) =
            r.training.physical.as_ref().map_or((r.training.relative_error_percent, &r.training.joints), |written| {
                (written.relative_error_percent, &written.joints)
            });
        let (title, fit) =
            joint.map_or(("all joints", all), |j| (&joints[j].name[..], joints[j].relative_error_percent));
        let mut row = vec![name(title), percent(fit)];
        for log in logs {
            let written = log.exported();
            let (relative, rms) = joint.map_or((written.relative_error_percent, written.rmse_nm), |j| {
                let joint = &written.joints[j];
                (joint.relative_error_percent, joint.rmse_nm)
            });
            row.push(percent(relative));
            if detailed {
                row.extend([format!("{rms:.3}"), percent(prior_of(log, joint))]);
            }
        }
        row
    };
    let rows = (0..r.training.joints.len()).map(|joint| row(Some(joint))).chain([row(None)]).collect();
    let mut text = table(&header, 1..header.len(), rows);
    if r.validation.len() > MAX_LOG_COLUMNS {
        let _ = writeln!(text, "  {} more held-out logs in result.json", r.validation.len() - MAX_LOG_COLUMNS);
    }
    text
}

fn between_logs(r: &ResultFile) -> String {
    let Some(found) = r.method.between_logs else { return String::new() };
    let of = |what: &str, k: Option<f64>| {
        k.filter(|k| *k >= MIN_REPORTED_RATIO)
            .map(|k| format!("{what} vary between logs ({k:.1} times their error bars)"))
    };
    let said: Vec<String> =
        [of("bodies", found.bodies), of("friction parameters", found.friction)].into_iter().flatten().collect();
    if said.is_empty() {
        return String::new();
    }
    let is_of_bodies = found.bodies.is_some_and(|k| k >= MIN_REPORTED_RATIO);
    let next = if is_of_bodies { "; `dynident check` names a log with another load" } else { "" };
    wrapped(&format!("{}; the error bars include this{next}", said.join(", ")), 2)
}

/// The torque lag of the joints if it matters, otherwise a summary of it.
fn lags(r: &ResultFile) -> String {
    let known = || r.joints.iter().filter_map(|joint| joint.torque_lag.map(|lag| (&joint.name, lag)));
    let said = |what: String| format!("\n{}", wrapped(&format!("  torque lag: {what}"), 4));
    let text = r.method.torque_lag.sentence().map_or_else(String::new, said);
    if r.method.torque_lag.kind != LagKind::Joints && known().all(|(_, lag)| !lag.matters) {
        return text;
    }
    let header = ["torque lag behind motion", "ms", "+- (95 %)"].map(str::to_owned);
    let rows = known().map(|(joint, lag)| {
        let [value, half] = with_deviation(1e3 * lag.lag_s, 1e3 * lag.half_width_95_s);
        vec![name(joint), value, half]
    });
    format!("{text}\n{}", table(&header, 1..3, rows.collect()))
}

fn drives(r: &ResultFile) -> String {
    let said = r.drive_inertia_choice.as_ref();
    said.map_or_else(String::new, |choice| wrapped(&format!("drive inertia: {}", choice.sentence()), 2))
}

/// The friction laws selected from the training logs compared with the default; and the joints without selection,
/// with the reason.
fn friction(r: &ResultFile) -> String {
    let header = ["friction by cross-validation", "chosen Nm", "plain Nm", ""].map(str::to_owned);
    let (chosen, stated): (Vec<_>, Vec<_>) = r.friction_choice.iter().partition(|joint| joint.drive.is_some());
    let rows = chosen.iter().map(|joint| {
        let error = |candidate: Option<&FrictionCandidate>| {
            candidate.map_or_else(String::new, |candidate| format!("{:.3}", candidate.cv_error_nm))
        };
        let chosen = joint.candidates.iter().find(|candidate| candidate.chosen);
        vec![
            name(&joint.joint),
            error(chosen),
            error(joint.candidates.first()),
            shortened(&joint.chosen, EXPRESSION_COLUMNS),
        ]
    });
    let mut text = if chosen.is_empty() { String::new() } else { table(&header, 1..3, rows.collect()) };
    for joint in &chosen {
        if let Some(cost) = joint.restriction() {
            text += &wrapped(&format!("friction of {}: {cost}", name(&joint.joint)), 2);
        }
    }
    // Combine joints with the same reason.
    for same in stated.chunk_by(|a, b| a.chosen == b.chosen) {
        let names: Vec<String> = same.iter().map(|joint| name(&joint.joint)).collect();
        text += &wrapped(&format!("friction of {}: {}", names.join(", "), same[0].chosen), 2);
    }
    text
}

fn parameters(r: &ResultFile) -> String {
    let mut order: Vec<usize> = (0..r.base_parameters.len()).filter(|&i| r.base_parameters[i].excited).collect();
    let error = |index: usize| r.base_parameters[index].relative_half_width_percent().unwrap_or(f64::INFINITY);
    order.sort_by(|a, b| error(*a).total_cmp(&error(*b)));
    let counted = |limit: f64| order.iter().filter(|index| error(**index) <= limit).count();
    let mut text = wrapped(
        &format!(
            "95 % error bars: {} of {} base parameters are known to 10 % or better, {} to 30 % or better. The best:",
            counted(10.0),
            r.base_parameters.len(),
            counted(30.0)
        ),
        2,
    );
    let rows = order.iter().take(MAX_SHOWN).map(|&index| {
        let p = &r.base_parameters[index];
        let [value, half_width] = with_deviation(p.value, p.bar_95());
        vec![value, half_width, p.unit.clone(), shortened(&p.expression, EXPRESSION_COLUMNS)]
    });
    let header = ["value", "+- (95 %)", "unit", "base parameter"].map(str::to_owned);
    text += &table(&header, 0..2, rows.collect());
    text += &poorly_known(r);
    for sentence in &r.method.coincident {
        text += &wrapped(sentence, 2);
    }
    if !r.method.not_excited.is_empty() {
        let names: Vec<&str> = r.method.not_excited.iter().map(String::as_str).collect();
        let held = format!("not excited by these logs, fixed at the prior: {}", listed(&names, 2 * MAX_SHOWN));
        text += &wrapped(&held, 2);
        text += &conditional(r);
    }
    text
}

/// Kinds, links and joints of the poorly known parameters, whether they matter, and what to do.
fn poorly_known(r: &ResultFile) -> String {
    let found = r.poorly_known();
    if found.is_empty() {
        return String::new();
    }
    let dead = dynident::dead_torques(r);
    let advice = if dead.is_empty() {
        "`dynident design` with `--result` finds a motion that measures them".to_owned()
    } else {
        let joints: Vec<String> = dead.iter().map(|joint| name(joint)).collect();
        format!("first find out why the torque of {} is zero", joints.join(", "))
    };
    wrapped(
        &format!(
            "poorly known (error bar above {POORLY_KNOWN_PERCENT}\u{a0}%): {}; motion like the recorded one hardly needs \
             them, other motion and payloads do: {advice}",
            dynident::poorly_known_words(&found)
        ),
        2,
    )
}

/// Estimates that depend on parameters that were fixed at the prior, and how to determine these parameters.
fn conditional(r: &ResultFile) -> String {
    let dependent: Vec<_> = r.base_parameters.iter().filter(|p| !p.conditional_on.is_empty()).collect();
    let mut text = String::new();
    if !dependent.is_empty() {
        let one = |p: &&BaseParameterResult| {
            let on: Vec<&str> = p.conditional_on.iter().map(|condition| condition.on.as_str()).collect();
            format!("{} on {}", p.symbol, listed(&on, 2))
        };
        let all: Vec<String> = dependent.iter().map(one).collect();
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        let bars = if dependent.iter().any(|p| p.half_width_95_with_nominal.is_some()) {
            "the error bars include 30\u{a0}% uncertainty of the nominal masses"
        } else {
            "the error bars are valid only if these values are right, and their uncertainty is unknown"
        };
        let words = format!(
            "{} estimates depend on parameters fixed at the prior: {}; {bars}",
            dependent.len(),
            listed(&all, MAX_SHOWN)
        );
        text += &wrapped(&words, 2);
    }
    if !r.method.resting_joints.is_empty() {
        let joints: Vec<&str> = r.method.resting_joints.iter().map(String::as_str).collect();
        let words = format!(
            "no log moves {} more than the encoder noise: record a motion of all joints (use `dynident design`; \
             with `prior.result = \"result.json\"` in [design] it excites the parameters that these logs do not determine)",
            listed(&joints, MAX_SHOWN)
        );
        text += &wrapped(&words, 2);
    }
    text
}

fn physics(r: &ResultFile) -> String {
    let bodies = r.physical.violations.len();
    wrapped(
        &if r.physical.consistent {
            "physics: bodies and friction are physically consistent".to_owned()
        } else {
            format!(
                "physics: NOT consistent ({bodies} violations, listed in result.json under `physical`). Torques are predicted as \
                 well as shown above, but masses and inertias of single bodies are not reliable, and a simulator may reject them."
            )
        },
        2,
    )
}

/// Intervals of the bodies' masses from the data and the conditions of physical consistency.
fn masses(intervals: &[ParameterInterval]) -> String {
    let end = |end: Option<f64>, open: &str| end.map_or_else(|| open.to_owned(), |end| format!("{end:.3}"));
    let rows = intervals.iter().filter(|interval| interval.unit == "kg").map(|interval| {
        vec![
            name(interval.of.as_deref().unwrap_or_default()),
            format!("{:.3}", interval.value),
            end(interval.lower, "0"),
            end(interval.upper, "open"),
        ]
    });
    let header = ["mass, 95 % interval, physically consistent", "kg", "from", "to"].map(str::to_owned);
    table(&header, 1..4, rows.collect())
}

fn data(log: &LogSummary) -> String {
    let motion =
        log.motion_cutoff_hz.map_or(String::new(), |cutoff| format!(", positions filtered at {cutoff:.1}\u{a0}Hz"));
    format!(
        "{} ({}): {} rows at {:.1}\u{a0}Hz{motion}, {} filtered rows per joint",
        log.log,
        log.role.name(),
        log.import.rows,
        log.import.rate_hz,
        log.filtered_rows
    )
}

const _: () = assert!(EXPRESSION_COLUMNS + 34 <= WIDTH, "value, deviation, unit and their gaps take 34 columns");
