//! Settings of `[iteration]` for a real robot: gains, envelope, rehearsal.

use super::{IterationSection, RobotChoice, Study};
use crate::StudyRobot;
use crate::error::StudyError;
use dynident_excitation::limits::Limits;
use dynident_iteration::robot::{EnvelopeSettings, ProcessLimits, ProcessMode};
use dynident_iteration::{
    GainSettings, HomeSettings, IterationSettings, LoweredBandwidth, RehearsalSettings, SafetySettings, StartWith,
    derived_controllers, lowered_bandwidths,
};
use dynident_simulation::controllers::PositionLoopSettings;
use dynident_simulation::{ControllerSettings, Reference};

impl IterationSection {
    /// Whether the robot is outside the simulator.
    pub fn is_outside(&self) -> bool {
        match self.robot {
            RobotChoice::Simulation => false,
            RobotChoice::Process(_) | RobotChoice::Folder(_) | RobotChoice::Function => true,
        }
    }

    /// The envelope of a robot outside the simulator, or an envelope given in the study; otherwise `None`.
    pub fn envelope_in_force(&self) -> Option<&EnvelopeSettings> {
        (self.is_outside() || self.envelope != EnvelopeSettings::default()).then_some(&self.envelope)
    }

    /// Checks that a robot outside the simulator has given gains, or a given bandwidth and a description with
    /// inertials.
    ///
    /// # Errors
    /// The missing keys, with the fix.
    pub fn check_gains(&self, study: &Study, robot: &StudyRobot) -> Result<(), StudyError> {
        let controllers = [study.controller.as_ref(), self.model_free.as_ref(), self.first.as_ref()];
        let own_loop = controllers.into_iter().flatten().any(|controller| !controller.can_be_simulated());
        if own_loop && self.steps() {
            let fix = "Dynident computes every torque here: state kp and kd of the drives' loop, or let a \
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
            let fix = "bandwidth_hz computes gains from the inertial parameters in the robot description: add these parameters, or state the gains";
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
            "a robot outside of the simulator has no default gains, because suitable gains depend on the arm. Give bandwidth_hz (gains from the \
             description's inertials, critically damped, say 2.0), [controller] with kind = \"position-loop\" (the \
             drives' own loop), or model_free = { kind = \"joint-pd\", kp = [..], \
             kd = [..] } and [controller] with gains that this robot has run under",
        ))
    }

    /// Whether Dynident computes every torque in step with the robot, so that there is no delay except one given in
    /// the study.
    fn steps(&self) -> bool {
        match &self.robot {
            RobotChoice::Simulation | RobotChoice::Function => true,
            RobotChoice::Process(process) => process.mode == ProcessMode::Step,
            RobotChoice::Folder(_) => false,
        }
    }

    /// Assumed delay of the controller, s, if the study gives none. For the simulator it is the delay of the
    /// simulated sensors. Given gains have been used with the real delay, so they need no assumed delay.
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

    /// Completes the settings with controllers, envelope and rehearsal for the robot and its `references`. Returns
    /// the joints whose derived loops are slower than `bandwidth_hz`.
    ///
    /// # Errors
    /// Invalid numbers.
    pub fn guarded(
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
        // Without a model, the drives' position loop receives only the path.
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
                // A robot in mode `step` still has real drives and sensors.
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
            // A robot description with masses also permits gravity compensation.
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
                // Given gains have already been used on the robot.
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

    /// Checks that a warm-up is possible with this robot.
    ///
    /// # Errors
    /// A robot behind a folder: each call makes one run, and a person warms the robot up.
    pub fn check_warm_up(&self) -> Result<(), StudyError> {
        let folder = matches!(self.robot, RobotChoice::Folder(_));
        if folder && self.warm_up_s != 0.0 {
            let fix = "with a folder every call makes one run: repeat trajectory.csv for some minutes before you record the log, and remove the key";
            return Err(StudyError::conflict("warm_up_s", fix));
        }
        Ok(())
    }

    /// Home posture, and limits of the approach and return paths.
    ///
    /// # Errors
    /// An incomplete posture, or legs that lock joints.
    pub fn home_settings(&self, robot: &StudyRobot, limits: Limits) -> Result<Option<HomeSettings>, StudyError> {
        let Some(home) = &self.home else { return Ok(None) };
        let (named, joints) = (home.named("home", robot.model())?, robot.model().joints());
        if let Some((joint, _)) = joints.iter().zip(&named).find(|(_, position)| position.is_none()) {
            let fix = "the home posture is incomplete: give the position of every joint, rad (m)";
            return Err(StudyError::missing(format!("home.{}", joint.name), fix));
        }
        if !self.is_outside() && self.leg.iter().any(|leg| leg.locked && !leg.hold.is_empty()) {
            let fix =
                "the simulator locks held joints at the start of a run: set locked = false in the legs, or remove home";
            return Err(StudyError::conflict("home", fix));
        }
        Ok(Some(HomeSettings {
            posture: named.into_iter().flatten().collect(),
            speed: self.approach_speed,
            limits,
            uncertainty_percent: self.rehearsal.uncertainty_percent,
        }))
    }

    /// The section without settings that do not affect the data of a run: program of the robot and its time limits,
    /// stop conditions, warm-up, home posture, end of the iteration. Earlier runs remain valid when these change.
    pub fn without_unrelated_settings(&self) -> Self {
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
        // Gains that are derived from a bandwidth depend on delay, light drives and model uncertainty.
        let RehearsalSettings { uncertainty_percent, delay_s, lightest_drive, .. } = own.rehearsal;
        own.rehearsal = match own.bandwidth_hz {
            Some(_) => RehearsalSettings { uncertainty_percent, delay_s, lightest_drive, ..default.rehearsal },
            None => default.rehearsal,
        };
        // Home posture, approach speed and warm-up of a robot outside the simulator do not change its motion.
        if self.is_outside() {
            (own.home, own.approach_speed, own.warm_up_s) = (None, default.approach_speed, 0.0);
        }
        own
    }
}
