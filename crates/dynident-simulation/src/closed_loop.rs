//! Closed loop of a controller and a simulated robot along a reference.

use crate::controllers::{Controller, Measured};
use crate::error::{SimulationError, require_length};
use crate::feedback::Feedback;
use crate::motion_buffer::{Arrays, MotionBuffer, ReferenceBuffer, Row};
use crate::per_joint::PerJoint;
use crate::plant::{Integrator, Plant};
use crate::reference::Reference;
use crate::run::{Divergence, LimitedQuantity, Run, RunStatus};
use crate::sensors::SensorSettings;
use dynident_model::Model;
use serde::{Deserialize, Serialize};

/// Velocity above which a run has diverged, rad/s (m/s) for an arm of usual size; no robot reaches it.
const DIVERGENCE_SPEED: f64 = 1e4;

/// Initial state of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// Position and velocity of the reference.
    #[default]
    Reference,
    /// Position of the reference, with zero velocity.
    AtRest,
    /// A given state.
    At {
        /// Positions, rad (m).
        q: Vec<f64>,
        /// Velocities, rad/s (m/s).
        dq: Vec<f64>,
    },
}

/// Limits that stop a run, and torque limits of the controller. Default no limits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RunLimits {
    /// Maximum torque, Nm (N), to which the loop limits the controller's torque; saturated samples are counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque: Option<PerJoint>,
    /// Minimum position, rad (m); a lower one ends the run, as do violations of the following limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower: Option<PerJoint>,
    /// Maximum position, rad (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<PerJoint>,
    /// Maximum velocity, rad/s (m/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed: Option<PerJoint>,
    /// Maximum distance from the reference, rad (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking_error: Option<PerJoint>,
}

impl RunLimits {
    /// Position, velocity and torque limits of the robot description. A missing limit becomes the largest finite
    /// number, because JSON cannot represent infinity.
    pub fn of_model(model: &Model) -> Self {
        let each = |of: fn(&dynident_model::JointLimits) -> Option<f64>, none: f64| {
            Some(PerJoint::Each(model.joints().iter().map(|joint| of(&joint.limits).unwrap_or(none)).collect()))
        };
        Self {
            torque: each(|limits| limits.effort, f64::MAX),
            lower: each(|limits| limits.lower, f64::MIN),
            upper: each(|limits| limits.upper, f64::MAX),
            speed: each(|limits| limits.velocity, f64::MAX),
            tracking_error: None,
        }
    }

    /// Checks the limits for a number of joints.
    ///
    /// # Errors
    /// Lists of the wrong length, NaN, limits of torque, velocity or error that are not positive.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.values(joints).map(|_| ())
    }

    fn values(&self, joints: usize) -> Result<Limits, SimulationError> {
        let positive = |what: &str, limit: &Option<PerJoint>| match limit {
            Some(limit) => limit.values(what, joints, "give a positive number", |x| x > 0.0),
            None => Ok(vec![f64::INFINITY; joints]),
        };
        let place = |what: &str, limit: &Option<PerJoint>, none: f64| match limit {
            Some(limit) => limit.values(what, joints, "give a number", |x| !x.is_nan()),
            None => Ok(vec![none; joints]),
        };
        Ok(Limits {
            torque: positive("limits.torque", &self.torque)?,
            lower: place("limits.lower", &self.lower, f64::NEG_INFINITY)?,
            upper: place("limits.upper", &self.upper, f64::INFINITY)?,
            speed: positive("limits.speed", &self.speed)?,
            error: positive("limits.tracking_error", &self.tracking_error)?,
            divergence_speed: vec![f64::INFINITY; joints],
        })
    }
}

/// Settings of a run. The controller's rate is that of the reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LoopSettings {
    /// Integrator of the robot. Default one semi-implicit Euler step per sample.
    pub integrator: Integrator,
    /// Initial state. Default the position and velocity of the reference.
    pub start: Start,
    /// Limits that stop the run. By default only divergence stops it.
    pub limits: RunLimits,
    /// Sensors of the controller and of [`SensorSettings::record`]. Default perfect.
    pub sensors: SensorSettings,
    /// Whether true accelerations are stored; default false.
    pub accelerations: bool,
}

