//! Controllers that run at a fixed rate: the trait, and the registry of the available ones.

mod computed_torque;
mod finite_time;
mod joint_pd;
mod joint_pid;
mod model;
mod pd_gravity;
mod position_loop;
mod slotine_li;

pub use computed_torque::{ComputedTorque, ComputedTorqueSettings};
pub use finite_time::{FiniteTime, FiniteTimeSettings};
pub use joint_pd::{JointPd, JointPdSettings};
pub use joint_pid::{JointPid, JointPidSettings};
pub use model::{ControllerModel, FrictionCompensation};
pub use pd_gravity::PdGravity;
pub use position_loop::{PositionLoop, PositionLoopSettings};
pub use slotine_li::{SlotineLi, SlotineLiSettings};

use crate::error::SimulationError;
use serde::{Deserialize, Serialize};

/// Desired motion of all joints at one time; units rad, rad/s, rad/s² (m).
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Positions.
    pub q: &'a [f64],
    /// Velocities.
    pub dq: &'a [f64],
    /// Accelerations.
    pub ddq: &'a [f64],
}

/// Measured motion of all joints at one time; units rad, rad/s (m).
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Positions.
    pub q: &'a [f64],
    /// Velocities.
    pub dq: &'a [f64],
}

/// A controller of joint torques. It is called once per sample, in the order of time; the loop applies the torque
/// limits.
pub trait Controller: core::fmt::Debug + Send {
    /// Name of the controller in study files and results.
    fn name(&self) -> &'static str;

    /// Number of joints.
    fn joints(&self) -> usize;

    /// Resets integrals and adapted parameters.
    fn reset(&mut self);

    /// Computes the torques of the drives at `time_s`, Nm (N), without allocation.
    ///
    /// # Panics
    /// If a vector does not have one entry per joint.
    fn torque(&mut self, time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]);

    /// Replaces the model for the next run. Controllers without a model ignore it.
    ///
    /// # Errors
    /// A model with another number of joints.
    fn set_model(&mut self, _model: &ControllerModel) -> Result<(), SimulationError> {
        Ok(())
    }
}

/// Registry of controllers: values of `controller` in a study file.
///
/// ```
/// use dynident_simulation::controllers::ControllerSettings;
/// let settings: ControllerSettings = toml::from_str("kind = \"joint-pd\"\nkp = 16.0\nkd = [8.0, 4.0]").unwrap();
/// let controller = settings.build(2, None)?;
/// assert_eq!(controller.name(), "joint-pd");
/// assert!(settings.build(3, None).is_err());
/// assert!(!settings.needs_model());
/// # Ok::<(), dynident_simulation::SimulationError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum ControllerSettings {
    /// [`JointPd`]: `τ = K_p e + K_d ė`.
    JointPd(JointPdSettings),
    /// [`JointPid`]: PD with the integral of the error.
    JointPid(JointPidSettings),
    /// [`PdGravity`]: joint PD and the gravity torque of the model.
    PdGravity(JointPdSettings),
    /// [`ComputedTorque`]: `τ = M̂ (q̈_d + K_p e + K_d ė) + ĥ`.
    ComputedTorque(ComputedTorqueSettings),
    /// [`FiniteTime`]: Eq. 23 of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*,
    /// with corrected signs.
    FiniteTime(FiniteTimeSettings),
    /// [`FiniteTime`] with the signs as printed in Eq. 23, for demonstration: it is unstable.
    FiniteTimeLiteral(FiniteTimeSettings),
    /// [`SlotineLi`]: passivity-based, optionally adaptive.
    SlotineLi(SlotineLiSettings),
    /// [`PositionLoop`]: the position loop inside the robot's drives, with or without torque feed-forward.
    PositionLoop(PositionLoopSettings),
}

impl ControllerSettings {
    /// Name of the controller in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::JointPd(_) => joint_pd::NAME,
            Self::JointPid(_) => joint_pid::NAME,
            Self::PdGravity(_) => pd_gravity::NAME,
            Self::ComputedTorque(_) => computed_torque::NAME,
            Self::FiniteTime(_) => finite_time::NAME,
            Self::FiniteTimeLiteral(_) => finite_time::LITERAL_NAME,
            Self::SlotineLi(_) => slotine_li::NAME,
            Self::PositionLoop(_) => position_loop::NAME,
        }
    }

    /// Whether the controller needs a model of the robot.
    pub fn needs_model(&self) -> bool {
        match self {
            Self::JointPd(_) | Self::JointPid(_) => false,
            Self::PositionLoop(settings) => settings.feed_forward,
            Self::PdGravity(_)
            | Self::ComputedTorque(_)
            | Self::FiniteTime(_)
            | Self::FiniteTimeLiteral(_)
            | Self::SlotineLi(_) => true,
        }
    }

    /// Whether the control law is known. The law of the drives' own position loop is known only if the study contains
    /// its gains.
    pub fn can_be_simulated(&self) -> bool {
        match self {
            Self::PositionLoop(settings) => settings.can_be_simulated(),
            Self::JointPd(_)
            | Self::JointPid(_)
            | Self::PdGravity(_)
            | Self::ComputedTorque(_)
            | Self::FiniteTime(_)
            | Self::FiniteTimeLiteral(_)
            | Self::SlotineLi(_) => true,
        }
    }

    /// Checks the settings for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length, exponents out of range.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        match self {
            Self::JointPd(settings) | Self::PdGravity(settings) => settings.validate(joints),
            Self::JointPid(settings) => settings.validate(joints),
            Self::ComputedTorque(settings) => settings.validate(joints),
            Self::FiniteTime(settings) | Self::FiniteTimeLiteral(settings) => settings.validate(joints),
            Self::SlotineLi(settings) => settings.validate(joints),
            Self::PositionLoop(settings) => settings.validate(joints),
        }
    }

    /// Creates the controller for a number of joints, with the model if it needs one.
    ///
    /// # Errors
    /// Errors of [`validate`](Self::validate); [`SimulationError::NoModel`]; a model with another number of joints.
    pub fn build(
        &self,
        joints: usize,
        model: Option<&ControllerModel>,
    ) -> Result<Box<dyn Controller>, SimulationError> {
        self.validate(joints)?;
        let model = || {
            let model = model.ok_or(SimulationError::NoModel { controller: self.name() })?;
            model.check_joints(joints)?;
            Ok::<_, SimulationError>(model.clone())
        };
        Ok(match self {
            Self::JointPd(settings) => Box::new(JointPd::new(joints, settings)?),
            Self::JointPid(settings) => Box::new(JointPid::new(joints, settings)?),
            Self::PdGravity(settings) => Box::new(PdGravity::new(model()?, settings)?),
            Self::ComputedTorque(settings) => Box::new(ComputedTorque::new(model()?, settings)?),
            Self::FiniteTime(settings) => Box::new(FiniteTime::new(model()?, settings)?),
            Self::FiniteTimeLiteral(settings) => Box::new(FiniteTime::literal(model()?, settings)?),
            Self::SlotineLi(settings) => Box::new(SlotineLi::new(model()?, settings)?),
            Self::PositionLoop(settings) => {
                let ahead = if settings.feed_forward { Some(model()?) } else { None };
                Box::new(PositionLoop::new(joints, settings, ahead)?)
            }
        })
    }
}
