//! Converts a study to an identification task: recordings, estimator settings, joints with friction selection.

use super::friction::FrictionChoice;
use super::log_source::StudyLogSource;
use super::robot_model::drive_choice;
use super::{EstimatorMethod, Folders, Study, StudyRobot};
use crate::error::{StudyError, StudyFileError};
use dynident_identification::estimators::SimulatedLoopSettings;
use dynident_identification::friction::{FrictionSearch, JointFriction};
use dynident_identification::payload::Payload;
use dynident_identification::{DriveInertiaChoice, IdentificationSettings, IdentificationTask, Recording};
use dynident_model::Joint;
use dynident_recording::{FilterError, RecordingError, Reference};
use std::path::Path;
use std::sync::Arc;

impl Study {
    /// The study's identification with its robot: recordings, payloads, settings.
    ///
    /// # Errors
    /// Missing files, a controller or commanded motion that does not match the robot.
    pub fn task(
        &self,
        path: &Path,
        robot: &StudyRobot,
        folders: &Folders,
    ) -> Result<IdentificationTask, StudyFileError> {
        self.task_with(self.settings(path, robot)?, robot, folders)
    }

    /// Like [`task`](Self::task), with other settings.
    ///
    /// # Errors
    /// Missing files, or a commanded motion that does not match the robot.
    pub fn task_with(
        &self,
        settings: IdentificationSettings,
        robot: &StudyRobot,
        folders: &Folders,
    ) -> Result<IdentificationTask, StudyFileError> {
        let sources = self.log_sources(folders)?;
        let recordings = self.recordings(robot, folders, &sources)?;
        let mut task = IdentificationTask::new(robot.parametric.clone(), recordings);
        (task.payloads, task.settings) = (self.payloads(), settings);
        Ok(task)
    }

    /// Sources of all logs.
    ///
    /// # Errors
    /// A log file in none of the folders.
    pub fn log_sources(&self, folders: &Folders) -> Result<Vec<StudyLogSource>, StudyFileError> {
        (0..self.log.len()).map(|index| self.log_source(folders, index)).collect()
    }

    /// Source of log number `index`.
    ///
    /// # Errors
    /// A log file in none of the folders.
    pub fn log_source(&self, folders: &Folders, index: usize) -> Result<StudyLogSource, StudyFileError> {
        match &self.log[index].samples {
            Some(samples) => Ok(StudyLogSource::Memory(samples.clone())),
            None => folders.find(&self.log[index].file, self.source.as_deref()).map(StudyLogSource::File),
        }
    }

    /// Recordings of all logs from their sources.
    ///
    /// # Errors
    /// Same as for [`recording`](Self::recording).
    pub fn recordings(
        &self,
        robot: &StudyRobot,
        folders: &Folders,
        sources: &[StudyLogSource],
    ) -> Result<Vec<Recording>, StudyFileError> {
        sources.iter().enumerate().map(|(index, source)| self.recording(robot, folders, index, source)).collect()
    }

    /// Recording of log number `index` from its source.
    ///
    /// # Errors
    /// A commanded motion that cannot be read or does not match the robot.
    pub fn recording(
        &self,
        robot: &StudyRobot,
        folders: &Folders,
        index: usize,
        source: &StudyLogSource,
    ) -> Result<Recording, StudyFileError> {
        let log = source.log(self.format_of(index), &robot.log_joints);
        let mut recording = Recording::training(self.log_name(index), log);
        recording.role = self.log[index].role;
        recording.payload.clone_from(&self.log[index].payload);
        if self.estimator.needs_commanded_motion() || self.motion.differentiator.reference().is_some() {
            recording.commanded = self.commanded(robot, folders, index)?.map(Arc::new);
        }
        Ok(recording)
    }

    /// The payloads of the study.
    pub fn payloads(&self) -> Vec<Payload> {
        let payload = |section: &super::PayloadSection| Payload {
            name: section.name.clone(),
            link: section.link.clone(),
            known: section.known(),
            known_mass_kg: section.known_mass_kg(),
        };
        self.payload.iter().map(payload).collect()
    }

    /// Commanded motion of log number `index`, in the order of the model's joints: the log's `reference`, or that of
    /// the differentiator; `None` if neither is given.
    fn commanded(
        &self,
        robot: &StudyRobot,
        folders: &Folders,
        index: usize,
    ) -> Result<Option<Reference>, StudyFileError> {
        let own = self.log[index].reference.as_ref();
        let Some(settings) = own.or_else(|| self.motion.differentiator.reference()) else { return Ok(None) };
        let failed = |source| StudyFileError::recording(&self.log_name(index), source);
        let filter = |source| failed(RecordingError::Filter(source));
        let dof = robot.model().dof();
        let reference = match (&settings.file, settings.closed_form().map_err(filter)?) {
            (_, Some(closed)) => closed,
            (Some(file), None) => {
                let path = folders.find(file, self.source.as_deref())?;
                settings.placed(Reference::read(&path, dof).map_err(failed)?).map_err(filter)?
            }
            (None, None) => return Ok(None),
        };
        let found = reference.joints();
        if found != dof {
            let problem = format!(
                "the reference moves {found} joints, but the robot has {dof}: give one column per joint, in the robot's order"
            );
            return Err(filter(FilterError::Reference { problem }));
        }
        Ok(Some(reference))
    }

