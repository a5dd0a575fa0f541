//! `report.html` of an identification.

use super::identification_parameters::{bodies, friction, parameters};
use super::robot::RobotAppearance;
use super::verdict::{key_figures, model_description, percent, verdict};
use crate::error::Error;
use crate::result::{LogSummary, ResultFile, grouped_findings};
use dynident_identification::Role;
use dynident_identification::examination::{LogTrace, LogValidation};
use dynident_recording::Level;
use dynident_report::{Cell, Heading, LinePlot, Report, Table, Text, Tone, short};

/// The page of a stored result with torque over time and a picture of the robot, like
/// [`IdentificationOutcome::report`](crate::IdentificationOutcome).
///
/// # Errors
/// [`Error::Report`], which indicates a bug.
pub fn identification_report(
    r: &ResultFile,
    traces: &[LogTrace],
    robot: Option<&RobotAppearance>,
) -> Result<String, Error> {
    let mut page = Report::new(&r.name).subtitle(format!(
        "{}: {} joints, {} base parameters; estimator: {}; 95 % error bars by {}",
        r.robot.name,
        r.robot.dof,
        r.base_parameters.len(),
        r.method.estimator,
        r.method.covariance
    ));
    page.add(verdict(r));
    page.add(key_figures(r));
    let first = first_plot(r, traces);
    if let Some(PlotPlace { trace, joint }) = first {
        let plot = torque_plot(r, &traces[trace], joint);
        page.add(Heading::new("Held-out torque"));
        let note = format!("joint with the largest torque; {}; the other joints are below", plot.note);
        page.add(plot.note(note));
    }
    if let Some(robot) = robot {
        page.add(super::robot_colours::scene(robot, r, traces));
    }
    let differences = super::differences::difference_words(r);
    if !differences.is_empty() {
        let points = differences.into_iter().map(|words| (Tone::Warning, words)).collect();
        page.add(Text { paragraphs: vec!["Differences from the robot description:".to_owned()], points });
    }
    if let Some(check) = &r.check {
        super::check::examination(&mut page, check, r.logs.len());
    }
    page.add(Heading::new("Torque"));
    page.add(model_description(r));
    page.add(error_table(r));
    for log in &r.validation {
        page.add(held_out_table(r, log));
    }
    super::forms::forms(&mut page, r);
    for trace in (0..traces.len()).rev() {
        for joint in 0..traces[trace].joints.len() {
            let place = PlotPlace { trace, joint };
            if Some(place) != first {
                page.add(torque_plot(r, &traces[trace], joint));
            }
        }
    }
    super::events::events(&mut page, r, traces);
    page.add(Heading::new("Parameters"));
    parameters(&mut page, r);
    page.add(Heading::new("Friction and drives"));
    friction(&mut page, r);
    super::payloads::loads(&mut page, r);
    page.add(Heading::new("Bodies"));
    bodies(&mut page, r);
    page.add(Heading::new("Logs"));
    for log in &r.logs {
        page.add(log_text(log));
    }
    page.add(log_findings(&r.logs));
    page.add(Heading::new("Origin and time"));
    super::provenance::origin(&mut page, r);
    page.add(Text::new(format!(
        "Condition number of the regressor with columns of unit length: {}. Error bars are large for parameters whose \
         columns are nearly dependent.",
        short(r.method.condition_number_scaled, 3)
    )));
    let t = &r.timings_s;
    let steps = [
        ("robot and base parameters", t.robot),
        ("logs to factors", t.logs),
        ("estimation", t.estimation),
        ("validation", t.validation),
        ("all", t.total),
    ];
    page.add(
        Table::new("", ["step", "s"])
            .rows(steps.iter().map(|(step, seconds)| vec![(*step).into(), short(*seconds, 3).into()])),
    );
    Ok(page.html()?)
}

pub(super) fn error_table(r: &ResultFile) -> Table {
    let unit = r.common_torque_unit();
    let mut columns = vec!["joint".to_owned(), format!("fit, {unit}"), "fit, %".to_owned()];
    for log in &r.validation {
        columns.extend([format!("{}, {unit}", log.log), format!("{}, %", log.log)]);
    }
    let number = |value: Option<f64>| Cell::from(value.map_or_else(|| "–".to_owned(), |value| short(value, 3)));
    let mut table = Table::new("Torque error by joint", columns).note(
        "root mean square of measured minus predicted filtered torque, absolute and relative to the measured torque",
    );
    let joints = r.training.physical.as_ref().map_or(&r.training.joints, |own| &own.joints);
    for (j, joint) in joints.iter().enumerate() {
        let mut row = vec![Cell::from(&joint.name), number(Some(joint.rmse_nm)), number(joint.relative_error_percent)];
        for log in &r.validation {
            let joint = &log.exported().joints[j];
            row.extend([number(Some(joint.rmse_nm)), number(joint.relative_error_percent)]);
        }
        table = table.rows([row]);
    }
    table
}