impl LoopSettings {
    /// Checks the settings for a number of joints.
    ///
    /// # Errors
    /// [`SimulationError`] with the invalid setting.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.integrator.validate()?;
        self.limits.validate(joints)?;
        self.sensors.validate(joints)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Limits {
    pub(crate) torque: Vec<f64>,
    pub(crate) lower: Vec<f64>,
    pub(crate) upper: Vec<f64>,
    pub(crate) speed: Vec<f64>,
    pub(crate) error: Vec<f64>,
    pub(crate) divergence_speed: Vec<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct LoopStart {
    pub(crate) limits: Limits,
    pub(crate) q: Vec<f64>,
    pub(crate) dq: Vec<f64>,
}

impl LoopStart {
    pub(crate) fn of(
        plant: &Plant,
        controller: &dyn Controller,
        reference: &Reference,
        settings: &LoopSettings,
    ) -> Result<Self, SimulationError> {
        let joints = plant.dof();
        settings.validate(joints)?;
        let own = plant.model().characteristic_scale();
        let divergence_speed =
            plant.model().joints().iter().map(|joint| own.velocity(joint.is_rotary(), DIVERGENCE_SPEED)).collect();
        let limits = Limits { divergence_speed, ..settings.limits.values(joints)? };
        require_length("joints of the reference", joints, reference.joints())?;
        require_length("joints of the controller", joints, controller.joints())?;
        let motion = reference.motion();
        let first = |values: &[f64]| (0..joints).map(|joint| values[joint * motion.samples]).collect::<Vec<f64>>();
        let (q, dq) = match &settings.start {
            Start::Reference => (first(&motion.q), first(&motion.dq)),
            Start::AtRest => (first(&motion.q), vec![0.0; joints]),
            Start::At { q, dq } => {
                plant.check_state(q, dq)?;
                (q.clone(), dq.clone())
            }
        };
        Ok(Self { limits, q, dq })
    }
}

/// Runs the controller on the robot along the reference. At every sample the controller computes torques from the
/// measurement; they are limited and stay constant until the next sample. The controller is reset first. Steps do not
/// allocate memory, except those of the adaptive integrator.
///
/// ```
/// use dynident_simulation::{ControllerSettings, LoopSettings, Plant, Reference, closed_loop};
/// use dynident_model::{InertialParameters, Mat3, Vec3, sample::planar_2r};
/// let rod = InertialParameters::from_centre_of_mass(1.0, Vec3([1.0, 0.0, 0.0]), &Mat3::ZERO);
/// let mut plant = Plant::new(&planar_2r(1.0, rod, rod), &[], &[])?;
/// let settings: ControllerSettings = toml::from_str("kind = \"joint-pd\"\nkp = 400.0\nkd = 80.0").unwrap();
/// let mut controller = settings.build(2, None)?;
/// let reference = Reference::standing(&[-1.5, 0.0], 1000.0, 2.0)?;
/// let run = closed_loop(&mut plant, controller.as_mut(), &reference, &LoopSettings::default())?;
/// assert!(run.status.is_done() && run.max_error[0] < 0.02);
/// # Ok::<(), dynident_simulation::SimulationError>(())
/// ```
///
/// # Errors
/// Invalid settings, different numbers of joints. Events during the run are reported by its [`RunStatus`].
pub fn closed_loop(
    plant: &mut Plant,
    controller: &mut dyn Controller,
    reference: &Reference,
    settings: &LoopSettings,
) -> Result<Run, SimulationError> {
    let LoopStart { limits, q, dq } = LoopStart::of(plant, controller, reference, settings)?;
    let (joints, samples) = (plant.dof(), reference.samples());
    plant.set_state(0.0, &q, &dq);
    controller.reset();
    // Memory for the whole run, so that the loop does not allocate.
    let mut run = Run::begin(plant, reference, settings.accelerations);
    let perfect_feedback = settings.sensors.are_perfect(joints);
    if !perfect_feedback {
        (run.measured_q, run.measured_dq) = (vec![0.0; joints * samples], vec![0.0; joints * samples]);
    }
    let feedback = (!perfect_feedback).then(|| Feedback::new(&settings.sensors, plant, reference.rate_hz()));
    let mut running = RunningLoop {
        controller,
        settings,
        limits,
        target: ReferenceBuffer::new(reference),
        feedback,
        step_s: 1.0 / reference.rate_hz(),
        samples,
        tau: vec![0.0; joints],
        ddq: vec![0.0; joints],
        buffer: MotionBuffer::new(joints, !perfect_feedback),
        plant,
        run,
        completed: 0,
    };
    for sample in 0..samples {
        if let Err(status) = running.sample(sample) {
            running.run.status = status;
            break;
        }
    }
    let RunningLoop { plant, mut buffer, mut run, completed, .. } = running;
    buffer.flush(arrays(&mut run), samples);
    if perfect_feedback {
        (run.measured_q, run.measured_dq) = (run.q.clone(), run.dq.clone());
    }
    run.unsettled_steps = plant.unsettled_steps();
    run.end(completed);
    Ok(run)
}

struct RunningLoop<'a> {
    plant: &'a mut Plant,
    controller: &'a mut dyn Controller,
    settings: &'a LoopSettings,
    limits: Limits,
    target: ReferenceBuffer<'a>,
    /// Sensors; `None` if the controller measures the true state.
    feedback: Option<Feedback<'a>>,
    step_s: f64,
    samples: usize,
    tau: Vec<f64>,
    ddq: Vec<f64>,
    buffer: MotionBuffer,
    run: Run,
    completed: usize,
}

impl RunningLoop<'_> {
    /// Controls and records one sample and advances to the next; the error is the status that ends the run.
    fn sample(&mut self, sample: usize) -> Result<(), RunStatus> {
        let Self { plant, settings, limits, target, tau, run, .. } = self;
        let time_s = run.time_s(sample);
        let diverged = |reason| RunStatus::Diverged { time_s, reason };
        plant.set_time_s(time_s);
        target.go_to(sample);
        if let Some(status) = stop_status(plant.q(), plant.dq(), limits, target.target().q, time_s, &run.joints) {
            return Err(status);
        }
        let sensed = self.feedback.as_mut().map(|feedback| {
            feedback.read(plant.q(), plant.dq());
            feedback.measured()
        });
        let measured = sensed.unwrap_or(Measured { q: plant.q(), dq: plant.dq() });
        self.controller.torque(time_s, target.target(), measured, tau);
        if let Some(joint) = tau.iter().position(|tau| !tau.is_finite()) {
            return Err(diverged(Divergence::Torque { joint }));
        }
        for joint in 0..tau.len() {
            if tau[joint].abs() > limits.torque[joint] {
                tau[joint] = limits.torque[joint].copysign(tau[joint]);
                run.saturated[joint] += 1;
            }
            let error = (target.target().q[joint] - plant.q()[joint]).abs();
            run.max_error[joint] = run.max_error[joint].max(error);
            run.rms_error[joint] += error * error;
        }
        if self.buffer.push(Row { q: plant.q(), dq: plant.dq(), tau, measured: sensed }) {
            self.buffer.flush(arrays(run), self.samples);
        }
        if settings.accelerations {
            plant.accelerations(tau, &mut self.ddq).map_err(|fault| diverged(Divergence::Plant { fault }))?;
            for joint in 0..tau.len() {
                run.ddq[joint * self.samples + sample] = self.ddq[joint];
            }
        }
        self.completed = sample + 1;
        if self.completed < self.samples {
            let advanced = plant.advance(tau, self.step_s, settings.integrator);
            advanced.map_err(|fault| diverged(Divergence::Plant { fault }))?;
        }
        Ok(())
    }
}

