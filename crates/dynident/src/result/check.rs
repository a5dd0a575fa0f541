//! What `check` prints, and `identify` keeps in its result: whether study, robot and logs fit together.

use core::fmt::Write;
use dynident_recording::Level;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of what `check --json` prints.
pub const CHECK_SCHEMA: &str = "dynident/check/1";

/// A study examined.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CheckFile {
    /// [`CHECK_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// What was found in the logs and by comparing readings of them.
    pub check: StudyCheck,
}

/// Whether study, robot and logs fit together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StudyCheck {
    /// What was found, the worst first.
    pub findings: Vec<CheckFinding>,
    /// Names of the joints, in the order of the readings.
    pub joints: Vec<String>,
    /// The study as it is written; none where the readings could not be compared.
    pub as_written: Option<ReadingResult>,
    /// The reading that explains the logs clearly better, if there is one.
    pub best: Option<ReadingResult>,
    /// Other readings that were tried.
    pub tried: usize,
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CheckFinding {
    /// How much it matters.
    pub level: Level,
    /// What kind of mistake: `sign`, `order`, `offset`, `unit`, `coupling`, `lag`, `mounting`, `payload`,
    /// `description`, `torque`, `limits`, `samples`, `rows` or `log`.
    pub kind: String,
    /// What, in a sentence that names joints.
    pub what: String,
    /// What speaks for it, in figures.
    pub evidence: String,
    /// What to write into the study; empty where no key mends it.
    pub write: Vec<StudyChange>,
    /// Other explanations that these logs cannot tell from it.
    pub or: Vec<String>,
}

/// A key of a study and its new value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StudyChange {
    /// The table that it stands in: `format.torque`, `robot`, `[[log]] 2`.
    pub table: String,
    /// The line to write, as TOML.
    pub line: String,
}

/// How well a robot that can exist explains the logs in one reading of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ReadingResult {
    /// Percent of each joint's torque that no physically consistent robot explains (root mean squares).
    pub left_percent: Vec<f64>,
    /// Joints beyond their limits.
    pub beyond_limits: Vec<String>,
    /// All evidence as one number, the less the better; a difference of 0.6 is clear.
    pub score: f64,
}

impl StudyCheck {
    /// Sentences for what would spoil an identification.
    pub fn problems(&self) -> impl Iterator<Item = String> + '_ {
        self.findings.iter().filter(|finding| finding.level == Level::Problem).map(CheckFinding::sentence)
    }
}

impl StudyChange {
    /// The table in brackets.
    pub fn place(&self) -> String {
        if self.table.starts_with('[') { self.table.clone() } else { format!("[{}]", self.table) }
    }

    /// Whether the line is one key with a value of TOML.
    pub fn is_well_formed(&self) -> bool {
        self.line.parse::<toml::Table>().is_ok_and(|table| table.len() == 1)
    }
}

impl CheckFinding {
    /// What was found, why, and what to write, in one text.
    pub fn sentence(&self) -> String {
        let mut text = format!("{}: {}", self.what, self.evidence);
        for change in &self.write {
            let _ = write!(text, "; under {} write `{}`", change.place(), change.line);
        }
        if !self.or.is_empty() {
            let _ = write!(text, "; these logs cannot tell it from: {}", self.or.join("; or "));
        }
        text
    }
}
