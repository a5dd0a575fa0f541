//! Results as a person likes to read them.

use comfy_table::{CellAlignment, Table, presets};
use core::fmt::Write;
use dynident::estimation::ValidationReport;
use dynident::{Inspection, LogSummary, LogValidation, ResultFile};
use std::path::Path;

/// Base parameters shown with their error bars; the rest stand in the file.
const SHOWN: usize = 8;

/// The result of `inspect`.
pub(crate) fn inspection(i: &Inspection) -> String {
    let mut text = format!("{}: {} joints, {:.3} kg that move\n\n", i.name, i.dof, i.moving_mass_kg);
    let mut table = plain(&["joint", "type", "limits", "speed", "torque", "body", "mass kg", "links"]);
    for (joint, body) in i.joints.iter().zip(&i.bodies) {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
        table.add_row([
            joint.name.clone(),
            joint.kind.to_owned(),
            format!("{} .. {}", number(joint.lower), number(joint.upper)),
            number(joint.velocity),
            number(joint.effort),
            body.name.clone(),
            body.mass_kg.map_or("unknown".to_owned(), |mass| format!("{mass:.4}")),
            body.links.len().to_string(),
        ]);
    }
    let base = &i.base_parameters;
    let _ = writeln!(text, "{table}\n\n{} base parameters:", base.count);
    for expression in &base.expressions {
        let _ = writeln!(text, "  {expression}");
    }
    if base.numerical_rank != base.count {
        let _ =
            writeln!(text, "  (regressors at random states have rank {}: the split is not clear)", base.numerical_rank);
    }
    let _ = writeln!(text, "\naudit:");
    for level in ["problem", "warning", "info"] {
        for entry in i.audit.iter().filter(|entry| entry.level == level) {
            let _ = writeln!(text, "  {:<8} {}: {}", entry.level, entry.place, entry.what);
        }
    }
    text
}

/// The result of `identify`.
pub(crate) fn identification(r: &ResultFile, out: &Path, urdf: bool) -> String {
    let mut text = format!(
        "{}: {} joints, {} base parameters, {} least squares\n\n",
        r.name,
        r.robot.dof,
        r.base_parameters.len(),
        r.method.estimator
    );
    findings(&mut text, &r.logs);
    let percent = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2} %"));
    let mut table = plain(&["torque error", "fit"]);
    let header: Vec<String> = ["torque error".to_owned(), "fit".to_owned()]
        .into_iter()
        .chain(
            r.validation.iter().flat_map(|v| [format!("held out: {}", v.log), "Nm rms".to_owned(), "prior".to_owned()]),
        )
        .collect();
    table.set_header(header);
    let prior_of = |v: &LogValidation, joint: Option<usize>| {
        v.prior.as_ref().and_then(|p| joint.map_or(p.relative_error_percent, |j| p.joints[j].relative_error_percent))
    };
    for (index, joint) in r.training.joints.iter().enumerate() {
        let mut row = vec![joint.name.clone(), percent(joint.relative_error_percent)];
        for v in &r.validation {
            let held = &v.model.joints[index];
            row.extend([
                percent(held.relative_error_percent),
                format!("{:.3}", held.rmse_nm),
                percent(prior_of(v, Some(index))),
            ]);
        }
        table.add_row(row);
    }
    let mut row = vec!["all joints".to_owned(), percent(r.training.relative_error_percent)];
    for v in &r.validation {
        row.extend([
            percent(v.model.relative_error_percent),
            format!("{:.3}", v.model.rmse_nm),
            percent(prior_of(v, None)),
        ]);
    }
    table.add_row(row);
    align_numbers(&mut table);
    let _ = writeln!(text, "{table}\n");
    if r.validation.is_empty() {
        let _ = writeln!(
            text,
            "No log was held out: the errors above say how well the model fits, not how well it predicts.\n"
        );
    }
    parameters(&mut text, r);
    let verdict = if r.physical.consistent {
        "the full set nearest to the prior is physically possible".to_owned()
    } else {
        format!("the full set nearest to the prior is NOT physically possible: {}", r.physical.violations.join("; "))
    };
    let _ = writeln!(text, "physics: {verdict}");
    if !r.method.not_excited.is_empty() {
        let _ = writeln!(text, "not excited by these logs, held at the prior: {}", r.method.not_excited.join(", "));
    }
    let _ = writeln!(
        text,
        "wrote {}{} in {:.2} s",
        out.join("result.json").display(),
        if urdf { " and identified.urdf" } else { "" },
        r.timings_s.total
    );
    text
}

