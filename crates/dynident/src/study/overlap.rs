//! A log that the model is fitted to proves nothing when the model is tested on it.

use super::Study;
use super::log_source::StudyLogSource;
use crate::error::StudyError;
use dynident_identification::Role;
use dynident_recording::LogFormat;

impl Study {
    /// No sample is both fitted to and tested on: two logs of different roles are not the same file (nor copies of one)
    /// with rows in common. `sources` are where their samples are.
    ///
    /// # Errors
    /// [`StudyError::Overlap`] with the names of both logs.
    pub(crate) fn check_overlap(&self, sources: &[StudyLogSource]) -> Result<(), StudyError> {
        for held_out in self.logs_of_role(Role::Validate) {
            for training in self.logs_of_role(Role::Identify) {
                if may_share_rows(&self.format_of(training), &self.format_of(held_out))
                    && sources[training].has_content_of(&sources[held_out])
                {
                    let [training, held_out] = [training, held_out].map(|index| self.log_name(index));
                    return Err(StudyError::Overlap { training, held_out });
                }
            }
        }
        Ok(())
    }
}

/// Whether two parts of one file have rows in common, or could have: parts by rows, by fraction and by time cannot be
/// compared before the file is read.
fn may_share_rows(a: &LogFormat, b: &LogFormat) -> bool {
    let common = |a: [f64; 2], b: [f64; 2]| a[0] < b[1] && b[0] < a[1];
    let rows = |rows: [u64; 2]| rows.map(|row| row as f64);
    match (a.rows, b.rows, a.fraction, b.fraction, a.time_range_s, b.time_range_s) {
        (Some(a), Some(b), ..) => common(rows(a), rows(b)),
        (_, _, Some(a), Some(b), ..) | (.., Some(a), Some(b)) => common(a, b),
        _ => true,
    }
}
