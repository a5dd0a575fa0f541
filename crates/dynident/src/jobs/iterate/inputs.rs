//! Files and settings of the study, checked before any search starts.

use super::job::Job;
use crate::error::{Error, StudyError};
use crate::inputs::InputFiles;
use crate::study::{Folders, IterationSection, RobotChoice, SimulatedTruth, SimulationSection, Study, StudyRobot};
use dynident_excitation::limits::Limits;
use dynident_iteration::IterationSettings;
use dynident_system::{PermittedProgram, ProgramPermission};
use std::path::Path;

pub(super) struct Inputs {
    pub(super) section: IterationSection,
    pub(super) simulation: SimulationSection,
    /// State of the input files before they were first read.
    pub(super) files: InputFiles,
    pub(super) folders: Folders,
    pub(super) robot: StudyRobot,
    pub(super) settings: IterationSettings,
    /// The simulated robot, if the study uses the simulator.
    pub(super) truth: Option<SimulatedTruth>,
}

impl Inputs {
    pub(super) fn read(job: &Job<'_>, section: IterationSection) -> Result<Self, Error> {
        let (study, data) = (job.study, job.options.data.as_deref());
        let simulation = study.simulation.clone().unwrap_or_default();
        let files = InputFiles::of(study, data);
        let folders = study.folders(data);
        let robot = study.robot_in(&folders)?;
        let identification = study.settings(study.path, &robot)?;
        let settings = section.settings(&study, identification).map_err(Error::study(study.path))?;
        let truth = match section.robot {
            RobotChoice::Simulation => {
                Some(simulation.truth(&study.coupling, &robot).map_err(Error::section(study.path, "simulation"))?)
            }
            _ => None,
        };
        Ok(Self { section, simulation, files, folders, robot, settings, truth })
    }

    pub(super) fn check_section(&self, study: &Study) -> Result<(), StudyError> {
        let Self { section, robot, .. } = self;
        section.check_legs(robot)?;
        section.check_gains(study, robot)?;
        section.home_settings(robot, Limits::default())?;
        section.check_warm_up()?;
        section.check_held_out(study)?;
        section.redesign(study)?;
        Ok(())
    }
}

/// The program of the study's robot, if starting it is permitted.
pub(super) fn permitted_program(
    section: &IterationSection,
    study_path: &Path,
    programs: ProgramPermission<'_>,
) -> Result<Option<PermittedProgram>, Error> {
    let RobotChoice::Process(settings) = &section.robot else { return Ok(None) };
    let refused = |source| Error::NotPermitted { path: study_path.to_owned(), source };
    settings.permitted(programs).map(Some).map_err(refused)
}
