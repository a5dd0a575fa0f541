//! Friction by cross-validation inside the training logs, joint by joint.
//!
//! All columns that a joint may have are in the factors already, so a candidate model is a selection of them (see
//! [`CrossValidation`]). Terms are added one at a time to viscous friction with a Coulomb step or a sigmoid, the one
//! that lowers the error most first; of all candidates met, the simplest counts whose mean square error is within one
//! standard error of the least (Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*, 7.10; the
//! standard error is that of the difference, block by block, because blocks differ among themselves far more than
//! candidates do).

use super::candidates::{CandidateColumn, FrictionKind};
use crate::regressor_model::RegressorModel;
use dynident_dynamics::{Column, ParametricModel, ParametricModelError};
use dynident_estimation::{CrossValidation, Estimate, EstimationError, FoldErrors, JointFolds, LinearProblem};
use dynident_model::terms::{TorqueTerm, sort_terms};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Blocks of time; half as many where a log is too short for these.
const FOLDS: [usize; 2] = [10, 5];
/// Terms added at most to viscous friction and a step.
const MOST_ADDED: usize = 3;
/// Rounds over all joints: from the second on, the others have the friction that was chosen for them.
const ROUNDS: usize = 2;
/// Root mean square velocity below which a joint does not move, rad/s or m/s: what the position noise of a standing
/// joint looks like.
const MOVING: f64 = 1.0e-3;

/// How the friction of one joint was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointFriction {
    /// The joint.
    pub joint: String,
    /// What was chosen, or why nothing was: the stated terms then stay in force.
    pub chosen: String,
    /// The joint's friction; none when nothing was chosen.
    pub terms: Option<Vec<TorqueTerm>>,
    /// Blocks of time that were left out in turn.
    pub folds: usize,
    /// What was compared, each with its best constants.
    pub candidates: Vec<FrictionCandidate>,
}

/// One model of a joint's friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FrictionCandidate {
    /// Its terms.
    #[serde(rename = "law")]
    pub term: String,
    /// Symbols of the parameters that are not zero.
    pub parameters: Vec<String>,
    /// Parameters and tuned constants.
    pub complexity: usize,
    /// Root mean square of the joint's residual on blocks that were left out, Nm (N).
    pub cv_error_nm: f64,
    /// Mean square error above the least of all candidates, in standard errors of this difference; 0 for the least.
    pub excess_standard_errors: f64,
    /// Whether it was chosen.
    pub chosen: bool,
}

/// The terms that the given columns state, each once.
fn stated(columns: &[&CandidateColumn]) -> Vec<TorqueTerm> {
    let mut kinds: Vec<TorqueTerm> = Vec::new();
    for term in columns.iter().flat_map(|column| &column.stated) {
        if !kinds.contains(term) {
            kinds.push(term.clone());
        }
    }
    kinds
}

/// The robot with the choice in force: a joint's friction is replaced, its drive inertia and offset stay.
///
/// # Errors
/// Terms of joints that the robot does not have.
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

