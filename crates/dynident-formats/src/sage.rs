//! Recordings of SAGE: a folder with `control.csv` (commands) and `state_motor.csv` (measurements), text tables with
//! lists of numbers. Layout: <https://github.com/isaac-sim2real/sage>.

use crate::error::FileError;
use std::path::{Path, PathBuf};

/// Files of a SAGE recording: the commands and the measurements.
pub const SAGE_FILES: [&str; 2] = ["control.csv", "state_motor.csv"];
/// Names of the joints, one on each line, in the order of the lists.
const JOINTS: &str = "joint_list.txt";
const MAX_JOINTS_BYTES: u64 = 1 << 20;

/// Whether `path` is the folder of a SAGE recording.
pub(crate) fn is_recording(path: &Path) -> bool {
    SAGE_FILES.iter().all(|name| path.join(name).is_file())
}

pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let joints = Some(folder.join(JOINTS)).filter(|path| path.is_file());
    SAGE_FILES.iter().map(|name| folder.join(name)).chain(joints).collect()
}

/// Names of the joints of the SAGE recording in `folder`; empty without a list.
///
/// # Errors
/// If the list exists and cannot be read, is not UTF-8 or has a duplicate name.
pub fn sage_joints(folder: &Path) -> Result<Vec<String>, FileError> {
    let file = folder.join(JOINTS);
    if !file.is_file() {
        return Ok(Vec::new());
    }
    let text = dynident_files::read_text(&file, MAX_JOINTS_BYTES)
        .map_err(|source| FileError::Io { file: file.clone(), source })?;
    let names: Vec<String> = text.lines().map(|line| line.trim().to_owned()).filter(|name| !name.is_empty()).collect();
    let is_duplicate = |at: &usize| names[..*at].contains(&names[*at]);
    if let Some(at) = (0..names.len()).find(is_duplicate) {
        let problem = format!("the joint `{}` is listed twice", names[at]);
        let fix = "write each joint once, in the order of the lists in state_motor.csv";
        return Err(FileError::broken(&file, crate::FileFormat::Sage, format!("name {}", at + 1), problem, fix));
    }
    Ok(names)
}
