//! Nonlinear constants of selected friction, estimated together with all parameters. Passes over the recordings start
//! from the values on the grid, and from a second start if the first is known to end in a local minimum.

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

/// Maximum number of passes over the recordings for the constants, plus one if the last step was too long.
const MAX_PASSES: usize = 8;
/// Number of passes after which insignificant terms are dropped, even if the constants have not converged.
const DROP_PASSES: usize = 3;
/// Maximum number of halvings of a step that makes the fit worse.
const MAX_HALVINGS: usize = 3;
/// Increase of the deviance that a step may cause; it is far below the statistical variation of the deviance.
const MAX_DEVIANCE_INCREASE: f64 = 0.1;
/// Minimum number of passes for load-dependent friction, because each pass uses the load of the previous fit.
const MIN_LOAD_PASSES: usize = 3;

struct LastPass {
    constants: FrictionConstants,
    steps: Vec<f64>,
    misfit: f64,
    halvings: usize,
}

/// One pass for the constants of selected friction: rows with additional columns for changed constants, and the fit.
struct ConstantsPass {
    wide: RegressorModel,
    factors: Vec<LogFactors>,
    merged: Vec<LogFactors>,
    /// The rows without the additional columns for changed constants.
    problem: LinearProblem,
    fit: WeightedValues,
}

impl ConstantsPass {
    /// Computes the Gauss-Newton step of the friction constants and its covariance, which gives the error bars of the
    /// constants.
    fn step(
        &self,
        passes: &TrainingPasses<'_>,
        constants: &FrictionConstants,
        model: &RegressorModel,
        gains: &[usize],
    ) -> Result<ConstantsStep, IdentificationError> {
        self.step_by(passes, constants, model, gains, &self.factors, &passes.settings.estimation)
    }

    /// Computes the Gauss-Newton step with error bars that assume independent rows, without time segments.
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

pub(crate) struct FrictionEvidence {
    /// Number of rows that contain as much information as one independent row ([`FrictionConstants::design_effect`]).
    pub(crate) design_effect: f64,
    /// Whether the friction has possibly insignificant terms that the first selection did not have.
    pub(crate) is_doubtful: bool,
}

/// Evidence of the rows of `passes` for the friction of every joint, with refitted constants. `before` is the first
/// selection of friction from the same motion. For joints without constants, all rows are treated as independent.
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
            constants.has_doubtful_term(joint, before, model, &norms, &step, passes.settings.thresholds.friction)
        };
        FrictionEvidence {
            design_effect: place.map_or(1.0, |joint| constants.design_effect(joint, model, &step)),
            is_doubtful: place.zip(before.terms.as_ref()).is_some_and(is_doubtful),
        }
    };
    Ok(joints.iter().zip(before).map(of_joint).collect())
}

/// Finds the best constants from the values on the grid and, for joints with rows near rest, from a [second
/// start](second_start). For each joint, the friction with the lower Bayesian information criterion is used. `gains`
/// are joints with unknown torque gains.
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

    // Fit from the second start; the better result of both is used.
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

/// For each joint, whether the friction `others` has a lower Bayesian information criterion (Schwarz, Annals of
/// Statistics 6 (1978) 461) than the friction `joints`. It must be lower with all rows and with the number of rows
/// divided by `design_effects`. Only joints in `is_other` can differ.
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
        let counted = |effect: f64| second[place].bic(effect) < first[place].bic(effect);
        is_other[place] && is_possible(&others[place]) && counted(1.0) && counted(design_effects[place])
    };
    Ok((0..joints.len()).map(is_better).collect())
}

/// Copies the friction in `others` to the joints that are marked in `taken`.
pub(crate) fn take(joints: &mut [JointFriction], others: Vec<JointFriction>, taken: &[bool]) {
    for ((one, other), _) in joints.iter_mut().zip(others).zip(taken).filter(|(_, taken)| **taken) {
        *one = other;
    }
}

/// Uncertainty of the constants of friction that was selected from other rows, computed from these rows; `None` without
/// constants.
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

/// Makes one Gauss-Newton step of the constants of friction that was selected from other rows; `None` if no constant
/// can change.
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

/// Quality of the fit to each joint's rows. The number of parameters of a joint is the number of terms and constants of
/// its friction.
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

