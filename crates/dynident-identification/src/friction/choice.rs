//! Selection of friction by cross-validation within the training logs. It selects joint by joint, in two rounds, with
//! the current friction of the other joints.
//!
//! The triangular factors contain all candidate columns, so a candidate model is a selection of these columns (see
//! [`CrossValidation`]). The module `search` contains the search for one joint.

use super::candidates::{CandidateColumn, JointScale};
use super::joint_friction::JointFriction;
use super::search::{SearchLimits, search};
use dynident_dynamics::{Column, ParametricModel, ParametricModelError};
use dynident_estimation::{CrossValidation, Estimate, EstimationError, LinearProblem};
use dynident_model::terms::{TorqueTerm, sort_terms};
use dynident_rows::RegressorModel;
use rayon::prelude::*;

/// Number of time blocks; the second number is for logs that are too short for the first.
const FOLDS: [usize; 2] = [10, 5];
/// Number of rounds over all joints. From the second round on, the other joints have their selected friction.
const ROUNDS: usize = 2;
/// Root mean square velocity below which a joint is treated as resting, rad/s or m/s of an arm of usual size. It is a
/// typical velocity noise of a resting joint.
const MIN_SPEED: f64 = 1.0e-3;

/// The robot with the selected friction. Drive inertia and offset of each joint are kept.
///
/// # Errors
/// Terms of unknown joints.
pub fn chosen_model(
    robot: &ParametricModel,
    choice: &[JointFriction],
) -> Result<ParametricModel, ParametricModelError> {
    let joint_of = |name: &str| robot.model().joint_index(name);
    let replaced: Vec<(usize, &[TorqueTerm])> =
        choice.iter().filter_map(|joint| Some((joint_of(&joint.joint)?, joint.terms.as_deref()?))).collect();
    let is_replaced =
        |term: &TorqueTerm| term.is_joint_friction() && replaced.iter().any(|(joint, _)| term.joints() == [*joint]);
    let mut terms: Vec<TorqueTerm> = robot.terms().iter().filter(|term| !is_replaced(term)).cloned().collect();
    terms.extend(replaced.iter().flat_map(|(_, kinds)| kinds.iter().cloned()));
    sort_terms(&mut terms);
    robot.with_terms(terms)
}

