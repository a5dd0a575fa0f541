//! The friction of the joints as their recordings choose it: which terms, then their constants.

use crate::error::IdentificationError;
use crate::estimators::{EstimationSettings, Estimator};
use crate::friction::{
    CandidateColumn, ConstantsError, ConstantsStep, FrictionConstants, FrictionSearch, JointFriction, JointScale,
    candidate_columns, choose_friction as choose_terms, chosen_model, step_columns,
};
use crate::likelihood::deviance;
use crate::logs::Logs;
use crate::payload::{Payload, free_gains, with_free_gains};
use crate::regressor_model::RegressorModel;
use crate::settings::IdentificationSettings;
use crate::training::{LogFactors, Training, TrainingPasses, plain_estimate};
use dynident_dynamics::{Column, ParametricModel};
use dynident_estimation::{CovarianceMethod, Estimate, LinearProblem};
use dynident_model::terms::{Coulomb, CoulombShape, TorqueTerm};

/// Passes over the recordings for the constants of chosen friction, at most.
const MOST_PASSES: usize = 8;
/// Passes after which terms that are not seen are dropped although constants still move.
const DROP_PASSES: usize = 3;
/// Passes at least where friction depends on the load, which is the fit's before.
const LOAD_PASSES: usize = 3;

/// A model with the friction that its recordings chose.
#[derive(Clone, Debug)]
pub struct ChosenFriction {
    /// The model, with the load where friction depends on it.
    pub model: RegressorModel,
    /// How each joint's was chosen; empty where none was to be.
    pub joints: Vec<JointFriction>,
    /// The rows and the fit with the terms as stated, of which the choice began; none where none was to be.
    pub stated: Option<(Training, Estimate)>,
    /// What the error of the chosen constants adds to the bars of all parameters; none where none was chosen.
    pub(crate) constants_error: Option<ConstantsError>,
}

impl ChosenFriction {
    /// A model whose friction is all stated.
    pub(crate) fn as_stated(model: RegressorModel) -> Self {
        Self { model, joints: Vec::new(), stated: None, constants_error: None }
    }
}

/// The constants of a pass, the step from there, and what the fit left before it.
struct LastPass {
    constants: FrictionConstants,
    steps: Vec<f64>,
    misfit: f64,
}

/// Chooses the friction of the joints that `settings.friction` names, by cross-validation inside the recordings
/// `training`: first among terms whose columns stand in one set of factors, for a grid of constants; then in further
/// passes the constants between the grid's points, together with all parameters. Filters are those of `logs`.
///
/// # Errors
/// Recordings that cannot be read, rows that do not carry an estimate.
pub fn choose_friction(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    friction_of_logs((logs, logs), settings, robot, (training, payloads))
}

/// The same with other filters for the constants: terms from the rows of `logs`, constants from those of
/// `of_constants`. Where the first are too few to choose from, terms come from the second as well.
pub(crate) fn friction_of_logs(
    (logs, of_constants): (&Logs<'_>, &Logs<'_>),
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let found = friction_by_terms((logs, of_constants), settings, robot, (training, payloads))?;
    let is_nothing = |one: &JointFriction| one.terms.is_none();
    if core::ptr::eq(logs, of_constants) || found.joints.is_empty() || !found.joints.iter().all(is_nothing) {
        return Ok(found);
    }
    friction_by_terms((of_constants, of_constants), settings, robot, (training, payloads))
}

