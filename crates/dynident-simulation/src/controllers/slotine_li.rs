//! Passivity-based controller of Slotine and Li, optionally adaptive.

use super::{Controller, ControllerModel, FrictionCompensation, Measured, Target};
use crate::error::{SimulationError, require};
use crate::per_joint::PerJoint;
use dynident_dynamics::{Workspace, torque_regressor};
use dynident_model::terms::{HysteresisState, JointMotion, TermInput};
use dynident_model::{Model, Vec3};
use serde::{Deserialize, Serialize};

pub(super) const NAME: &str = "slotine-li";

/// Gains of [`SlotineLi`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SlotineLiSettings {
    /// Λ, 1/s.
    pub lambda: PerJoint,
    /// K_D, Nm s/rad (N s/m).
    pub kd: PerJoint,
    /// Adaptation gain Γ of every parameter. Its unit is the square of the parameter's unit per joule. Default 0: no
    /// adaptation.
    #[serde(default)]
    pub gamma: f64,
    /// Velocity at which the friction of the model is compensated; default the velocity of the reference.
    #[serde(default)]
    pub friction: FrictionCompensation,
}

impl SlotineLiSettings {
    /// Checks the settings for a number of joints.
    ///
    /// # Errors
    /// Gains that are negative or not finite, lists of the wrong length.
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        self.lambda.gains("lambda", joints)?;
        self.kd.gains("kd", joints)?;
        let fix = "give zero or a finite positive number";
        require(self.gamma >= 0.0 && self.gamma.is_finite(), "gamma", self.gamma, fix)
    }
}

/// Control law `τ = Y(q, q̇, q̇_r, q̈_r) θ̂ + K_D s` with regressor Y, parameters θ̂, `s = ė + Λ e`, `q̇_r = q̇_d + Λ
/// e` and `q̈_r = q̈_d + Λ ė`; adaptation `θ̂' = Γ Yᵀ s` (Slotine and Li, IJRR 6 (1987) 49).
///
/// `Y` contains `C(q, q̇) q̇_r` with C from the Christoffel symbols, so that `Ṁ - 2C` is skew-symmetric. This product
/// is the symmetric bilinear form of the centrifugal torques, `C(q, u) v = c((u + v)/2) - c((u - v)/2)` with `c(w) =
/// C(q, w) w`. It is therefore computed as the difference of two ordinary regressors. The adapted parameters (bodies,
/// then terms) start from the model in every run. Friction that depends on the transmitted torque is omitted, because
/// its torque is not linear in the parameters.
#[derive(Debug)]
pub struct SlotineLi {
    start: ControllerModel,
    /// Model without gravity, for the centrifugal torques.
    weightless: Model,
    gains: [Vec<f64>; 2],
    gamma: f64,
    friction: FrictionCompensation,
    workspace: Workspace,
    parameters: Vec<f64>,
    memories: Vec<HysteresisState>,
    /// Regressor Y, row-major, one row per joint.
    regressor: Vec<f64>,
    vectors: [Vec<f64>; 5],
    last_time_s: Option<f64>,
}

impl SlotineLi {
    /// Creates the controller with a model.
    ///
    /// # Errors
    /// Errors of [`SlotineLiSettings::validate`].
    pub fn new(model: ControllerModel, settings: &SlotineLiSettings) -> Result<Self, SimulationError> {
        let joints = model.dof();
        settings.validate(joints)?;
        let parameters = model.parameters();
        Ok(Self {
            weightless: model.model().clone().with_gravity(Vec3::ZERO)?,
            gains: [settings.lambda.gains("lambda", joints)?, settings.kd.gains("kd", joints)?],
            gamma: settings.gamma,
            friction: settings.friction,
            workspace: Workspace::new(model.model()),
            memories: vec![HysteresisState::default(); model.terms().len()],
            regressor: vec![0.0; joints * parameters.len()],
            parameters,
            vectors: core::array::from_fn(|_| vec![0.0; joints]),
            last_time_s: None,
            start: model,
        })
    }

