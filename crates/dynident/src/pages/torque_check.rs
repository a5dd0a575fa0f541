//! Page section about logged and commanded torque.

use super::run_figures::HALF_WIDTH_95;
use crate::result::{IterationRun, IterationsFile};
use dynident_iteration::{CommandSource, JointTorqueCheck, TorqueCheck};
use dynident_report::{Bar, BarPlot, Heading, LinePlot, Report, Text, Tone};

/// Maximum number of joints with plots.
const MAX_PLOTS: usize = 8;

/// Adds the section if the torque of a run was checked; plots show the newest such run.
pub(crate) fn torque_section(page: &mut Report, file: &IterationsFile) {
    let mut checked = file.runs.iter().rev().filter_map(|run| Some((run, run.torque_check.as_ref()?)));
    let Some((run, check)) = checked.next() else { return };
    page.add(Heading::new("Logged and commanded torque"));
    page.add(statement(run, check));
    page.add(scales(file, check));
    for (name, joint) in
        file.joints.iter().zip(&check.joints).filter(|(_, joint)| !joint.points.is_empty()).take(MAX_PLOTS)
    {
        page.add(points(name, joint));
    }
}

fn statement(run: &IterationRun, check: &TorqueCheck) -> Text {
    let source = match check.source {
        CommandSource::Controller => {
            "The commanded torque is computed from the controller, its model, the trajectory and the logged positions."
        }
        CommandSource::FeedForward => {
            "The drives have their own position loop with unknown gains. The feed-forward torque is known, and the gains are estimated from all accepted runs."
        }
        CommandSource::PathOnly => {
            "The commanded torque is unknown because the drives have their own loop. NOT checked: a common scale of all joints. The relative scales of joints are estimated from parameters that affect several joints."
        }
    };
    let [position_s, velocity_s] = check.feedback_delay_s;
    let timing = format!(
        "Run {}: feedback delay {:.1} ms for positions and {:.1} ms for velocities; the logged torque lags the commanded torque by {:.1} ms; the clock of the log is {:.3} % slow.",
        run.run,
        1e3 * position_s,
        1e3 * velocity_s,
        1e3 * check.torque_lag_s,
        check.clock_percent
    );
    let causes =
        check.causes.iter().map(|cause| (Tone::Warning, format!("{cause}. To correct it: {}.", cause.remedy())));
    let points: Vec<(Tone, String)> = causes.collect();
    let points =
        if points.is_empty() { vec![(Tone::Good, "No significant difference was found.".to_owned())] } else { points };
    let paragraphs = match check.source {
        CommandSource::PathOnly => vec![source.to_owned()],
        CommandSource::Controller | CommandSource::FeedForward => vec![source.to_owned(), timing],
    };
    Text { paragraphs, points }
}

/// Scale of each joint's torque, from the command and from the other joints.
fn scales(file: &IterationsFile, check: &TorqueCheck) -> BarPlot {
    let mut plot = BarPlot::new("Scale of the logged torque", "logged per commanded torque").note(
        "With 95 % error bars. \"From the other joints\": from parameters that affect the torques of several joints.",
    );
    "correct scale".clone_into(&mut plot.reference_label);
    for (name, joint) in file.joints.iter().zip(&check.joints) {
        let rows =
            [(joint.scale, joint.scale_std, ""), (joint.row_scale, joint.row_scale_std, ", from the other joints")];
        for (value, std, which) in rows {
            let Some(value) = value else { continue };
            plot.bars.push(Bar {
                label: format!("{name}{which}"),
                value,
                half_width: std.map(|std| HALF_WIDTH_95 * std),
                reference: Some(1.0),
            });
        }
    }
    plot
}

fn points(name: &str, joint: &JointTorqueCheck) -> LinePlot {
    let mut points = joint.points.clone();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (commanded, logged): (Vec<f64>, Vec<f64>) =
        points.iter().map(|[commanded, logged]| (*commanded, *logged)).unzip();
    let mut plot = LinePlot::new(
        format!("{name}: logged and commanded torque"),
        "commanded torque, Nm (N)",
        "logged torque, Nm (N)",
        commanded.clone(),
    )
    .line("equal", commanded)
    .line("log", logged);
    if let Some(line) = plot.lines.last_mut() {
        line.points = true;
    }
    plot
}
