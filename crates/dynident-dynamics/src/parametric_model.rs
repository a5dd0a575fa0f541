//! The one noun of identification: a robot as a function of its parameters.

use crate::base_parameters::{BaseParameterSettings, BaseParameters, DeclaredFault, fault};
use crate::regressor_panels::{Column, PanelLayout};
use dynident_model::terms::{Coupling, Declared, TorqueTerm};
use dynident_model::{INERTIAL_NAMES, Model};
use thiserror::Error;

/// Why a parametric model could not be put together.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ParametricModelError {
    /// A torque term of a joint that is not there.
    #[error("torque term {term} acts on a joint that the model of {joints} joints does not have")]
    NoSuchJoint {
        /// The term's symbol.
        term: String,
        /// Joints of the model.
        joints: usize,
    },
    /// A coupling whose ratios no drive has, so that their product could leave the range of numbers.
    #[error("coupling {term}: ratio {ratio}: give ratios of 1e-6 to 1e6 in size")]
    Ratio {
        /// The term's symbol.
        term: String,
        /// The ratio.
        ratio: f64,
    },
    /// A declared torque of an expression that follows joints which the model does not have.
    #[error("torque {term} follows joint number {joint}, and the model has {joints}")]
    FollowsNoJoint {
        /// The term's symbol.
        term: String,
        /// The joint's number, from 1.
        joint: usize,
        /// Joints of the model.
        joints: usize,
    },
    /// A declared torque without a value inside the joints' limits.
    #[error(
        "torque {term} = {law}: no value at {at}, which is inside the joints' limits: keep roots, logarithms and divisions from what they do not take with max(.., 0) or the like, or narrow the limits"
    )]
    Undefined {
        /// The term's symbol.
        term: String,
        /// What it follows.
        law: String,
        /// Positions and velocities.
        at: String,
    },
    /// A declared torque that is no torque.
    #[error("torque {term} = {law}: it is zero (below 1e-9) wherever the joints may go: leave it out")]
    Nothing {
        /// The term's symbol.
        term: String,
        /// What it follows.
        law: String,
    },
    /// A declared torque with a name that is none, or that another parameter has.
    #[error(
        "torque {term}: the name stands among the parameters' symbols: give it one of its own, a letter and then letters, digits and `_`, at most 60"
    )]
    Symbol {
        /// The name.
        term: String,
    },
    /// Nominal values of another number than there are parameters.
    #[error("parameters of the prior: {found} entries where {expected} are needed")]
    NominalLength {
        /// Ten for each body and one for each term.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A nominal value that is no number.
    #[error("prior = {value}: give finite numbers")]
    NominalNotFinite {
        /// The value.
        value: f64,
    },
}

/// A model with torque terms beside its rigid bodies (friction, drives, offsets), its base parameters, the layout of
/// its regressor, and the nominal values of all parameters.
///
/// The torque is linear in the parameters, `τ = Y(q, q̇, q̈) π = W(q, q̇, q̈) θ`, with `π` ten inertial parameters for
/// each body (base to tip) and one value for each term, and `θ = B π` the base parameters ([`BaseParameters`]). Made
/// once for a robot and used by everything that needs rows, values or symbols.
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
/// // The first moment of the rod, 2 kg half a metre below its hinge.
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
    /// The parametric model of a robot. Nominal values are those of its description: inertial parameters, viscous and
    /// Coulomb friction where it has them, zero for all other terms.
    ///
    /// # Errors
    /// A term of a joint that the model does not have; a declared torque whose name is taken, that is zero everywhere,
    /// or that has no value inside the joints' limits.
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

    /// The same with other nominal values: ten for each body, then one for each term.
    ///
    /// # Errors
    /// Another number of values than there are parameters, or values that are not finite.
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

    /// The same robot with other torque terms. Nominal values of bodies and of terms that stay are kept; those of new
    /// terms are the description's.
    ///
    /// # Errors
    /// As [`new`](Self::new).
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

    /// The same with further terms behind the base columns of the layout, whether they depend on these or not: one set
    /// of rows for choosing among them. Base parameters and terms stay as they are.
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

    /// Torque terms beside the rigid bodies, in the order of their parameters.
    pub fn terms(&self) -> &[TorqueTerm] {
        &self.terms
    }

    /// Base parameters of bodies and terms.
    pub fn base(&self) -> &BaseParameters {
        &self.base
    }

    /// Regressor blocks of the joints, of the base columns.
    pub fn layout(&self) -> &PanelLayout {
        &self.layout
    }

    /// Nominal values of all parameters: ten for each body (zeros where the description has none), then one for each
    /// term.
    pub fn nominal(&self) -> &[f64] {
        &self.nominal
    }

    /// Nominal values of the layout's columns; `None` while a moving body's inertial parameters are unknown.
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

/// That declared torques have names of their own, and values wherever the joints may go.
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

/// All parameters by the description: inertials, and what it says of damping and friction.
fn described(model: &Model, terms: &[TorqueTerm]) -> Vec<f64> {
    let mut parameters = model.parameter_vector();
    parameters.extend(terms.iter().map(|term| term.described(model).unwrap_or(0.0)));
    parameters
}