/// Divides the rows into time blocks and returns the number of blocks; `None` if the logs are too short.
fn cross_validation(problem: &LinearProblem) -> Result<Option<(CrossValidation<'_>, usize)>, EstimationError> {
    for folds in FOLDS {
        match CrossValidation::new(problem, folds) {
            Ok(found) => return Ok(Some((found, folds))),
            Err(EstimationError::TooFewSegments { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(None)
}

/// Weights of the joints' rows, as in the fit `plain`.
fn weights(plain: &Estimate, equal: bool) -> Vec<f64> {
    let of_sigma = |sigma: &f64| if equal || *sigma <= 0.0 { 1.0 } else { sigma.recip() };
    plain.joint_sigma.iter().map(of_sigma).collect()
}

/// Indices in `wide_problem` of the columns after the base parameters (payloads, offsets of single logs, gains). Every
/// candidate model contains these columns if the fit `plain` of `model` excites them.
pub(super) fn further_columns(
    model: &RegressorModel,
    plain: &Estimate,
    wide: &RegressorModel,
    wide_problem: &LinearProblem,
) -> impl Iterator<Item = usize> {
    let (base, wide_base) = (model.layout().columns().len(), wide.layout().columns().len());
    let fixed: Vec<usize> = plain.rank.fixed.iter().map(|fixed| fixed.column).collect();
    let further = wide_problem.columns().len() - wide_base;
    (0..further).filter(move |place| !fixed.contains(&(base + place))).map(move |place| wide_base + place)
}

/// Index of a term's column.
fn place_of(model: &RegressorModel, term: &TorqueTerm) -> Option<usize> {
    model.layout().columns().iter().position(|column| matches!(column, Column::Term(l) if l == term))
}

/// Selects the friction of the joints in `candidates`: pairs of a joint and its candidate columns, all of them columns
/// of `wide_problem`. `plain` is the fit with the stated terms; `equal_weights` states whether its joints have equal
/// weights. `limits` contains the thresholds of the search for each entry of `candidates`.
pub(crate) fn choose_friction(
    model: &RegressorModel,
    wide: &RegressorModel,
    wide_problem: &LinearProblem,
    candidates: &[(usize, Vec<CandidateColumn>)],
    limits: &[SearchLimits<'_>],
    plain: &Estimate,
    equal_weights: bool,
) -> Result<Vec<JointFriction>, EstimationError> {
    let name = |joint: usize| model.model().joints()[joint].name.clone();
    let refused = |joint: usize, reason: &str| JointFriction::as_stated(name(joint), reason);
    let choose: Vec<usize> = candidates.iter().map(|(joint, _)| *joint).collect();
    let Some((validation, folds)) = cross_validation(wide_problem)? else {
        let reason = "the training logs are too short for cross-validation in blocks";
        return Ok(choose.iter().map(|&joint| refused(joint, reason)).collect());
    };
    let weights = weights(plain, equal_weights);
    let rows = wide_problem.joint_rows();
    let norms = wide_problem.column_norms();
    let place = |term: &TorqueTerm| place_of(wide, term);
    let of_joint =
        |joint: usize, columns: &[CandidateColumn], limits: &SearchLimits<'_>, before: &[Option<Vec<usize>>]| {
            let variable: Vec<usize> = columns.iter().filter_map(|column| place(&column.term)).collect();
            let speed = norms[variable[0]] / (rows[joint].max(1) as f64).sqrt();
            let scale = JointScale::of(model.model(), joint);
            if speed < MIN_SPEED * scale.velocity {
                return Ok((refused(joint, "the joint does not move in the training logs"), Vec::new()));
            }
            // The excited columns of the stated model, without the friction of this joint, and with the selected
            // friction of other joints.
            let chosen_before = |other: usize| choose.iter().position(|&c| c == other).and_then(|c| before[c].as_ref());
            let kept = |index: &usize| match &model.layout().columns()[*index] {
                Column::Term(term) if term.is_joint_friction() => {
                    term.joints().iter().all(|&other| other != joint && chosen_before(other).is_none())
                }
                _ => true,
            };
            let fixed = |index: &usize| plain.rank.fixed.iter().any(|fixed| fixed.column == *index);
            let stated = (0..model.layout().columns().len()).filter(|index| kept(index) && !fixed(index));
            let others = choose.iter().filter(|&&other| other != joint).filter_map(|&other| chosen_before(other));
            let further = further_columns(model, plain, wide, wide_problem);
            let common: Vec<usize> = stated.chain(others.flatten().copied()).chain(further).collect();
            match validation.joint(joint, &common, &variable, &weights) {
                Ok(prepared) => Ok(search(name(joint), scale, folds, limits, &prepared, columns)),
                Err(EstimationError::TooFewRows { .. }) => {
                    Ok((refused(joint, "fewer rows than columns without one block"), Vec::new()))
                }
                Err(error) => Err(error),
            }
        };
    let mut chosen: Vec<JointFriction> = Vec::new();
    let mut before: Vec<Option<Vec<usize>>> = vec![None; choose.len()];
    for _ in 0..ROUNDS {
        let found: Vec<(JointFriction, Vec<usize>)> = candidates
            .par_iter()
            .zip(limits)
            .map(|((joint, columns), limits)| of_joint(*joint, columns, limits, &before))
            .collect::<Result<_, EstimationError>>()?;
        (chosen, before) = found
            .into_iter()
            .zip(candidates)
            .map(|((friction, places), (_, columns))| {
                let wide = places.iter().filter_map(|&at| place(&columns[at].term)).collect();
                let known = friction.terms.is_some().then_some(wide);
                (friction, known)
            })
            .unzip();
    }
    Ok(chosen)
}
