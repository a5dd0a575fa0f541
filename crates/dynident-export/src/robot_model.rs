//! What is exported: a robot with all its numbers.

use crate::error::ExportError;
use crate::recorded_velocity::RecordedVelocity;
use dynident_dynamics::{Column, ParametricModel};
use dynident_model::terms::TorqueTerm;
use dynident_model::{InertialParameters, Joint, Mat3, Model, Transform, Vec3};

/// Entries of rotations closer than this to 0 or ±1 are that number: what rounding leaves of a right angle written as
/// 1.5707963267948966, some units of the last place. It moves a link of one metre by a femtometre.
const DUST: f64 = 1e-15;

/// A robot with inertial parameters for every body and a value for every torque term.
#[derive(Clone, Debug)]
pub struct RobotModel {
    model: Model,
    terms: Vec<TorqueTerm>,
    values: Vec<f64>,
    velocities: Vec<Vec<RecordedVelocity>>,
}

impl RobotModel {
    /// A robot whose bodies have the inertial parameters of `model`, with torque terms and a value for each (Nm,
    /// Nm s/rad, kg m², as the terms say).
    ///
    /// # Errors
    /// If a body has no inertial parameters, values are not finite or not one for each term, or a term acts on a joint
    /// that is not there.
    pub fn new(model: Model, terms: Vec<TorqueTerm>, values: Vec<f64>) -> Result<Self, ExportError> {
        if values.len() != terms.len() {
            return Err(ExportError::Values { expected: terms.len(), found: values.len() });
        }
        if let Some((term, &value)) = terms.iter().zip(&values).find(|(_, value)| !value.is_finite()) {
            return Err(ExportError::NotFinite { symbol: term.symbol(), value });
        }
        let bodies: Vec<String> = model.bodies_without_prior().into_iter().map(str::to_owned).collect();
        if !bodies.is_empty() {
            return Err(ExportError::Unknown { bodies });
        }
        // Says what is wrong with terms.
        let checked = ParametricModel::new(model, terms)?;
        Ok(Self { model: checked.model().clone(), terms: checked.terms().to_vec(), values, velocities: Vec::new() })
    }

    /// The same with the velocities at which its joints were recorded, joint by joint (none for a joint of which
    /// nothing is known): what the friction of simulators is fitted over.
    ///
    /// # Errors
    /// Velocities of another number of joints; a velocity of zero, weights that are not positive, numbers that are not
    /// finite.
    pub fn with_velocities(self, velocities: Vec<Vec<RecordedVelocity>>) -> Result<Self, ExportError> {
        if velocities.len() != self.model.dof() {
            return Err(ExportError::Velocities { expected: self.model.dof(), found: velocities.len() });
        }
        let is_wrong = |one: &RecordedVelocity| {
            !(one.velocity.is_finite() && one.velocity != 0.0 && one.samples.is_finite() && one.samples > 0.0)
        };
        for (joint, velocities) in self.model.joints().iter().zip(&velocities) {
            if let Some(&RecordedVelocity { velocity, samples }) = velocities.iter().find(|one| is_wrong(one)) {
                return Err(ExportError::Velocity { joint: joint.name.clone(), velocity, samples });
            }
        }
        Ok(Self { velocities, ..self })
    }

    /// The velocities at which a joint was recorded; none where there are none.
    pub(crate) fn recorded_velocities(&self, joint: usize) -> Option<&[RecordedVelocity]> {
        self.velocities.get(joint).map(Vec::as_slice).filter(|velocities| !velocities.is_empty())
    }

    /// Links, joints and gravity.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Torque terms with their values.
    pub fn terms(&self) -> impl Iterator<Item = (&TorqueTerm, f64)> {
        self.terms.iter().zip(self.values.iter().copied())
    }

    /// Its name as an identifier of any language: letters, digits and `_`, not beginning with a digit.
    pub fn identifier(&self) -> String {
        identifier(self.model.name())
    }

    /// A robot with the same torques and fewer numbers: the base parameters stand at the places of their own columns,
    /// all other inertial parameters are zero; dust of right angles is swept out of placements.
    ///
    /// Its bodies are no real bodies, but `M(q)`, `C(q, q̇) q̇` and `g(q)` are the robot's, for `Y π = Y_b θ` at every
    /// motion.
    pub(crate) fn reduced(&self) -> Result<Model, ExportError> {
        let swept = swept(&self.model)?;
        let rigid = ParametricModel::new(swept.clone(), Vec::new())?;
        let values = rigid.base().values(&self.model.parameter_vector());
        let mut inertials = vec![InertialParameters::ZERO; swept.body_count()];
        for (column, value) in rigid.base().base_columns().into_iter().zip(values) {
            match column {
                Column::Body { body, parameter } => inertials[body].0[parameter] = value,
                Column::Term(_) => {}
            }
        }
        Ok(swept.with_inertials(&inertials)?)
    }
}

/// Letters, digits and `_` of a name; `robot` where nothing is left.
pub(crate) fn identifier(name: &str) -> String {
    let mut text: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect();
    if !text.chars().any(|c| c.is_ascii_alphanumeric()) {
        "robot".clone_into(&mut text);
    }
    if text.starts_with(|c: char| !c.is_ascii_alphabetic()) {
        text.insert_str(0, "robot_");
    }
    text
}

/// The same model with exact right angles.
fn swept(model: &Model) -> Result<Model, ExportError> {
    let sweep = |x: f64| if (x - x.round()).abs() < DUST && x.abs() < 1.5 { x.round() } else { x };
    let joint = |joint: &Joint| Joint {
        placement: Transform {
            rotation: Mat3(joint.placement.rotation.0.map(|row| row.map(sweep))),
            translation: joint.placement.translation,
        },
        axis: Vec3(joint.axis.0.map(sweep)),
        ..joint.clone()
    };
    let joints = model.tree_joints().iter().map(joint).collect();
    let gravity = model.gravity();
    Ok(Model::new(model.name(), model.base().clone(), joints, model.bodies().to_vec())?.with_gravity(gravity)?)
}
