//! Equal findings of several joints and logs as one finding.

use super::check::CheckFinding;
use super::{LogSummary, ResultFile};
use dynident_recording::{Finding, Level};

/// Maximum number of joints and of logs that are listed by name.
const MAX_NAMES: usize = 3;

/// Findings that differ only in joint, log and numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct FindingGroup {
    /// Severity.
    pub level: Level,
    /// Subject without its joint: `time`, `torque`.
    pub quantity: String,
    /// Code of the findings.
    pub code: String,
    joints: Vec<String>,
    logs: Vec<String>,
    /// Texts between the numbers; there is one more text than numbers.
    words: Vec<String>,
    /// The smallest and the largest value of each number.
    numbers: Vec<NumberRange>,
}

/// A number in a text.
#[derive(Clone, Debug, PartialEq)]
struct Number {
    value: f64,
    text: String,
}

#[derive(Clone, Debug, PartialEq)]
struct NumberRange {
    smallest: Number,
    largest: Number,
}

impl FindingGroup {
    /// Quantity, joints and logs: `torque arm_5, arm_6 (both logs)`. `logs` is the number of all logs, if known.
    pub fn place(&self, logs: Option<usize>) -> String {
        let joints = match &self.joints[..] {
            [] => String::new(),
            few if few.len() <= MAX_NAMES => format!(" {}", few.join(", ")),
            [first, .., last] => format!(" of {} joints ({first} .. {last})", self.joints.len()),
            [one] => format!(" {one}"),
        };
        let places = match (&self.logs[..], logs) {
            (_, Some(1)) => String::new(),
            ([_, _], Some(2)) => " (both logs)".to_owned(),
            (all, Some(logs)) if all.len() == logs => " (all logs)".to_owned(),
            (few, _) if few.len() <= MAX_NAMES => format!(" ({})", few.join(", ")),
            (many, _) => format!(" ({} logs: {} ..)", many.len(), many[..MAX_NAMES].join(", ")),
        };
        format!("{}{joints}{places}", self.quantity)
    }

    /// The message, with ranges for numbers that differ.
    pub fn message(&self) -> String {
        let mut message = self.words[0].clone();
        for (NumberRange { smallest, largest }, words) in self.numbers.iter().zip(&self.words[1..]) {
            message += &smallest.text;
            if smallest.text != largest.text {
                message += " to ";
                message += &largest.text;
            }
            message += words;
        }
        message
    }

    /// Joints to which the finding applies.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// Combines findings with the names of their logs, in the order of the first of each group.
    fn combined<'a>(findings: impl Iterator<Item = (&'a str, &'a Finding)>) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for (log, finding) in findings {
            let (quantity, joint) = finding.channel.split_once(' ').unwrap_or((&finding.channel, ""));
            let (words, numbers) = parted(&finding.message);
            let is_same =
                |group: &Self| group.level == finding.level && group.quantity == quantity && group.words == words;
            let at = groups.iter().position(is_same).unwrap_or_else(|| {
                let range = |number: &Number| NumberRange { smallest: number.clone(), largest: number.clone() };
                groups.push(Self {
                    level: finding.level,
                    quantity: quantity.to_owned(),
                    code: finding.code.clone(),
                    joints: Vec::new(),
                    logs: Vec::new(),
                    words,
                    numbers: numbers.iter().map(range).collect(),
                });
                groups.len() - 1
            });
            groups[at].include(log, joint, numbers);
        }
        groups
    }

    fn include(&mut self, log: &str, joint: &str, numbers: Vec<Number>) {
        for (NumberRange { smallest, largest }, number) in self.numbers.iter_mut().zip(numbers) {
            if number.value > largest.value {
                *largest = number;
            } else if number.value < smallest.value {
                *smallest = number;
            }
        }
        if !joint.is_empty() && !self.joints.iter().any(|known| known == joint) {
            self.joints.push(joint.to_owned());
        }
        if !self.logs.iter().any(|known| known == log) {
            self.logs.push(log.to_owned());
        }
    }
}

/// Findings of all logs at one level; equal findings of several joints and logs are combined.
pub fn grouped_findings(logs: &[LogSummary], level: Level) -> Vec<FindingGroup> {
    FindingGroup::combined(logs.iter().flat_map(|log| {
        let findings = log.import.findings.iter().chain(&log.model_findings);
        findings.filter(move |finding| finding.level == level).map(move |finding| (&log.log[..], finding))
    }))
}

