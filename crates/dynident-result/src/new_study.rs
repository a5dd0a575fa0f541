//! Output of `new` as JSON.

use super::{StudyChange, StudyCheck};
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`NewStudyFile`].
pub const NEW_STUDY_SCHEMA: &str = "dynident/new/1";

/// A study created from a robot and its recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NewStudyFile {
    /// [`NEW_STUDY_SCHEMA`].
    pub schema: String,
    /// Path of the study.
    pub file: String,
    /// Text of the study.
    pub text: String,
    /// Points that a person should check before using the study; empty if there are none.
    pub unsure: Vec<Unsure>,
    /// Result of the final examination; null if it was not possible.
    pub check: Option<StudyCheck>,
}

/// A point that a person should check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Unsure {
    /// The line of the study to check; null if the doubt is not about a single line.
    pub line: Option<StudyChange>,
    /// Corrections proposed by `check`. Other mistakes could explain its findings equally well.
    pub proposed: Vec<StudyChange>,
    /// Reason for the doubt.
    pub reason: String,
}

impl Unsure {
    /// Place and reason as text.
    pub fn sentence(&self) -> String {
        match &self.line {
            Some(change) => format!("{} `{}`: {}", change.place(), change.line, self.reason),
            None => self.reason.clone(),
        }
    }
}
