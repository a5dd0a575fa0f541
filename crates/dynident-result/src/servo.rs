//! Result of `identify` for logs of commands and positions.

use crate::provenance::Provenance;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`ServoFile`].
pub const SERVO_SCHEMA: &str = "dynident/servo/1";

/// Drives and bodies that turn commands into the measured motion.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoFile {
    /// [`SERVO_SCHEMA`].
    pub schema: String,
    /// Name of the study.
    pub study: String,
    /// Name of the robot.
    pub robot: String,
    /// Names of the joints; all lists of values have this order.
    pub joints: Vec<String>,
    /// Whether each joint is rotary.
    pub rotary: Vec<bool>,
    /// Time step of the simulation, s.
    pub step_s: f64,
    /// Number of unknowns.
    pub unknowns: usize,
    /// Steps of the search.
    pub iterations: usize,
    /// Whether the search settled. If not, values and error bars are not final.
    pub settled: bool,
    /// The training logs.
    pub training: Vec<ServoLog>,
    /// The held-out logs.
    pub validation: Vec<ServoLog>,
    /// The simulated motion of the first held-out log, for a comparison with other simulators: at most 1,500 samples.
    pub motion: Option<ServoMotion>,
    /// The drive of each joint.
    pub drives: Vec<ServoDrive>,
    /// The moving bodies.
    pub bodies: Vec<ServoBody>,
    /// The factor that positions do not contain.
    pub scale: ServoScale,
    /// Values that the motion did not determine, in words.
    pub not_determined: Vec<String>,
    /// Remarks, in words.
    pub notes: Vec<String>,
    /// Reasons not to use the result, in words.
    pub problems: Vec<String>,
    /// The files that the result comes from, program and command.
    pub provenance: Option<Provenance>,
    /// Computing time, s.
    pub seconds: f64,
}

/// A log, simulated from its first position without resets.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoLog {
    /// Name of the log.
    pub name: String,
    /// Number of samples.
    pub samples: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Root mean square error of the simulated position of each joint, rad (m).
    pub errors: Vec<f64>,
    /// Root mean square distance of the measured position from the command, rad (m): the error of a simulation that
    /// takes the command for the motion.
    pub command_errors: Vec<f64>,
}

/// The motion of a log.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoMotion {
    /// Name of the log.
    pub name: String,
    /// Times of the samples, s.
    pub times_s: Vec<f64>,
    /// Measured position of each joint at these times, rad (m).
    pub measured: Vec<Vec<f64>>,
    /// Simulated position of each joint at these times, rad (m).
    pub simulated: Vec<Vec<f64>>,
    /// Command of each joint at these times, rad (m).
    pub commands: Vec<Vec<f64>>,
}

/// The drive of one joint.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoDrive {
    /// Position gain, Nm/rad (N/m).
    pub stiffness: f64,
    /// Torque per velocity, Nm s/rad (N s/m): gain of the velocity, viscous friction and back-EMF together.
    pub damping: f64,
    /// Inertia of rotor and gear at the joint, kg m² (kg).
    pub armature: f64,
    /// Coulomb friction without load, Nm (N).
    pub coulomb: f64,
    /// Friction per torque of weight and velocity.
    pub load_friction: f64,
    /// Friction at rest above that in motion, Nm (N).
    pub stribeck: f64,
    /// Velocity at which most of that is gone, rad/s (m/s).
    pub stribeck_speed: f64,
    /// Largest torque, Nm (N); null without limit.
    pub torque_limit: Option<f64>,
    /// Largest acceleration of the set point, rad/s² (m/s²); null without limit.
    #[serde(default)]
    pub profile_acceleration: Option<f64>,
    /// Largest speed of the set point, rad/s (m/s); null without limit.
    #[serde(default)]
    pub profile_speed: Option<f64>,
    /// Time from a command to its effect, s.
    pub delay_s: f64,
    /// Time from a stamp to the measurement of the position, s.
    pub read_delay_s: f64,
    /// Position of the model minus the measured position, rad (m).
    pub zero: f64,
    /// Mean torque of weight and velocity over the training logs, without sign, Nm (N).
    pub mean_load: f64,
    /// Mean of the largest friction over the training logs, Nm (N): the one number of the written robot descriptions.
    #[serde(default)]
    pub mean_friction: f64,
    /// Values with error bars.
    pub values: Vec<ServoNumber>,
}

/// A moving body.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoBody {
    /// Name of the body.
    pub body: String,
    /// Mass, first moment and inertia about the origin of the body's frame: m, mx, my, mz, Ixx, Ixy, Ixz, Iyy, Iyz,
    /// Izz.
    pub parameters: [f64; 10],
    /// Mass in the robot description, kg.
    pub nominal_mass_kg: f64,
    /// Values with error bars.
    pub values: Vec<ServoNumber>,
}

/// A value with its error bar.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoNumber {
    /// Name in words.
    pub name: String,
    /// Unit; empty for a number without unit.
    pub unit: String,
    /// The value.
    pub value: f64,
    /// Half-width of the 95 % interval.
    pub half_width_95: f64,
    /// Half-width of the 95 % interval if the scale were known.
    pub half_width_95_at_scale: f64,
    /// Half-width of the 95 % interval before the fit.
    pub half_width_95_before: f64,
    /// Whether the motion determines it: the interval is at most half of that before the fit.
    pub determined: bool,
}

/// The common factor of all torques, inertias and masses.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoScale {
    /// Whether the logs determine it.
    pub determined: bool,
    /// Total mass of the moving bodies, kg.
    pub mass_kg: f64,
    /// Half-width of the 95 % interval of the factor, percent.
    pub half_width_95_percent: f64,
    /// The reason why it is determined, or the log that would determine it, in words.
    pub anchor: String,
}