/// The worst and the best known base parameters.
fn parameters(text: &mut String, r: &ResultFile) {
    let mut order: Vec<usize> = (0..r.base_parameters.len()).collect();
    let error = |index: usize| r.base_parameters[index].relative_std_percent.unwrap_or(f64::INFINITY);
    order.sort_by(|a, b| error(*a).total_cmp(&error(*b)));
    let counted = |limit: f64| order.iter().filter(|index| error(**index) <= limit).count();
    let _ = writeln!(
        text,
        "error bars (residuals' correlation in time counted): {} of {} base parameters known to 10 %, {} to 30 %; the best {}:",
        counted(10.0),
        order.len(),
        counted(30.0),
        SHOWN.min(order.len())
    );
    let mut table = plain(&["value", "+-", "unit", "base parameter"]);
    for &index in order.iter().take(SHOWN) {
        let p = &r.base_parameters[index];
        table.add_row([format!("{:.5}", p.value), format!("{:.5}", p.std), p.unit.clone(), shortened(&p.expression)]);
    }
    let _ = writeln!(text, "{table}\n");
}

fn shortened(expression: &str) -> String {
    const LONGEST: usize = 70;
    if expression.len() <= LONGEST {
        return expression.to_owned();
    }
    let terms = expression.matches(" + ").count() + expression.matches(" - ").count() + 1;
    let cut = expression[..LONGEST].rfind([' ']).unwrap_or(LONGEST);
    format!("{} .. ({terms} terms)", expression[..cut].trim_end_matches([' ', '+', '-']))
}

/// The result of `validate`.
pub(crate) fn validation(logs: &[LogValidation], summaries: &[LogSummary]) -> String {
    let mut text = String::new();
    findings(&mut text, summaries);
    for log in logs {
        let _ = writeln!(text, "{}: {} samples", log.log, log.model.samples);
        let mut table = plain(&["joint", "rms Nm", "relative", "largest Nm", "R2", "as logged", "prior"]);
        let line = |report: &ValidationReport, joint: Option<usize>| {
            joint.map_or(report.relative_error_percent, |j| report.joints[j].relative_error_percent)
        };
        let percent = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2} %"));
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
        let others = |joint: Option<usize>| {
            [percent(line(&log.raw, joint)), percent(log.prior.as_ref().and_then(|prior| line(prior, joint)))]
        };
        for (index, joint) in log.model.joints.iter().enumerate() {
            let [raw, prior] = others(Some(index));
            table.add_row([
                joint.name.clone(),
                format!("{:.4}", joint.rmse_nm),
                percent(joint.relative_error_percent),
                format!("{:.4}", joint.max_error_nm),
                number(joint.r_squared),
                raw,
                prior,
            ]);
        }
        let [raw, prior] = others(None);
        table.add_row([
            "all joints".to_owned(),
            format!("{:.4}", log.model.rmse_nm),
            percent(log.model.relative_error_percent),
            format!("{:.4}", log.model.max_error_nm),
            number(log.model.r_squared),
            raw,
            prior,
        ]);
        align_numbers(&mut table);
        let _ = writeln!(text, "{table}\n");
    }
    text
}

/// What the importer found, problems first.
fn findings(text: &mut String, logs: &[LogSummary]) {
    for log in logs {
        let filter = log
            .filter_cutoff_hz
            .map_or("no parallel filter".to_owned(), |cutoff| format!("parallel filter {cutoff:.1} Hz"));
        let motion = log
            .motion_cutoff_hz
            .map_or("no low-pass on positions".to_owned(), |cutoff| format!("positions below {cutoff:.1} Hz"));
        let _ = writeln!(
            text,
            "{} ({}): {} rows at {:.1} Hz; {motion}, {filter}, {} rows a joint at {:.1} Hz",
            log.log, log.role, log.import.rows, log.import.rate_hz, log.filtered_rows, log.filtered_rate_hz
        );
        let all = log.import.findings.iter().chain(&log.model_findings);
        for finding in all.filter(|finding| finding.level != dynident::recording::Level::Info) {
            let level = if finding.level == dynident::recording::Level::Problem { "PROBLEM" } else { "warning" };
            let _ = writeln!(text, "  {level} {}: {}", finding.channel, finding.message);
        }
    }
    text.push('\n');
}

fn plain(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.iter().copied());
    table
}

fn align_numbers(table: &mut Table) {
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}
