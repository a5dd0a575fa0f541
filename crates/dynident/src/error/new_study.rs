//! Errors of `new`.

use core::fmt;
use thiserror::Error;

/// Reason why a study cannot be written from these recordings.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NewStudyError {
    /// `new` recognises columns by common names, such as `actual_q_0` or `tau_1`, and found none for this quantity.
    /// Rename the columns in the file, or write the study by hand.
    #[error("no columns of {quantity} recognised: {}; write the study by hand (page \"Your robot in 15 minutes\": `dynident docs your-robot`); `dynident log` shows the contents of a recording", listed(.found))]
    NotRecognised {
        /// Missing quantity: `positions`, or `torques or currents`.
        quantity: &'static str,
        /// The columns that were found in each recording.
        found: Vec<RecognisedFile>,
    },
    /// The log has position columns for more joints than the robot. The robot description is of another robot, or the
    /// log also contains a gripper, a second arm or an external axis. Give the matching description, or write a study
    /// with the columns of this robot.
    #[error(
        "{columns} position columns, but the robot description has {joints} independent joints: check that it is the robot of this recording; if the log also has other joints (second arm, gripper), write the study by hand (`dynident docs your-robot`) with the columns of this robot, probably `columns = {probable}` in [format.position], and those of torque or command likewise"
    )]
    MoreColumnsThanJoints {
        /// Number of position columns.
        columns: usize,
        /// Number of independent joints of the robot.
        joints: usize,
        /// Columns that probably belong to the robot, in the notation of a study.
        probable: String,
    },
}

/// The columns of one recording, sorted by whether their names are known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecognisedFile {
    /// Name of the file.
    pub file: String,
    /// Number of columns.
    pub columns: usize,
    /// Columns whose names state a quantity of joints; empty if there are none.
    pub known: String,
    /// All other columns.
    pub unknown: String,
}

impl fmt::Display for RecognisedFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, columns, known, unknown } = self;
        write!(f, "{file} ({columns} columns)")?;
        if !unknown.is_empty() {
            write!(f, " has unknown columns {unknown}")?;
        }
        if !known.is_empty() {
            let and = if unknown.is_empty() { " has" } else { ", and" };
            write!(f, "{and} other columns of joints {known}")?;
        }
        Ok(())
    }
}

/// Maximum number of files in a message.
const MAX_FILES: usize = 4;

fn listed(found: &[RecognisedFile]) -> String {
    let first: Vec<String> = found.iter().take(MAX_FILES).map(ToString::to_string).collect();
    let more =
        if found.len() > MAX_FILES { format!("; {} more files", found.len() - MAX_FILES) } else { String::new() };
    format!("{}{more}", first.join("; "))
}
