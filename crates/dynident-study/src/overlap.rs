//! Checks that no sample is used twice: validation logs contain no training data, and training logs differ.

use super::Study;
use super::log_source::StudyLogSource;
use crate::error::StudyError;
use dynident_identification::{Recording, Role, Samples};
use dynident_recording::LogFormat;
use dynident_recording::log::LogSamples;

/// Largest number of training logs whose samples are compared with each other: all of them are in memory.
const MAX_COMPARED_LOGS: usize = 8;

impl Study {
    /// Checks that no sample is used for both fit and validation: two logs with different roles must not be the same
    /// file (or copies) with common rows, nor contain the same samples in another file. `sources` and `recordings` are
    /// the study's logs.
    ///
    /// # Errors
    /// [`StudyError::Overlap`] and [`StudyError::SameSamples`] with the names of both logs.
    pub fn check_overlap(&self, sources: &[StudyLogSource], recordings: &[Recording]) -> Result<(), StudyError> {
        let held_out_logs = self.logs_of_role(Role::Validate);
        let training_logs = self.logs_of_role(Role::Identify);
        let names = |logs: [usize; 2]| logs.map(|index| self.log_name(index));
        // Pairs of different files, whose samples have to be compared.
        let mut others = Vec::new();
        for &held_out in &held_out_logs {
            for &training in &training_logs {
                let is_same_file = sources[training].has_content_of(&sources[held_out]);
                if is_same_file && may_share_rows(&self.format_of(training), &self.format_of(held_out)) {
                    let [training, held_out] = names([training, held_out]);
                    return Err(StudyError::Overlap { training, held_out });
                }
                others.extend((!is_same_file).then_some([training, held_out]));
            }
        }

        // Each log is read once. A log that cannot be read is reported later by its reader.
        let read = |index: usize| samples_of(&recordings[index]);
        let is_needed = |index: usize| others.iter().any(|pair| pair.contains(&index));
        let tests: Vec<(usize, LogSamples)> = held_out_logs
            .iter()
            .filter(|&&index| is_needed(index))
            .filter_map(|&index| Some((index, read(index)?)))
            .collect();
        for &training in training_logs.iter().filter(|&&index| !tests.is_empty() && is_needed(index)) {
            let Some(fitted) = read(training) else { continue };
            for (held_out, tested) in tests.iter().filter(|(held_out, _)| others.contains(&[training, *held_out])) {
                if let Some(shared) = fitted.shared_with(tested) {
                    let [training, held_out] = names([training, *held_out]);
                    let (training_row, held_out_row) = (shared.row, shared.other_row);
                    return Err(StudyError::SameSamples { training, training_row, held_out, held_out_row });
                }
            }
        }
        Ok(())
    }

    /// Checks that no sample is in two training logs, which would make the error bars too small. Samples of up to eight
    /// training logs are compared.
    ///
    /// # Errors
    /// [`StudyError::RepeatedRows`] with the names and rows of both logs.
    pub fn check_repeated_rows(&self, sources: &[StudyLogSource], recordings: &[Recording]) -> Result<(), StudyError> {
        let logs = self.logs_of_role(Role::Identify);
        if !(2..=MAX_COMPARED_LOGS).contains(&logs.len()) {
            return Ok(());
        }
        let mut before: Vec<(usize, LogSamples)> = Vec::new();
        for second in logs {
            let Some(samples) = samples_of(&recordings[second]) else { continue };
            for (first, earlier) in &before {
                let is_same_file = sources[*first].has_content_of(&sources[second]);
                if is_same_file && !may_share_rows(&self.format_of(*first), &self.format_of(second)) {
                    continue;
                }
                if let Some(shared) = earlier.shared_with(&samples) {
                    return Err(StudyError::RepeatedRows {
                        first: self.log_name(*first),
                        first_row: shared.row,
                        second: self.log_name(second),
                        second_row: shared.other_row,
                    });
                }
            }
            before.push((second, samples));
        }
        Ok(())
    }
}

/// The samples of a log; `None` for prepared motions, long logs, and logs that cannot be read.
fn samples_of(recording: &Recording) -> Option<LogSamples> {
    match &recording.samples {
        Samples::Log(log) => LogSamples::read(log).ok().flatten(),
        Samples::Motion(_) => None,
    }
}

/// Whether two parts of one file have, or may have, common rows: ranges by rows, fraction and time cannot be compared
/// before the file is read.
fn may_share_rows(a: &LogFormat, b: &LogFormat) -> bool {
    let common = |a: [f64; 2], b: [f64; 2]| a[0] < b[1] && b[0] < a[1];
    let rows = |rows: [u64; 2]| rows.map(|row| row as f64);
    match (a.rows, b.rows, a.fraction, b.fraction, a.time_range_s, b.time_range_s) {
        (Some(a), Some(b), ..) => common(rows(a), rows(b)),
        (_, _, Some(a), Some(b), ..) | (.., Some(a), Some(b)) => common(a, b),
        _ => true,
    }
}
