//! A parametric model with what its regressor needs beside the motion.

use dynident_dynamics::{BaseParameters, Column, PanelLayout, ParametricModel};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;

/// A parametric model, and what estimates have added to it: the load behind load-dependent friction, the gains of
/// logged torque.
#[derive(Clone, Debug)]
pub struct RegressorModel {
    /// Model, torque terms, base parameters, layout.
    pub parametric: ParametricModel,
    /// For load-dependent friction: the bodies by an earlier estimate, one value per column of the layout. Without it
    /// such friction has a column of zeros.
    pub load_parameters: Option<Vec<f64>>,
    /// What logged torque is multiplied by, joint by joint, where gains were found and not stated; empty otherwise.
    pub torque_gains: Vec<f64>,
}

impl From<ParametricModel> for RegressorModel {
    fn from(parametric: ParametricModel) -> Self {
        Self { parametric, load_parameters: None, torque_gains: Vec::new() }
    }
}

impl RegressorModel {
    /// Links, joints and gravity.
    pub fn model(&self) -> &Model {
        self.parametric.model()
    }

    /// Torque terms beside the rigid bodies.
    pub fn terms(&self) -> &[TorqueTerm] {
        self.parametric.terms()
    }

    /// Base parameters of bodies and terms.
    pub fn base(&self) -> &BaseParameters {
        self.parametric.base()
    }

    /// Regressor blocks of the joints.
    pub fn layout(&self) -> &PanelLayout {
        self.parametric.layout()
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.parametric.dof()
    }

    /// Names of the joints, base to tip.
    pub fn joint_names(&self) -> Vec<String> {
        self.parametric.joint_names()
    }

    /// The same with further terms behind its base columns, dependent or not: for choosing among them from one set of
    /// factors.
    #[must_use]
    pub fn with_further_columns(&self, further: impl IntoIterator<Item = TorqueTerm>) -> Self {
        let mut wide = self.clone();
        wide.parametric = self.parametric.with_further_columns(further);
        let columns = wide.layout().columns().len();
        if let Some(parameters) = &mut wide.load_parameters {
            parameters.resize(columns, 0.0);
        }
        wide
    }

    /// The same with the bodies of an estimate of `other`, where load-dependent friction needs them.
    #[must_use]
    pub fn with_load_of(mut self, other: &Self, values: &[f64]) -> Self {
        if self.needs_load() {
            let known = other.layout().columns();
            let value = |column: &Column| known.iter().position(|c| c == column).map_or(0.0, |place| values[place]);
            self.load_parameters = Some(self.layout().columns().iter().map(value).collect());
        }
        self
    }

    /// Whether some friction depends on the joint's load.
    pub fn needs_load(&self) -> bool {
        self.layout().columns().iter().any(|column| matches!(column, Column::Term(term) if term.needs_load()))
    }

    /// The first joint whose friction depends on its temperature.
    pub fn joint_that_needs_temperature(&self) -> Option<usize> {
        let needing = self.layout().columns().iter().filter_map(|column| match column {
            Column::Term(term) if term.needs_temperature() => term.joints().first().copied(),
            _ => None,
        });
        needing.min()
    }
}
