//! Page section about the study examination: findings and unexplained torque.

use crate::result::{CheckFinding, HypothesisResult, StudyCheck, grouped_check_findings};
use dynident_recording::Level;
use dynident_report::{BarPlot, Heading, Report, Text, Tone};

/// Kinds of findings that refer to the unexplained torque of joints.
const TORQUE_KIND: &str = "torque";

/// Adds the section; `logs` is the number of logs.
pub(super) fn examination(page: &mut Report, check: &StudyCheck, logs: usize) {
    page.add(Heading::new("Study, robot and logs"));
    let mut text = Text::new(format!(
        "Dynident tested {} possible mistakes of the study (signs, orders, zeros, units, mounting). Each hypothesis was \
         scored by the best physically consistent fit.",
        check.tried
    ));
    if check.findings.iter().all(|finding| finding.level != Level::Problem) {
        text = text.point(Tone::Good, "no hypothesis explains the logs clearly better than the study as written");
    }
    for finding in grouped_check_findings(&check.findings, Some(logs)) {
        text = text.point(tone(&finding), finding.sentence());
    }
    page.add(text);
    if let Some(as_written) = &check.as_written {
        let plot = unexplained_torque(&check.joints, as_written, check.best.as_ref());
        let is_evidence = check.best.is_some() || check.findings.iter().any(|finding| finding.kind == TORQUE_KIND);
        page.add(if is_evidence { plot } else { plot.folded() });
    }
}

fn tone(finding: &CheckFinding) -> Tone {
    match finding.level {
        Level::Problem => Tone::Bad,
        Level::Warning => Tone::Warning,
        Level::Info => Tone::Plain,
    }
}

/// Unexplained torque of each joint, for the study as written and with the correction.
fn unexplained_torque(joints: &[String], as_written: &HypothesisResult, best: Option<&HypothesisResult>) -> BarPlot {
    let title = "Unexplained torque with the best physically consistent fit";
    let label = "unexplained torque of the joint, %";
    let shown = best.unwrap_or(as_written);
    let mut plot = BarPlot::new(title, label).note(if best.is_some() {
        "bars: with the correction; marks: as written. A mark far to the right of its bar indicates a mistake"
    } else {
        "root mean square of another fit than that of the tables: to a few hundred unfiltered samples of the logs, with \
         their noise, so the figures are larger than the torque errors of the result"
    });
    if best.is_some() {
        plot = plot.reference_label("as written");
    }
    for (joint, name) in joints.iter().enumerate() {
        let value = shown.left_percent.get(joint).copied().unwrap_or(f64::NAN);
        let reference = best.and(as_written.left_percent.get(joint).copied());
        plot = plot.bar(name, value, None, reference);
    }
    plot
}