/// Refines the constants of the selected terms and drops insignificant terms; returns the model and the uncertainty of
/// the constants. `gains` are joints with unknown torque gains.
pub(crate) fn with_constants(
    passes: &TrainingPasses<'_>,
    robot: &ParametricModel,
    joints: &mut [JointFriction],
    mut model: RegressorModel,
    gains: &[usize],
) -> Result<(RegressorModel, Option<ConstantsError>), IdentificationError> {
    let equal_weights = matches!(passes.settings.estimation.estimator, Estimator::Ordinary);
    let mut last: Option<LastPass> = None;
    let thresholds = passes.settings.thresholds.friction;
    let (mut are_found, mut error) = (false, None);
    for pass in 1.. {
        let constants = FrictionConstants::new(&model, joints);
        if !model.needs_load() && constants.is_empty() {
            break;
        }
        let measured = passes.constants_pass(&constants, &model)?;
        let fit = &measured.fit;

        // A step that increased the misfit was too long and is halved. If no shorter step helps, the constants are
        // final, and one more pass shows which terms no rows support.
        let misfit = misfit(&measured.problem, &fit.joint_sigma, equal_weights);
        if let Some(before) = last.as_mut().filter(|before| misfit > before.misfit + MAX_DEVIANCE_INCREASE) {
            before.halvings += 1;
            are_found = before.halvings > MAX_HALVINGS || pass >= MAX_PASSES;
            before.steps.iter_mut().for_each(|step| *step *= if are_found { 0.0 } else { 0.5 });
            let terms = before.constants.moved(&before.steps);
            model = with_chosen(robot, joints, &terms, &model, &fit.values)?;
            last = last.filter(|_| !are_found);
            continue;
        }

        // Intermediate passes need no error bars.
        if pass < DROP_PASSES && !are_found {
            let step = measured.step_without_bars(passes, &constants, &model, gains)?;
            if !step.may_have_converged() {
                let terms = constants.moved(&step.steps);
                model = with_chosen(robot, joints, &terms, &model, &fit.values)?;
                last = Some(LastPass { constants, steps: step.steps, misfit, halvings: 0 });
                continue;
            }
        }

        let step = measured.step(passes, &constants, &model, gains)?;
        take_intervals(joints, &model, &constants, &step);
        error = Some(step.error().clone());
        let has_converged = are_found || step.has_converged() && (pass >= MIN_LOAD_PASSES || !model.needs_load());

        // Drops the weakest insignificant term of every joint and repeats. If the passes made no progress, terms may be
        // significant only together, so only terms that no rows support are dropped.
        let weak = if are_found { Weak::Unsupported } else { Weak::Insignificant };
        let fewer = constants.without_weakest(weak, &model, &measured.problem.column_norms(), &step, thresholds);
        if pass >= MAX_PASSES {
            if !fewer.is_empty() {
                model = with_chosen(robot, joints, &fewer, &model, &fit.values)?;
            }
            break;
        }
        if !fewer.is_empty() && (has_converged || pass >= DROP_PASSES) {
            model = with_chosen(robot, joints, &fewer, &model, &fit.values)?;
            last = None;
            are_found = false;
            continue;
        }
        if has_converged {
            break;
        }
        let terms = constants.moved(&step.steps);
        model = with_chosen(robot, joints, &terms, &model, &fit.values)?;
        last = Some(LastPass { constants, steps: step.steps, misfit, halvings: 0 });
    }
    Ok((model, error))
}

/// The robot with these terms, and the load from a fit of the previous model.
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
    /// The robot with this friction, and the load from a fit with the friction of `before`.
    pub(super) fn with_friction(
        &self,
        robot: &ParametricModel,
        joints: &[JointFriction],
        before: &RegressorModel,
    ) -> Result<RegressorModel, IdentificationError> {
        let (_, fit) = self.rows_and_fit(before)?;
        with_friction_of(robot, joints, before, &fit.values)
    }

    fn rows_and_fit(&self, model: &RegressorModel) -> Result<(Training, WeightedValues), IdentificationError> {
        let rows = self.rows_once(model.clone())?;
        let fit = plain_values(&self.settings.estimation, &rows.problem)?;
        Ok((rows, fit))
    }

    /// Rows of a model with additional columns for changed friction constants.
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

/// Deviance of a fit (minus twice the log-likelihood). If all joints have equal weights, the deviance of all rows
/// together, `N ln(Σ N_j σ_j²)`, with N_j rows and residual variance σ_j² of joint j.
fn misfit(problem: &LinearProblem, joint_sigma: &[f64], equal_weights: bool) -> f64 {
    if !equal_weights {
        return deviance(problem, joint_sigma);
    }
    let rows = problem.joint_rows();
    let of_joint = |(rows, sigma): (&usize, &f64)| *rows as f64 * sigma * sigma;
    let squares: f64 = rows.iter().zip(joint_sigma).map(of_joint).sum();
    rows.iter().sum::<usize>() as f64 * squares.max(f64::MIN_POSITIVE).ln()
}
