//! What `[iteration]` says of a robot that moves for real: its gains, its envelope, the rehearsal.

use super::{IterationSection, RobotChoice, Study};
use crate::error::StudyError;
use crate::study::StudyRobot;
use dynident_excitation::limits::Limits;
use dynident_iteration::robot::{EnvelopeSettings, ProcessLimits, ProcessMode};
use dynident_iteration::{
    GainSettings, HomeSettings, IterationSettings, LoweredBandwidth, RehearsalSettings, SafetySettings, StartWith,
    derived_controllers, lowered_bandwidths,
};
use dynident_simulation::controllers::PositionLoopSettings;
use dynident_simulation::{ControllerSettings, Reference};

impl IterationSection {
    /// Whether the robot is not the simulator.
    pub(crate) fn is_outside(&self) -> bool {
        match self.robot {
            RobotChoice::Simulation => false,
            RobotChoice::Process(_) | RobotChoice::Folder(_) | RobotChoice::Function => true,
        }
    }

    /// The envelope, where there is one: of a robot outside, or stated.
    pub(crate) fn envelope_in_force(&self) -> Option<&EnvelopeSettings> {
        (self.is_outside() || self.envelope != EnvelopeSettings::default()).then_some(&self.envelope)
    }

    /// That a robot outside has gains that somebody stands for: stated, or by a stated bandwidth from a description
    /// with bodies.
    ///
    /// # Errors
    /// What is missing, and what to write.
    pub(crate) fn check_gains(&self, study: &Study, robot: &StudyRobot) -> Result<(), StudyError> {
        let controllers = [study.controller.as_ref(), self.model_free.as_ref(), self.first.as_ref()];
        let own_loop = controllers.into_iter().flatten().any(|controller| !controller.can_be_simulated());
        if own_loop && self.steps() {
            let fix = "here Dynident computes every torque: state what kp and kd of the drives' loop are, or let a \
                       program run it (mode = \"run\")";
            return Err(StudyError::conflict("kind = \"position-loop\"", fix));
        }
        if !self.is_outside() {
            return Ok(());
        }
        if self.bandwidth_hz.is_some() {
            let unknown = robot.model().bodies_without_prior();
            if unknown.is_empty() {
                return Ok(());
            }
            let fix = "bandwidth_hz makes gains of the description's inertials: give them there, or state the gains";
            return Err(StudyError::NoInertials { bodies: unknown.into_iter().map(str::to_owned).collect(), fix });
        }
        let missing = match (&self.model_free, &study.controller) {
            (Some(_), Some(_)) | (None, Some(ControllerSettings::PositionLoop(_))) => return Ok(()),
            (None, Some(_)) => "model_free",
            (Some(_), None) => "[controller]",
            (None, None) => "model_free and [controller]",
        };
        Err(StudyError::missing(
            format!("gains ({missing})"),
            "a robot outside has no default gains: what holds one arm drops another. Give bandwidth_hz (gains from the \
             description's inertials, critically damped, say 2.0), [controller] with kind = \"position-loop\" (the \
             drives' own loop), or model_free = { kind = \"joint-pd\", kp = [..], \
             kd = [..] } and [controller] with gains that this robot has run under",
        ))
    }

    /// Whether the robot waits for every torque, which Dynident computes: there is no delay but what it states.
    fn steps(&self) -> bool {
        match &self.robot {
            RobotChoice::Simulation | RobotChoice::Function => true,
            RobotChoice::Process(process) => process.mode == ProcessMode::Step,
            RobotChoice::Folder(_) => false,
        }
    }

    /// How late a controller of this robot may be, s, where the study does not state it: the simulated one is as late
    /// as its sensors, and stated gains are those that a robot has run under, with whatever delay it has.
    fn delay_s(&self, study: &Study, robot: &StudyRobot) -> f64 {
        let simulation = study.simulation.clone().unwrap_or_default();
        let rate_hz = self.rate_hz.unwrap_or(simulation.rate_hz);
        match self.rehearsal.delay_s {
            Some(stated) => stated,
            None if !self.is_outside() => simulation.sensors.feedback_delay_samples as f64 / rate_hz,
            None if self.steps() || self.bandwidth_hz.is_none() => 0.0,
            None => self.rehearsal.delay_s(robot.model()),
        }
    }