    /// Current values of the adapted parameters: ten for each body, then one for each term.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    fn fill_regressor(&mut self, target: Target<'_>, measured: Measured<'_>) {
        let Self { start, weightless, workspace, regressor, vectors, memories, .. } = self;
        let [reference_velocity, reference_acceleration, mean, half, _] = vectors;
        let (joints, bodies) = (mean.len(), start.model().inertial_count());
        let columns = bodies + start.terms().len();
        for joint in 0..joints {
            mean[joint] = 0.5 * (measured.dq[joint] + reference_velocity[joint]);
            half[joint] = 0.5 * (measured.dq[joint] - reference_velocity[joint]);
        }
        regressor.fill(0.0);
        let y = torque_regressor(start.model(), workspace, measured.q, mean, reference_acceleration);
        for joint in 0..joints {
            regressor[joint * columns..][..bodies].copy_from_slice(&y[joint * bodies..][..bodies]);
        }
        // The half difference of the velocities is evaluated without gravity and acceleration.
        mean.fill(0.0);
        let y = torque_regressor(weightless, workspace, measured.q, half, mean);
        for joint in 0..joints {
            for (to, from) in regressor[joint * columns..][..bodies].iter_mut().zip(&y[joint * bodies..]) {
                *to -= from;
            }
        }
        let [q, dq] = match self.friction {
            FrictionCompensation::Measured => [measured.q, measured.dq],
            _ => [target.q, target.dq],
        };
        let for_friction = JointMotion { samples: 1, q, dq, ddq: reference_acceleration };
        let as_measured = JointMotion { samples: 1, q: measured.q, dq: measured.dq, ddq: reference_acceleration };
        for (place, ((term, _), memory)) in start.terms().iter().zip(memories).enumerate() {
            // A dependence on the transmitted torque would make the column depend on the other parameters.
            if self.friction == FrictionCompensation::None && term.is_friction() || term.needs_load() {
                continue;
            }
            let motion = if term.is_declared() { as_measured } else { for_friction };
            for joint in 0..joints {
                if term.acts_on(joint) {
                    let entry = &mut regressor[joint * columns + bodies + place..][..1];
                    term.column_following(
                        joint,
                        &motion,
                        &mut TermInput { load: None, temperature_c: None, memory },
                        entry,
                    );
                }
            }
        }
    }
}

impl Controller for SlotineLi {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.gains[0].len()
    }

    fn reset(&mut self) {
        self.parameters = self.start.parameters();
        self.memories.iter_mut().for_each(HysteresisState::restart);
        self.last_time_s = None;
    }

    fn torque(&mut self, time_s: f64, target: Target<'_>, measured: Measured<'_>, tau: &mut [f64]) {
        let span_s = self.last_time_s.map_or(0.0, |last| time_s - last);
        self.last_time_s = Some(time_s);
        let [lambda, kd] = &self.gains;
        for joint in 0..lambda.len() {
            let error = target.q[joint] - measured.q[joint];
            let velocity_error = target.dq[joint] - measured.dq[joint];
            self.vectors[0][joint] = target.dq[joint] + lambda[joint] * error;
            self.vectors[1][joint] = target.ddq[joint] + lambda[joint] * velocity_error;
            self.vectors[4][joint] = velocity_error + lambda[joint] * error;
            tau[joint] = kd[joint] * self.vectors[4][joint];
        }
        self.fill_regressor(target, measured);
        let columns = self.parameters.len();
        let sliding = &self.vectors[4];
        if self.gamma > 0.0 && span_s > 0.0 {
            for (joint, s) in sliding.iter().enumerate() {
                let row = &self.regressor[joint * columns..(joint + 1) * columns];
                for (parameter, y) in self.parameters.iter_mut().zip(row) {
                    *parameter += span_s * self.gamma * y * s;
                }
            }
        }
        for (tau, row) in tau.iter_mut().zip(self.regressor.chunks_exact(columns)) {
            *tau += row.iter().zip(&self.parameters).map(|(y, p)| y * p).sum::<f64>();
        }
    }

    fn set_model(&mut self, model: &ControllerModel) -> Result<(), SimulationError> {
        model.check_joints(self.joints())?;
        let settings = SlotineLiSettings {
            lambda: PerJoint::Each(self.gains[0].clone()),
            kd: PerJoint::Each(self.gains[1].clone()),
            gamma: self.gamma,
            friction: self.friction,
        };
        *self = Self::new(model.clone(), &settings)?;
        Ok(())
    }
}
