//! Result of `check`, also part of the result of `identify`: consistency of study, robot and logs.

use core::fmt::Write;
use dynident_identification::diagnosis::KeyChange;
use dynident_recording::{Finding, Level};
use serde::{Deserialize, Serialize};

/// Name and version of the schema of `check --json`.
pub const CHECK_SCHEMA: &str = "dynident/check/1";

/// Share of unexplained torque above which most of a joint's torque is unexplained, percent.
const MOST_PERCENT: f64 = 50.0;

/// Kind of findings about single logs.
const LOG_KIND: &str = "log";

/// Result of `check`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CheckFile {
    /// [`CHECK_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub name: String,
    /// Findings about the logs and from the comparison of hypotheses.
    pub check: StudyCheck,
}

/// Consistency of study, robot and logs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StudyCheck {
    /// Findings, the most serious first.
    pub findings: Vec<CheckFinding>,
    /// Names of the joints, in the order of the hypothesis results.
    pub joints: Vec<String>,
    /// Score of the study as it is written; null if the hypotheses could not be compared.
    pub as_written: Option<HypothesisResult>,
    /// Score of the hypothesis (a possible mistake in the study) that explains the logs clearly better; null if there
    /// is none.
    pub best: Option<HypothesisResult>,
    /// Number of tested hypotheses about mistakes in the study.
    pub tried: usize,
    /// Unexplained torque of the best hypothesis, all joints together, percent of the measured torque (root mean
    /// squares); null if the hypotheses could not be compared, and in results of older versions.
    #[serde(default)]
    pub unexplained_percent: Option<f64>,
    /// Share of each joint's torque that measurement noise explains, percent; empty in results of older versions.
    #[serde(default)]
    pub noise_percent: Vec<f64>,
    /// Share of the torque of all joints together that measurement noise explains, percent; null in results of older
    /// versions.
    #[serde(default)]
    pub noise_of_all_percent: Option<f64>,
    /// Number of logs without torque whose commands were compared with the positions; 0 in results of older versions.
    #[serde(default)]
    pub commanded_logs: usize,
}

/// One finding of `check`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CheckFinding {
    /// Severity.
    pub level: Level,
    /// Kind of mistake: `sign`, `order`, `offset`, `unit`, `coupling`, `lag`, `mounting`, `payload`, `description`,
    /// `torque`, `limits`, `samples`, `rows`, `motion`, `command` or `log`.
    pub kind: String,
    /// Description, with the names of joints.
    pub what: String,
    /// Evidence, with numbers.
    pub evidence: String,
    /// Corrections of the study; empty if no key corrects the mistake.
    pub write: Vec<StudyChange>,
    /// Other explanations that the logs cannot distinguish from this finding.
    pub or: Vec<String>,
    /// Code of the finding; `dynident docs CODE` explains it. Empty in results of older versions.
    #[serde(default)]
    pub code: String,
}

/// A study key and its new value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StudyChange {
    /// Table of the key: `format.torque`, `robot`, `[[log]] 2`.
    pub table: String,
    /// The new line, as TOML.
    pub line: String,
}

/// Score of one hypothesis: the best physically consistent fit to the logs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HypothesisResult {
    /// Unexplained torque of each joint in the best physically consistent fit, percent of its measured torque (root
    /// mean squares).
    pub left_percent: Vec<f64>,
    /// Names of the joints whose positions or velocities exceed their limits.
    pub beyond_limits: Vec<String>,
    /// Score from all evidence, lower is better; a difference of 0.6 is clear.
    pub score: f64,
}

impl StudyCheck {
    /// Joints with more than half of their torque (root mean square) unexplained by the best hypothesis and by noise,
    /// with the unexplained percentage.
    pub fn mostly_unexplained(&self) -> Vec<(&str, f64)> {
        let left = self.best.as_ref().or(self.as_written.as_ref()).map_or(&[][..], |result| &result.left_percent);
        let noise = |joint: usize| self.noise_percent.get(joint).copied().unwrap_or(0.0);
        let is_far = |joint: usize, left: f64| left.powi(2) - noise(joint).powi(2) > MOST_PERCENT.powi(2);
        let all = self.joints.iter().zip(left).enumerate();
        all.filter(|(joint, (_, left))| is_far(*joint, **left)).map(|(_, (name, left))| (&name[..], *left)).collect()
    }

    /// Findings that make an identification unreliable.
    pub fn problems(&self) -> impl Iterator<Item = String> + '_ {
        self.findings.iter().filter(|finding| finding.level == Level::Problem).map(CheckFinding::sentence)
    }
}

impl From<KeyChange> for StudyChange {
    fn from(change: KeyChange) -> Self {
        let KeyChange { table, line } = change;
        Self { table, line }
    }
}

impl StudyChange {
    /// The table of the key in brackets, as in a study file.
    pub fn place(&self) -> String {
        if self.table.starts_with('[') { self.table.clone() } else { format!("[{}]", self.table) }
    }

    /// Whether the line is one key with a value of TOML.
    pub fn is_well_formed(&self) -> bool {
        self.line.parse::<toml::Table>().is_ok_and(|table| table.len() == 1)
    }
}

impl CheckFinding {
    /// Creates a finding about the log with the name `log`.
    pub fn about_log(log: &str, finding: &Finding) -> Self {
        Self {
            level: finding.level,
            kind: LOG_KIND.to_owned(),
            what: format!("log `{log}`, {}", finding.channel),
            evidence: finding.message.clone(),
            write: Vec::new(),
            or: Vec::new(),
            code: finding.code.clone(),
        }
    }

    /// Name of the log and its finding, for a finding that [`about_log`](Self::about_log) created.
    pub fn of_log(&self) -> Option<(&str, Finding)> {
        let named = self.what.strip_prefix("log `").filter(|_| self.kind == LOG_KIND)?;
        let (log, channel) = named.rsplit_once("`, ")?;
        let (level, message, code) = (self.level, self.evidence.clone(), self.code.clone());
        Some((log, Finding { level, channel: channel.to_owned(), message, code }))
    }

    /// Finding, evidence and corrections in one text.
    pub fn sentence(&self) -> String {
        let mut text = format!("{}: {}", self.what, self.evidence);
        for change in &self.write {
            let _ = write!(text, "; in {} write `{}`", change.place(), change.line);
        }
        if !self.or.is_empty() {
            let _ = write!(text, "; these logs do not distinguish it from: {}", self.or.join("; or "));
        }
        text
    }
}
