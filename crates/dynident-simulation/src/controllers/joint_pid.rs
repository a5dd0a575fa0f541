//! Joint PID: PD with the integral of the position error, as in many drives.

use super::{Controller, Measured, Target};
use crate::error::SimulationError;
use crate::per_joint::PerJoint;
use serde::{Deserialize, Serialize};

pub(super) const NAME: &str = "joint-pid";

/// Gains of [`JointPid`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JointPidSettings {
    /// K_p, Nm/rad (N/m).
    pub kp: PerJoint,
    /// K_i, Nm/(rad s).
    pub ki: PerJoint,
    /// K_d, Nm s/rad (N s/m).
    pub kd: PerJoint,
    /// Maximum torque of the integral, Nm (N). Default unlimited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub integral_limit: Option<PerJoint>,
}

impl JointPidSettings {
    /// Checks the gains for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        JointPid::new(joints, self).map(|_| ())
    }
}

/// Control law `τ = K_p e + K_i ∫ e dt + K_d ė` with `e = q_d - q`; trapezoidal integration between samples.
#[derive(Clone, Debug)]
pub struct JointPid {
    gains: [Vec<f64>; 3],
    limit: Vec<f64>,
    integral: Vec<f64>,
    last_error: Vec<f64>,
    last_time_s: Option<f64>,
}

impl JointPid {
    /// Creates the controller for a number of joints.
    ///
    /// # Errors
    /// Errors of [`JointPidSettings::validate`].
    pub fn new(joints: usize, settings: &JointPidSettings) -> Result<Self, SimulationError> {
        let gains =
            [settings.kp.gains("kp", joints)?, settings.ki.gains("ki", joints)?, settings.kd.gains("kd", joints)?];
        let limit = match &settings.integral_limit {
            Some(limit) => limit.gains("integral_limit", joints)?,
            None => vec![f64::INFINITY; joints],
        };
        let zeros = || vec![0.0; joints];
        Ok(Self { gains, limit, integral: zeros(), last_error: zeros(), last_time_s: None })
    }
}

impl Controller for JointPid {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.limit.len()
    }

    fn reset(&mut self) {
        self.integral.fill(0.0);
        self.last_time_s = None;
    }

    fn torque(&mut self, time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        let span_s = self.last_time_s.map_or(0.0, |last| time_s - last);
        self.last_time_s = Some(time_s);
        let [kp, ki, kd] = &self.gains;
        for joint in 0..self.limit.len() {
            let error = target.q[joint] - measured.q[joint];
            if span_s > 0.0 {
                let grown = self.integral[joint] + ki[joint] * 0.5 * span_s * (error + self.last_error[joint]);
                self.integral[joint] = grown.clamp(-self.limit[joint], self.limit[joint]);
            }
            self.last_error[joint] = error;
            let velocity_error = target.dq[joint] - measured.dq[joint];
            tau[joint] = kp[joint] * error + self.integral[joint] + kd[joint] * velocity_error;
        }
    }
}
