//! From a study to what is identified: the recordings with their files, the estimator with its settings, joints whose
//! friction is chosen.

use super::friction::FrictionChoice;
use super::log_source::StudyLogSource;
use super::robot_model::drive_choice;
use super::{EstimatorMethod, Folders, Study, StudyRobot};
use crate::error::{Error, StudyError};
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
    /// Files that are in none of the study's folders, a controller or a commanded motion that does not fit the robot.
    pub fn task(&self, path: &Path, robot: &StudyRobot, folders: &Folders) -> Result<IdentificationTask, Error> {
        self.task_with(self.settings(path, robot)?, robot, folders)
    }

    /// The same with settings that are made already.
    pub(crate) fn task_with(
        &self,
        settings: IdentificationSettings,
        robot: &StudyRobot,
        folders: &Folders,
    ) -> Result<IdentificationTask, Error> {
        let sources = self.log_sources(folders)?;
        let recordings = self.recordings(robot, folders, &sources)?;
        let mut task = IdentificationTask::new(robot.parametric.clone(), recordings);
        (task.payloads, task.settings) = (self.payloads(), settings);
        Ok(task)
    }

    /// Where the samples of all logs are.
    pub(crate) fn log_sources(&self, folders: &Folders) -> Result<Vec<StudyLogSource>, Error> {
        (0..self.log.len()).map(|index| self.log_source(folders, index)).collect()
    }

    /// Where the samples of log number `index` are.
    pub(crate) fn log_source(&self, folders: &Folders, index: usize) -> Result<StudyLogSource, Error> {
        match &self.log[index].samples {
            Some(samples) => Ok(StudyLogSource::Memory(samples.clone())),
            None => folders.find(&self.log[index].file, self.source.as_deref()).map(StudyLogSource::File),
        }
    }

    /// The logs whose samples are in `sources`.
    pub(crate) fn recordings(
        &self,
        robot: &StudyRobot,
        folders: &Folders,
        sources: &[StudyLogSource],
    ) -> Result<Vec<Recording>, Error> {
        sources.iter().enumerate().map(|(index, source)| self.recording(robot, folders, index, source)).collect()
    }

    /// Log number `index`, whose samples are in `source`.
    pub(crate) fn recording(
        &self,
        robot: &StudyRobot,
        folders: &Folders,
        index: usize,
        source: &StudyLogSource,
    ) -> Result<Recording, Error> {
        let log = source.log(self.format_of(index), &robot.log_joints);
        let mut recording = Recording::training(self.log_name(index), log);
        recording.role = self.log[index].role;
        recording.payload.clone_from(&self.log[index].payload);
        if self.estimator.needs_commanded_motion() || self.motion.differentiator.reference().is_some() {
            recording.commanded = self.commanded(robot, folders, index)?.map(Arc::new);
        }
        Ok(recording)
    }

    /// What logs were recorded with.
    pub(crate) fn payloads(&self) -> Vec<Payload> {
        let payload = |section: &super::PayloadSection| Payload {
            name: section.name.clone(),
            link: section.link.clone(),
            known: section.known(),
            known_mass_kg: section.known_mass_kg(),
        };
        self.payload.iter().map(payload).collect()
    }

    /// The motion that was commanded in log number `index`, its joints in the model's order: the log's own `reference`,
    /// or the differentiator's; `None` if neither is given.
    fn commanded(&self, robot: &StudyRobot, folders: &Folders, index: usize) -> Result<Option<Reference>, Error> {
        let own = self.log[index].reference.as_ref();
        let Some(settings) = own.or_else(|| self.motion.differentiator.reference()) else { return Ok(None) };
        let failed = |source| Error::recording(&self.log_name(index), source);
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
            let problem =
                format!("it moves {found} joints, the robot has {dof}: give one for each, in the robot's order");
            return Err(filter(FilterError::Reference { problem }));
        }
        Ok(Some(reference))
    }

    /// Filters, estimator, what is known of the bodies, whose friction is chosen.
    pub(crate) fn settings(&self, path: &Path, robot: &StudyRobot) -> Result<IdentificationSettings, Error> {
        let mut settings = IdentificationSettings::default();
        settings.motion = self.motion.clone();
        settings.parallel_filter = self.parallel_filter.clone();
        settings.estimation = self.estimator.common();
        settings.estimation.estimator = self.estimator.estimator(|| self.simulated_loop(path, robot).map(Box::new))?;
        settings.consistency = self.estimator.physical.settings();
        settings.intervals = self.estimator.intervals;
        settings.friction = self.friction_searches(robot);
        if self.why_drives_are_untested().is_none() {
            settings.drive_inertia = self.unstated_drives(robot);
        }
        (settings.offsets, settings.gains) = (self.drive.offsets, self.drive.gains);
        settings.gain_std = 0.01 * self.drive.gain_std_percent.unwrap_or(0.0);
        Ok(settings)
    }

    /// The experiment of estimators that simulate the closed loop: `[controller]`, `[simulation]` and
    /// `[estimator.simulated]`.
    fn simulated_loop(&self, path: &Path, robot: &StudyRobot) -> Result<SimulatedLoopSettings, Error> {
        let method = format!("estimator.method = \"{}\"", self.estimator.method.name());
        let Some(controller) = &self.controller else {
            let fix = "it needs the controller that drove the robot, [controller] (kind and gains); where it is not known, take method = \"instrumental\"";
            return Err(Error::study(path)(StudyError::conflict(method, fix)));
        };
        let dof = robot.model().dof();
        controller
            .validate(dof)
            .map_err(StudyError::at(format!("{method}: [controller]")))
            .map_err(Error::study(path))?;
        let simulation = self.simulation.clone().unwrap_or_default();
        simulation
            .validate(dof)
            .map_err(StudyError::at(format!("{method}: [simulation]")))
            .map_err(Error::study(path))?;
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

    /// Joints whose drive inertia no key states.
    fn unstated_drives(&self, robot: &StudyRobot) -> Vec<String> {
        let names = robot.model().joints().iter().map(|joint| &joint.name);
        names.filter(|name| self.drive.drive_inertia_of(name).is_none()).cloned().collect()
    }

    /// Joints without drive inertia although no key states that they have none, with the reason.
    pub(crate) fn drive_inertia_untested(&self, robot: &StudyRobot) -> Option<DriveInertiaChoice> {
        let (reason, joints) = (self.why_drives_are_untested()?, self.unstated_drives(robot));
        (!joints.is_empty()).then(|| DriveInertiaChoice::untested(joints, reason))
    }

    /// Why the logs are not asked for drive inertia that no key states; `None` where they are.
    fn why_drives_are_untested(&self) -> Option<&'static str> {
        let method = self.estimator.method;
        if self.arm.is_some() {
            Some("a known arm has the drives of its result")
        } else if method.is_least_squares() || method == EstimatorMethod::Instrumental {
            None
        } else {
            Some("with this estimator [drive] drive_inertia says it")
        }
    }

    /// The joints whose friction the training logs choose: those of which a key says so, and by default all others
    /// whose friction no key states, unless something else in the study stands against it.
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
            ..FrictionSearch::of(&description.name)
        };
        model.joints().iter().enumerate().filter(|(_, joint)| is_chosen(&joint.name)).map(search).collect()
    }

    /// Joints whose friction is left as it is by default although no key states it, with the reason.
    pub(crate) fn friction_as_stated(&self, robot: &StudyRobot) -> Vec<JointFriction> {
        let Some(reason) = self.why_friction_is_stated() else { return Vec::new() };
        let names = robot.model().joints().iter().map(|joint| &joint.name);
        names
            .filter(|name| self.drive.friction_of(name).is_none())
            .map(|name| JointFriction::as_stated(name, reason))
            .collect()
    }

    /// Why the logs do not choose friction that no key states; `None` where they do.
    fn why_friction_is_stated(&self) -> Option<&'static str> {
        let estimator = &self.estimator;
        if self.arm.is_some() {
            Some("a known arm has the friction of its result")
        } else if !(estimator.method.is_least_squares() || estimator.method == EstimatorMethod::Instrumental) {
            Some("with this estimator it is not chosen unless friction = \"auto\" says so")
        } else if estimator.physical.settings().is_some_and(|knowledge| !knowledge.terms.is_empty()) {
            Some("[estimator.physical] says what is known of its parameters")
        } else {
            None
        }
    }
}