fn held_out_table(r: &ResultFile, log: &LogValidation) -> Table {
    let without_events = log.without_events.as_ref().map(|rest| rest.physical.as_ref().unwrap_or(&rest.model));
    let sets = [
        ("consistent set (exported)", log.physical.as_ref()),
        ("the same, unfiltered torque", log.raw_physical.as_ref()),
        ("the same without the intervals of events", without_events.filter(|_| log.physical.is_some())),
        ("unconstrained estimate", Some(&log.model)),
        ("the same without the intervals of events", without_events.filter(|_| log.physical.is_none())),
        ("unconstrained estimate, unfiltered torque", Some(&log.raw)),
        ("robot description", log.prior.as_ref()),
    ];
    let rows = sets.into_iter().filter_map(|(set, report)| {
        let report = report?;
        let r_squared = report.r_squared.map_or_else(|| "–".to_owned(), |value| short(value, 4));
        Some(vec![
            set.into(),
            short(report.rmse_nm, 3).into(),
            percent(report.relative_error_percent).into(),
            short(report.max_error_nm, 3).into(),
            r_squared.into(),
        ])
    });
    let unit = r.common_torque_unit();
    let columns = ["parameters".to_owned(), format!("RMS, {unit}"), "error".to_owned(), format!("largest, {unit}")];
    Table::new(format!("Held-out log {}", log.log), columns.into_iter().chain(["R²".to_owned()])).rows(rows)
}

/// Place of a plot of torque over time.
#[derive(Clone, Copy, PartialEq, Eq)]
struct PlotPlace {
    trace: usize,
    joint: usize,
}

/// The plot at the beginning of the page: the joint with the largest torque in the first held-out log.
fn first_plot(r: &ResultFile, traces: &[LogTrace]) -> Option<PlotPlace> {
    let trace = traces.iter().position(|trace| trace.role == Role::Validate)?;
    // Forces of prismatic joints are not comparable with torques.
    let unit = if r.robot.torque_units.iter().any(|unit| unit == "Nm") { "Nm" } else { r.torque_unit(0) };
    let of_unit = traces[trace].joints.iter().enumerate().filter(|(joint, _)| r.torque_unit(*joint) == unit);
    let square = |values: &[f64]| values.iter().filter(|value| value.is_finite()).map(|x| x * x).sum::<f64>();
    let sizes = of_unit.map(|(joint, torque)| (joint, square(&torque.measured_nm)));
    let (joint, _) = sizes.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(PlotPlace { trace, joint })
}

fn torque_plot(r: &ResultFile, trace: &LogTrace, index: usize) -> LinePlot {
    let (name, joint) = (&r.robot.joints[index], &trace.joints[index]);
    let role = if trace.role == Role::Validate { "held out" } else { "training" };
    let part = if trace.cut || trace.role == Role::Identify { "; the first samples" } else { "" };
    let is_consistent = r.validation.iter().any(|log| log.physical.is_some());
    let is_written = trace.role == Role::Validate && is_consistent;
    let predicted_by = if is_written { "predicted" } else { "predicted by the unconstrained estimate" };
    let (time, rows) = (rising(&trace.time_s), trace.time_s.len());
    let (measured, predicted) = (joint.measured_nm[..rows].to_vec(), joint.predicted_nm[..rows].to_vec());
    let label = format!("torque, {}", r.torque_unit(index));
    LinePlot::new(format!("{name}: {} ({role})", trace.log), "t, s", label, time)
        .note(format!("filtered rows at {} Hz{part}", short(trace.rate_hz, 4)))
        .of_joint(name)
        .broad(predicted_by, predicted)
        .line("measured", measured)
        .difference("measured minus predicted", 1, 0)
}

/// Converts the times of a recorder that was restarted to one axis, so that time does not decrease.
fn rising(times: &[f64]) -> Vec<f64> {
    let (mut added, mut before) = (0.0, f64::NEG_INFINITY);
    let continued = |time: &f64| {
        if *time < before {
            added += before - time;
        }
        before = *time;
        time + added
    };
    times.iter().map(continued).collect()
}

fn log_text(log: &LogSummary) -> Text {
    let filter =
        log.filter_cutoff_hz.map_or_else(String::new, |hz| format!(", parallel filter at {} Hz", short(hz, 3)));
    let cutoff =
        log.motion_cutoff_hz.map_or_else(String::new, |hz| format!(", positions filtered at {} Hz", short(hz, 3)));
    Text::new(format!(
        "{} ({}): {} rows at {} Hz{cutoff}{filter}; {} filtered rows of each joint at {} Hz.",
        log.log,
        if log.role == Role::Validate { "held out" } else { "training" },
        log.import.rows,
        short(log.import.rate_hz, 5),
        log.filtered_rows,
        short(log.filtered_rate_hz, 5),
    ))
}

/// Findings of all logs, the most serious first; equal findings of several joints and logs are one line.
fn log_findings(logs: &[LogSummary]) -> Text {
    let mut text = Text::default();
    for (level, tone) in [(Level::Problem, Tone::Bad), (Level::Warning, Tone::Warning), (Level::Info, Tone::Plain)] {
        for group in grouped_findings(logs, level) {
            text = text.point(tone, format!("{}: {}", group.place(Some(logs.len())), group.message()));
        }
    }
    text
}
