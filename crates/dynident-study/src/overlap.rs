//! Checks that no sample is used twice: validation logs contain no training data, and no training data occur in two
//! logs.

use super::Study;
use super::log_source::StudyLogSource;
use crate::error::StudyError;
use dynident_identification::{Recording, Role, Samples};
use dynident_recording::LogFormat;
use dynident_recording::log::{LogSamples, SharedSamples};

/// Maximum number of values of training logs that are kept for the comparison with later training logs: 128 MB.
const MAX_KEPT_VALUES: usize = 1 << 24;

impl Study {
    /// Checks that no sample is used twice, for fit and validation or twice for the fit. Two logs must not be the
    /// same file (or copies) with common rows, nor contain the same samples in different files. Held-out logs are not
    /// compared with each other. `sources` and `recordings` belong to the study's logs.
    ///
    /// # Errors
    /// [`StudyError::Overlap`], [`StudyError::SameSamples`] and [`StudyError::RepeatedRows`] with the names of both
    /// logs.
    pub fn check_overlap(&self, sources: &[StudyLogSource], recordings: &[Recording]) -> Result<(), StudyError> {
        let [training_logs, held_out_logs] = [Role::Identify, Role::Validate].map(|role| self.logs_of_role(role));
        let is_same_file = |a: usize, b: usize| sources[a].has_content_of(&sources[b]);
        let may_share = |a: usize, b: usize| may_share_rows(&self.format_of(a), &self.format_of(b));
        for &held_out in &held_out_logs {
            let same = training_logs.iter().find(|log| is_same_file(**log, held_out) && may_share(**log, held_out));
            if let Some(&training) = same {
                let [training, held_out] = [training, held_out].map(|index| self.log_name(index));
                return Err(StudyError::Overlap { training, held_out });
            }
        }

        let is_compared = |a: usize, b: usize| a != b && (!is_same_file(a, b) || may_share(a, b));
        let is_needed = |log: usize, others: &[usize]| others.iter().any(|other| is_compared(log, *other));
        let tests = held_out_logs.iter().copied().filter(|&log| is_needed(log, &training_logs));
        let mut before: Vec<(usize, LogSamples)> =
            tests.filter_map(|log| Some((log, samples_of(&recordings[log])?))).collect();
        let mut kept = 0;
        for &training in &training_logs {
            if !is_needed(training, &training_logs) && !is_needed(training, &held_out_logs) {
                continue;
            }
            let Some(samples) = samples_of(&recordings[training]) else { continue };
            for (other, others) in before.iter().filter(|(other, _)| is_compared(*other, training)) {
                if let Some(shared) = others.shared_with(&samples) {
                    return Err(self.same_samples([*other, training], shared));
                }
            }
            kept += samples.values();
            if kept <= MAX_KEPT_VALUES {
                before.push((training, samples));
            }
        }
        Ok(())
    }

    /// The error for samples that another log shares with a training log.
    fn same_samples(&self, [other, training]: [usize; 2], shared: SharedSamples) -> StudyError {
        let [name, training] = [other, training].map(|index| self.log_name(index));
        let SharedSamples { row, other_row } = shared;
        if self.logs_of_role(Role::Validate).contains(&other) {
            StudyError::SameSamples { training, training_row: other_row, held_out: name, held_out_row: row }
        } else {
            StudyError::RepeatedRows { first: name, first_row: row, second: training, second_row: other_row }
        }
    }
}

/// The samples of a log; `None` for prepared motions, long logs, and logs that cannot be read (their reader reports
/// the error later).
fn samples_of(recording: &Recording) -> Option<LogSamples> {
    match &recording.samples {
        Samples::Log(log) => LogSamples::read(log).ok().flatten(),
        Samples::Motion(_) => None,
    }
}

/// Whether two parts of one file have, or can have, common rows: ranges by rows, fraction and time cannot be compared
/// before the file is read.
fn may_share_rows(a: &LogFormat, b: &LogFormat) -> bool {
    if a.part.is_some() && b.part.is_some() && a.part != b.part {
        return false;
    }
    let common = |a: [f64; 2], b: [f64; 2]| a[0] < b[1] && b[0] < a[1];
    let rows = |rows: [u64; 2]| rows.map(|row| row as f64);
    match (a.rows, b.rows, a.fraction, b.fraction, a.time_range_s, b.time_range_s) {
        (Some(a), Some(b), ..) => common(rows(a), rows(b)),
        (_, _, Some(a), Some(b), ..) | (.., Some(a), Some(b)) => common(a, b),
        _ => true,
    }
}
