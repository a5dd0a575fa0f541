//! What `new` prints: the schema of its JSON.

use super::{StudyChange, StudyCheck};
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`NewStudyFile`].
pub const NEW_STUDY_SCHEMA: &str = "dynident/new/1";

/// A study that was written from a robot and its recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NewStudyFile {
    /// [`NEW_STUDY_SCHEMA`].
    pub schema: String,
    /// Where the study stands.
    pub file: String,
    /// The study.
    pub text: String,
    /// What a person should look at before the study is believed; empty where nothing is left.
    pub unsure: Vec<Unsure>,
    /// What an examination of the study found in the end; none where it could not be examined.
    pub check: Option<StudyCheck>,
}

/// What a person should look at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Unsure {
    /// The line of the study that may be wrong; none where it is no single one.
    pub line: Option<StudyChange>,
    /// What the examination would write there instead, where it names something but cannot tell it from other mistakes.
    pub proposed: Vec<StudyChange>,
    /// Why it may be wrong.
    pub reason: String,
}

impl Unsure {
    /// Place and reason as a sentence.
    pub fn sentence(&self) -> String {
        match &self.line {
            Some(change) => format!("{} `{}`: {}", change.place(), change.line, self.reason),
            None => self.reason.clone(),
        }
    }
}
