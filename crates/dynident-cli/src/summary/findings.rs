//! Findings of the data import; equal findings of several joints and logs are combined.

use super::text::{explained, wrapped};
use dynident::ResultFile;
use dynident::recording::Level;
use dynident::result::LogSummary;

/// Findings that differ only in joint, log and numbers.
struct Group {
    level: Level,
    quantity: String,
    joints: Vec<String>,
    logs: Vec<usize>,
    words: Vec<String>,
    /// The smallest and the largest value of each number, with their texts.
    numbers: Vec<[(f64, String); 2]>,
}

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
    let (mut groups, mut codes): (Vec<Group>, Vec<&str>) = (Vec::new(), Vec::new());
    for (log, summary) in logs.iter().enumerate() {
        for finding in summary.import.findings.iter().chain(&summary.model_findings) {
            if finding.level == level {
                add(&mut groups, log, finding);
                codes.push(&finding.code);
            }
        }
    }
    let sentences: String = groups.iter().map(|group| wrapped(&sentence(group, logs), 4)).collect();
    sentences + &explained(codes.into_iter())
}

fn add(groups: &mut Vec<Group>, log: usize, finding: &dynident::recording::Finding) {
    let (quantity, joint) = finding.channel.split_once(' ').unwrap_or((&finding.channel, ""));
    let (words, numbers) = parted(&finding.message);
    let same = |group: &Group| group.level == finding.level && group.quantity == quantity && group.words == words;
    let group = if let Some(at) = groups.iter().position(same) {
        &mut groups[at]
    } else {
        groups.push(Group {
            level: finding.level,
            quantity: quantity.to_owned(),
            joints: Vec::new(),
            logs: Vec::new(),
            words,
            numbers: numbers.iter().map(|number| [number.clone(), number.clone()]).collect(),
        });
        let last = groups.len() - 1;
        &mut groups[last]
    };
    for (extremes, number) in group.numbers.iter_mut().zip(&numbers) {
        if number.0 < extremes[0].0 {
            extremes[0] = number.clone();
        }
        if number.0 > extremes[1].0 {
            extremes[1] = number.clone();
        }
    }
    if !joint.is_empty() && !group.joints.iter().any(|known| known == joint) {
        group.joints.push(joint.to_owned());
    }
    if !group.logs.contains(&log) {
        group.logs.push(log);
    }
}

fn sentence(group: &Group, logs: &[LogSummary]) -> String {
    let level = if group.level == Level::Problem { "PROBLEM" } else { "warning" };
    let joints = match &group.joints[..] {
        [] => String::new(),
        few if few.len() <= 3 => format!(" {}", few.join(", ")),
        [first, .., last] => format!(" of {} joints ({first} .. {last})", group.joints.len()),
        [one] => format!(" {one}"),
    };
    let places = match &group.logs[..] {
        all if all.len() == logs.len() && logs.len() > 1 => " (all logs)".to_owned(),
        _ if logs.len() == 1 => String::new(),
        some => format!(" ({})", some.iter().map(|&log| logs[log].log.clone()).collect::<Vec<_>>().join(", ")),
    };
    let mut message = group.words[0].clone();
    for (extremes, words) in group.numbers.iter().zip(&group.words[1..]) {
        message += &extremes[0].1;
        if extremes[0].1 != extremes[1].1 {
            message += " to ";
            message += &extremes[1].1;
        }
        message += words;
    }
    let unused = if matches!(&group.quantity[..], "velocity" | "acceleration") {
        "; it is only compared, the fit computes its own"
    } else {
        ""
    };
    format!("  {level} {}{joints}{places}: {message}{unused}", group.quantity)
}

/// Splits a message into its numbers and the texts between them; there is one more text than numbers.
fn parted(message: &str) -> (Vec<String>, Vec<(f64, String)>) {
    let (mut words, mut numbers, mut rest) = (vec![String::new()], Vec::new(), message);
    while let Some(first) = rest.chars().next() {
        let unsigned = rest.strip_prefix('-').unwrap_or(rest);
        let starts = unsigned.starts_with(|c: char| c.is_ascii_digit());
        let after_word = words.last().is_some_and(|w| w.ends_with(|c: char| c.is_alphanumeric() || c == '_'));
        let digits = unsigned.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(unsigned.len());
        let end = rest.len() - unsigned.len() + digits;
        let number = if starts && !after_word { rest[..end].trim_end_matches('.') } else { "" };
        if let Ok(value) = number.parse::<f64>() {
            numbers.push((value, number.to_owned()));
            words.push(String::new());
            rest = &rest[number.len()..];
        } else {
            if let Some(last) = words.last_mut() {
                last.push(first);
            }
            rest = &rest[first.len_utf8()..];
        }
    }
    (words, numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_parted_at_their_numbers() {
        let (words, numbers) = parted("differs by 64.5 % (correlation -0.801). Row 12.");
        assert_eq!(words, ["differs by ", " % (correlation ", "). Row ", "."]);
        assert_eq!(numbers.iter().map(|n| n.0).collect::<Vec<_>>(), [64.5, -0.801, 12.0]);
        assert_eq!(parted("joint q2 \u{e4}").1, []);
    }
}
