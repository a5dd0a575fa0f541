//! Sentences about the events of a log.

use dynident_events::{EventKind, EventSearch, LogEvent};
use dynident_recording::{Finding, Level};

/// One finding for each kind of event in the log `log`, with all of its time intervals.
pub fn event_findings(search: &EventSearch, log: &str) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    let mut done: Vec<(EventKind, bool)> = Vec::new();
    for event in &search.events {
        let class = (event.kind, event.set_aside);
        if done.contains(&class) {
            continue;
        }
        done.push(class);
        let same: Vec<&LogEvent> =
            search.events.iter().filter(|other| (other.kind, other.set_aside) == class).collect();
        let message = if event.kind.is_trend() { slow_change(&same, log) } else { intervals(&same, log) };
        findings.push(Finding {
            code: code(event.kind).to_owned(),
            level: Level::Warning,
            channel: "events".to_owned(),
            message,
        });
    }
    findings
}

/// Code of a kind of event; `dynident docs CODE` explains it.
fn code(kind: EventKind) -> &'static str {
    match kind {
        EventKind::DrivesOff => "event-drives-off",
        EventKind::JointStop => "event-joint-stop",
        EventKind::Contact => "event-contact",
        EventKind::LoadChange => "event-load-change",
        EventKind::OffsetChange => "event-offset-change",
        EventKind::Overflow => "event-overflow",
        EventKind::Interpolated => "event-interpolated",
        EventKind::Drift => "event-drift",
        EventKind::WarmUp => "event-warm-up",
        EventKind::Unexplained => "event-unexplained",
    }
}

fn intervals(events: &[&LogEvent], log: &str) -> String {
    let first = events[0];
    let places: Vec<String> =
        events.iter().map(|event| format!("{:.2} to {:.2} s", event.from_s, event.to_s)).collect();
    let keys: Vec<String> = events.iter().map(|event| format!("[{:.2}, {:.2}]", event.from_s, event.to_s)).collect();
    let alternative = first.alternative.map_or(String::new(), |kind| format!(" (or: {})", kind.text()));
    let strongest = events.iter().max_by(|a, b| a.unexplained_nm.total_cmp(&b.unexplained_nm)).unwrap_or(&events[0]);
    let share: f64 = events.iter().map(|event| event.share).sum();
    let all_clear = if first.clear { ", or events = \"set-aside\" under [estimator]" } else { "" };
    let fate = if first.set_aside {
        format!(
            "these {:.1} % of log `{log}` are set aside for {}; to keep them, write events = \"warn\" under [estimator]",
            100.0 * share,
            strongest.affected.join(", ")
        )
    } else {
        format!(
            "no row of log `{log}` is set aside; if this is not normal operation, write drop_time_s = [{}] for this log\
             {all_clear}",
            keys.join(", ")
        )
    };
    let doubt = if first.kind.is_unmistakable() { "" } else { ", or an error of the model" };
    format!(
        "{}: {}{alternative}{doubt}; joints {}; unexplained torque {:.3} Nm, elsewhere {:.3} Nm; {fate}",
        places.join(", "),
        first.kind.text(),
        strongest.joints.join(", "),
        strongest.unexplained_nm,
        strongest.usual_nm,
    )
}

fn slow_change(events: &[&LogEvent], log: &str) -> String {
    let sizes: Vec<String> =
        events.iter().map(|event| format!("{} {:.3} Nm", event.joints.join(", "), event.unexplained_nm)).collect();
    let fix = if events[0].kind == EventKind::Drift {
        "split the log by time_range_s and write offsets = \"per-log\" under [drive], or zero the sensor before each log"
    } else {
        "leave out the warm-up by time_range_s, or log the joint temperature"
    };
    format!(
        "{} during log `{log}`: {} (root mean square); no row is set aside; {fix}",
        events[0].kind.text(),
        sizes.join("; ")
    )
}
