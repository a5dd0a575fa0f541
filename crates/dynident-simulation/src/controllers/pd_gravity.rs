//! Joint PD with the gravity torque of a model.

use super::{Controller, ControllerModel, JointPd, JointPdSettings, Measured, Target};
use crate::error::SimulationError;

pub(super) const NAME: &str = "pd-gravity";

/// Control law `τ = K_p e + K_d ė + ĝ(q)`: holds any posture without error if the gravity torque ĝ is correct
/// (Takegaki and Arimoto 1981). ĝ includes constant torques of the model's terms.
#[derive(Clone, Debug)]
pub struct PdGravity {
    pd: JointPd,
    model: ControllerModel,
    gravity: Vec<f64>,
}

impl PdGravity {
    /// Creates the controller with a model.
    ///
    /// # Errors
    /// Errors of [`JointPdSettings::validate`].
    pub fn new(model: ControllerModel, settings: &JointPdSettings) -> Result<Self, SimulationError> {
        let joints = model.dof();
        Ok(Self { pd: JointPd::new(joints, settings)?, gravity: vec![0.0; joints], model })
    }
}

impl Controller for PdGravity {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.gravity.len()
    }

    fn reset(&mut self) {}

    fn torque(&mut self, time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        self.pd.torque(time_s, target, measured, tau);
        self.model.gravity(measured.q, &mut self.gravity);
        for (tau, gravity) in tau.iter_mut().zip(&self.gravity) {
            *tau += gravity;
        }
    }

    fn set_model(&mut self, model: &ControllerModel) -> Result<(), SimulationError> {
        model.check_joints(self.joints())?;
        self.model = model.clone();
        Ok(())
    }
}
