//! The constants of the friction that joints chose, together with all parameters: passes over the recordings from where
//! the terms were found, and from a second start where such steps are known to end beside the best.

use super::passes::{with_friction_of, with_terms, without_bars};
use crate::error::IdentificationError;
use crate::estimators::{EstimationSettings, Estimator};
use crate::friction::{
    ConstantsError, ConstantsStep, FrictionConstants, JointFriction, JointScale, Weak, is_one_friction, second_start,
};
use crate::likelihood::{JointScore, deviance};
use crate::training::{LogFactors, Training, TrainingPasses, plain_estimate, plain_values};
use dynident_dynamics::ParametricModel;
use dynident_estimation::{LinearProblem, WeightedValues};
use dynident_model::terms::TorqueTerm;
use dynident_rows::RegressorModel;

/// Passes over the recordings for the constants of chosen friction, at most, and one more where the last went too far.
const MOST_PASSES: usize = 8;
/// Passes after which terms that are not seen are dropped although constants still move.
const DROP_PASSES: usize = 3;
/// Times that a step which makes the fit worse is halved: the constants are as good as they get.
const MOST_HALVINGS: usize = 3;
/// Deviance that a step may cost without being too long: far less than chance makes of it.
const NO_WORSE: f64 = 0.1;
/// Passes at least where friction depends on the load, which is the fit's before.
const LOAD_PASSES: usize = 3;

/// The constants of a pass, the step from there, and what the fit left before it.
struct LastPass {
    constants: FrictionConstants,
    steps: Vec<f64>,
    misfit: f64,
    halvings: usize,
}

/// One pass over the recordings for the constants of chosen friction: rows with the columns beside them, and the fit.
struct ConstantsPass {
    wide: RegressorModel,
    factors: Vec<LogFactors>,
    /// The same rows, each log's as one segment.
    merged: Vec<LogFactors>,
    /// Those without the columns beside them.
    problem: LinearProblem,
    fit: WeightedValues,
}

impl ConstantsPass {
    /// The step from here, and how well the constants are known, by the covariance that bars are made of.
    fn step(
        &self,
        passes: &TrainingPasses<'_>,
        constants: &FrictionConstants,
        model: &RegressorModel,
        gains: &[usize],
    ) -> Result<ConstantsStep, IdentificationError> {
        self.step_by(passes, constants, model, gains, &self.factors, &passes.settings.estimation)
    }

    /// The same step with bars that count every row for independent: no time segments are looked at.
    fn step_without_bars(
        &self,
        passes: &TrainingPasses<'_>,
        constants: &FrictionConstants,
        model: &RegressorModel,
        gains: &[usize],
    ) -> Result<ConstantsStep, IdentificationError> {
        self.step_by(passes, constants, model, gains, &self.merged, &without_bars(passes.settings))
    }

