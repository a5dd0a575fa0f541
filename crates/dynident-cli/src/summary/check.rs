use super::text::{explained, name, table, wrapped};
use core::fmt::Write;
use dynident::CheckFile;
use dynident::recording::Level;

pub(crate) fn check(file: &CheckFile) -> String {
    let check = &file.check;
    let mut text = String::new();
    let problems = check.findings.iter().filter(|finding| finding.level == Level::Problem).count();
    if problems == 0 {
        let _ =
            writeln!(text, "study, robot and logs fit together: none of {} tested mistakes fits better", check.tried);
    }
    for finding in &check.findings {
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
            let percent = |reading: &dynident::result::HypothesisResult| format!("{:.1}", reading.left_percent[joint]);
            vec![name(joint_name), percent(written), best.map_or_else(|| "-".to_owned(), percent)]
        });
        text += &table(&["joint", "as written %", "corrected %"].map(str::to_owned), 1..3, rows.collect());
    }
    text
}
