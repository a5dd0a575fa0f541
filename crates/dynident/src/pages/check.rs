//! What the examiner says in a page: its findings, and what robots that can exist leave of the torque.

use crate::result::{CheckFinding, ReadingResult, StudyCheck};
use dynident_recording::Level;
use dynident_report::{BarPlot, Heading, Report, Text, Tone};

/// The section of a study's examination.
pub(super) fn examination(page: &mut Report, check: &StudyCheck) {
    page.add(Heading::new("Study, robot and logs"));
    let mut text = Text::new(format!(
        "The logs were read as under {} possible mistakes of the study (signs, orders, zeros, units, mounting), and each reading was \
         explained by the best robot that can exist.",
        check.tried
    ));
    if check.findings.iter().all(|finding| finding.level != Level::Problem) {
        text = text.point(Tone::Good, "no other reading explains them clearly better than the study as it is written");
    }
    for finding in &check.findings {
        text = text.point(tone(finding), finding.sentence());
    }
    page.add(text);
    if let Some(as_written) = &check.as_written {
        page.add(left(&check.joints, as_written, check.best.as_ref()));
    }
}

fn tone(finding: &CheckFinding) -> Tone {
    match finding.level {
        Level::Problem => Tone::Bad,
        Level::Warning => Tone::Warning,
        Level::Info => Tone::Plain,
    }
}

/// What is left of each joint's torque, as written and as corrected.
fn left(joints: &[String], as_written: &ReadingResult, best: Option<&ReadingResult>) -> BarPlot {
    let title = "Torque that the best possible robot leaves";
    let label = "left of the joint's torque, %";
    let shown = best.unwrap_or(as_written);
    let mut plot = BarPlot::new(title, label).note(if best.is_some() {
        "bars: the logs read as corrected; marks: as the study is written. A mistake shows where the mark stands far to the right of the bar"
    } else {
        "root mean squares over a few hundred instants of the logs; friction and drives are fitted as well"
    });
    if best.is_some() {
        plot = plot.reference_label("as the study is written");
    }
    for (joint, name) in joints.iter().enumerate() {
        let value = shown.left_percent.get(joint).copied().unwrap_or(f64::NAN);
        let reference = best.and(as_written.left_percent.get(joint).copied());
        plot = plot.bar(name, value, None, reference);
    }
    plot
}
