//! The files of an iteration as a whole: `iterations.json`, the page, the trajectories and the robot that was found.

use super::model::RobotFiles;
use crate::error::Error;
use crate::output_set::OutputSet;
use crate::result::IterationsFile;
use std::path::{Path, PathBuf};

const ITERATIONS: &str = "iterations.json";
const TRAJECTORY: &str = "trajectory.json";
const PAGE: &str = "report.html";

/// The files in the folder of the results.
pub(super) struct ResultFiles<'a> {
    out: &'a Path,
    /// Whether an iteration wrote the robot and the page in the folder. Those of another command stay until this
    /// iteration has its own.
    robot_is_own: bool,
}

impl<'a> ResultFiles<'a> {
    /// The files of `out`, as an earlier call left them.
    pub(super) fn of(out: &'a Path) -> Self {
        let earlier = IterationsFile::read(&out.join(ITERATIONS));
        Self { out, robot_is_own: earlier.is_ok_and(|earlier| !earlier.base_parameters.is_empty()) }
    }

    /// Path of the trajectories.
    pub(super) fn trajectory(&self) -> PathBuf {
        self.out.join(TRAJECTORY)
    }

    /// Removes the results of an earlier call.
    pub(super) fn remove(&self) -> Result<(), Error> {
        let set = OutputSet::new(self.out).absent(ITERATIONS).absent(TRAJECTORY);
        RobotFiles::none().added_to(self.without_page(set), self.robot_is_own).write()
    }

    /// Writes the file, its page and the identified robot. While runs are still being made, page and robot of an
    /// earlier call are removed.
    pub(super) fn write(&self, file: &IterationsFile, page: Option<String>, found: RobotFiles) -> Result<(), Error> {
        let bytes = dynident_text::json::to_string_pretty(file)
            .map_err(|error| Error::Result { path: self.out.join(ITERATIONS), message: error.to_string() })?;
        let set = found.added_to(OutputSet::new(self.out).file(ITERATIONS, bytes), self.robot_is_own);
        match page {
            Some(page) => set.file(PAGE, page),
            None => self.without_page(set),
        }
        .write()
    }

    /// The set without a page of an earlier call; `identify` writes a page with the same name.
    fn without_page(&self, set: OutputSet) -> OutputSet {
        if self.robot_is_own { set.absent(PAGE) } else { set }
    }
}
