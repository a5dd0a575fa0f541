//! Result of `identify` for logs of commands and positions of servo drives.

use crate::error::ResultFileError;
use crate::provenance::Provenance;
use crate::read::{parsed, read_result, schema_of};
use crate::servo_form::ServoForm;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name and version of the schema of [`ServoFile`].
pub const SERVO_SCHEMA: &str = "dynident/servo/1";

/// Drives and bodies, identified so that the simulated motion for the commands equals the measured motion.
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
    /// Time step of the simulation in the fit, s.
    pub step_s: f64,
    /// Number of unknown values in the fit.
    pub unknowns: usize,
    /// Number of steps of the search.
    pub iterations: usize,
    /// Whether the search converged. If not, values and error bars are not final.
    pub settled: bool,
    /// The training logs.
    pub training: Vec<ServoLog>,
    /// The held-out logs.
    pub validation: Vec<ServoLog>,
    /// Measured and simulated motion of the first held-out log, to check another simulator: at most 1,500 samples.
    pub motion: Option<ServoMotion>,
    /// The drive of each joint.
    pub drives: Vec<ServoDrive>,
    /// The moving bodies.
    pub bodies: Vec<ServoBody>,
    /// The common factor of all torques, inertias and masses, which positions alone do not determine.
    pub scale: ServoScale,
    /// The drives in each export format of `dynident export`, with their errors; empty in results of older versions.
    #[serde(default)]
    pub forms: Vec<ServoForm>,
    /// Values that the motion did not determine, in words.
    pub not_determined: Vec<String>,
    /// Remarks, in words.
    pub notes: Vec<String>,
    /// Reasons not to use the result, in words.
    pub problems: Vec<String>,
    /// Input files, program version and command of the result.
    pub provenance: Option<Provenance>,
    /// Computing time, s.
    pub seconds: f64,
}

impl ServoFile {
    /// Reads a result of `identify` for commands and positions; `None` if the file has another schema.
    ///
    /// # Errors
    /// A file that cannot be read, is not a result, or has implausible numbers.
    pub fn read(path: &Path) -> Result<Option<Self>, ResultFileError> {
        Self::parse(&read_result(path)?, path)
    }

    /// Parses a result of `identify` for commands and positions from text; `path` is its name in messages.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &[u8], path: &Path) -> Result<Option<Self>, ResultFileError> {
        if schema_of(text, path)? != SERVO_SCHEMA {
            return Ok(None);
        }
        let file: Self = parsed(text, path)?;
        let wrong = |message: String| ResultFileError::Content { path: path.to_owned(), message };
        match file.implausible() {
            Some(problem) => Err(wrong(format!("{problem}: the file was edited or damaged; identify again"))),
            None => Ok(Some(file)),
        }
    }

    /// Message about the first list of a wrong length or the first impossible value of a drive.
    fn implausible(&self) -> Option<String> {
        let joints = self.joints.len();
        let errors = self.forms.iter().flat_map(|form| &form.logs);
        let mut lengths = vec![("rotary", self.rotary.len()), ("drives", self.drives.len())];
        lengths.extend(errors.clone().map(|log| ("model_errors", log.model_errors.len())));
        lengths.extend(errors.filter_map(|log| Some(("errors", log.errors.as_ref()?.len()))));
        if let Some((key, found)) = lengths.into_iter().find(|(_, found)| *found != joints) {
            return Some(format!("{key} has {found} entries for {joints} joints"));
        }
        let of_drive = |(joint, drive): (&String, &ServoDrive)| {
            let not_negative = [
                ("stiffness", drive.stiffness),
                ("damping", drive.damping),
                ("armature", drive.armature),
                ("mean_friction", drive.mean_friction),
                ("torque_limit", drive.torque_limit.unwrap_or(0.0)),
                ("velocity_limit", drive.velocity_limit.unwrap_or(0.0)),
                // Read delays are differences and may be negative.
                ("delay_s", drive.delay_s),
            ];
            let (key, value) = not_negative.into_iter().find(|(_, value)| *value < 0.0)?;
            Some(format!("{key} = {value} of the drive of joint `{joint}`"))
        };
        self.joints.iter().zip(&self.drives).find_map(of_drive)
    }
}

