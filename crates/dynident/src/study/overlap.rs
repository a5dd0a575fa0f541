//! A log that the model is fitted to proves nothing when the model is tested on it.

use super::Study;
use crate::error::StudyError;
use dynident_identification::Role;
use dynident_recording::LogFormat;
use fnv::FnvHasher;
use std::fs::File;
use std::hash::Hasher;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

impl Study {
    /// No sample is both fitted to and tested on: two logs of different roles are not the same file (nor copies of one)
    /// with rows in common. `files` are the logs' files. A file that cannot be read is left to its reader.
    ///
    /// # Errors
    /// [`StudyError::Overlap`] with the names of both logs.
    pub(crate) fn check_overlap(&self, files: &[PathBuf]) -> Result<(), StudyError> {
        for held_out in self.logs_of_role(Role::Validate) {
            for training in self.logs_of_role(Role::Identify) {
                if may_share_rows(&self.format_of(training), &self.format_of(held_out))
                    && same_content(&files[training], &files[held_out])
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

/// Whether two files hold the same bytes: the same file, or one of the same length and hash.
fn same_content(a: &Path, b: &Path) -> bool {
    if let (Ok(a), Ok(b)) = (a.canonicalize(), b.canonicalize())
        && a == b
    {
        return true;
    }
    let length = |path: &Path| path.metadata().map(|metadata| metadata.len()).ok();
    length(a).is_some() && length(a) == length(b) && hash(a).is_some_and(|one| Some(one) == hash(b))
}

/// FNV-1a of a file's bytes, 64 bits; none if it cannot be read.
fn hash(path: &Path) -> Option<u64> {
    let mut file = BufReader::with_capacity(1 << 16, File::open(path).ok()?);
    let mut hasher = FnvHasher::default();
    loop {
        let block = file.fill_buf().ok()?;
        if block.is_empty() {
            return Some(hasher.finish());
        }
        hasher.write(block);
        let read = block.len();
        file.consume(read);
    }
}
