//! `report.html` of an identification.

use super::robot::RobotAppearance;
use super::unit;
use super::verdict::{key_figures, model_description, percent, verdict};
use crate::error::Error;
use crate::result::{
    BaseParameterResult, BodyResult, ErrorTermResult, JointFrictionResult, LogSummary, POORLY_KNOWN_PERCENT,
    ResultFile, TermResult, ValueSource, grouped_findings,
};
use dynident_estimation::HALF_WIDTH_95;
use dynident_estimation::consistent::IntervalEnd;
use dynident_identification::consistent::ParameterInterval;
use dynident_identification::examination::{LogTrace, LogValidation};
use dynident_identification::friction::FrictionConstant;
use dynident_identification::{DriveInertiaEstimate, Role};
use dynident_recording::Level;
use dynident_report::{BarPlot, Cell, Heading, HeatMap, LinePlot, Report, Table, Text, Tone, short};

const MAX_CORRELATED_PARAMETERS: usize = 80;

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

fn base_table(page: &mut Report, r: &ResultFile) {
    let optional = |value: Option<f64>| Cell::from(value.map_or_else(String::new, |value| short(value, 5)));
    let row = |p: &BaseParameterResult| {
        let relative = p.relative_half_width_percent();
        let tone =
            if relative.is_none_or(|relative| relative > POORLY_KNOWN_PERCENT) { Tone::Warning } else { Tone::Plain };
        let relative = relative.map_or_else(String::new, |value| short(value, 3));
        vec![
            Cell::from(&p.expression),
            short(p.value, 6).into(),
            short(p.bar_95(), 3).into(),
            Cell::judged(relative, if p.excited { tone } else { Tone::Bad }),
            optional(p.physical),
            optional(p.prior),
            Cell::from(unit(&p.unit)),
            Cell::from(largest_error(p)),
        ]
    };
    let columns = [
        "expression",
        "estimate",
        "± (95 %)",
        "± in %",
        "consistent set",
        "robot description",
        "unit",
        "largest error source",
    ];
    page.add(Table::new("Base parameters", columns).rows(r.base_parameters.iter().map(row)));
}

fn largest_error(p: &BaseParameterResult) -> String {
    let words = |(term, share): (&ErrorTermResult, f64)| format!("{} ({:.0} %)", term.name(), 100.0 * share);
    p.largest_error().map_or_else(String::new, words)
}

fn parameters(page: &mut Report, r: &ResultFile) {
    // One plot per unit, because parameters in a plot have a common scale.
    let mut units: Vec<&str> = Vec::new();
    for parameter in &r.base_parameters {
        if !units.contains(&parameter.unit.as_str()) {
            units.push(&parameter.unit);
        }
    }
    for of_unit in units {
        let mut plot = BarPlot::new(format!("Base parameters in {}", unit(of_unit)), unit(of_unit))
            .note("with 95 % error bars")
            .reference_label("robot description");
        for p in r.base_parameters.iter().filter(|parameter| parameter.unit == of_unit) {
            let half_width = p.excited.then_some(p.bar_95());
            plot = plot.bar(&p.expression, if p.excited { p.value } else { f64::NAN }, half_width, p.prior);
        }
        page.add(plot);
    }
    base_table(page, r);
    if !r.method.coincident.is_empty() {
        let points = r.method.coincident.iter().map(|sentence| (Tone::Warning, sentence.clone())).collect();
        page.add(Text { paragraphs: Vec::new(), points });
    }
    if !r.method.not_excited.is_empty() {
        let mut points = vec![(
            Tone::Warning,
            format!(
                "Not excited by the logs, fixed at the values of the robot description: {}",
                r.method.not_excited.join(", ")
            ),
        )];
        if !r.method.resting_joints.is_empty() {
            let text = format!("Not moved above encoder noise in any log: {}", r.method.resting_joints.join(", "));
            points.push((Tone::Warning, text));
        }
        page.add(Text { paragraphs: Vec::new(), points });
        conditional_estimates(page, r);
    }
    let n = r.base_parameters.len();
    if (2..=MAX_CORRELATED_PARAMETERS).contains(&n) && r.base_parameter_covariance.len() == n {
        let std = |i: usize| r.base_parameter_covariance[i][i].sqrt();
        let value = |i: usize, j: usize| r.base_parameter_covariance[i][j] / (std(i) * std(j));
        let values = (0..n).map(|i| (0..n).map(|j| value(i, j)).collect()).collect();
        let names = || r.base_parameters.iter().map(|parameter| parameter.symbol.clone());
        page.add(HeatMap::new("Correlation of the base parameters", names(), names(), values).limit(1.0));
        let strongest = r.correlations.iter().map(|pair| {
            let [first, second] = &pair.parameters;
            vec![Cell::from(first), Cell::from(second), Cell::from(short(pair.correlation, 4))]
        });
        page.add(Table::new("Strongest correlations", ["parameter", "and", "correlation"]).rows(strongest));
    }
}

