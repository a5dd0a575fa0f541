//! Computed torque controller.

use super::{Controller, ControllerModel, FrictionCompensation, Measured, Target};
use crate::error::SimulationError;
use crate::per_joint::PerJoint;
use serde::{Deserialize, Serialize};

pub(super) const NAME: &str = "computed-torque";

/// Gains of [`ComputedTorque`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ComputedTorqueSettings {
    /// K_p, 1/s².
    pub kp: PerJoint,
    /// K_d, 1/s; `2 √K_p` is critical damping.
    pub kd: PerJoint,
    /// Velocity at which the friction of the model is compensated; default the velocity of the reference.
    #[serde(default)]
    pub friction: FrictionCompensation,
}

impl ComputedTorqueSettings {
    /// Checks the gains for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.kp.gains("kp", joints)?;
        self.kd.gains("kd", joints).map(|_| ())
    }
}

/// Control law `τ = M̂(q)(q̈_d + K_p e + K_d ė) + ĥ(q, q̇) + friction` with the model's mass matrix M̂ and the
/// Coriolis, centrifugal and gravity torque ĥ. With an exact model the error e of every joint satisfies `ë + K_d ė +
/// K_p e = 0` (Luh, Walker and Paul 1980).
#[derive(Clone, Debug)]
pub struct ComputedTorque {
    model: ControllerModel,
    gains: [Vec<f64>; 2],
    friction: FrictionCompensation,
    acceleration: Vec<f64>,
}

impl ComputedTorque {
    /// Creates the controller with a model.
    ///
    /// # Errors
    /// Errors of [`ComputedTorqueSettings::validate`].
    pub fn new(model: ControllerModel, settings: &ComputedTorqueSettings) -> Result<Self, SimulationError> {
        let joints = model.dof();
        let gains = [settings.kp.gains("kp", joints)?, settings.kd.gains("kd", joints)?];
        Ok(Self { gains, friction: settings.friction, acceleration: vec![0.0; joints], model })
    }
}

impl Controller for ComputedTorque {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.acceleration.len()
    }

    fn reset(&mut self) {
        self.model.restart();
    }

    fn torque(&mut self, _time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        let [kp, kd] = &self.gains;
        for joint in 0..kp.len() {
            self.acceleration[joint] = target.ddq[joint]
                + kp[joint] * (target.q[joint] - measured.q[joint])
                + kd[joint] * (target.dq[joint] - measured.dq[joint]);
        }
        self.model.torque(measured, target, &self.acceleration, self.friction, tau);
    }

    fn set_model(&mut self, model: &ControllerModel) -> Result<(), SimulationError> {
        model.check_joints(self.joints())?;
        self.model = model.clone();
        Ok(())
    }
}
