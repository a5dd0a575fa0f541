//! Files of an iteration: `iterations.json`, page, trajectories and identified robot.

use super::model::RobotFiles;
use crate::error::Error;
use crate::output_set::OutputSet;
use crate::result::IterationsFile;
use std::path::{Path, PathBuf};

const ITERATIONS: &str = "iterations.json";
const TRAJECTORY: &str = "trajectory.json";
const PAGE: &str = "report.html";

pub(super) struct ResultFiles<'a> {
    out: &'a Path,
    /// Whether robot and page in the folder come from an iteration. Files of another command are kept until this
    /// iteration writes its own.
    robot_is_own: bool,
}

impl<'a> ResultFiles<'a> {
    pub(super) fn of(out: &'a Path) -> Self {
        let earlier = IterationsFile::read(&out.join(ITERATIONS));
        Self { out, robot_is_own: earlier.is_ok_and(|earlier| !earlier.base_parameters.is_empty()) }
    }

    pub(super) fn trajectory(&self) -> PathBuf {
        self.out.join(TRAJECTORY)
    }

    pub(super) fn remove(&self) -> Result<(), Error> {
        let set = OutputSet::new(self.out).absent(ITERATIONS).absent(TRAJECTORY);
        RobotFiles::none().added_to(self.without_page(set), self.robot_is_own).write()
    }

    /// Writes the file, its page and the identified robot. Page and robot of an earlier call are removed until new ones
    /// exist.
    pub(super) fn write(&self, file: &IterationsFile, page: Option<String>, found: RobotFiles) -> Result<(), Error> {
        let bytes = file
            .to_json()
            .map_err(|error| Error::Result { path: self.out.join(ITERATIONS), message: error.to_string() })?;
        let set = found.added_to(OutputSet::new(self.out).file(ITERATIONS, bytes), self.robot_is_own);
        match page {
            Some(page) => set.file(PAGE, page),
            None => self.without_page(set),
        }
        .write()
    }

    /// Removes the page of an earlier iteration, because `identify` writes a page with the same name.
    fn without_page(&self, set: OutputSet) -> OutputSet {
        if self.robot_is_own { set.absent(PAGE) } else { set }
    }
}
