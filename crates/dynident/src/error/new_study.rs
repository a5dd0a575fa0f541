//! Errors of `new`.

use thiserror::Error;

/// Maximum number of column names in a message.
const MAX_SHOWN: usize = 12;

/// Reason why a study cannot be written from these recordings.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NewStudyError {
    /// No columns for a quantity, or not for the joints of the positions.
    #[error("no columns of {quantity} recognised among {}; write the study by hand (page \"Your robot in 15 minutes\": `dynident docs your-robot`); `dynident log` shows the contents of a recording", shown(.columns))]
    NotRecognised {
        /// `positions`, or `torques or currents`.
        quantity: &'static str,
        /// All columns.
        columns: Vec<String>,
    },
    /// More position columns than joints.
    #[error(
        "{columns} position columns, but the robot description has {joints} independent joints: check that it is the robot of this recording"
    )]
    MoreColumnsThanJoints {
        /// Position columns.
        columns: usize,
        /// Independent joints.
        joints: usize,
    },
}

fn shown(columns: &[String]) -> String {
    let first: Vec<&str> = columns.iter().take(MAX_SHOWN).map(String::as_str).collect();
    let more =
        if columns.len() > MAX_SHOWN { format!(" and {} more", columns.len() - MAX_SHOWN) } else { String::new() };
    format!("{}{more}", first.join(", "))
}