/// Adds estimates that depend on parameters fixed at nominal values.
fn conditional_estimates(page: &mut Report, r: &ResultFile) {
    let rows = r.base_parameters.iter().filter(|p| !p.conditional_on.is_empty()).map(|p| {
        let on = p.conditional_on.iter().map(|own| format!("{} ({} per unit)", own.on, short(own.per_unit, 3)));
        let with = p.half_width_95_with_nominal.map_or_else(String::new, |bar| short(bar, 3));
        vec![
            Cell::from(&p.symbol),
            short(p.value, 6).into(),
            short(p.half_width_95, 3).into(),
            Cell::from(with),
            Cell::from(on.collect::<Vec<_>>().join(", ")),
        ]
    });
    let rows: Vec<Vec<Cell>> = rows.collect();
    if rows.is_empty() {
        return;
    }
    let columns =
        ["parameter", "estimate", "± (95 %) if these are exact", "± (95 %) with their uncertainty", "fixed at nominal"];
    page.add(Table::new("Estimates that depend on unexcited parameters", columns).rows(rows));
}

fn friction(page: &mut Report, r: &ResultFile) {
    let mut table = Table::new("", ["joint", "parameter", "value", "± (95 %)", "unit"]).note(
        "from the physically consistent set if there is one; error bars only for separately identified parameters",
    );
    // A term that is identified separately is a base parameter; its error bar is the one that is shown.
    let bar = |term: &TermResult| {
        let base = r.base_parameters.iter().find(|p| Some(&p.expression) == term.base_parameter.as_ref());
        base.filter(|p| term.std.is_some() && p.excited).map_or_else(String::new, |p| short(p.half_width_95, 3))
    };
    let owned = r.joints.iter().map(|joint| (joint.name.as_str(), &joint.terms[..]));
    let coupled = [("coupling", &r.couplings[..])];
    for (name, terms) in owned.chain(coupled) {
        for term in terms {
            table =
                table.row([name.to_owned(), term.symbol.clone(), short(term.value, 5), bar(term), unit(&term.unit)]);
        }
    }
    page.add(table);
    lags(page, r);
    drives(page, r);
    if !r.friction_choice.is_empty() {
        let row = |joint: &JointFrictionResult| {
            let constants: Vec<String> = joint.constants.iter().map(constant).collect();
            let chosen =
                joint.restriction().map_or_else(|| joint.chosen.clone(), |cost| format!("{} ({cost})", joint.chosen));
            vec![Cell::from(&joint.joint), Cell::from(chosen), Cell::from(constants.join(", "))]
        };
        let header = ["joint", "friction", "constants with 95 % intervals (rad/s or m/s, and their powers)"];
        page.add(Table::new("Selected friction", header).rows(r.friction_choice.iter().map(row)));
    }
}

/// Adds the test for drive inertia, with the estimate of each joint.
fn drives(page: &mut Report, r: &ResultFile) {
    let Some(choice) = &r.drive_inertia_choice else { return };
    let row = |drive: &DriveInertiaEstimate| {
        let figures = [short(drive.inertia, 3), short(drive.half_width_95, 3)].map(Cell::from);
        core::iter::once(Cell::from(&drive.joint)).chain(figures).collect::<Vec<_>>()
    };
    if !choice.drives.is_empty() {
        let header = ["joint", "drive inertia, kg m² (kg)", "± (95 %)"];
        let table = Table::new("Test for drive inertia", header)
            .note("least squares with stated friction, before any other selection");
        page.add(table.rows(choice.drives.iter().map(row)));
    }
    page.add(Text::new(format!("Drive inertia: {}.", choice.sentence())));
}

/// A constant of the selected friction as text.
fn constant(own: &FrictionConstant) -> String {
    let [from, to] = own.interval_95;
    format!("{} {} {} ({} to {})", own.term, own.constant, short(own.value, 3), short(from, 2), short(to, 2))
}

fn lags(page: &mut Report, r: &ResultFile) {
    if r.joints.iter().all(|joint| joint.torque_lag.is_none()) {
        return;
    }
    let rows = r.joints.iter().filter_map(|joint| {
        let lag = joint.torque_lag?;
        let ms = |seconds: f64| Cell::from(short(1e3 * seconds, 3));
        let tone = if lag.matters { Tone::Warning } else { Tone::Plain };
        Some(vec![Cell::from(&joint.name), Cell::judged(short(1e3 * lag.lag_s, 3), tone), ms(lag.half_width_95_s)])
    });
    let table = Table::new("Lag of the torque behind the motion", ["joint", "lag, ms", "± (95 %), ms"])
        .note("estimated with the model for each log, including the compensated part; marked if the remaining lag changes the torque by more than the residual")
        .rows(rows);
    page.add(table);
    if let Some(what) = r.method.torque_lag.sentence() {
        page.add(Text::new(format!("Lag of the torque: {what}.")));
    }
}

