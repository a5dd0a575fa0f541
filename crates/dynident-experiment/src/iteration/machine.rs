//! The machine whose parameters an iteration looks for.

use crate::error::{ExperimentError, require, require_length};
use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
use dynident_model::Model;
use dynident_model::laws::{Coulomb, Law};

/// Links, laws and base parameters; and a prior of all parameters, which a physically consistent fit falls back to where the data say nothing.
#[derive(Clone, Debug)]
pub struct IteratedMachine {
    model: Model,
    laws: Vec<Law>,
    base: BaseParameters,
    layout: PanelLayout,
    prior: Vec<f64>,
}

impl IteratedMachine {
    /// The machine of a model and laws. `prior` has ten parameters for each body and one for each law; without it, what the description says.
    ///
    /// # Errors
    /// A prior of another length, or with numbers that are not finite; laws of joints that do not exist.
    pub fn new(model: &Model, laws: &[Law], prior: Option<Vec<f64>>) -> Result<Self, ExperimentError> {
        for law in laws {
            if law.joints().iter().any(|&joint| joint >= model.dof()) {
                return Err(ExperimentError::LawJoint { law: law.symbol(), joints: model.dof() });
            }
        }
        let prior = prior.unwrap_or_else(|| described(model, laws));
        require_length("parameters of the prior", 10 * model.dof() + laws.len(), prior.len())?;
        for &value in &prior {
            require(value.is_finite(), "prior", value, "give finite numbers")?;
        }
        let base = BaseParameters::new(model, laws, &BaseParameterSettings::default());
        let layout = PanelLayout::new(model, base.base_columns());
        Ok(Self { model: model.clone(), laws: laws.to_vec(), base, layout, prior })
    }

    /// The links.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The laws.
    pub fn laws(&self) -> &[Law] {
        &self.laws
    }

    /// Base parameters of bodies and laws.
    pub fn base(&self) -> &BaseParameters {
        &self.base
    }

    /// Panels of the base columns.
    pub fn layout(&self) -> &PanelLayout {
        &self.layout
    }

    /// The prior of all parameters.
    pub fn prior(&self) -> &[f64] {
        &self.prior
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.model.dof()
    }
}

/// Inertials of the description, with its damping and friction.
fn described(model: &Model, laws: &[Law]) -> Vec<f64> {
    let mut parameters = model.parameter_vector();
    parameters.extend(laws.iter().map(|law| match law {
        Law::Viscous(law) => model.joints()[law.joint].damping.unwrap_or(0.0),
        Law::Coulomb(Coulomb { joint, .. }) => model.joints()[*joint].friction.unwrap_or(0.0),
        _ => 0.0,
    }));
    parameters
}
