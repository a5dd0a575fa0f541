//! Why no study can be written from recordings.

use thiserror::Error;

/// Names of columns that a message shows at most.
const SHOWN: usize = 12;

/// Why no study can be written from these recordings.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NewStudyError {
    /// No columns of a quantity, or not for the joints of the positions.
    #[error("no columns of {quantity} were recognised among {}; write the study by hand: docs/src/your-robot.md, and `dynident log` for what a recording holds", shown(.columns))]
    NotRecognised {
        /// Positions, or torques or currents.
        quantity: &'static str,
        /// All columns.
        columns: Vec<String>,
    },
    /// More positions than joints.
    #[error(
        "{columns} columns of positions, and the description has {joints} joints that move by themselves: is it the robot of this recording?"
    )]
    MoreColumnsThanJoints {
        /// Columns of positions.
        columns: usize,
        /// Joints that follow no other.
        joints: usize,
    },
}

fn shown(columns: &[String]) -> String {
    let first: Vec<&str> = columns.iter().take(SHOWN).map(String::as_str).collect();
    let more = if columns.len() > SHOWN { format!(" and {} more", columns.len() - SHOWN) } else { String::new() };
    format!("{}{more}", first.join(", "))
}
