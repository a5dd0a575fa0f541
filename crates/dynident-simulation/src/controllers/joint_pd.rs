//! Independent proportional-derivative controller of every joint.

use super::{Controller, Measured, Target};
use crate::error::SimulationError;
use crate::per_joint::PerJoint;
use serde::{Deserialize, Serialize};

pub(super) const NAME: &str = "joint-pd";

/// Gains of [`JointPd`] and [`PdGravity`](super::PdGravity).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JointPdSettings {
    /// K_p, Nm/rad (N/m).
    pub kp: PerJoint,
    /// K_d, Nm s/rad (N s/m).
    pub kd: PerJoint,
}

impl JointPdSettings {
    /// Checks the gains for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.gains(joints).map(|_| ())
    }

    pub(super) fn gains(&self, joints: usize) -> Result<[Vec<f64>; 2], SimulationError> {
        Ok([self.kp.gains("kp", joints)?, self.kd.gains("kd", joints)?])
    }
}

/// Control law `τ = K_p (q_d - q) + K_d (q̇_d - q̇)`, without a model.
#[derive(Clone, Debug)]
pub struct JointPd {
    gains: [Vec<f64>; 2],
}

impl JointPd {
    /// Creates the controller for a number of joints.
    ///
    /// # Errors
    /// Errors of [`JointPdSettings::validate`].
    pub fn new(joints: usize, settings: &JointPdSettings) -> Result<Self, SimulationError> {
        Ok(Self { gains: settings.gains(joints)? })
    }
}

impl Controller for JointPd {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.gains[0].len()
    }

    fn reset(&mut self) {}

    fn torque(&mut self, _time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        let [kp, kd] = &self.gains;
        for joint in 0..kp.len() {
            tau[joint] =
                kp[joint] * (target.q[joint] - measured.q[joint]) + kd[joint] * (target.dq[joint] - measured.dq[joint]);
        }
    }
}