    /// The settings with controllers, envelope and rehearsal of the robot that is to move along `references`, and the
    /// joints whose derived loops are slower than `bandwidth_hz`.
    ///
    /// # Errors
    /// Numbers that do not fit.
    pub(crate) fn guarded(
        &self,
        mut settings: IterationSettings,
        study: &Study,
        limits: Limits,
        robot: &StudyRobot,
        references: &[&Reference],
    ) -> Result<(IterationSettings, Vec<LoweredBandwidth>), StudyError> {
        self.rehearsal.validate()?;
        let mut lowered = Vec::new();
        let (outside, model) = (self.is_outside(), robot.model());
        // Before there is a model the drives' loop gets nothing but the path.
        if let (Some(ControllerSettings::PositionLoop(own)), None) = (&study.controller, &self.model_free) {
            let own = PositionLoopSettings { feed_forward: false, ..own.clone() };
            settings.model_free = ControllerSettings::PositionLoop(own);
        }
        if let Some(bandwidth) = &self.bandwidth_hz {
            let gains = GainSettings {
                bandwidth_hz: bandwidth.clone(),
                uncertainty_percent: self.rehearsal.uncertainty_percent,
                delay_s: self.delay_s(study, robot),
                lightest_drive: if outside { self.rehearsal.lightest_drive() } else { 1.0 },
                // A robot that waits for every torque has drives and sensors all the same.
                light_delay_s: self.rehearsal.delay_s(model),
                tracking_error: self.envelope.tracking_error.clone(),
            };
            let derived = derived_controllers(&robot.parametric, references, &gains)?;
            let names = robot.parametric.joint_names();
            let mut note = |model: &str, given_hz: &[f64]| {
                lowered.extend(lowered_bandwidths(model, given_hz, &names, bandwidth));
            };
            let is_own = matches!(settings.model_free, ControllerSettings::PositionLoop(_));
            if self.model_free.is_none() && !is_own {
                note("none", &derived.model_free_hz);
                settings.model_free = derived.model_free;
            }
            // Gains of the description's bodies: their weight is known as well.
            if self.start.is_none() && self.model_free.is_none() {
                settings.start = StartWith::Prior;
            }
            let open = self.start.is_none() || study.controller.is_none();
            if self.first.is_none() && settings.start == StartWith::Prior && open {
                note("nominal", &derived.first_hz);
                (settings.first, settings.first_model) = (Some(derived.first), derived.first_model);
            }
            if study.controller.is_none() {
                note("newest", &derived.model_based_hz);
                settings.controller = derived.model_based;
            }
        }
        settings.safety = SafetySettings {
            outside,
            envelope: self.envelope_in_force().map(|own| own.envelope(model)).transpose()?,
            oscillation: self.oscillation.clone(),
            rehearsal: outside.then(|| RehearsalSettings {
                delay_s: Some(self.delay_s(study, robot)),
                // Gains that are stated are those that a robot has run under.
                lightest_drive: self.rehearsal.lightest_drive.or(self.bandwidth_hz.is_none().then_some(1.0)),
                ..self.rehearsal.clone()
            }),
            speed_steps: self.speed_steps.clone(),
            warm_up_s: self.warm_up_s,
            home: self.home_settings(robot, limits)?,
        };
        settings.safety.validate(model.dof())?;
        Ok((settings, lowered))
    }

    /// That somebody is there to be asked for passes along the motion.
    ///
    /// # Errors
    /// A folder: a call makes one run there, and its person knows how warm the robot is.
    pub(crate) fn check_warm_up(&self) -> Result<(), StudyError> {
        let folder = matches!(self.robot, RobotChoice::Folder(_));
        if folder && self.warm_up_s != 0.0 {
            let fix = "behind a folder every run is a call of its own: run trajectory.csv some minutes without a log before you log it, and take the key out";
            return Err(StudyError::conflict("warm_up_s", fix));
        }
        Ok(())
    }

    /// Where the robot waits, and what the ways from there keep.
    ///
    /// # Errors
    /// A posture that is none; legs that hold joints locked.
    pub(crate) fn home_settings(&self, robot: &StudyRobot, limits: Limits) -> Result<Option<HomeSettings>, StudyError> {
        let Some(home) = &self.home else { return Ok(None) };
        let (named, joints) = (home.named("home", robot.model())?, robot.model().joints());
        if let Some((joint, _)) = joints.iter().zip(&named).find(|(_, position)| position.is_none()) {
            let fix = "the robot waits in one posture: give the position of every joint, rad (m)";
            return Err(StudyError::missing(format!("home.{}", joint.name), fix));
        }
        if !self.is_outside() && self.leg.iter().any(|leg| leg.locked && !leg.hold.is_empty()) {
            let fix = "the simulator locks held joints where a run begins: give the legs locked = false, or no home";
            return Err(StudyError::conflict("home", fix));
        }
        Ok(Some(HomeSettings {
            posture: named.into_iter().flatten().collect(),
            speed: self.approach_speed,
            limits,
            uncertainty_percent: self.rehearsal.uncertainty_percent,
        }))
    }

    /// The section without what a run does not depend on: who speaks for the robot, how long that may take, what stops
    /// it, what comes before a run, where a robot outside waits, and when the iteration ends. Runs made before these
    /// were corrected are still this iteration's.
    pub(crate) fn of_runs(&self) -> Self {
        let mut own = self.clone();
        match &mut own.robot {
            RobotChoice::Simulation | RobotChoice::Function => {}
            RobotChoice::Process(process) => {
                process.command.clear();
                process.limits = ProcessLimits::default();
                process.folder = None;
            }
            RobotChoice::Folder(folder) => {
                (folder.wait_s, folder.forms, folder.urscript_rate_hz) = (0.0, Vec::new(), None);
            }
        }
        let default = Self::default();
        own.envelope = EnvelopeSettings::default();
        own.speed_steps = Vec::new();
        (own.max_runs, own.settled) = (default.max_runs, default.settled);
        if let Some(held_out) = &mut own.held_out {
            held_out.every = None;
        }
        own.oscillation = default.oscillation;
        // Gains that are made of a bandwidth bear the delay, light drives, and another robot than the description's.
        let RehearsalSettings { uncertainty_percent, delay_s, lightest_drive, .. } = own.rehearsal;
        own.rehearsal = match own.bandwidth_hz {
            Some(_) => RehearsalSettings { uncertainty_percent, delay_s, lightest_drive, ..default.rehearsal },
            None => default.rehearsal,
        };
        // A robot outside is moved to another place, or at another speed, or warmed up longer; its motion is the same.
        if self.is_outside() {
            (own.home, own.approach_speed, own.warm_up_s) = (None, default.approach_speed, 0.0);
        }
        own
    }
}
