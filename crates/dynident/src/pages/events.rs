//! Events of the logs in the report of an identification: one picture for each.

use crate::result::ResultFile;
use dynident_identification::examination::{EventTrace, LogTrace};
use dynident_report::{Heading, LinePlot, Report, Text, short};

/// Adds a heading and the pictures, if a log has events.
pub(super) fn events(page: &mut Report, r: &ResultFile, traces: &[LogTrace]) {
    if traces.iter().all(|trace| trace.events.is_empty()) {
        return;
    }
    page.add(Heading::new("Events in the logs"));
    page.add(Text::new(
        "Intervals and slow changes that no single model of the robot explains. The predicted torque is that of a model \
         of the rest of the same log. Intervals that are set aside are not in the fit.",
    ));
    for log in traces {
        for trace in &log.events {
            page.add(picture(r, &log.log, trace));
        }
    }
}

fn picture(r: &ResultFile, log: &str, trace: &EventTrace) -> LinePlot {
    let EventTrace { event, joint, time_s, measured_nm, predicted_nm } = trace;
    let unit = r.robot.joints.iter().position(|name| name == joint).map_or("Nm (N)", |place| r.torque_unit(place));
    let times = format!("{:.2} to {:.2} s", event.from_s, event.to_s);
    let alternative = event.alternative.map_or_else(String::new, |kind| format!(" (or: {})", kind.text()));
    let fate = if event.set_aside {
        format!("set aside for {}", event.affected.join(", "))
    } else {
        "not set aside".to_owned()
    };
    let note = format!(
        "{times}: {}{alternative}; joints {}; unexplained torque {} {unit}, elsewhere {} {unit}; {fate}",
        event.kind.text(),
        event.joints.join(", "),
        short(event.unexplained_nm, 3),
        short(event.usual_nm, 3),
    );
    LinePlot::new(format!("{log}, {times}: {joint}"), "t, s", format!("torque, {unit}"), time_s.clone())
        .note(note)
        .broad("predicted", predicted_nm.clone())
        .line("measured", measured_nm.clone())
        .difference("measured minus predicted", 1, 0)
        .shaded(event.from_s, event.to_s)
}
