//! Log files of every format: lists the contents and reads all rows.

use super::Run;
use dynident::log_contents;
use std::io;
use tempfile::TempDir;

struct AnyFormat {
    folder: TempDir,
}

impl Run for AnyFormat {
    fn run(&mut self, _: &str, input: &[u8]) -> bool {
        let path = self.folder.path().join("recording");
        if std::fs::write(&path, input).is_err() {
            return false;
        }
        match log_contents(&path) {
            Ok(found) => {
                for channel in &found.channels {
                    assert!(channel.range.is_none_or(|range| range.iter().all(|x| x.is_finite())), "not finite");
                    assert!(channel.course.iter().flatten().all(|x| x.is_finite()), "not finite");
                }
                true
            }
            Err(error) => {
                assert!(!error.to_string().trim().is_empty(), "an empty message");
                false
            }
        }
    }
}

/// Reads all rows of a file.
pub(crate) fn any() -> io::Result<Box<dyn Run>> {
    Ok(Box::new(AnyFormat { folder: tempfile::tempdir()? }))
}
