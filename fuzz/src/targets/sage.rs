//! Folders of SAGE recordings: lists the contents, and reads commands and positions from the folder and from its files.

use super::Run;
use dynident::log_contents;
use dynident::recording::{Log, LogFormat};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The files of a recording; each is a seed.
const FILES: [&str; 3] = ["control.csv", "joint_list.txt", "state_motor.csv"];

const OF_FOLDER: &str = r#"{
    "time": { "column": "timestamp", "unit": "us" },
    "position": { "columns": "state_motor.positions[{joint}]" },
    "command": { "columns": "control.positions[{joint}]" }
}"#;
const OF_FILES: &str = r#"{
    "time": { "column": "timestamp", "unit": "us" },
    "position": { "columns": "positions[{0..1}]" },
    "command": { "columns": "positions[{0..1}]", "file": "control.csv" }
}"#;

struct Sage {
    folder: TempDir,
    formats: [LogFormat; 2],
}

/// A folder with a valid recording.
pub(crate) fn sage() -> io::Result<Box<dyn Run>> {
    let folder = tempfile::tempdir()?;
    for file in FILES {
        std::fs::copy(seed(file), folder.path().join(file))?;
    }
    let format = |text: &str| serde_json::from_str(text).map_err(io::Error::other);
    Ok(Box::new(Sage { folder, formats: [format(OF_FOLDER)?, format(OF_FILES)?] }))
}

fn seed(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus/sage").join(file)
}

impl Run for Sage {
    fn run(&mut self, file: &str, input: &[u8]) -> bool {
        let path = self.folder.path().join(file);
        if std::fs::write(&path, input).is_err() {
            return false;
        }
        let mut accepted = true;
        if let Err(error) = log_contents(self.folder.path()) {
            assert!(!error.to_string().trim().is_empty(), "an empty message");
            accepted = false;
        }
        let places = [self.folder.path().to_owned(), self.folder.path().join("state_motor.csv")];
        for (place, format) in places.iter().zip(&self.formats) {
            match Log::file(place, format.clone(), &["pan", "lift"].map(str::to_owned)).commanded_motion() {
                Ok(motion) => {
                    let numbers = motion.positions.iter().chain(&motion.commands).chain(&motion.times_s);
                    assert!(numbers.copied().all(f64::is_finite), "not finite");
                    assert_eq!(motion.positions.len(), motion.commands.len(), "columns of different length");
                }
                Err(error) => {
                    assert!(!error.to_string().trim().is_empty(), "an empty message");
                    accepted = false;
                }
            }
        }
        // Restore the valid file for the next input.
        let _ = std::fs::copy(seed(file), &path);
        accepted
    }
}