/// Errors of one log. The simulation starts at the first measured position and is not reset later.
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
    /// Root mean square difference between measured position and command, rad (m): the error of a simulation in which
    /// joints follow commands exactly.
    pub command_errors: Vec<f64>,
    /// Range of the measured position of each joint, rad (m); empty in older files.
    #[serde(default)]
    pub ranges: Vec<f64>,
}

/// Measured and simulated motion of a log.
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
    /// Torque per velocity, Nm s/rad (N s/m): sum of the velocity gain of the controller, viscous friction and
    /// back-EMF.
    pub damping: f64,
    /// Inertia of rotor and gear at the joint, kg m² (kg).
    pub armature: f64,
    /// Coulomb friction without load, Nm (N).
    pub coulomb: f64,
    /// Increase of friction per torque that the gear carries (weight and velocity-dependent torque of the arm), without
    /// unit.
    pub load_friction: f64,
    /// Difference between friction at rest and friction in motion (Stribeck effect), Nm (N).
    pub stribeck: f64,
    /// Velocity at which most of the Stribeck effect has disappeared, rad/s (m/s).
    pub stribeck_speed: f64,
    /// Largest torque of the position controller, Nm (N); null without limit.
    pub torque_limit: Option<f64>,
    /// Largest acceleration of the set point, rad/s² (m/s²); null without limit.
    #[serde(default)]
    pub profile_acceleration: Option<f64>,
    /// Largest speed of the set point, rad/s (m/s); null without limit.
    #[serde(default)]
    pub profile_speed: Option<f64>,
    /// Largest speed of the joint in the robot description, rad/s (m/s); null without limit.
    #[serde(default)]
    pub velocity_limit: Option<f64>,
    /// Delay from a command to its effect, s.
    pub delay_s: f64,
    /// Delay from a time stamp of the log to the measurement of the position, s.
    pub read_delay_s: f64,
    /// Position of the model minus the measured position, rad (m).
    pub zero: f64,
    /// Mean absolute torque of weight and velocity over the training logs, Nm (N).
    pub mean_load: f64,
    /// Mean of the friction limit over the training logs, Nm (N): the single friction number that exported robot
    /// descriptions contain.
    #[serde(default)]
    pub mean_friction: f64,
    /// Values of the drive with error bars.
    pub values: Vec<ServoNumber>,
}

impl ServoDrive {
    /// The values for a table: in place of the mean delay and the read delay, the delay of this joint from a command to
    /// its measurement, `delay_s - read_delay_s`, with the error bars of both.
    pub fn shown_values(&self) -> Vec<ServoNumber> {
        let (delays, mut shown): (Vec<_>, Vec<_>) =
            self.values.iter().cloned().partition(|value| value.name.ends_with("delay"));
        let sum = |of: fn(&ServoNumber) -> f64| delays.iter().map(|delay| of(delay).powi(2)).sum::<f64>().sqrt();
        shown.extend(delays.first().map(|first| ServoNumber {
            name: "delay".to_owned(),
            unit: first.unit.clone(),
            value: self.delay_s - self.read_delay_s,
            half_width_95: sum(|delay| delay.half_width_95),
            half_width_95_at_scale: sum(|delay| delay.half_width_95_at_scale),
            half_width_95_before: sum(|delay| delay.half_width_95_before),
            determined: delays.iter().all(|delay| delay.determined),
        }));
        shown
    }
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
    /// Values of the body with error bars.
    pub values: Vec<ServoNumber>,
}

/// A value with its error bar.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoNumber {
    /// Name in words.
    pub name: String,
    /// Unit; empty for a value without unit.
    pub unit: String,
    /// The value.
    pub value: f64,
    /// Half-width of the 95 % interval.
    pub half_width_95: f64,
    /// Half-width of the 95 % interval if the common factor of torques, inertias and masses were known.
    pub half_width_95_at_scale: f64,
    /// Half-width of the 95 % interval before the fit.
    pub half_width_95_before: f64,
    /// Whether the motion determines the value: the interval is at most half as wide as before the fit.
    pub determined: bool,
}

/// The common factor of all torques, inertias and masses, which positions alone do not determine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ServoScale {
    /// Whether the logs determine the factor.
    pub determined: bool,
    /// Total mass of the moving bodies, kg.
    pub mass_kg: f64,
    /// Half-width of the 95 % interval of the factor, percent.
    pub half_width_95_percent: f64,
    /// Reason why the factor is determined, or the additional log that would determine it, in words.
    pub anchor: String,
}
