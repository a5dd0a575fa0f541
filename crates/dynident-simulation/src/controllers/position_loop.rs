//! Position loop of the robot's drives, with or without feed-forward of torque (or current).

use super::{Controller, ControllerModel, FrictionCompensation, JointPd, JointPdSettings, Measured, Target};
use crate::error::SimulationError;
use crate::per_joint::PerJoint;
use serde::{Deserialize, Serialize};

pub(super) const NAME: &str = "position-loop";

/// Settings of [`PositionLoop`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PositionLoopSettings {
    /// Whether the drives get the model's torque along the reference as feed-forward; default true. Otherwise they get
    /// only the path.
    #[serde(default = "fed_forward")]
    pub feed_forward: bool,
    /// Assumed stiffness of the loop, Nm/rad (N/m), for simulations. It does not change the robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kp: Option<PerJoint>,
    /// Assumed damping of the loop, Nm s/rad (N s/m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kd: Option<PerJoint>,
}

fn fed_forward() -> bool {
    true
}

impl PositionLoopSettings {
    /// Settings of the drives' own loop, whose gains are not known.
    pub fn of_robot(feed_forward: bool) -> Self {
        Self { feed_forward, kp: None, kd: None }
    }

    /// Checks the given gains for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.stated_gains().map_or(Ok(()), |gains| gains.validate(joints))
    }

    /// Whether both gains are given.
    pub fn can_be_simulated(&self) -> bool {
        self.kp.is_some() && self.kd.is_some()
    }

    /// The given gains; a missing gain is zero.
    fn stated_gains(&self) -> Option<JointPdSettings> {
        let none = || PerJoint::All(0.0);
        (self.kp.is_some() || self.kd.is_some()).then(|| JointPdSettings {
            kp: self.kp.clone().unwrap_or_else(none),
            kd: self.kd.clone().unwrap_or_else(none),
        })
    }
}

/// Model of the loop, `τ = K_p e + K_d ė + τ̂(q_d, q̇_d, q̈_d)`, with the model's torque along the reference as
/// optional feed-forward. On a robot the loop runs in the drives, which get the path and this torque.
#[derive(Clone, Debug)]
pub struct PositionLoop {
    pd: JointPd,
    model: Option<ControllerModel>,
    ahead: Vec<f64>,
}

impl PositionLoop {
    /// Creates the loop for a number of joints; `model` computes the feed-forward.
    ///
    /// # Errors
    /// Gains that are not stated, or errors of [`PositionLoopSettings::validate`].
    pub fn new(
        joints: usize,
        settings: &PositionLoopSettings,
        model: Option<ControllerModel>,
    ) -> Result<Self, SimulationError> {
        let Some(gains) = settings.stated_gains().filter(|_| settings.can_be_simulated()) else {
            return Err(SimulationError::OwnLoop);
        };
        Ok(Self { pd: JointPd::new(joints, &gains)?, model, ahead: vec![0.0; joints] })
    }
}

impl Controller for PositionLoop {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.ahead.len()
    }

    fn reset(&mut self) {
        if let Some(model) = &mut self.model {
            model.restart();
        }
    }

    fn torque(&mut self, time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        self.pd.torque(time_s, target, measured, tau);
        let Some(model) = &mut self.model else { return };
        let along = Measured { q: target.q, dq: target.dq };
        model.torque(along, target, target.ddq, FrictionCompensation::Reference, &mut self.ahead);
        for (tau, ahead) in tau.iter_mut().zip(&self.ahead) {
            *tau += ahead;
        }
    }

    fn set_model(&mut self, model: &ControllerModel) -> Result<(), SimulationError> {
        model.check_joints(self.joints())?;
        if self.model.is_some() {
            self.model = Some(model.clone());
        }
        Ok(())
    }
}
