//! The files that a study's jobs read.

use super::{Folders, Study};
use std::path::{Path, PathBuf};

impl Study {
    /// The files that a job of the study in `path` reads, as far as they are there: its own, the robot's description,
    /// earlier results, trajectories, and its logs if the job reads them. `data` is the folder that the user named.
    pub fn input_files(&self, path: &Path, data: Option<&Path>, logs: bool) -> Vec<PathBuf> {
        let folders = Folders::new(self, path, data);
        let arm = self.arm.iter().filter_map(|arm| folders.find(&arm.result, None).ok());
        let logs = self.log.iter().filter(|_| logs).filter_map(|log| folders.find(&log.file, None).ok());
        let others = self.motion_inputs(&folders).into_iter().map(|(_, path)| path);
        [path.to_owned()].into_iter().chain(others).chain(arm).chain(logs).collect()
    }

    /// What a motion is designed, simulated or iterated from, with what each file is: the robot's description, the
    /// result behind a prior, trajectories.
    pub(crate) fn motion_inputs(&self, folders: &Folders) -> Vec<(&'static str, PathBuf)> {
        let iteration = self.iteration.as_ref();
        let trajectories = iteration.and_then(|section| section.trajectory.as_ref()).into_iter();
        let legs = iteration.into_iter().flat_map(|section| &section.leg).filter_map(|leg| leg.trajectory.as_ref());
        let prior = self.design.as_ref().and_then(|design| design.prior.result.as_ref());
        let robot = [("robot", &self.robot.file)].into_iter();
        let named = robot
            .chain(prior.map(|file| ("result", file)))
            .chain(trajectories.chain(legs).map(|file| ("trajectory", file)));
        named.filter_map(|(what, file)| Some((what, folders.find(file, None).ok()?))).collect()
    }
}
