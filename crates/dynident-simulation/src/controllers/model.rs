//! Robot model of a controller.

use super::{Measured, Target};
use crate::error::{SimulationError, require, require_length};
use dynident_dynamics::{Column, Workspace, gravity_torque, inverse_dynamics};
use dynident_model::terms::{HysteresisState, JointMotion, TermInput, TorqueTerm};
use dynident_model::{InertialParameters, Model};
use serde::{Deserialize, Serialize};

/// Velocity at which a controller evaluates the friction of its model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum FrictionCompensation {
    /// No friction compensation.
    None,
    /// Velocity of the reference: it has no noise, and friction compensation causes no feedback.
    #[default]
    Reference,
    /// Measured velocity: correct also when the joint lags behind, but the friction torque chatters with the sign of
    /// a noisy velocity.
    Measured,
}

/// A robot model for control: bodies and terms with their parameters. Torques are linear in the parameters, so that a
/// vector of base parameters is sufficient: see [`from_columns`](Self::from_columns). The parameters need not be
/// physically consistent.
pub struct ControllerModel {
    model: Model,
    terms: Vec<(TorqueTerm, f64)>,
    memories: Vec<HysteresisState>,
    workspace: Workspace,
    load: Vec<f64>,
    zeros: Vec<f64>,
}

impl core::fmt::Debug for ControllerModel {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("ControllerModel")
            .field("model", &self.model.name())
            .field("terms", &self.terms)
            .finish_non_exhaustive()
    }
}

impl Clone for ControllerModel {
    fn clone(&self) -> Self {
        Self::assembled(self.model.clone(), self.terms.clone())
    }
}

impl ControllerModel {
    /// Creates the model from the inertial parameters of `model`, and terms with their parameters.
    ///
    /// # Errors
    /// Different lengths, values that are not finite, terms of missing joints.
    pub fn new(model: &Model, terms: &[TorqueTerm], term_parameters: &[f64]) -> Result<Self, SimulationError> {
        require_length("parameters of terms", terms.len(), term_parameters.len())?;
        for (term, &value) in terms.iter().zip(term_parameters) {
            require(value.is_finite(), term.symbol(), value, "give a finite number")?;
            if term.joints().iter().any(|&joint| joint >= model.dof()) {
                return Err(SimulationError::TermJoint { term: term.symbol(), joints: model.dof() });
            }
        }
        Ok(Self::assembled(model.clone(), terms.iter().cloned().zip(term_parameters.iter().copied()).collect()))
    }

    /// Creates the model from a vector of parameters: ten for each body from base to tip, then one for each term. The
    /// geometry is that of `model`.
    ///
    /// # Errors
    /// Errors of [`new`](Self::new).
    pub fn from_parameters(model: &Model, terms: &[TorqueTerm], parameters: &[f64]) -> Result<Self, SimulationError> {
        let bodies = model.inertial_count();
        require_length("parameters", bodies + terms.len(), parameters.len())?;
        let inertials: Vec<InertialParameters> = parameters[..bodies]
            .chunks_exact(10)
            .map(|own| InertialParameters(core::array::from_fn(|k| own[k])))
            .collect();
        Self::new(&model.with_inertials(&inertials)?, terms, &parameters[bodies..])
    }

    /// Creates the model from values of some columns of the regressor, with zeros elsewhere, for example from an
    /// estimate of base parameters ([`BaseParameters::base_columns`](dynident_dynamics::BaseParameters::base_columns)).
    /// Its torques are exactly `W θ`.
    ///
    /// # Errors
    /// Errors of [`new`](Self::new).
    pub fn from_columns(model: &Model, columns: &[Column], values: &[f64]) -> Result<Self, SimulationError> {
        require_length("values of columns", columns.len(), values.len())?;
        let mut inertials = vec![InertialParameters::ZERO; model.body_count()];
        let (mut terms, mut term_parameters) = (Vec::new(), Vec::new());
        for (column, &value) in columns.iter().zip(values) {
            match column {
                Column::Body { body, parameter } => {
                    require_length("bodies", model.body_count(), model.body_count().max(body + 1))?;
                    inertials[*body].0[*parameter] = value;
                }
                Column::Term(term) => {
                    terms.push(term.clone());
                    term_parameters.push(value);
                }
            }
        }
        Self::new(&model.with_inertials(&inertials)?, &terms, &term_parameters)
    }

