//! A log that the model is fitted to proves nothing when the model is tested on it.

use super::Study;
use super::log_source::StudyLogSource;
use crate::error::StudyError;
use dynident_identification::{Recording, Role, Samples};
use dynident_recording::LogFormat;
use dynident_recording::log::shared_samples;

impl Study {
    /// No sample is both fitted to and tested on: two logs of different roles are not the same file (nor copies of one)
    /// with rows in common, nor is one the other's samples saved once more. `sources` are where their samples are,
    /// `recordings` the same as logs.
    ///
    /// # Errors
    /// [`StudyError::Overlap`] and [`StudyError::SameSamples`] with the names of both logs.
    pub(crate) fn check_overlap(&self, sources: &[StudyLogSource], recordings: &[Recording]) -> Result<(), StudyError> {
        for held_out in self.logs_of_role(Role::Validate) {
            for training in self.logs_of_role(Role::Identify) {
                let names = || [training, held_out].map(|index| self.log_name(index));
                let is_same_file = sources[training].has_content_of(&sources[held_out]);
                if is_same_file && may_share_rows(&self.format_of(training), &self.format_of(held_out)) {
                    let [training, held_out] = names();
                    return Err(StudyError::Overlap { training, held_out });
                }
                let logs = [training, held_out].map(|index| &recordings[index].samples);
                let [Samples::Log(a), Samples::Log(b)] = logs else { continue };
                if is_same_file {
                    continue;
                }
                // A log that cannot be read is left to its reader.
                if let Ok(Some(shared)) = shared_samples(a, b) {
                    let [training, held_out] = names();
                    let (training_row, held_out_row) = (shared.row, shared.other_row);
                    return Err(StudyError::SameSamples { training, training_row, held_out, held_out_row });
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