fn arrays(run: &mut Run) -> Arrays<'_> {
    [&mut run.q, &mut run.dq, &mut run.tau, &mut run.measured_q, &mut run.measured_dq]
}

/// Status that ends the run at this state, if any.
#[inline]
pub(crate) fn stop_status(
    q: &[f64],
    dq: &[f64],
    limits: &Limits,
    target: &[f64],
    time_s: f64,
    names: &[String],
) -> Option<RunStatus> {
    for joint in 0..target.len() {
        let (q, dq) = (q[joint], dq[joint]);
        if dq.abs() > limits.divergence_speed[joint] {
            return Some(RunStatus::Diverged { time_s, reason: Divergence::Speed { joint, value: dq } });
        }
        let error = target[joint] - q;
        let broken = |quantity, value, limit| {
            Some(RunStatus::LimitBroken { time_s, joint: names[joint].clone(), quantity, value, limit })
        };
        if q < limits.lower[joint] {
            return broken(LimitedQuantity::Position, q, limits.lower[joint]);
        }
        if q > limits.upper[joint] {
            return broken(LimitedQuantity::Position, q, limits.upper[joint]);
        }
        if dq.abs() > limits.speed[joint] {
            return broken(LimitedQuantity::Speed, dq, limits.speed[joint]);
        }
        if error.abs() > limits.error[joint] {
            return broken(LimitedQuantity::TrackingError, error, limits.error[joint]);
        }
    }
    None
}