    /// Settings of the identification with this robot.
    ///
    /// # Errors
    /// A controller that does not match the robot, or an invalid setting.
    pub fn settings(&self, path: &Path, robot: &StudyRobot) -> Result<IdentificationSettings, StudyFileError> {
        let mut settings = IdentificationSettings::default();
        settings.motion = self.motion.clone();
        settings.parallel_filter = self.parallel_filter.clone();
        settings.estimation = self.estimator.common();
        settings.estimation.estimator = self.estimator.estimator(|| self.simulated_loop(path, robot).map(Box::new))?;
        settings.consistency = self.estimator.physical.settings();
        settings.intervals = self.estimator.intervals;
        self.thresholds.apply(&mut settings);
        settings.events.choice = self.estimator.events;
        settings.friction = self.friction_searches(robot).into();
        if self.why_drives_are_untested().is_none() {
            settings.drive_inertia = self.unstated_drives(robot);
        }
        (settings.offsets, settings.gains) = (self.drive.offsets, self.drive.gains);
        settings.gain_std = 0.01 * self.drive.gain_std_percent.unwrap_or(0.0);
        Ok(settings)
    }

    /// Closed loop for estimators that simulate it, from `[controller]`, `[simulation]` and `[estimator.simulated]`.
    fn simulated_loop(&self, path: &Path, robot: &StudyRobot) -> Result<SimulatedLoopSettings, StudyFileError> {
        let method = format!("estimator.method = \"{}\"", self.estimator.method.name());
        let Some(controller) = &self.controller else {
            let fix = "this estimator needs the robot's controller: give [controller] (kind and gains); if it is unknown, set method = \"instrumental\"";
            return Err(StudyFileError::study(path)(StudyError::conflict(method, fix)));
        };
        let dof = robot.model().dof();
        controller
            .validate(dof)
            .map_err(StudyError::at(format!("{method}: [controller]")))
            .map_err(StudyFileError::study(path))?;
        let simulation = self.simulation.clone().unwrap_or_default();
        simulation
            .validate(dof)
            .map_err(StudyError::at(format!("{method}: [simulation]")))
            .map_err(StudyFileError::study(path))?;
        let section = &self.estimator.simulated;
        Ok(SimulatedLoopSettings {
            controller: controller.clone(),
            rate_hz: simulation.rate_hz,
            loop_settings: simulation.loop_settings(Some(robot.model())),
            start: section.start,
            tolerance: section.tolerance,
            max_iterations: section.max_iterations,
            difference: section.difference,
        })
    }

    fn unstated_drives(&self, robot: &StudyRobot) -> Vec<String> {
        let names = robot.model().joints().iter().map(|joint| &joint.name);
        names.filter(|name| self.drive.drive_inertia_of(name).is_none()).cloned().collect()
    }

    /// Joints for which no key gives drive inertia and no test checks it, with the reason.
    pub fn drive_inertia_untested(&self, robot: &StudyRobot) -> Option<DriveInertiaChoice> {
        let (reason, joints) = (self.why_drives_are_untested()?, self.unstated_drives(robot));
        (!joints.is_empty()).then(|| DriveInertiaChoice::untested(joints, reason))
    }

    /// Reason why drive inertia without a key is not tested; `None` if it is tested.
    fn why_drives_are_untested(&self) -> Option<&'static str> {
        let method = self.estimator.method;
        if self.arm.is_some() {
            Some("a known arm has the drives of its result")
        } else if method.is_least_squares() || method == EstimatorMethod::Instrumental {
            None
        } else {
            Some("with this estimator, [drive] drive_inertia states it")
        }
    }

    /// The joints with friction selection: those with `friction = "auto"`, and by default those without a friction
    /// key, unless the study does not permit selection.
    fn friction_searches(&self, robot: &StudyRobot) -> Vec<FrictionSearch> {
        let by_default = self.why_friction_is_stated().is_none();
        let is_chosen = |name: &str| match self.drive.friction_of(name) {
            Some(choice) => choice == FrictionChoice::Auto,
            None => by_default,
        };
        let model = robot.model();
        let search = |(joint, description): (usize, &Joint)| FrictionSearch {
            coulomb: drive_choice(&self.drive, model, joint).coulomb,
            dead_band: self.drive.coulomb_dead_band,
            width: self.drive.coulomb_width,
            most_inflation: self.drive.most_inflation,
            laws: self.drive.candidates.clone(),
            exportable: self.drive.exportable.map(Into::into),
            ..FrictionSearch::of(&description.name)
        };
        model.joints().iter().enumerate().filter(|(_, joint)| is_chosen(&joint.name)).map(search).collect()
    }

    /// Joints without a friction key whose friction is not selected, with the reason.
    pub fn friction_as_stated(&self, robot: &StudyRobot) -> Vec<JointFriction> {
        let Some(reason) = self.why_friction_is_stated() else { return Vec::new() };
        let names = robot.model().joints().iter().map(|joint| &joint.name);
        names
            .filter(|name| self.drive.friction_of(name).is_none())
            .map(|name| JointFriction::as_stated(name, reason))
            .collect()
    }

    /// Reason why friction without a key is not selected; `None` if it is selected.
    fn why_friction_is_stated(&self) -> Option<&'static str> {
        let estimator = &self.estimator;
        if self.arm.is_some() {
            Some("a known arm has the friction of its result")
        } else if !(estimator.method.is_least_squares() || estimator.method == EstimatorMethod::Instrumental) {
            Some("with this estimator, friction is selected only with friction = \"auto\"")
        } else if estimator.physical.settings().is_some_and(|knowledge| !knowledge.terms.is_empty()) {
            Some("[estimator.physical] constrains friction parameters")
        } else {
            None
        }
    }
}
