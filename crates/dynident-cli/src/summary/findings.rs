//! Findings of the data import; equal findings of several joints and logs are combined.

use super::text::{explained, wrapped};
use dynident::ResultFile;
use dynident::recording::Level;
use dynident::result::{FindingGroup, LogSummary, grouped_findings};

pub(super) fn findings(logs: &[LogSummary]) -> String {
    let problems = of_level(logs, Level::Problem);
    let spoilt = if problems.is_empty() { "" } else { PROBLEM_NOTE };
    problems + spoilt + &warnings(logs)
}

const PROBLEM_NOTE: &str = "  A PROBLEM invalidates the result: fix it before you use any value shown here.\n";

/// All problems of a result's model; equal findings of several joints and logs are combined.
pub(super) fn problems(r: &ResultFile) -> String {
    let mut text = of_level(&r.logs, Level::Problem);
    for problem in r.problems_of_the_model() {
        text += &wrapped(&format!("  PROBLEM {problem}"), 4);
    }
    if text.is_empty() { text } else { text + PROBLEM_NOTE }
}

pub(super) fn warnings(logs: &[LogSummary]) -> String {
    of_level(logs, Level::Warning)
}

/// Findings of one level, with equal ones combined.
fn of_level(logs: &[LogSummary], level: Level) -> String {
    let groups = grouped_findings(logs, level);
    let sentences: String = groups.iter().map(|group| wrapped(&sentence(group, logs.len()), 4)).collect();
    sentences + &explained(groups.iter().map(|group| &group.code[..]))
}

fn sentence(group: &FindingGroup, logs: usize) -> String {
    let level = if group.level == Level::Problem { "PROBLEM" } else { "warning" };
    let unused = if matches!(&group.quantity[..], "velocity" | "acceleration") {
        "; it is only compared, the fit computes its own"
    } else {
        ""
    };
    format!("  {level} {}: {}{unused}", group.place(Some(logs)), group.message())
}
