//! A complete robot model for export.

use crate::error::ExportError;
use crate::recorded_velocity::RecordedVelocity;
use dynident_dynamics::{Column, ParametricModel};
use dynident_model::terms::{CoulombShape, TermClass, TorqueTerm};
use dynident_model::urdf::MAX_MAGNITUDE;
use dynident_model::{InertialParameters, Joint, Mat3, Model, Transform, Vec3};

/// Tolerance for rotation entries near 0 or ±1: rounding error of a right angle written as 1.5707963267948966. A
/// rounded entry moves a link of one metre by a femtometre.
const RIGHT_ANGLE_TOLERANCE: f64 = 1e-15;

/// A robot with inertial parameters of every body and a value of every torque term.
#[derive(Clone, Debug)]
pub struct RobotModel {
    model: Model,
    terms: Vec<TorqueTerm>,
    values: Vec<f64>,
    velocities: Vec<Vec<RecordedVelocity>>,
    load: Option<Vec<InertialParameters>>,
    state_terms: Vec<(TorqueTerm, f64)>,
}

impl RobotModel {
    /// Creates a robot with the inertial parameters of `model`, torque terms, and one value per term (Nm, Nm s/rad,
    /// kg m², depending on the term).
    ///
    /// # Errors
    /// A body without or with too large inertial parameters, values that are not finite or do not match the terms, or a
    /// term of an unknown joint.
    pub fn new(model: Model, terms: Vec<TorqueTerm>, values: Vec<f64>) -> Result<Self, ExportError> {
        check_terms(&terms, &values)?;
        let bodies: Vec<String> = model.bodies_without_prior().into_iter().map(str::to_owned).collect();
        if !bodies.is_empty() {
            return Err(ExportError::Unknown { bodies });
        }
        for (body, inertial) in model.bodies().iter().zip(model.inertials()) {
            check_numbers(body.name(), inertial)?;
        }
        // This call validates the terms.
        let checked = ParametricModel::new(model, terms)?;
        let (model, terms) = (checked.model().clone(), checked.terms().to_vec());
        Ok(Self { model, terms, values, velocities: Vec::new(), load: None, state_terms: Vec::new() })
    }

    /// Replaces the torque terms, with one value each; the bodies for load-dependent friction are kept.
    ///
    /// # Errors
    /// Same as for [`new`](Self::new).
    pub fn with_terms(&self, terms: Vec<TorqueTerm>, values: Vec<f64>) -> Result<Self, ExportError> {
        Ok(Self { load: self.load.clone(), ..Self::new(self.model.clone(), terms, values)? })
    }

    /// Sets the inertial parameters, one set per body, whose rigid-body torque load-dependent friction uses as
    /// transmitted torque. They need not be physically consistent. Without this call the bodies of the model are
    /// used.
    ///
    /// # Errors
    /// A different number of bodies, or numbers that are not finite.
    pub fn with_load(self, bodies: Vec<InertialParameters>) -> Result<Self, ExportError> {
        let _ = self.model.with_inertials(&bodies)?;
        Ok(Self { load: Some(bodies), ..self })
    }

    /// Sets the torque terms of the function with state: all terms, including those with hysteresis. Without this
    /// call, or if no term has hysteresis, exported code has no function with state.
    ///
    /// # Errors
    /// Same as for [`new`](Self::new).
    pub fn with_state_terms(self, terms: Vec<TorqueTerm>, values: Vec<f64>) -> Result<Self, ExportError> {
        check_terms(&terms, &values)?;
        let checked = ParametricModel::new(self.model.clone(), terms)?;
        let state_terms = checked.terms().iter().cloned().zip(values).collect();
        Ok(Self { state_terms, ..self })
    }

    /// Returns a copy with another width of the smoothed functions that replace `sign(velocity)` in friction terms,
    /// rad/s (m/s). Unsmoothed sign functions, and smoothed ones with a width up to [`TermClass::CODE_STEP_WIDTH`],
    /// get the width `width`. Wider functions are widened to `width` if they are narrower than `width`. The values of
    /// the terms do not change.
    ///
    /// # Errors
    /// A width that is not a positive finite number.
    pub fn with_step_width(&self, width: f64) -> Result<Self, ExportError> {
        if !(width.is_finite() && width > 0.0) {
            return Err(ExportError::StepWidth { width });
        }
        let usual = |term: &TorqueTerm| {
            // The width that an unsmoothed sign function gets.
            let sign = term.clone().with_step(|_| CoulombShape::Sign { dead_band: 0.0 });
            let least = TermClass::FunctionsOfMotion.in_form(&self.model, &sign).step_width().unwrap_or(0.0);
            let is_narrow = term.step_width().is_some_and(|own| own <= least);
            term.clone().with_step(|step| match step {
                CoulombShape::Smooth { width: own } if !is_narrow => CoulombShape::Smooth { width: own.max(width) },
                CoulombShape::Smooth { .. } | CoulombShape::Sign { .. } => CoulombShape::Smooth { width },
            })
        };
        let terms = self.terms.iter().map(usual).collect();
        let state_terms = self.state_terms.iter().map(|(term, value)| (usual(term), *value)).collect();
        Ok(Self { terms, state_terms, ..self.clone() })
    }

    /// Torque terms of the function with state; empty if no term has hysteresis.
    pub(crate) fn state_terms(&self) -> &[(TorqueTerm, f64)] {
        if self.state_terms.iter().any(|(term, _)| term.has_memory()) { &self.state_terms } else { &[] }
    }

    /// The robot whose rigid-body torque is the transmitted torque of load-dependent friction; `None` without such
    /// friction.
    pub(crate) fn load_model(&self) -> Result<Option<Model>, ExportError> {
        let mut terms = self.terms.iter().chain(self.state_terms.iter().map(|(term, _)| term));
        if !terms.any(TorqueTerm::needs_load) {
            return Ok(None);
        }
        match &self.load {
            Some(bodies) => Ok(Some(with_exact_right_angles(&self.model)?.with_inertials(bodies)?)),
            None => self.reduced().map(Some),
        }
    }

    /// Sets the recorded velocities of each joint (empty if unknown), over which friction is fitted to the laws of
    /// simulators.
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
    pub fn terms(&self) -> impl Iterator<Item = (&TorqueTerm, f64)> + Clone {
        self.terms.iter().zip(self.values.iter().copied())
    }

    /// Name of the robot as an identifier in any language: letters, digits and `_`, not starting with a digit.
    pub fn identifier(&self) -> String {
        dynident_text::identifier(self.model.name())
    }

    /// An equivalent robot with fewer numbers: base parameters in the positions of their columns, all other inertial
    /// parameters zero, and exact right angles.
    ///
    /// Its bodies are not physically consistent. But its `M(q)`, `C(q, q̇) q̇` and `g(q)` are those of the robot,
    /// because `Y π = Y_b θ` for every motion (regressor Y of all parameters π, Y_b of the base parameters θ).
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

fn check_terms(terms: &[TorqueTerm], values: &[f64]) -> Result<(), ExportError> {
    if values.len() != terms.len() {
        return Err(ExportError::Values { expected: terms.len(), found: values.len() });
    }
    match terms.iter().zip(values).find(|(_, value)| !value.is_finite()) {
        Some((term, &value)) => Err(ExportError::NotFinite { symbol: term.symbol(), value }),
        None => Ok(()),
    }
}

/// Checks that a body's parameters, and the numbers derived from them in robot descriptions, are within the magnitude
/// limit.
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

pub(crate) fn with_exact_right_angles(model: &Model) -> Result<Model, ExportError> {
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