fn friction_by_terms(
    (logs, of_constants): (&Logs<'_>, &Logs<'_>),
    settings: &IdentificationSettings,
    robot: &ParametricModel,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let stated = RegressorModel::from(robot.clone());
    let searches: Vec<(usize, &FrictionSearch)> = settings
        .friction
        .iter()
        .filter_map(|search| Some((stated.model().joint_index(&search.joint)?, search)))
        .collect();
    if searches.is_empty() {
        return Ok(ChosenFriction::as_stated(stated));
    }
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    let equal_weights = matches!(settings.estimation.estimator, Estimator::Ordinary);

    // The stated terms first: the load, the noise of every joint, what is excited; with gains that nobody knows the
    // torque in newton metres.
    let first = passes.with_gains(passes.rows_once(stated)?)?;
    let plain = match &first.gains {
        Some((with_gains, _)) => with_gains.clone(),
        None => plain_estimate(&without_bars(settings), &first.problem)?,
    };
    let gains = first.gains.as_ref().map_or_else(Vec::new, |(_, gains)| free_gains(gains));

    // All candidates as columns of one set of factors, from which each candidate model is a selection.
    let chosen_among = |candidates: &[(usize, Vec<CandidateColumn>)]| -> Result<_, IdentificationError> {
        let further = candidates.iter().flat_map(|(_, columns)| columns).map(|column| column.term.clone());
        let wide = with_terms(&first.model, further).with_load_of(&first.model, &plain.values);
        let wide_problem = passes.free_problem(&wide, &passes.read(&wide)?, (&first.model, &plain, &gains))?;
        Ok(choose_terms(&first.model, &wide, &wide_problem, candidates, (&plain, equal_weights))?)
    };
    // How wide the step is; then all that friction may be. With payloads the load would be the bare arm's.
    let scale = |joint: usize| JointScale::of(robot.model(), joint);
    let steps: Vec<_> = searches.iter().map(|(joint, search)| (*joint, step_columns(search, scale(*joint)))).collect();
    let widths: Vec<Option<f64>> = chosen_among(&steps)?.iter().map(step_width).collect();
    let is_loaded = logs.recordings.iter().any(|recording| recording.payload.is_some());
    let all = |((joint, search), width): (&(usize, &FrictionSearch), &Option<f64>)| {
        let mut columns = candidate_columns(search, scale(*joint), *width);
        columns.retain(|column| !(is_loaded && column.term.needs_load()));
        (*joint, columns)
    };
    let candidates: Vec<_> = searches.iter().zip(&widths).map(all).collect();
    let mut joints = chosen_among(&candidates)?;
    let model = with_friction_of(robot, &joints, (&first.model, &plain))?;
    let passes = TrainingPasses { logs: of_constants, ..passes };
    let (mut model, constants_error) = with_constants(&passes, robot, &mut joints, (model, &gains))?;
    // What follows finds the gains with the friction that was chosen.
    model.torque_gains.clear();
    Ok(ChosenFriction { model, joints, stated: Some((first, plain)), constants_error })
}

