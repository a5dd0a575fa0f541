//! The files that a study's jobs read.

use super::{Folders, Study};
use std::path::{Path, PathBuf};

impl Study {
    /// The files that a job of the study in `path` reads, as far as they are there: its own, the robot's description,
    /// earlier results, trajectories, and its logs if the job reads them. `data` is the folder that the user named.
    pub fn input_files(&self, path: &Path, data: Option<&Path>, logs: bool) -> Vec<PathBuf> {
        let folders = Folders::new(self, path, data);
        let iteration = self.iteration.as_ref();
        let trajectories = iteration.and_then(|section| section.trajectory.as_ref()).into_iter();
        let legs = iteration.into_iter().flat_map(|section| &section.leg).filter_map(|leg| leg.trajectory.as_ref());
        let results = self.arm.as_ref().map(|arm| &arm.result).into_iter();
        let prior = self.design.as_ref().and_then(|design| design.prior.result.as_ref());
        let logs = self.log.iter().filter(|_| logs).map(|log| &log.file);
        let named =
            [&self.robot.file].into_iter().chain(results).chain(prior).chain(trajectories).chain(legs).chain(logs);
        let found = named.filter_map(|file| folders.find(file, None).ok());
        [path.to_owned()].into_iter().chain(found).collect()
    }
}
