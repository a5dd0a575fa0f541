//! `report.html` of an iteration.

use super::iteration_parameters::{add_parameters, identified_parameters};
use super::iteration_remarks::{log_remarks, motion_remarks, run_remarks, unmet_conditions};
use super::iteration_scene::{by_posture, scene};
use super::robot::RobotAppearance;
use super::run_figures::{MAX_CURVES, error_in_bars, is_known, largest_error, last_good, run_name, worst};
use super::run_trace::RunTrace;
use super::torque_check::torque_section;
use crate::error::Error;
use crate::result::{IterationRun, IterationsFile};
use dynident_report::{Cell, ConvergencePlot, Heading, KeyFigures, LinePlot, Report, Table, Tone, short};

/// Computing times of an iteration.
pub(crate) struct TimeSpent {
    /// Time before the first run (robot, base parameters, trajectory design), s.
    pub(crate) before_runs_s: f64,
    /// Total time without this page, s.
    pub(crate) all_s: f64,
    /// Number of new runs.
    pub(crate) runs: usize,
}

pub(crate) fn iteration_report(
    file: &IterationsFile,
    traces: &[RunTrace],
    robot: &RobotAppearance,
    time: &TimeSpent,
) -> Result<String, Error> {
    let mut page = Report::new(&file.name).subtitle(format!("{} joints; {}", file.joints.len(), file.reason));
    page.add(figures(file));
    unmet_conditions(&mut page, file);
    if let Some(scene) = scene(robot, traces) {
        page.add(scene);
    }
    page.add(Heading::new("Runs"));
    page.add(runs(file));
    run_remarks(&mut page, file);
    motion_remarks(&mut page, file);
    log_remarks(&mut page, file);
    torque_section(&mut page, file);
    page.add(Heading::new("Tracking"));
    tracking(&mut page, file, traces);
    page.add(Heading::new("Parameters"));
    if !file.base_parameters.is_empty() {
        page.add(identified_parameters(file));
    }
    add_parameters(&mut page, file);
    page.add(Heading::new("Time"));
    page.add(computing_times(file, time));
    Ok(page.html()?)
}

fn figures(file: &IterationsFile) -> KeyFigures {
    let tone = match &file.status[..] {
        "converged" => Tone::Good,
        "refused" => Tone::Bad,
        _ => Tone::Warning,
    };
    let rejected = file.runs.iter().filter(|run| !run.accepted).count();
    let of = if rejected == 0 { "none rejected".to_owned() } else { format!("{rejected} rejected") };
    let mut figures = KeyFigures::new().judged("result", file.status.replace('-', " "), "", tone).judged(
        "runs",
        file.runs.len().to_string(),
        of,
        if rejected == 0 { Tone::Plain } else { Tone::Warning },
    );
    if let [first, .., last] = &file.runs[..] {
        let note = format!("largest of all joints; {} in the first run", short(worst(first), 3));
        figures = figures.figure("tracking error, last run", format!("{} rad (m)", short(worst(last), 3)), note);
    }
    if let Some(improvement) = file.tracking_improvement {
        figures = figures.figure("tracking improvement factor", short(improvement, 3), "first to last accepted run");
    }
    if let Some(error) = last_good(file).and_then(largest_error) {
        figures =
            figures.figure("largest parameter error", short(error, 3), "last accepted run, compared with the truth");
    }
    if let Some(ratio) = file.error_over_bound {
        figures = figures.figure(
            "error relative to the Cramér-Rao bound",
            short(ratio, 3),
            "root mean square, last accepted run",
        );
    }
    figures
}

/// Description of the model of a run's controller.
fn model(run: &IterationRun) -> String {
    match (run.model_based, run.model_of_run) {
        (false, _) if run.stiffness == 1.0 => "none".to_owned(),
        (false, _) => format!("none; gains times {}", short(run.stiffness, 3)),
        (true, Some(of)) => format!("from run {of}"),
        (true, None) if run.damping < 1.0 => {
            format!("{} of the step from the last accepted model", short(run.damping, 3))
        }
        (true, None) => "prior".to_owned(),
    }
}

