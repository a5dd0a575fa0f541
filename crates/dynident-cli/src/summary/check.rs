use super::text::{explained, name, table, wrapped};
use dynident::CheckFile;
use dynident::recording::Level;
use dynident::result::{StudyCheck, grouped_check_findings};

/// Largest percentage of unexplained torque that is printed as a number; a larger one only means that no fit was
/// found.
const MAX_PERCENT: f64 = 1000.0;

pub(crate) fn check(file: &CheckFile) -> String {
    let check = &file.check;
    let mut text = String::new();
    let problems = check.findings.iter().filter(|finding| finding.level == Level::Problem).count();
    if problems == 0 {
        text += &wrapped(&verdict(check), 2);
    }
    for finding in grouped_check_findings(&check.findings, None) {
        let level = if finding.level == Level::Problem { "PROBLEM" } else { "warning" };
        text += &wrapped(&format!("{level} {}", finding.what), 2);
        text += &wrapped(&format!("  {}", finding.evidence), 4);
        for change in &finding.write {
            text += &wrapped(&format!("  under {} write: {}", change.place(), change.line), 4);
        }
        for other in &finding.or {
            text += &wrapped(&format!("  not distinguishable with these logs: {other}"), 4);
        }
    }
    text += &explained(check.findings.iter().map(|finding| &finding.code[..]));
    if let Some(written) = &check.as_written {
        let best = check.best.as_ref();
        text.push_str("\nTorque not explained by any physically consistent model:\n");
        let rows = check.joints.iter().enumerate().map(|(joint, joint_name)| {
            let percent = |result: &dynident::result::HypothesisResult| match result.left_percent[joint] {
                most if most > MAX_PERCENT => format!(">{MAX_PERCENT:.0}"),
                percent => format!("{percent:.1}"),
            };
            vec![name(joint_name), percent(written), best.map_or_else(|| "-".to_owned(), percent)]
        });
        text += &table(&["joint", "as written %", "corrected %"].map(str::to_owned), 1..3, rows.collect());
    }
    text
}

/// The result of a check without problems: whether the study fits, and how much torque is unexplained.
fn verdict(check: &StudyCheck) -> String {
    if check.commanded_logs > 0 {
        return format!(
            "commands and positions fit together in {} logs; torques were not compared",
            check.commanded_logs
        );
    }
    let tried = format!("none of {} tested mistakes fits better", check.tried);
    let Some(unexplained) = check.unexplained_percent else {
        return "study, robot and logs were not compared".to_owned();
    };
    let noise = check.noise_of_all_percent.unwrap_or(0.0);
    let shares = format!("{unexplained:.1} % of all torque is unexplained; noise explains {noise:.1} %");
    let joints: Vec<String> =
        check.mostly_unexplained().iter().map(|(joint, percent)| format!("{} ({percent:.0} %)", name(joint))).collect();
    if joints.is_empty() {
        format!("study, robot and logs fit together: {tried}; {shares}")
    } else {
        format!("no mistake found: {tried}; {shares}, but most of the torque of {} is unexplained", joints.join(", "))
    }
}
