//! The friction of the joints as their recordings choose it: which terms, then their constants.

use crate::error::IdentificationError;
use crate::estimators::{EstimationSettings, Estimator};
use crate::friction::{
    FrictionSearch, JointFriction, Neighbourhood, candidate_columns, choose_friction as choose_terms, chosen_model,
    refined,
};
use crate::logs::Logs;
use crate::payload::{Payload, free_gains, with_free_gains};
use crate::regressor_model::RegressorModel;
use crate::settings::IdentificationSettings;
use crate::training::{LogFactors, Training, TrainingPasses, plain_estimate};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::{CovarianceMethod, Estimate, LinearProblem};
use dynident_model::terms::TorqueTerm;

/// Factors by which constants are moved around what was found before, one for each pass: half a step of the grid, then
/// closer.
const REFINEMENTS: [f64; 3] = [1.4, 1.15, 1.05];

/// A model with the friction that its recordings chose.
#[derive(Clone, Debug)]
pub struct ChosenFriction {
    /// The model, with the load where friction depends on it.
    pub model: RegressorModel,
    /// How each joint's was chosen; empty where none was to be.
    pub joints: Vec<JointFriction>,
    /// The rows and the fit with the terms as stated, of which the choice began; none where none was to be.
    pub stated: Option<(Training, Estimate)>,
}

/// Chooses the friction of the joints that `settings.friction` names, by cross-validation inside the recordings
/// `training`: first among terms whose columns stand in one set of factors, for a grid of constants; then in further
/// passes the constants between the grid's points. Filters are those of `logs`.
///
/// # Errors
/// Recordings that cannot be read, rows that do not carry an estimate.
pub fn choose_friction(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let stated = RegressorModel::from(robot.clone());
    // The load would be the bare arm's.
    let loaded = logs.recordings.iter().any(|recording| recording.payload.is_some());
    let of_joint = |search: &FrictionSearch, joint: usize| {
        let mut columns = candidate_columns(search, joint);
        columns.retain(|column| !(loaded && column.term.needs_load()));
        columns
    };
    let candidates: Vec<_> = settings
        .friction
        .iter()
        .filter_map(|search| Some((stated.model().joint_index(&search.joint)?, search)))
        .map(|(joint, search)| (joint, of_joint(search, joint)))
        .collect();
    if candidates.is_empty() {
        return Ok(ChosenFriction { model: stated, joints: Vec::new(), stated: None });
    }
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    let equal_weights = matches!(settings.estimation.estimator, Estimator::Ordinary);
    // No error bars are wanted on the way.
    let estimation = EstimationSettings { covariance: CovarianceMethod::White, ..settings.estimation.clone() };

    // The stated terms first: the load, the noise of every joint, what is excited; with gains that nobody knows the
    // torque in newton metres.
    let first = passes.with_gains(passes.rows_once(stated)?)?;
    let plain = match &first.gains {
        Some((with_gains, _)) => with_gains.clone(),
        None => plain_estimate(&estimation, &first.problem)?,
    };
    let gains = first.gains.as_ref().map_or_else(Vec::new, |(_, gains)| free_gains(gains));

    // All candidates as columns of one set of factors, from which each candidate model is a selection.
    let further = candidates.iter().flat_map(|(_, columns)| columns).map(|column| column.term.clone());
    let wide = with_terms(&first.model, further).with_load_of(&first.model, &plain.values);
    let wide_problem = passes.free_problem(&wide, &passes.read(&wide)?, (&first.model, &plain, &gains))?;
    let mut joints = choose_terms(&first.model, &wide, &wide_problem, &candidates, (&plain, equal_weights))?;
    let in_newton_metres =
        |model: RegressorModel| RegressorModel { torque_gains: first.model.torque_gains.clone(), ..model };
    let mut model = in_newton_metres(chosen_model(robot, &joints)?.into()).with_load_of(&first.model, &plain.values);

    // Their constants, and the load with them.
    for ratio in REFINEMENTS {
        let around = |joint: &JointFriction| {
            let own = Neighbourhood::new(joint.terms.clone()?, ratio);
            Some((model.model().joint_index(&joint.joint)?, own))
        };
        let around: Vec<(usize, Neighbourhood)> = joints.iter().filter_map(around).collect();
        if !(model.needs_load() || around.iter().any(|(_, own)| own.has_constants())) {
            break;
        }
        let wide = with_terms(&model, around.iter().flat_map(|(_, own)| own.terms()));
        let factors = passes.read(&wide)?;
        let own = factors.iter().map(|log| log.clone().of(&wide, &model)).collect::<Result<Vec<_>, _>>()?;
        let problem = passes.stated_problem(&model, &passes.columns(&model)?, &own)?;
        let fit = plain_estimate(&estimation, &problem)?;
        let wide_problem = passes.free_problem(&wide, &factors, (&model, &fit, &gains))?;
        let better = refined((&model, &fit, equal_weights), (&wide, &wide_problem), &around)?;
        for ((joint, _), terms) in around.iter().zip(better) {
            let name = &model.model().joints()[*joint].name;
            joints.iter_mut().filter(|one| one.joint == *name).for_each(|one| one.terms = Some(terms.clone()));
        }
        model = in_newton_metres(chosen_model(robot, &joints)?.into()).with_load_of(&model, &fit.values);
    }
    // What follows finds the gains with the friction that was chosen.
    model.torque_gains.clear();
    Ok(ChosenFriction { model, joints, stated: Some((first, plain)) })
}

impl TrainingPasses<'_> {
    /// The rows of `wide`, with the `free` gains of some joints as unknowns about `fit`, whose columns are those of
    /// `model` and what logs add to them.
    fn free_problem(
        &self,
        wide: &RegressorModel,
        factors: &[LogFactors],
        (model, fit, free): (&RegressorModel, &Estimate, &[usize]),
    ) -> Result<LinearProblem, IdentificationError> {
        let columns = self.columns(wide)?;
        let problem = self.stated_problem(wide, &columns, factors)?;
        let (base, wide_base) = (model.layout().columns().len(), wide.layout().columns().len());
        let mut values = fit.values[..base].to_vec();
        values.resize(wide_base, 0.0);
        values.extend_from_slice(&fit.values[base..]);
        let known: Vec<Vec<f64>> = self.training.iter().map(|&log| columns.known(log)).collect();
        Ok(with_free_gains(problem, free, (&known, &values))?)
    }
}

/// The model with those of these terms as columns that it does not have.
fn with_terms(model: &RegressorModel, terms: impl Iterator<Item = TorqueTerm>) -> RegressorModel {
    let known = model.layout().columns();
    let mut further: Vec<TorqueTerm> = Vec::new();
    for term in terms {
        if !known.contains(&Column::Term(term.clone())) && !further.contains(&term) {
            further.push(term);
        }
    }
    model.with_further_columns(further)
}
