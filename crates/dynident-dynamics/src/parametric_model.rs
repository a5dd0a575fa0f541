//! A robot as a function of its parameters.

use crate::base_parameters::{BaseParameterSettings, BaseParameters, DeclaredFault, fault};
use crate::regressor_panels::{Column, PanelLayout};
use dynident_model::terms::{Coupling, Declared, TorqueTerm};
use dynident_model::{INERTIAL_NAMES, Model};
use thiserror::Error;

/// Errors of [`ParametricModel`].
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ParametricModelError {
    /// A program added a torque term for a joint number that the robot does not have. Joint numbers start at 0.
    #[error("torque term {term}: the joint does not exist (the model has {joints} joints)")]
    NoSuchJoint {
        /// Symbol of the term.
        term: String,
        /// Number of joints of the robot.
        joints: usize,
    },
    /// A coupling of joints has a ratio that is zero, too small or too large. Check the ratio and its units.
    #[error("coupling {term}: ratio {ratio} is out of range: use magnitudes from 1e-6 to 1e6")]
    Ratio {
        /// Symbol of the term.
        term: String,
        /// The ratio.
        ratio: f64,
    },
    /// The expression of a `[[torque]]` uses a joint number that the robot does not have. Correct the number.
    #[error("torque {term}: joint number {joint} does not exist (the model has {joints} joints)")]
    FollowsNoJoint {
        /// Symbol of the term.
        term: String,
        /// Number of the joint, from 1.
        joint: usize,
        /// Number of joints of the robot.
        joints: usize,
    },
    /// The expression or function of a `[[torque]]` has no value at a position and velocity that the joint limits
    /// permit, for example a logarithm of a negative number.
    #[error(
        "torque {term} = {law}: no value at {at}, which is inside the joints' limits: keep the arguments of roots, logarithms and divisions valid, for example with max(.., 0), or narrow the limits"
    )]
    Undefined {
        /// Symbol of the term.
        term: String,
        /// Expression of the torque.
        law: String,
        /// Positions and velocities at which the expression has no value.
        at: String,
    },
    /// The expression of a `[[torque]]` is zero at all positions and velocities within the joint limits, so that its
    /// coefficient cannot be identified.
    #[error("torque {term} = {law}: this torque is zero (below 1e-9) within the joint limits: remove its [[torque]]")]
    Nothing {
        /// Symbol of the term.
        term: String,
        /// Expression of the torque.
        law: String,
    },
    /// The `name` of a `[[torque]]` has an invalid character, is too long, or is the name of another parameter. Rename
    /// it.
    #[error(
        "torque {term}: the name is invalid, or the symbol of another parameter: use a unique name of a letter and up to 59 letters, digits and `_`"
    )]
    Symbol {
        /// The name.
        term: String,
    },
    /// A program passed a list of nominal parameters of the wrong length. Pass one value for each parameter.
    #[error("wrong number of nominal parameters: expected {expected}, found {found}")]
    NominalLength {
        /// Expected number of parameters: ten per body and one per term.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// A nominal parameter is NaN or infinite. Correct it in the robot description, or in `nominal` of the
    /// `[[torque]]`.
    #[error("nominal parameter {value} is not finite: use finite numbers")]
    NominalNotFinite {
        /// The value.
        value: f64,
    },
}

/// A model with its torque terms (friction, drives, offsets), base parameters, regressor layout, and nominal values of
/// all parameters.
///
/// The torque is linear in the parameters, `τ = Y(q, q̇, q̈) π = W(q, q̇, q̈) θ`. π contains ten inertial parameters
/// per body (base to tip) and one value per term. `θ = B π` are the base parameters ([`BaseParameters`]), and Y and W
/// the regressors of π and θ. Create it once per robot, and take regressor rows, nominal values and symbols from it.
///
/// ```
/// use dynident_dynamics::ParametricModel;
/// use dynident_model::terms::{DriveChoice, terms_per_joint};
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
/// #   <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// #   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// let model = dynident_model::read_urdf(text)?.model;
/// let friction = terms_per_joint(&model, |_| DriveChoice { viscous: true, ..DriveChoice::default() });
/// let pendulum = ParametricModel::new(model, friction)?;
/// assert_eq!(pendulum.base().expressions(), ["mx1", "mz1", "Iyy1", "fv1"]);
/// // The first moment of the rod: 2 kg, half a metre below its hinge.
/// assert_eq!(pendulum.nominal_base().unwrap()[1], -1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[doc(alias("robot", "nominal model", "machine"))]
#[derive(Clone, Debug)]
pub struct ParametricModel {
    model: Model,
    terms: Vec<TorqueTerm>,
    base: BaseParameters,
    layout: PanelLayout,
    nominal: Vec<f64>,
    nominal_base: Option<Vec<f64>>,
}

impl ParametricModel {
    /// Creates the parametric model of a robot. Nominal values come from the robot description: inertial parameters,
    /// viscous and Coulomb friction if given, zero for all other terms.
    ///
    /// # Errors
    /// A term of a joint that does not exist; a declared torque whose name is in use, that is zero everywhere or
    /// undefined within the joint limits.
    pub fn new(model: Model, terms: Vec<TorqueTerm>) -> Result<Self, ParametricModelError> {
        if let Some(term) = terms.iter().find(|term| term.joints().iter().any(|&joint| joint >= model.dof())) {
            return Err(ParametricModelError::NoSuchJoint { term: term.symbol(), joints: model.dof() });
        }
        for term in &terms {
            if let TorqueTerm::Coupling(coupling) = term
                && let Some(&ratio) = coupling.ratios.iter().find(|ratio| !Coupling::RATIOS.contains(&ratio.abs()))
            {
                return Err(ParametricModelError::Ratio { term: term.symbol(), ratio });
            }
        }
        check_declared(&model, &terms)?;
        let base = BaseParameters::new(&model, &terms, &BaseParameterSettings::default());
        let layout = PanelLayout::new(&model, base.base_columns());
        let nominal = described(&model, &terms);
        let nominal_base = model.bodies_without_prior().is_empty().then(|| base.values(&nominal));
        Ok(Self { model, terms, base, layout, nominal, nominal_base })
    }