/// Friction that an excerpt of the recordings `training` chose, with constants by all of their rows: one step from
/// where the excerpt's have settled, for what is left is short, and a step of Gauss and Newton then ends where a second
/// one would.
pub(crate) fn constants_of_all_rows(
    (logs, settings): (&Logs<'_>, &IdentificationSettings),
    robot: &ParametricModel,
    chosen: &ChosenFriction,
    (training, payloads): (&[usize], &[Payload]),
) -> Result<ChosenFriction, IdentificationError> {
    let ChosenFriction { model, joints, stated, constants_error } = chosen;
    let (mut model, mut joints) = (model.clone(), joints.clone());
    let mut constants_error = constants_error.clone();
    let passes = TrainingPasses { logs, settings, training, payloads, known_arm: None };
    let constants = FrictionConstants::new(&model, &joints);
    if model.needs_load() || !constants.is_empty() {
        let measured = passes.constants_pass(&constants, &model)?;
        let step = measured.step(&passes, (&constants, &model), &[])?;
        take_intervals(&mut joints, &model, &constants, &step);
        constants_error = Some(step.error().clone());
        let terms = constants.moved(&step.steps);
        model = with_chosen(robot, &mut joints, &terms, (&model, &measured.fit))?;
    }
    Ok(ChosenFriction { model, joints, stated: stated.clone(), constants_error })
}

/// One pass over the recordings for the constants of chosen friction: rows with the columns beside them, and the fit.
struct ConstantsPass {
    wide: RegressorModel,
    factors: Vec<LogFactors>,
    problem: LinearProblem,
    fit: Estimate,
}

impl ConstantsPass {
    /// The step from here, and how well the constants are known, by the covariance that bars are made of.
    fn step(
        &self,
        passes: &TrainingPasses<'_>,
        (constants, model): (&FrictionConstants, &RegressorModel),
        gains: &[usize],
    ) -> Result<ConstantsStep, IdentificationError> {
        let wide_problem = passes.free_problem(&self.wide, &self.factors, (model, &self.fit, gains))?;
        let solve = |problem: &LinearProblem| plain_estimate(&passes.settings.estimation, problem);
        Ok(constants.step((model, &self.fit), (&self.wide, &wide_problem), solve)?)
    }
}

/// What a step says of the constants' intervals, to the joints that have them.
fn take_intervals(
    joints: &mut [JointFriction],
    model: &RegressorModel,
    constants: &FrictionConstants,
    step: &ConstantsStep,
) {
    for (joint, found) in constants.with_intervals(step) {
        let name = &model.model().joints()[joint].name;
        joints.iter_mut().filter(|one| one.joint == *name).for_each(|one| one.constants.clone_from(&found));
    }
}

/// The model with the constants of the terms that its joints chose, and without terms that are not seen with the
/// constants free; and what the error of the constants adds to the bars. Gains of some joints are unknowns, too.
fn with_constants(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    joints: &mut [JointFriction],
    (mut model, gains): (RegressorModel, &[usize]),
) -> Result<(RegressorModel, Option<ConstantsError>), IdentificationError> {
    let equal_weights = matches!(passes.settings.estimation.estimator, Estimator::Ordinary);
    let mut last: Option<LastPass> = None;
    let mut error = None;
    for pass in 1..=MOST_PASSES {
        let constants = FrictionConstants::new(&model, joints);
        if !model.needs_load() && constants.is_empty() {
            break;
        }
        let measured = passes.constants_pass(&constants, &model)?;
        let fit = &measured.fit;

        // A step that made the fit worse was too long.
        let misfit = misfit(&measured.problem, fit, equal_weights);
        if let Some(before) = last.as_mut().filter(|before| misfit > before.misfit) {
            before.steps.iter_mut().for_each(|step| *step *= 0.5);
            let terms = before.constants.moved(&before.steps);
            model = with_chosen(robot, joints, &terms, (&model, fit))?;
            continue;
        }

        let step = measured.step(passes, (&constants, &model), gains)?;
        take_intervals(joints, &model, &constants, &step);
        error = Some(step.error().clone());
        let has_settled = step.has_settled() && (pass >= LOAD_PASSES || !model.needs_load());

        // Terms that are not seen once constants are free: the weakest of every joint, then again.
        let fewer = constants.without_weakest((&model, &measured.problem.column_norms()), &step);
        if pass == MOST_PASSES {
            if !fewer.is_empty() {
                model = with_chosen(robot, joints, &fewer, (&model, fit))?;
            }
            break;
        }
        if !fewer.is_empty() && (has_settled || pass >= DROP_PASSES) {
            model = with_chosen(robot, joints, &fewer, (&model, fit))?;
            last = None;
            continue;
        }
        if has_settled {
            break;
        }
        let terms = constants.moved(&step.steps);
        model = with_chosen(robot, joints, &terms, (&model, fit))?;
        last = Some(LastPass { constants, steps: step.steps, misfit });
    }
    Ok((model, error))
}

/// Settings of a fit whose error bars nobody wants.
fn without_bars(settings: &IdentificationSettings) -> EstimationSettings {
    EstimationSettings { covariance: CovarianceMethod::White, ..settings.estimation.clone() }
}

impl TrainingPasses<'_> {
    /// The rows of a model with the columns that its constants ask for beside it.
    fn constants_pass(
        &self,
        constants: &FrictionConstants,
        model: &RegressorModel,
    ) -> Result<ConstantsPass, IdentificationError> {
        let wide = with_terms(model, constants.neighbours().into_iter());
        let factors = self.read(&wide)?;
        let own = factors.iter().map(|log| log.clone().of(&wide, model)).collect::<Result<Vec<_>, _>>()?;
        let problem = self.stated_problem(model, &self.columns(model)?, &own)?;
        let fit = plain_estimate(&without_bars(self.settings), &problem)?;
        Ok(ConstantsPass { wide, factors, problem, fit })
    }

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

/// The robot with these terms at the joints that chose theirs, and the load of a fit of the model before.
fn with_chosen(
    robot: &ParametricModel,
    joints: &mut [JointFriction],
    terms: &[(usize, Vec<TorqueTerm>)],
    (before, fit): (&RegressorModel, &Estimate),
) -> Result<RegressorModel, IdentificationError> {
    for (joint, terms) in terms {
        let name = &before.model().joints()[*joint].name;
        joints.iter_mut().filter(|one| one.joint == *name).for_each(|one| one.choose(terms));
    }
    with_friction_of(robot, joints, (before, fit))
}

/// The robot with the friction that its joints chose, and the gains and the load of a fit of the model before.
fn with_friction_of(
    robot: &ParametricModel,
    joints: &[JointFriction],
    (before, fit): (&RegressorModel, &Estimate),
) -> Result<RegressorModel, IdentificationError> {
    let torque_gains = before.torque_gains.clone();
    let next = RegressorModel { torque_gains, ..RegressorModel::from(chosen_model(robot, joints)?) };
    Ok(next.with_load_of(before, &fit.values))
}

/// The width of the smooth step that a joint's friction has.
fn step_width(joint: &JointFriction) -> Option<f64> {
    joint.terms.iter().flatten().find_map(|term| match term {
        TorqueTerm::Coulomb(Coulomb { shape: CoulombShape::Smooth { width }, .. }) => Some(*width),
        _ => None,
    })
}

/// What a fit leaves: its deviance; where joints count alike the sum of squares.
fn misfit(problem: &LinearProblem, fit: &Estimate, equal_weights: bool) -> f64 {
    if !equal_weights {
        return deviance(problem, fit);
    }
    let of_joint = |(rows, sigma): (usize, &f64)| rows as f64 * sigma * sigma;
    problem.joint_rows().into_iter().zip(&fit.joint_sigma).map(of_joint).sum()
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