/// Explanation of the marks after the values of bodies.
const MARKS: &str = "~: identified only in sums; =: not identified, nominal value";

/// Mark of a body's value, in the order of the ten parameters.
fn source_mark(body: &BodyResult, parameter: usize) -> &'static str {
    match body.sources.map(|sources| sources[parameter]) {
        Some(ValueSource::Partly) => "\u{a0}~",
        Some(ValueSource::Nominal) => "\u{a0}=",
        Some(ValueSource::Measured) | None => "",
    }
}

fn bodies(page: &mut Report, r: &ResultFile) {
    let mut verdict = Text::new(format!("Consistency is that {}.", r.physical.note));
    if r.physical.consistent {
        let tone = if r.problems.is_empty() && r.method.is_settled() { Tone::Good } else { Tone::Plain };
        verdict = verdict.point(tone, "every body, friction and drive is physically consistent");
    }
    let failure = r.physical.failure.iter().map(|reason| format!("no physically consistent set: {reason}"));
    for violation in r.physical.violations.iter().cloned().chain(failure) {
        verdict = verdict.point(Tone::Bad, violation);
    }
    if let Some(reason) = &r.no_urdf {
        verdict = verdict.point(Tone::Warning, format!("no identified.urdf: {reason}"));
    }
    if let Some(reason) = &r.no_mjcf {
        verdict = verdict.point(Tone::Warning, format!("no identified.xml: {reason}"));
    }
    if let Some(reason) = &r.no_sdf {
        verdict = verdict.point(Tone::Warning, format!("no identified.sdf: {reason}"));
    }
    page.add(verdict);
    let rows = r.bodies.iter().map(|body| {
        let prior = body.prior.map_or_else(String::new, |prior| short(prior[0], 4));
        let marked = |text: String, k: usize| Cell::from(text + source_mark(body, k));
        let bar = body.std.map_or_else(String::new, |std| short(HALF_WIDTH_95 * std[0], 3));
        let mut row = vec![Cell::from(&body.name), marked(short(body.mass_kg, 4), 0), bar.into(), prior.into()];
        row.extend((0..3).map(|k| body.com_m.map_or_else(|| Cell::from(""), |com| marked(short(com[k], 4), k + 1))));
        let least = body.pseudo_inertia_min_eigenvalue;
        row.push(Cell::judged(short(least, 3), if least > 0.0 { Tone::Plain } else { Tone::Bad }));
        row
    });
    let bars = if r.description_differences.is_some() {
        "± averaged over the explanations of the difference from the robot description"
    } else {
        "± for 30 % uncertainty of the robot description"
    };
    let note = format!("{bars}; centre of mass in the body frame; smallest eigenvalue of the pseudo-inertia; {MARKS}");
    let columns = ["body", "mass, kg", "± (95 %), kg", "nominal, kg", "x, m", "y, m", "z, m", "smallest eigenvalue"];
    page.add(Table::new("Bodies", columns).note(note).rows(rows));
    let rows = r.bodies.iter().map(|body| {
        let inertia = body.inertia_at_origin_kgm2.iter().enumerate();
        let inertia = inertia.map(|(k, value)| Cell::from(short(*value, 4) + source_mark(body, k + 4)));
        [Cell::from(&body.name)].into_iter().chain(inertia).collect()
    });
    let note = format!("kg m², in the body frame, about its origin; {MARKS}");
    let columns = ["body", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
    page.add(Table::new("Inertia of the bodies", columns).note(note).rows(rows));
    if let Some(found) = &r.possible_intervals {
        page.add(intervals(found));
    }
}

/// Intervals of all parameters.
fn intervals(found: &[ParameterInterval]) -> Table {
    let end = |end: Option<f64>| Cell::from(end.map_or_else(|| "open".to_owned(), |end| short(end, 4)));
    let holder = |end: IntervalEnd| match end {
        IntervalEnd::Data => "data",
        IntervalEnd::Constraint => "physical consistency",
        IntervalEnd::Open => "–",
        IntervalEnd::Unsettled => "not converged",
    };
    let rows = found.iter().map(|interval| {
        vec![
            Cell::from(&interval.symbol),
            interval.of.clone().unwrap_or_default().into(),
            unit(&interval.unit).into(),
            short(interval.value, 4).into(),
            end(interval.lower),
            end(interval.upper),
            holder(interval.held_by[0]).into(),
            holder(interval.held_by[1]).into(),
        ]
    });
    let note = "every value in an interval belongs to a physically consistent set that the data do not reject at 95 %; each end is limited by the data, by physical consistency, or not at all";
    Table::new(
        "Possible intervals of the parameters",
        ["parameter", "of", "unit", "best fit", "from", "to", "lower end limited by", "upper end limited by"],
    )
    .note(note)
    .rows(rows)
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