    /// Replaces the nominal values: ten per body, then one per term.
    ///
    /// # Errors
    /// Wrong number of values, or values that are not finite.
    pub fn with_nominal(mut self, nominal: Vec<f64>) -> Result<Self, ParametricModelError> {
        let expected = 10 * self.model.body_count() + self.terms.len();
        if nominal.len() != expected {
            return Err(ParametricModelError::NominalLength { expected, found: nominal.len() });
        }
        if let Some(&value) = nominal.iter().find(|value| !value.is_finite()) {
            return Err(ParametricModelError::NominalNotFinite { value });
        }
        self.nominal_base = Some(self.base.values(&nominal));
        self.nominal = nominal;
        Ok(self)
    }

    /// The same robot with other torque terms. Nominal values of bodies and remaining terms are kept; nominal values
    /// of new terms come from the robot description.
    ///
    /// # Errors
    /// Same as for [`new`](Self::new).
    pub fn with_terms(&self, terms: Vec<TorqueTerm>) -> Result<Self, ParametricModelError> {
        let mut other = Self::new(self.model.clone(), terms)?;
        let bodies = 10 * self.model.body_count();
        other.nominal[..bodies].copy_from_slice(&self.nominal[..bodies]);
        for (place, term) in other.terms.iter().enumerate() {
            if let Some(known) = self.terms.iter().position(|kept| kept == term) {
                other.nominal[bodies + place] = self.nominal[bodies + known];
            }
        }
        other.nominal_base = self.nominal_base.as_ref().map(|_| other.base.values(&other.nominal));
        Ok(other)
    }

    /// Adds terms after the base columns of the layout, even if they depend on these columns, so that one set of rows
    /// is sufficient for selecting terms. Base parameters and terms do not change.
    #[must_use]
    pub fn with_further_columns(&self, further: impl IntoIterator<Item = TorqueTerm>) -> Self {
        let mut columns = self.base.base_columns();
        columns.extend(further.into_iter().map(Column::Term));
        let mut wide = self.clone();
        if let Some(values) = &mut wide.nominal_base {
            values.resize(columns.len(), 0.0);
        }
        wide.layout = PanelLayout::new(&self.model, columns);
        wide
    }

    /// Links, joints and gravity.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Torque terms in addition to the rigid bodies, in the order of their parameters.
    pub fn terms(&self) -> &[TorqueTerm] {
        &self.terms
    }

    /// Base parameters of bodies and terms.
    pub fn base(&self) -> &BaseParameters {
        &self.base
    }

    /// Regressor blocks of the joints, for the base columns.
    pub fn layout(&self) -> &PanelLayout {
        &self.layout
    }

    /// Nominal values of all parameters: ten per body (zeros if the robot description has none), then one per term.
    pub fn nominal(&self) -> &[f64] {
        &self.nominal
    }

    /// Nominal values of the layout's columns; `None` if the inertial parameters of a moving body are unknown.
    pub fn nominal_base(&self) -> Option<&[f64]> {
        self.nominal_base.as_deref()
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.model.dof()
    }

    /// Names of the joints, base to tip.
    pub fn joint_names(&self) -> Vec<String> {
        self.model.joints().iter().map(|joint| joint.name.clone()).collect()
    }
}

/// Checks that declared torques have unique names and values within the joint limits.
fn check_declared(model: &Model, terms: &[TorqueTerm]) -> Result<(), ParametricModelError> {
    for (place, term) in terms.iter().enumerate() {
        let TorqueTerm::Declared(declared) = term else { continue };
        let symbol = || declared.name.clone();
        let of_bodies = (0..model.body_count())
            .any(|body| INERTIAL_NAMES.iter().any(|name| declared.name == format!("{name}{}", body + 1)));
        let of_terms = terms.iter().enumerate().any(|(other, one)| other != place && one.symbol() == declared.name);
        if !Declared::is_symbol(&declared.name) || of_bodies || of_terms {
            return Err(ParametricModelError::Symbol { term: symbol() });
        }
        let Some(function) = term.state_function() else { continue };
        if let Some(joint) = function.follows().into_iter().find(|&joint| joint >= model.dof()) {
            let (joint, joints) = (joint + 1, model.dof());
            return Err(ParametricModelError::FollowsNoJoint { term: symbol(), joint, joints });
        }
        if let Some(value) = declared.nominal.filter(|value| !value.is_finite()) {
            return Err(ParametricModelError::NominalNotFinite { value });
        }
        let law = function.description();
        match fault(model, term) {
            None => {}
            Some(DeclaredFault::Nothing) => return Err(ParametricModelError::Nothing { term: symbol(), law }),
            Some(DeclaredFault::Undefined(states)) => {
                let at = states.iter().map(|(joint, q, dq)| format!("q{0} = {q:.4}, dq{0} = {dq:.4}", joint + 1));
                let at = at.collect::<Vec<_>>().join(", ");
                return Err(ParametricModelError::Undefined { term: symbol(), law, at });
            }
        }
    }
    Ok(())
}

/// All parameters from the robot description: inertials, damping and friction.
fn described(model: &Model, terms: &[TorqueTerm]) -> Vec<f64> {
    let mut parameters = model.parameter_vector();
    parameters.extend(terms.iter().map(|term| term.described(model).unwrap_or(0.0)));
    parameters
}