/// Chooses friction for joints whose `candidates` are among the columns of `wide_problem`; `plain` is the fit with the
/// stated terms, in which joints count alike if `equal_weights`.
pub(crate) fn choose_friction(
    model: &RegressorModel,
    wide: &RegressorModel,
    wide_problem: &LinearProblem,
    candidates: &[(usize, Vec<CandidateColumn>)],
    (plain, equal_weights): (&Estimate, bool),
) -> Result<Vec<JointFriction>, EstimationError> {
    let name = |joint: usize| model.model().joints()[joint].name.clone();
    let refused = |joint: usize, reason: &str| JointFriction {
        joint: name(joint),
        chosen: format!("as the study states: {reason}"),
        terms: None,
        folds: 0,
        candidates: Vec::new(),
    };
    let choose: Vec<usize> = candidates.iter().map(|(joint, _)| *joint).collect();
    let mut validation = None;
    for folds in FOLDS {
        match CrossValidation::new(wide_problem, folds) {
            Ok(found) => {
                validation = Some((found, folds));
                break;
            }
            Err(EstimationError::TooFewSegments { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    let Some((validation, folds)) = validation else {
        let reason = "the training logs are too short to be cut into blocks";
        return Ok(choose.iter().map(|&joint| refused(joint, reason)).collect());
    };
    // Rows count as in the plain fit.
    let weights: Vec<f64> = if equal_weights {
        vec![1.0; plain.joint_sigma.len()]
    } else {
        plain.joint_sigma.iter().map(|sigma| if *sigma > 0.0 { sigma.recip() } else { 1.0 }).collect()
    };
    let rows = wide_problem.joint_rows();
    let norms = wide_problem.column_norms();
    let place = |term: &TorqueTerm| {
        wide.layout().columns().iter().position(|column| matches!(column, Column::Term(l) if l == term))
    };
    let of_joint = |joint: usize, columns: &[CandidateColumn], before: &[Option<Vec<usize>>]| {
        let variable: Vec<usize> = columns.iter().filter_map(|column| place(&column.term)).collect();
        let speed = norms[variable[0]] / (rows[joint].max(1) as f64).sqrt();
        if speed < MOVING {
            return Ok((refused(joint, "the joint does not move in the training logs"), Vec::new()));
        }
        // The stated model, as far as the data excite it, without this joint's friction, and with that of others as
        // chosen before.
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
        let common: Vec<usize> = stated.chain(others.flatten().copied()).collect();
        match validation.joint(joint, &common, &variable, &weights) {
            Ok(prepared) => Ok(search(name(joint), folds, &prepared, columns)),
            Err(EstimationError::TooFewRows { .. }) => {
                Ok((refused(joint, "fewer rows than columns once a block is left out"), Vec::new()))
            }
            Err(error) => Err(error),
        }
    };
    let mut chosen: Vec<JointFriction> = Vec::new();
    let mut before: Vec<Option<Vec<usize>>> = vec![None; choose.len()];
    for _ in 0..ROUNDS {
        let found: Vec<(JointFriction, Vec<usize>)> = candidates
            .par_iter()
            .map(|(joint, columns)| of_joint(*joint, columns, &before))
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

/// A candidate with the best of its constants.
struct ScoredCandidate {
    kinds: Vec<FrictionKind>,
    /// Places of its columns.
    places: Vec<usize>,
    errors: FoldErrors,
}

impl ScoredCandidate {
    /// Columns that have a value at all.
    fn present(&self) -> Vec<usize> {
        self.places.iter().zip(&self.errors.coefficients).filter(|(_, value)| **value != 0.0).map(|(p, _)| *p).collect()
    }

    fn complexity(&self, columns: &[CandidateColumn]) -> usize {
        let present = self.present();
        let tuned = |kind: &&FrictionKind| present.iter().any(|&place| columns[place].kind == **kind);
        present.len() + self.kinds.iter().filter(tuned).map(|kind| kind.constants()).sum::<usize>()
    }

    /// Its terms that have a value at all.
    fn present_name(&self, columns: &[CandidateColumn]) -> String {
        let mut kinds: Vec<FrictionKind> = self.present().iter().map(|&place| columns[place].kind).collect();
        kinds.dedup();
        let names: Vec<&str> = kinds.into_iter().map(FrictionKind::name).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(" + ") }
    }

    fn name(&self) -> String {
        self.kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(" + ")
    }
}

/// The best constants of a model with the given terms. Constants of `before` are kept, but for those of the step, which
/// shares its velocities with the new term.
fn tuned(
    folds: &JointFolds,
    columns: &[CandidateColumn],
    kinds: Vec<FrictionKind>,
    before: Option<&ScoredCandidate>,
) -> ScoredCandidate {
    let mut choices: Vec<Vec<usize>> = vec![Vec::new()];
    for &kind in &kinds {
        let all: Vec<usize> = (0..columns.len()).filter(|&place| columns[place].kind == kind).collect();
        let kept = before
            .filter(|_| kind != FrictionKind::Coulomb)
            .and_then(|before| before.places.iter().copied().find(|&place| columns[place].kind == kind));
        let options: Vec<Vec<usize>> = match (kind.takes_one(), kept) {
            (false, _) => vec![all],
            (true, Some(kept)) => vec![vec![kept]],
            (true, None) => all.into_iter().map(|place| vec![place]).collect(),
        };
        choices = choices
            .iter()
            .flat_map(|chosen| options.iter().map(move |option| [chosen.as_slice(), option].concat()))
            .collect();
    }
    let nonnegative: Vec<Vec<bool>> = choices
        .iter()
        .map(|places| places.iter().map(|&place| columns[place].term.is_nonnegative()).collect())
        .collect();
    let models: Vec<(&[usize], &[bool])> =
        choices.iter().zip(&nonnegative).map(|(places, nonnegative)| (&places[..], &nonnegative[..])).collect();
    let errors = folds.errors_of_all(&models);
    let evaluated = choices.into_iter().zip(errors).map(|(places, errors)| ScoredCandidate {
        kinds: kinds.clone(),
        places,
        errors,
    });
    // The first of equals, so that the choice is the same everywhere.
    evaluated
        .reduce(|best, next| if next.errors.rms() < best.errors.rms() { next } else { best })
        .unwrap_or_else(|| ScoredCandidate { kinds, places: Vec::new(), errors: folds.errors(&[], &[]) })
}

/// The choice for one joint, and the places of its columns.
fn search(joint: String, count: usize, folds: &JointFolds, columns: &[CandidateColumn]) -> (JointFriction, Vec<usize>) {
    let mut met = vec![
        tuned(folds, columns, vec![FrictionKind::Viscous, FrictionKind::Coulomb], None),
        tuned(folds, columns, vec![FrictionKind::Viscous, FrictionKind::Sigmoid], None),
    ];
    let mut at = usize::from(met[1].errors.rms() < met[0].errors.rms());
    let mut additions: Vec<FrictionKind> =
        columns.iter().map(|column| column.kind).filter(|kind| kind.is_addition()).collect();
    additions.dedup();
    for _ in 0..MOST_ADDED {
        let start = met.len();
        for &added in &additions {
            if met[at].kinds.contains(&added) {
                continue;
            }
            let replaced =
                |kind: &FrictionKind| added == FrictionKind::AsymmetricViscous && *kind == FrictionKind::Viscous;
            let mut kinds: Vec<FrictionKind> = met[at].kinds.iter().copied().filter(|kind| !replaced(kind)).collect();
            kinds.push(added);
            kinds.sort();
            let with_constants_kept = tuned(folds, columns, kinds, Some(&met[at]));
            met.push(with_constants_kept);
        }
        let Some(best) =
            (start..met.len()).reduce(|a, b| if met[b].errors.rms() < met[a].errors.rms() { b } else { a })
        else {
            break;
        };
        if met[best].errors.rms() >= met[at].errors.rms() {
            break;
        }
        at = best;
    }
    let least =
        (0..met.len()).reduce(|a, b| if met[b].errors.rms() < met[a].errors.rms() { b } else { a }).unwrap_or(0);
    let excess: Vec<[f64; 2]> = met.iter().map(|one| one.errors.excess_over(&met[least].errors)).collect();
    let within = |index: &usize| *index == least || excess[*index][0] <= excess[*index][1];
    // Of equally simple ones the better.
    let order = |a: &usize, b: &usize| {
        let complexity = |index: usize| met[index].complexity(columns);
        complexity(*a).cmp(&complexity(*b)).then(met[*a].errors.rms().total_cmp(&met[*b].errors.rms()))
    };
    let chosen = (0..met.len()).filter(within).min_by(order).unwrap_or(least);
    let candidate = |(index, one): (usize, &ScoredCandidate)| FrictionCandidate {
        term: one.name(),
        parameters: one.present().iter().map(|&place| columns[place].term.symbol()).collect(),
        complexity: one.complexity(columns),
        cv_error_nm: one.errors.rms(),
        excess_standard_errors: if index == least || excess[index][1] <= 0.0 {
            0.0
        } else {
            excess[index][0] / excess[index][1]
        },
        chosen: index == chosen,
    };
    let present: Vec<&CandidateColumn> = met[chosen].present().iter().map(|&place| &columns[place]).collect();
    let friction = JointFriction {
        joint,
        chosen: met[chosen].present_name(columns),
        terms: Some(stated(&present)),
        folds: count,
        candidates: met.iter().enumerate().map(candidate).collect(),
    };
    (friction, met[chosen].present())
}