    fn assembled(model: Model, terms: Vec<(TorqueTerm, f64)>) -> Self {
        let dof = model.dof();
        Self {
            workspace: Workspace::new(&model),
            memories: vec![HysteresisState::default(); terms.len()],
            load: vec![0.0; dof],
            zeros: vec![0.0; dof],
            terms,
            model,
        }
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.zeros.len()
    }

    /// Model of the bodies.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The terms and their parameters.
    pub fn terms(&self) -> &[(TorqueTerm, f64)] {
        &self.terms
    }

    /// Ten parameters for each body, then one for each term.
    pub fn parameters(&self) -> Vec<f64> {
        self.model.parameter_vector().into_iter().chain(self.terms.iter().map(|(_, value)| *value)).collect()
    }

    /// Checks the number of joints of the model.
    ///
    /// # Errors
    /// A different number of joints.
    pub fn check_joints(&self, joints: usize) -> Result<(), SimulationError> {
        require_length("joints of the controller's model", joints, self.dof())
    }

    /// Resets the deflection of friction springs.
    pub(crate) fn restart(&mut self) {
        self.memories.iter_mut().for_each(HysteresisState::restart);
    }

    /// Computes `M̂(q) a + ĥ(q, q̇)` at the measured motion with the accelerations `a`, plus the torques of the
    /// terms. Inertia, offset and declared (user-defined) torques are always included and use the measured motion.
    /// Friction uses the selected velocity.
    pub fn torque(
        &mut self,
        measured: Measured<'_>,
        target: Target<'_>,
        acceleration: &[f64],
        friction: FrictionCompensation,
        tau: &mut [f64],
    ) {
        let Self { model, terms, memories, workspace, load, .. } = self;
        tau.copy_from_slice(inverse_dynamics(model, workspace, measured.q, measured.dq, acceleration));
        if terms.is_empty() {
            return;
        }
        load.copy_from_slice(tau);
        let [q, dq] = match friction {
            FrictionCompensation::Measured => [measured.q, measured.dq],
            _ => [target.q, target.dq],
        };
        let for_friction = JointMotion { samples: 1, q, dq, ddq: acceleration };
        let as_measured = JointMotion { samples: 1, q: measured.q, dq: measured.dq, ddq: acceleration };
        for ((term, value), memory) in terms.iter().zip(memories) {
            if friction == FrictionCompensation::None && term.is_friction() {
                continue;
            }
            let motion = if term.is_declared() { as_measured } else { for_friction };
            for joint in 0..tau.len() {
                if term.acts_on(joint) {
                    let mut column = [0.0];
                    let load = core::slice::from_ref(&load[joint]);
                    let mut input = TermInput { load: Some(load), temperature_c: None, memory };
                    term.column_following(joint, &motion, &mut input, &mut column);
                    tau[joint] += value * column[0];
                }
            }
        }
    }

    /// Computes the torques of a motion, with all terms.
    pub fn reference_torque(&mut self, q: &[f64], dq: &[f64], ddq: &[f64], tau: &mut [f64]) {
        let (measured, target) = (Measured { q, dq }, Target { q, dq, ddq });
        self.torque(measured, target, ddq, FrictionCompensation::Reference, tau);
    }

    /// Computes `ĝ(q)`, constant torques, and declared torques at rest.
    pub(crate) fn gravity(&mut self, q: &[f64], out: &mut [f64]) {
        out.copy_from_slice(gravity_torque(&self.model, &mut self.workspace, q));
        let motion = JointMotion { samples: 1, q, dq: &self.zeros, ddq: &self.zeros };
        for (term, value) in &self.terms {
            for (joint, out) in out.iter_mut().enumerate() {
                *out += value * term.constant_torque(joint);
            }
            if let (Some(joint), Some(function)) = (term.own_joint(), term.state_function()) {
                out[joint] += value * function.value(&motion, 0).unwrap_or(0.0);
            }
        }
    }
}