/// Combines equal findings about several joints and logs; other findings stay as they are. `logs` is the number of all
/// logs, if known.
pub fn grouped_check_findings(findings: &[CheckFinding], logs: Option<usize>) -> Vec<CheckFinding> {
    // The log and its finding; `None` for a finding that is not combined with others.
    let of_log: Vec<Option<(&str, Finding)>> = findings
        .iter()
        .map(|finding| finding.of_log().filter(|_| finding.write.is_empty() && finding.or.is_empty()))
        .collect();
    let mut grouped: Vec<CheckFinding> = Vec::new();
    let mut done: Vec<usize> = Vec::new();
    for (place, finding) in findings.iter().enumerate() {
        if of_log[place].is_none() {
            grouped.push(finding.clone());
            continue;
        }
        if done.contains(&place) {
            continue;
        }
        let combined = |places: &[usize]| {
            let named = places.iter().filter_map(|place| of_log[*place].as_ref());
            FindingGroup::combined(named.map(|(log, found)| (*log, found)))
        };
        let is_same = |other: &usize| of_log[*other].is_some() && combined(&[place, *other]).len() == 1;
        let same: Vec<usize> = (place..findings.len()).filter(is_same).collect();
        grouped.push(match &combined(&same)[..] {
            [group] if same.len() > 1 => {
                CheckFinding { what: group.place(logs), evidence: group.message(), ..finding.clone() }
            }
            _ => finding.clone(),
        });
        done.extend(same);
    }
    grouped
}

impl ResultFile {
    /// [`problems`](Self::problems) for people: equal problems of several joints and logs are one line.
    pub fn problem_lines(&self) -> Vec<String> {
        let of_logs: Vec<String> = self.logs.iter().flat_map(LogSummary::problems).collect();
        let mut lines: Vec<String> =
            self.problems.iter().filter(|problem| !of_logs.contains(problem)).cloned().collect();
        if lines.len() < self.problems.len() {
            let groups = grouped_findings(&self.logs, Level::Problem);
            let place = |group: &FindingGroup| group.place(Some(self.logs.len()));
            lines.extend(groups.iter().map(|group| format!("{}: {}", place(group), group.message())));
        }
        lines
    }
}

/// Splits a message into its numbers and the texts between them; there is one more text than numbers.
fn parted(message: &str) -> (Vec<String>, Vec<Number>) {
    let (mut words, mut numbers, mut rest) = (vec![String::new()], Vec::new(), message);
    while let Some(first) = rest.chars().next() {
        let unsigned = rest.strip_prefix('-').unwrap_or(rest);
        let starts = unsigned.starts_with(|c: char| c.is_ascii_digit());
        let after_word = words.last().is_some_and(|w| w.ends_with(|c: char| c.is_alphanumeric() || c == '_'));
        let digits = unsigned.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(unsigned.len());
        let exponent = exponent_length(&unsigned[digits..]);
        let end = rest.len() - unsigned.len() + digits + exponent;
        let number = if starts && !after_word { rest[..end].trim_end_matches('.') } else { "" };
        if let Ok(value) = number.parse::<f64>() {
            numbers.push(Number { value, text: number.to_owned() });
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

/// Length of an exponent such as `e-4` at the beginning of a text; 0 without an exponent.
fn exponent_length(text: &str) -> usize {
    let Some(power) = text.strip_prefix('e') else { return 0 };
    let unsigned = power.strip_prefix('-').unwrap_or(power);
    let digits = unsigned.find(|c: char| !c.is_ascii_digit()).unwrap_or(unsigned.len());
    if digits == 0 { 0 } else { text.len() - unsigned.len() + digits }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(channel: &str, message: &str) -> Finding {
        Finding {
            level: Level::Problem,
            channel: channel.to_owned(),
            message: message.to_owned(),
            code: "import-mostly-dead".to_owned(),
        }
    }

    #[test]
    fn messages_are_parted_at_their_numbers() {
        let (words, numbers) = parted("differs by 64.5 % (correlation -0.801). Row 12.");
        assert_eq!(words, ["differs by ", " % (correlation ", "). Row ", "."]);
        assert_eq!(numbers.iter().map(|n| n.value).collect::<Vec<_>>(), [64.5, -0.801, 12.0]);
        assert_eq!(parted("joint q2 \u{e4}").1, []);
        let (words, numbers) = parted("quantised in steps of 1.534e-4");
        assert_eq!((&words[1][..], &numbers[0].text[..]), ("", "1.534e-4"));
    }

    #[test]
    fn equal_findings_of_joints_and_logs_are_one_line() {
        let found = |joint: u8, percent: &str| {
            finding(&format!("torque arm_{joint}"), &format!("mostly dead: {percent} % of the samples are zero"))
        };
        let all = [("one", found(5, "87.5")), ("one", found(6, "87.4")), ("two", found(5, "85.7"))];
        let checks: Vec<CheckFinding> = all.iter().map(|(log, found)| CheckFinding::about_log(log, found)).collect();
        let other = CheckFinding { what: "sign".to_owned(), kind: "sign".to_owned(), ..checks[0].clone() };
        let mixed = [&checks[..1], core::slice::from_ref(&other), &checks[1..]].concat();
        let grouped = grouped_check_findings(&mixed, Some(2));
        assert_eq!(grouped.len(), 2);
        assert_eq!(grouped[0].what, "torque arm_5, arm_6 (both logs)");
        assert_eq!(grouped[0].evidence, "mostly dead: 85.7 to 87.5 % of the samples are zero");
        assert_eq!(grouped[1], other);
        assert_eq!(grouped_check_findings(&checks[..1], None), checks[..1], "a single finding keeps its words");
    }
}
