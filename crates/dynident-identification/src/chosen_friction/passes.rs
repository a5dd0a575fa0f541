//! Common parts of the passes that select friction: models with additional columns, and their rows.

use crate::error::IdentificationError;
use crate::estimators::EstimationSettings;
use crate::friction::{JointFriction, chosen_model};
use crate::payload::with_free_gains;
use crate::settings::IdentificationSettings;
use crate::training::{LogFactors, TrainingPasses};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::{CovarianceMethod, LinearProblem};
use dynident_model::terms::TorqueTerm;
use dynident_rows::RegressorModel;

pub(crate) fn without_bars(settings: &IdentificationSettings) -> EstimationSettings {
    EstimationSettings { covariance: CovarianceMethod::White, ..settings.estimation.clone() }
}

/// Adds the terms that the model does not have as columns.
pub(crate) fn with_terms(model: &RegressorModel, terms: impl Iterator<Item = TorqueTerm>) -> RegressorModel {
    let known = model.layout().columns();
    let mut further: Vec<TorqueTerm> = Vec::new();
    for term in terms {
        if !known.contains(&Column::Term(term.clone())) && !further.contains(&term) {
            further.push(term);
        }
    }
    model.with_further_columns(further)
}

/// The robot with the selected friction, and with the torque gains and the load from a fit of the previous model.
pub(crate) fn with_friction_of(
    robot: &ParametricModel,
    joints: &[JointFriction],
    before: &RegressorModel,
    values: &[f64],
) -> Result<RegressorModel, IdentificationError> {
    let torque_gains = before.torque_gains.clone();
    let next = RegressorModel { torque_gains, ..RegressorModel::from(chosen_model(robot, joints)?) };
    Ok(next.with_load_of_estimate(before, values))
}

impl TrainingPasses<'_> {
    /// Rows of the model `wide` in which the torque gains of the joints `free` are unknowns that may deviate from their
    /// last values. `fitted` are values for the columns of `model`, followed by the additional columns of single logs.
    pub(crate) fn free_problem(
        &self,
        wide: &RegressorModel,
        factors: &[LogFactors],
        model: &RegressorModel,
        fitted: &[f64],
        free: &[usize],
    ) -> Result<LinearProblem, IdentificationError> {
        let columns = self.columns(wide)?;
        let problem = self.stated_problem(wide, &columns, factors)?;
        let (base, wide_base) = (model.layout().columns().len(), wide.layout().columns().len());
        let mut values = fitted[..base].to_vec();
        values.resize(wide_base, 0.0);
        values.extend_from_slice(&fitted[base..]);
        let known: Vec<Vec<f64>> = self.training.iter().map(|&log| columns.known(log)).collect();
        Ok(with_free_gains(problem, free, &known, &values)?)
    }
}
