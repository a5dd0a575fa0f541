//! A complete robot model for export.

use crate::error::ExportError;
use crate::recorded_velocity::RecordedVelocity;
use dynident_dynamics::{Column, ParametricModel};
use dynident_model::terms::TorqueTerm;
use dynident_model::urdf::MAX_MAGNITUDE;
use dynident_model::{InertialParameters, Joint, Mat3, Model, Transform, Vec3};

/// Tolerance for rotation entries near 0 or ±1: rounding error of a right angle written as 1.5707963267948966. It
/// moves a link of one metre by a femtometre.
const RIGHT_ANGLE_TOLERANCE: f64 = 1e-15;

/// A robot with inertial parameters of every body and a value of every torque term.
#[derive(Clone, Debug)]
pub struct RobotModel {
    model: Model,
    terms: Vec<TorqueTerm>,
    values: Vec<f64>,
    velocities: Vec<Vec<RecordedVelocity>>,
}

impl RobotModel {
    /// A robot with the inertial parameters of `model`, torque terms, and one value per term (Nm, Nm s/rad, kg m²,
    /// depending on the term).
    ///
    /// # Errors
    /// A body without or with too large inertial parameters, values that are not finite or do not match the terms, or a
    /// term of an unknown joint.
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
        for (body, inertial) in model.bodies().iter().zip(model.inertials()) {
            check_numbers(body.name(), inertial)?;
        }
        // Validates the terms.
        let checked = ParametricModel::new(model, terms)?;
        Ok(Self { model: checked.model().clone(), terms: checked.terms().to_vec(), values, velocities: Vec::new() })
    }

    /// Adds the recorded velocities of each joint (empty if unknown), over which the friction of simulators is fitted.
    ///
    /// # Errors
    /// A different number of joints, a velocity of zero, weights that are not positive, or numbers that are not finite.
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

    /// Name as an identifier of any language: letters, digits and `_`, not starting with a digit.
    pub fn identifier(&self) -> String {
        dynident_text::identifier(self.model.name())
    }

    /// An equivalent robot with fewer numbers: base parameters at the places of their columns, all other inertial
    /// parameters zero, and exact right angles.
    ///
    /// Its bodies are not physically consistent, but `M(q)`, `C(q, q̇) q̇` and `g(q)` are those of the robot, because
    /// `Y π = Y_b θ` for every motion.
    pub(crate) fn reduced(&self) -> Result<Model, ExportError> {
        let with_exact_right_angles = with_exact_right_angles(&self.model)?;
        let rigid = ParametricModel::new(with_exact_right_angles.clone(), Vec::new())?;
        let values = rigid.base().values(&self.model.parameter_vector());
        let mut inertials = vec![InertialParameters::ZERO; with_exact_right_angles.body_count()];
        for (column, value) in rigid.base().base_columns().into_iter().zip(values) {
            match column {
                Column::Body { body, parameter } => inertials[body].0[parameter] = value,
                Column::Term(_) => {}
            }
        }
        Ok(with_exact_right_angles.with_inertials(&inertials)?)
    }
}

/// Checks that a body's parameters and the derived numbers in robot descriptions are within the magnitude limit.
fn check_numbers(body: &str, inertial: &InertialParameters) -> Result<(), ExportError> {
    let com = inertial.com_m().map_or([0.0; 3], |com| com.0);
    let inertia = inertial.inertia_at_com().map_or([[0.0; 3]; 3], |inertia| inertia.0);
    let all = [
        ("an inertial parameter", &inertial.0[..]),
        ("the centre of mass", &com[..]),
        ("the inertia about the centre of mass", inertia.as_flattened()),
    ];
    for (quantity, values) in all {
        if let Some(&value) = values.iter().find(|value| value.is_nan() || value.abs() > MAX_MAGNITUDE) {
            return Err(ExportError::Body { body: body.to_owned(), quantity, value });
        }
    }
    Ok(())
}

fn with_exact_right_angles(model: &Model) -> Result<Model, ExportError> {
    let sweep = |x: f64| if (x - x.round()).abs() < RIGHT_ANGLE_TOLERANCE && x.abs() < 1.5 { x.round() } else { x };
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
