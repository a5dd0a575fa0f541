//! The files that a study's motion is made from.

use super::{Folders, Study};
use std::path::PathBuf;

impl Study {
    /// What a motion is designed, simulated or iterated from, with what each file is: the robot's description, the
    /// result behind a prior, tables of torque, trajectories.
    pub(crate) fn motion_inputs(&self, folders: &Folders) -> Vec<(&'static str, PathBuf)> {
        let iteration = self.iteration.as_ref();
        let trajectories = iteration.and_then(|section| section.trajectory.as_ref()).into_iter();
        let legs = iteration.into_iter().flat_map(|section| &section.leg).filter_map(|leg| leg.trajectory.as_ref());
        let prior = self.design.as_ref().and_then(|design| design.prior.result.as_ref());
        let robot = [("robot", &self.robot.file)].into_iter();
        let named = robot
            .chain(prior.map(|file| ("result", file)))
            .chain(trajectories.chain(legs).map(|file| ("trajectory", file)));
        named
            .filter_map(|(what, file)| Some((what, folders.find(file, None).ok()?)))
            .chain(self.table_inputs(folders))
            .collect()
    }

    /// The tables of torque that a model is made with, as far as they exist.
    pub(crate) fn table_inputs(&self, folders: &Folders) -> Vec<(&'static str, PathBuf)> {
        let files = self.torque.iter().filter_map(|torque| torque.table_file.as_ref());
        files.filter_map(|file| Some(("torque", folders.find(file, None).ok()?))).collect()
    }
}
