//! Inputs of a study's results.

use super::{Folders, Study, StudyLogSource, StudyRobot};
use dynident_model::Robot;
use dynident_recording::MemoryLog;
use std::path::PathBuf;

/// One input of a result.
#[derive(Clone, Debug)]
pub enum StudyInput {
    /// A file.
    File(PathBuf),
    /// Samples in memory.
    Samples(MemoryLog),
    /// A description in memory.
    Description(Box<Robot>),
}

impl From<StudyLogSource> for StudyInput {
    fn from(source: StudyLogSource) -> Self {
        match source {
            StudyLogSource::File(path) => Self::File(path),
            StudyLogSource::Memory(samples) => Self::Samples(samples),
        }
    }
}

/// Inputs, each with its kind.
type NamedInputs = Vec<(&'static str, StudyInput)>;

impl Study {
    /// Inputs of `design`, `simulate` and `iterate`: robot description, result of the prior, torque tables,
    /// trajectories.
    pub fn motion_inputs(&self, folders: &Folders) -> NamedInputs {
        let robot = match &self.robot.description {
            Some(robot) => Some(StudyInput::Description(robot.clone())),
            None => folders.find(&self.robot.file, None).ok().map(StudyInput::File),
        };
        let iteration = self.iteration.as_ref();
        let trajectories = iteration.and_then(|section| section.trajectory.as_ref()).into_iter();
        let legs = iteration.into_iter().flat_map(|section| &section.leg).filter_map(|leg| leg.trajectory.as_ref());
        let prior = self.design.as_ref().and_then(|design| design.prior.result.as_ref());
        let named = prior
            .map(|file| ("result", file))
            .into_iter()
            .chain(trajectories.chain(legs).map(|file| ("trajectory", file)));
        let files = named.filter_map(|(what, file)| Some((what, StudyInput::File(folders.find(file, None).ok()?))));
        robot.map(|robot| ("robot", robot)).into_iter().chain(files).chain(self.table_inputs(folders)).collect()
    }

    /// The robot description as an input of a result.
    pub fn robot_input(&self, robot: &StudyRobot) -> StudyInput {
        match &self.robot.description {
            Some(description) => StudyInput::Description(description.clone()),
            None => StudyInput::File(robot.robot.path.clone()),
        }
    }

    /// The existing torque tables of the model.
    pub fn table_inputs(&self, folders: &Folders) -> NamedInputs {
        let files = self.torque.iter().filter_map(|torque| torque.table_file.as_ref());
        files.filter_map(|file| Some(("torque", StudyInput::File(folders.find(file, None).ok()?)))).collect()
    }
}