pub(super) fn runs(file: &IterationsFile) -> Table {
    let known = is_known(file);
    let mut columns = vec!["run", "controller", "model", "result", "tracking error, rad (m)", "largest error bar"];
    if known {
        columns.extend(["largest error", "error in std"]);
    }
    let mut table = Table::new("", columns).note(if known {
        "tracking: largest of all joints; error in std: root mean square of parameter error divided by its standard deviation"
    } else {
        "tracking: largest of all joints; largest error bar: one standard deviation"
    });
    let optional = |value: Option<f64>| Cell::from(value.map_or_else(|| "–".to_owned(), |value| short(value, 3)));
    for run in &file.runs {
        let verdict = if run.accepted { ("accepted", Tone::Good) } else { ("rejected", Tone::Warning) };
        let widest = run.parameters.iter().filter_map(|parameter| parameter.std).reduce(f64::max);
        let mut row = vec![
            Cell::from(run_name(run)),
            Cell::from(&run.controller),
            Cell::from(model(run)),
            Cell::judged(verdict.0, verdict.1),
            Cell::from(short(worst(run), 3)),
            optional(widest),
        ];
        if known {
            row.extend([optional(largest_error(run)), optional(error_in_bars(run))]);
        }
        table = table.rows([row]);
    }
    table
}

fn tracking(page: &mut Report, file: &IterationsFile, traces: &[RunTrace]) {
    let mut settling = ConvergencePlot::new("Largest tracking error", "rad (m)").log_y();
    for (joint, name) in file.joints.iter().enumerate() {
        let of = |run: &IterationRun| run.max_tracking_error_rad.get(joint).copied().unwrap_or(f64::NAN);
        settling = settling.curve(name, file.runs.iter().map(of).collect());
    }
    page.add(settling);
    let mut legs: Vec<Option<usize>> = traces.iter().map(|trace| trace.name.leg).collect();
    legs.sort_unstable();
    legs.dedup();
    for leg in legs {
        let own: Vec<&RunTrace> = traces.iter().filter(|trace| trace.name.leg == leg).collect();
        let Some(longest) = own.iter().max_by_key(|trace| trace.times_s.len()) else { continue };
        let of_leg = leg.map_or_else(String::new, |leg| format!(", leg {leg}"));
        if let Some(map) = by_posture(&own, format!("Tracking error along the motion{of_leg}")) {
            page.add(map);
        }
        for (joint, name) in file.joints.iter().enumerate() {
            // A locked joint has no tracking error.
            if own.iter().all(|trace| trace.error[joint].iter().all(|error| *error == 0.0)) {
                continue;
            }
            let title = format!("{name}: tracking error{of_leg}");
            let mut plot = LinePlot::new(title, "t, s", "rad (m)", longest.times_s.clone())
                .note("desired minus measured position")
                .of_joint(name);
            // First and last runs are shown, because intermediate runs are similar.
            let shown = |place: usize| place + 2 < MAX_CURVES || place + 2 >= own.len();
            for trace in own.iter().enumerate().filter(|(place, _)| shown(*place)).map(|(_, trace)| trace) {
                let mut error = trace.error[joint].clone();
                error.resize(longest.times_s.len(), f64::NAN);
                plot = plot.line(format!("run {}", trace.name.run), error);
            }
            page.add(plot);
        }
    }
}

fn computing_times(file: &IterationsFile, time: &TimeSpent) -> Table {
    let duration = format!("{} s", short(file.duration_s, 4));
    let moved = format!("{} s", short(file.duration_s * file.runs.len() as f64, 4));
    let made = format!("{} runs and their identification", time.runs);
    Table::new("", ["step", "time"]).rows([
        vec![Cell::from("motion of one run"), Cell::from(duration)],
        vec!["motion of all runs".into(), moved.into()],
        vec!["computing: robot and trajectory".into(), format!("{} s", short(time.before_runs_s, 3)).into()],
        vec![
            format!("computing: {made}").into(),
            format!("{} s", short((time.all_s - time.before_runs_s).max(0.0), 3)).into(),
        ],
    ])
}