    fn step_by(
        &self,
        passes: &TrainingPasses<'_>,
        constants: &FrictionConstants,
        model: &RegressorModel,
        gains: &[usize],
        factors: &[LogFactors],
        estimation: &EstimationSettings,
    ) -> Result<ConstantsStep, IdentificationError> {
        let wide_problem = passes.free_problem(&self.wide, factors, model, &self.fit.values, gains)?;
        let solve = |problem: &LinearProblem| plain_estimate(estimation, problem);
        Ok(constants.step(model, &self.fit.values, &self.wide, &wide_problem, solve)?)
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

/// What the rows say of a joint's friction.
pub(crate) struct FrictionEvidence {
    /// How many rows say what one independent row would ([`FrictionConstants::design_effect`]).
    pub(crate) design_effect: f64,
    /// Whether it has terms that may be chance, of which a first look at the same motion had none.
    pub(crate) is_doubtful: bool,
}

/// What the rows of `passes` say of the friction of every joint, with the constants that suit them; a first look at the
/// same motion had the friction `before`. Where no friction has constants every row is taken for independent.
pub(crate) fn friction_evidence(
    passes: &TrainingPasses<'_>,
    joints: &[JointFriction],
    model: &RegressorModel,
    before: &[JointFriction],
) -> Result<Vec<FrictionEvidence>, IdentificationError> {
    let constants = FrictionConstants::new(model, joints);
    if constants.is_empty() {
        let nothing = |_| FrictionEvidence { design_effect: 1.0, is_doubtful: false };
        return Ok(joints.iter().map(nothing).collect());
    }
    let measured = passes.constants_pass(&constants, model)?;
    let step = measured.step(passes, &constants, model, &[])?;
    let norms = measured.problem.column_norms();
    let of_joint = |(one, before): (&JointFriction, &JointFriction)| {
        let place = model.model().joint_index(&one.joint);
        let is_doubtful = |(joint, before): (usize, &Vec<TorqueTerm>)| {
            constants.has_doubtful_term((joint, before), (model, &norms), &step)
        };
        FrictionEvidence {
            design_effect: place.map_or(1.0, |joint| constants.design_effect(joint, model, &step)),
            is_doubtful: place.zip(before.terms.as_ref()).is_some_and(is_doubtful),
        }
    };
    Ok(joints.iter().zip(before).map(of_joint).collect())
}

/// The best constants from where the terms were found and, for joints of which rows near rest count, from a
/// [second start](second_start); joint by joint the friction that says most of the rows with the fewest numbers
/// (Schwarz). Gains of some joints are unknowns, too.
pub(crate) fn best_constants(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    joints: &mut Vec<JointFriction>,
    near_rest: &[&str],
    model: RegressorModel,
    gains: &[usize],
) -> Result<(RegressorModel, Option<ConstantsError>), IdentificationError> {
    let mut others = joints.clone();
    let mut is_moved = vec![false; joints.len()];
    for (one, is_moved) in others.iter_mut().zip(&mut is_moved).filter(|(one, _)| near_rest.contains(&&one.joint[..])) {
        let place = model.model().joint_index(&one.joint);
        let scale = place.map(|joint| JointScale::of(robot.model(), joint));
        if let (Some(terms), Some(scale)) = (&one.terms, scale)
            && let Some(start) = second_start(terms, scale)
        {
            one.choose(&start);
            *is_moved = true;
        }
    }
    let first = with_constants(passes, robot, joints, model, gains)?;
    if !is_moved.contains(&true) {
        return Ok(first);
    }

    // From the other start; then of both what is better.
    let start = passes.with_friction(robot, &others, &first.0)?;
    let second = with_constants(passes, robot, &mut others, start, gains)?;
    let as_counted = vec![1.0; joints.len()];
    let taken = better_of_joints(passes, joints, &first.0, &others, &second.0, &is_moved, &as_counted)?;
    if !taken.contains(&true) {
        return Ok(first);
    }
    if taken == is_moved {
        *joints = others;
        return Ok(second);
    }
    take(joints, others, &taken);
    let start = passes.with_friction(robot, joints, &first.0)?;
    with_constants(passes, robot, joints, start, gains)
}

/// Of two frictions with the constants that suit the rows of `passes` whether, joint by joint, the second says more of
/// them with fewer numbers (Schwarz, Annals of Statistics 6 (1978) 461), both if all rows count and if they count as
/// their `design_effects` have it. Only joints count whose friction `is_other`.
pub(crate) fn better_of_joints(
    passes: &TrainingPasses<'_>,
    joints: &[JointFriction],
    model: &RegressorModel,
    others: &[JointFriction],
    of_others: &RegressorModel,
    is_other: &[bool],
    design_effects: &[f64],
) -> Result<Vec<bool>, IdentificationError> {
    let of_joints =
        |model: &RegressorModel, joints: &[JointFriction]| -> Result<Vec<JointScore>, IdentificationError> {
            let scores = friction_scores(passes, model, joints)?;
            let place = |one: &JointFriction| model.model().joint_index(&one.joint);
            Ok(joints.iter().map(|one| place(one).map_or(JointScore::default(), |joint| scores[joint])).collect())
        };
    let (first, second) = (of_joints(model, joints)?, of_joints(of_others, others)?);
    let is_possible = |one: &JointFriction| one.terms.as_deref().is_none_or(is_one_friction);
    let is_better = |place: usize| {
        let counted = |effect: f64| second[place].schwarz(effect) < first[place].schwarz(effect);
        is_other[place] && is_possible(&others[place]) && counted(1.0) && counted(design_effects[place])
    };
    Ok((0..joints.len()).map(is_better).collect())
}

/// The friction of `others` to the joints that have `taken` it.
pub(crate) fn take(joints: &mut [JointFriction], others: Vec<JointFriction>, taken: &[bool]) {
    for ((one, other), _) in joints.iter_mut().zip(others).zip(taken).filter(|(_, taken)| **taken) {
        *one = other;
    }
}

/// What is unknown of the constants of friction that `model` has and other rows chose, by these rows; none where there
/// is no constant.
pub(crate) fn error_of_constants(
    passes: &TrainingPasses<'_>,
    joints: &[JointFriction],
    model: &RegressorModel,
) -> Result<Option<ConstantsError>, IdentificationError> {
    let constants = FrictionConstants::new(model, joints);
    if constants.is_empty() {
        return Ok(None);
    }
    let step = passes.constants_pass(&constants, model)?.step(passes, &constants, model, &[])?;
    Ok(Some(step.error().clone()))
}

/// One step of the constants from where they are, for joints that chose their friction by other rows; none where there
/// is nothing to move.
pub(crate) fn one_step(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    joints: &mut [JointFriction],
    model: &RegressorModel,
) -> Result<Option<(RegressorModel, ConstantsError)>, IdentificationError> {
    let constants = FrictionConstants::new(model, joints);
    if !model.needs_load() && constants.is_empty() {
        return Ok(None);
    }
    let measured = passes.constants_pass(&constants, model)?;
    let step = measured.step(passes, &constants, model, &[])?;
    take_intervals(joints, model, &constants, &step);
    let error = step.error().clone();
    let terms = constants.moved(&step.steps);
    Ok(Some((with_chosen(robot, joints, &terms, model, &measured.fit.values)?, error)))
}

/// How well every joint's rows are explained by a model, with the terms and the constants of its friction as its own
/// numbers.
fn friction_scores(
    passes: &TrainingPasses<'_>,
    model: &RegressorModel,
    joints: &[JointFriction],
) -> Result<Vec<JointScore>, IdentificationError> {
    let (rows, fit) = passes.rows_and_fit(model)?;
    let constants = FrictionConstants::new(model, joints);
    let mut scores = vec![JointScore::default(); model.dof()];
    for ((&joint, count), &sigma) in rows.joints.iter().zip(rows.problem.joint_rows()).zip(&fit.joint_sigma) {
        let is_own = |term: &&TorqueTerm| term.is_joint_friction() && term.own_joint() == Some(joint);
        let terms = model.parametric.terms().iter().filter(is_own).count();
        scores[joint] = JointScore { rows: count, sigma, own: terms + constants.count(joint) };
    }
    Ok(scores)
}

/// The model with the constants of the terms that its joints chose, and without terms that are not seen with the
/// constants free; and what the error of the constants adds to the bars. Gains of some joints are unknowns, too.
pub(crate) fn with_constants(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    joints: &mut [JointFriction],
    mut model: RegressorModel,
    gains: &[usize],
) -> Result<(RegressorModel, Option<ConstantsError>), IdentificationError> {
    let equal_weights = matches!(passes.settings.estimation.estimator, Estimator::Ordinary);
    let mut last: Option<LastPass> = None;
    let (mut are_found, mut error) = (false, None);
    for pass in 1.. {
        let constants = FrictionConstants::new(&model, joints);
        if !model.needs_load() && constants.is_empty() {
            break;
        }
        let measured = passes.constants_pass(&constants, &model)?;
        let fit = &measured.fit;

        // A step that made the fit worse was too long; where no length makes it better the constants are found, and one
        // more pass there says which terms no row shows.
        let misfit = misfit(&measured.problem, &fit.joint_sigma, equal_weights);
        if let Some(before) = last.as_mut().filter(|before| misfit > before.misfit + NO_WORSE) {
            before.halvings += 1;
            are_found = before.halvings > MOST_HALVINGS || pass >= MOST_PASSES;
            before.steps.iter_mut().for_each(|step| *step *= if are_found { 0.0 } else { 0.5 });
            let terms = before.constants.moved(&before.steps);
            model = with_chosen(robot, joints, &terms, &model, &fit.values)?;
            last = last.filter(|_| !are_found);
            continue;
        }

        // On the way bars are for nobody.
        if pass < DROP_PASSES && !are_found {
            let step = measured.step_without_bars(passes, &constants, &model, gains)?;
            if !step.may_have_settled() {
                let terms = constants.moved(&step.steps);
                model = with_chosen(robot, joints, &terms, &model, &fit.values)?;
                last = Some(LastPass { constants, steps: step.steps, misfit, halvings: 0 });
                continue;
            }
        }

        let step = measured.step(passes, &constants, &model, gains)?;
        take_intervals(joints, &model, &constants, &step);
        error = Some(step.error().clone());
        let has_settled = are_found || step.has_settled() && (pass >= LOAD_PASSES || !model.needs_load());

        // Terms that are not seen once constants are free: the weakest of every joint, then again. Where the passes got
        // no further terms may say something together that none of them says alone; what no row shows says nothing.
        let weak = if are_found { Weak::Unshown } else { Weak::Unseen };
        let fewer = constants.without_weakest(weak, (&model, &measured.problem.column_norms()), &step);
        if pass >= MOST_PASSES {
            if !fewer.is_empty() {
                model = with_chosen(robot, joints, &fewer, &model, &fit.values)?;
            }
            break;
        }
        if !fewer.is_empty() && (has_settled || pass >= DROP_PASSES) {
            model = with_chosen(robot, joints, &fewer, &model, &fit.values)?;
            last = None;
            are_found = false;
            continue;
        }
        if has_settled {
            break;
        }
        let terms = constants.moved(&step.steps);
        model = with_chosen(robot, joints, &terms, &model, &fit.values)?;
        last = Some(LastPass { constants, steps: step.steps, misfit, halvings: 0 });
    }
    Ok((model, error))
}

/// The robot with these terms at the joints that chose theirs, and the load of a fit of the model before.
fn with_chosen(
    robot: &ParametricModel,
    joints: &mut [JointFriction],
    terms: &[(usize, Vec<TorqueTerm>)],
    before: &RegressorModel,
    values: &[f64],
) -> Result<RegressorModel, IdentificationError> {
    for (joint, terms) in terms {
        let name = &before.model().joints()[*joint].name;
        joints.iter_mut().filter(|one| one.joint == *name).for_each(|one| one.choose(terms));
    }
    with_friction_of(robot, joints, before, values)
}

impl TrainingPasses<'_> {
    /// The robot with this friction, and the load of a fit with the friction of `before`.
    pub(super) fn with_friction(
        &self,
        robot: &ParametricModel,
        joints: &[JointFriction],
        before: &RegressorModel,
    ) -> Result<RegressorModel, IdentificationError> {
        let (_, fit) = self.rows_and_fit(before)?;
        with_friction_of(robot, joints, before, &fit.values)
    }

    /// The rows of a model and a fit without bars.
    fn rows_and_fit(&self, model: &RegressorModel) -> Result<(Training, WeightedValues), IdentificationError> {
        let rows = self.rows_once(model.clone())?;
        let fit = plain_values(&self.settings.estimation, &rows.problem)?;
        Ok((rows, fit))
    }

    /// The rows of a model with the columns that its constants ask for beside it.
    fn constants_pass(
        &self,
        constants: &FrictionConstants,
        model: &RegressorModel,
    ) -> Result<ConstantsPass, IdentificationError> {
        let wide = with_terms(model, constants.neighbours().into_iter());
        let factors = self.read(&wide)?;
        let merged: Vec<LogFactors> = factors.iter().map(LogFactors::as_one_segment).collect();
        let own = merged.iter().map(|log| log.clone().of(&wide, model)).collect::<Result<Vec<_>, _>>()?;
        let problem = self.stated_problem(model, &self.columns(model)?, &own)?;
        let fit = plain_values(&self.settings.estimation, &problem)?;
        Ok(ConstantsPass { wide, factors, merged, problem, fit })
    }
}

/// What a fit leaves: its deviance; where joints count alike that of all rows together, `N ln(Σ N_j σ_j²)`.
fn misfit(problem: &LinearProblem, joint_sigma: &[f64], equal_weights: bool) -> f64 {
    if !equal_weights {
        return deviance(problem, joint_sigma);
    }
    let rows = problem.joint_rows();
    let of_joint = |(rows, sigma): (&usize, &f64)| *rows as f64 * sigma * sigma;
    let squares: f64 = rows.iter().zip(joint_sigma).map(of_joint).sum();
    rows.iter().sum::<usize>() as f64 * squares.max(f64::MIN_POSITIVE).ln()
}
