//! Page section about the study examination: findings and unexplained torque.

use crate::result::{CheckFinding, HypothesisResult, StudyCheck};
use dynident_recording::Level;
use dynident_report::{BarPlot, Heading, Report, Text, Tone};

pub(super) fn examination(page: &mut Report, check: &StudyCheck) {
    page.add(Heading::new("Study, robot and logs"));
    let mut text = Text::new(format!(
        "Dynident tested {} possible mistakes of the study (signs, orders, zeros, units, mounting). Each hypothesis was \
         scored by the best physically consistent fit.",
        check.tried
    ));
    if check.findings.iter().all(|finding| finding.level != Level::Problem) {
        text = text.point(Tone::Good, "no hypothesis explains the logs clearly better than the study as written");
    }
    for finding in &check.findings {
        text = text.point(tone(finding), finding.sentence());
    }
    page.add(text);
    if let Some(as_written) = &check.as_written {
        page.add(unexplained_torque(&check.joints, as_written, check.best.as_ref()));
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
        "root mean square over a few hundred samples of the logs; friction and drives are fitted too"
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
