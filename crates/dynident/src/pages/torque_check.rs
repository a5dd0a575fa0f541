//! The section of an iteration's page that compares logged with commanded torque.

use crate::result::{IterationRun, IterationsFile};
use dynident_iteration::{CommandSource, JointTorqueCheck, TorqueCheck};
use dynident_report::{Bar, BarPlot, Heading, LinePlot, Report, Text, Tone};

/// Half width of a 95 % error bar, in standard deviations.
const HALF_WIDTH_95: f64 = 1.96;
/// Joints whose torques are drawn.
const MOST_PICTURES: usize = 8;

/// Adds the section, if the torque of some run was checked. The pictures show the newest such run.
pub(crate) fn torque_section(page: &mut Report, file: &IterationsFile) {
    let mut checked = file.runs.iter().rev().filter_map(|run| Some((run, run.torque_check.as_ref()?)));
    let Some((run, check)) = checked.next() else { return };
    page.add(Heading::new("Logged and commanded torque"));
    page.add(statement(run, check));
    page.add(scales(file, check));
    for (name, joint) in
        file.joints.iter().zip(&check.joints).filter(|(_, joint)| !joint.points.is_empty()).take(MOST_PICTURES)
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
            "The drives close their own position loop with unknown gains. The torque that is fed forward to them is known, and their gains are estimated from all good runs."
        }
        CommandSource::PathOnly => {
            "The commanded torque is not known: the drives close their own loop. NOT checked: a scale that all joints share. The scales of single joints follow from the parameters that several joints share."
        }
    };
    let [position_s, velocity_s] = check.feedback_delay_s;
    let timing = format!(
        "Run {}: the controller sees positions {:.1} ms and velocities {:.1} ms late; the logged torque comes {:.1} ms after the commanded torque; the clock of the log is {:.3} % slow.",
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
        if points.is_empty() { vec![(Tone::Good, "No difference that counts was found.".to_owned())] } else { points };
    let paragraphs = match check.source {
        CommandSource::PathOnly => vec![source.to_owned()],
        CommandSource::Controller | CommandSource::FeedForward => vec![source.to_owned(), timing],
    };
    Text { paragraphs, points }
}

/// The scale of each joint's torque, by the command and by the other joints.
fn scales(file: &IterationsFile, check: &TorqueCheck) -> BarPlot {
    let mut plot = BarPlot::new("Scale of the logged torque", "logged per commanded torque").note(
        "With 95 % error bars. \"By the other joints\": from the parameters that the torques of several joints share.",
    );
    "correct scale".clone_into(&mut plot.reference_label);
    for (name, joint) in file.joints.iter().zip(&check.joints) {
        let rows =
            [(joint.scale, joint.scale_std, ""), (joint.row_scale, joint.row_scale_std, ", by the other joints")];
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

/// Logged against commanded torque of one joint.
fn points(name: &str, joint: &JointTorqueCheck) -> LinePlot {
    let mut points = joint.points.clone();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (commanded, logged): (Vec<f64>, Vec<f64>) =
        points.iter().map(|[commanded, logged]| (*commanded, *logged)).unzip();
    let mut plot = LinePlot::new(
        format!("{name}: logged against commanded torque"),
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
