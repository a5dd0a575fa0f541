//! Search for one joint's friction among the candidate columns in its triangular factors.
//!
//! Coulomb friction that differs by direction is only tried if the rows distinguish it from gravity, offsets and the
//! other columns: see [`FrictionSearch::most_inflation`](super::FrictionSearch::most_inflation).
//!
//! The search starts twice: with viscous and Coulomb friction, and with these two and a sigmoid. It adds one term at a
//! time, always the term that reduces the error most. Of all tried candidates, it selects the simplest one whose mean
//! square error is within one standard error of the minimum (Hastie, Tibshirani and Friedman, *The Elements of
//! Statistical Learning*, 7.10). The standard error is computed from the differences between two candidates in each
//! time block, because blocks differ far more than candidates.
//!
//! Laws with hysteresis or load dependence have a disadvantage besides their additional parameters: not every
//! controller and simulator supports them. Such a law is selected only if it is clearly better than the best selection
//! without such laws ([`FrictionThresholds`](crate::FrictionThresholds)).
//!
//! A nonlinear constant of a term (a width, a velocity) may lie between two neighbouring grid points. The columns of
//! both points together approximate the column between them, so a coarse grid does not cause additional terms.

use super::candidates::{CandidateColumn, FrictionKind, JointScale, options, takes_one};
use super::constants::{mean_term, with_one_step};
use super::joint_friction::{FrictionCandidate, JointFriction, UnrestrictedFriction};
use crate::thresholds::FrictionThresholds;
use dynident_estimation::{FoldErrors, JointFolds};
use dynident_model::terms::{CandidateRole, TorqueTerm};

/// Maximum number of terms that are added to viscous and Coulomb friction.
const MAX_ADDED_TERMS: usize = 3;

struct ScoredCandidate {
    kinds: Vec<FrictionKind>,
    places: Vec<usize>,
    errors: FoldErrors,
}

impl ScoredCandidate {
    /// Columns of one kind of friction whose value is not zero.
    fn present(&self, columns: &[CandidateColumn], kind: FrictionKind) -> Vec<(usize, f64)> {
        let values = self.places.iter().copied().zip(self.errors.coefficients.iter().copied());
        values.filter(|&(place, value)| value != 0.0 && columns[place].kind == kind).collect()
    }

    /// Terms of this candidate with nonzero values, with their constants; both directions of a directional term.
    fn terms(&self, columns: &[CandidateColumn], scale: JointScale) -> Vec<TorqueTerm> {
        self.kinds.iter().flat_map(|&kind| self.terms_of(columns, kind, scale)).collect()
    }

    fn terms_of(&self, columns: &[CandidateColumn], kind: FrictionKind, scale: JointScale) -> Vec<TorqueTerm> {
        let present = self.present(columns, kind);
        if !takes_one(kind) {
            let mut stated: Vec<TorqueTerm> = Vec::new();
            for term in present.iter().flat_map(|&(place, _)| &columns[place].stated) {
                if !stated.contains(term) {
                    stated.push(term.clone());
                }
            }
            return stated;
        }
        let Some(&(first, _)) = present.first() else { return Vec::new() };
        // One grid point can have several terms.
        let weighted = |number: usize| -> Vec<(&TorqueTerm, f64)> {
            present.iter().map(|&(place, value)| (&columns[place].stated[number], value)).collect()
        };
        (0..columns[first].stated.len()).map(|number| mean_term(&weighted(number), scale)).collect()
    }

    fn parameters(&self, columns: &[CandidateColumn]) -> Vec<String> {
        let mut symbols: Vec<String> = Vec::new();
        for (place, _) in self.kinds.iter().flat_map(|&kind| self.present(columns, kind)) {
            let symbol = columns[place].term.symbol();
            if !symbols.contains(&symbol) {
                symbols.push(symbol);
            }
        }
        symbols
    }

    fn complexity(&self, columns: &[CandidateColumn]) -> usize {
        let is_present = |kind: &&FrictionKind| !self.present(columns, kind).is_empty();
        let constants = self.kinds.iter().filter(is_present).map(|kind| kind.constants);
        self.parameters(columns).len() + constants.sum::<usize>()
    }

    fn present_name(&self, columns: &[CandidateColumn]) -> String {
        let is_present = |kind: &&FrictionKind| !self.present(columns, kind).is_empty();
        let names: Vec<&str> = self.kinds.iter().filter(is_present).map(|kind| kind.name).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(" + ") }
    }

    fn name(&self) -> String {
        self.kinds.iter().map(|kind| kind.name).collect::<Vec<_>>().join(" + ")
    }
}

/// Finds the best constants of a model with the given kinds of terms. Constants in `before` are kept, except those of
/// the smoothed sign, whose velocities overlap with those of the new term.
fn tuned(
    folds: &JointFolds,
    columns: &[CandidateColumn],
    kinds: Vec<FrictionKind>,
    before: Option<&ScoredCandidate>,
) -> ScoredCandidate {
    let mut choices: Vec<Vec<usize>> = vec![Vec::new()];
    for &kind in &kinds {
        let options = options(kind, columns);
        let kept = before.filter(|_| !kind.is_step).and_then(|before| {
            let of_kind = |place: &&usize| columns[**place].kind == kind;
            let places: Vec<usize> = before.places.iter().filter(of_kind).copied().collect();
            options.contains(&places).then_some(places)
        });
        let options = kept.map_or(options, |kept| vec![kept]);
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
    // Among equal candidates the first one is selected, so that results are reproducible.
    evaluated
        .reduce(|best, next| if next.errors.rms() < best.errors.rms() { next } else { best })
        .unwrap_or_else(|| ScoredCandidate { kinds, places: Vec::new(), errors: folds.errors(&[], &[]) })
}

/// Variance inflation of the difference between both directions of Coulomb friction in a model, given the model's other
/// columns and the common columns. (`|s|` of the smoothed sign s is constant except near rest, and gravity can be
/// constant, too.) 1 for a model without such a difference.
fn asymmetry_inflation(folds: &JointFolds, columns: &[CandidateColumn], model: &ScoredCandidate) -> f64 {
    let steps: Vec<(usize, f64)> = model
        .kinds
        .iter()
        .filter(|kind| kind.is_common_step())
        .flat_map(|&kind| model.present(columns, kind))
        .collect();
    let whole: f64 = steps.iter().map(|(_, value)| value).sum();
    let (mut difference, mut sum) = (Vec::new(), Vec::new());
    for (place, value) in steps {
        // An exact sign function has no grid index; the narrowest smoothed sign is used instead.
        let step = columns[place].grid.unwrap_or(0);
        let is_direction = |at: &usize| is_step_by_direction(columns[*at].kind) && columns[*at].grid == Some(step);
        let mut directions = (0..columns.len()).filter(is_direction);
        let (Some(forward), Some(backward)) = (directions.next(), directions.next()) else { continue };
        let share = value / whole;
        difference.extend([(forward, share), (backward, -share)]);
        sum.extend([(forward, share), (backward, share)]);
    }
    if difference.is_empty() {
        return 1.0;
    }
    let others: Vec<[(usize, f64); 1]> = model
        .places
        .iter()
        .filter(|&&place| !columns[place].kind.is_common_step())
        .map(|&place| [(place, 1.0)])
        .collect();
    let others: Vec<&[(usize, f64)]> = others.iter().map(|one| &one[..]).chain([&sum[..]]).collect();
    folds.variance_inflation(&difference, &others)
}

fn is_step_by_direction(kind: FrictionKind) -> bool {
    kind.is_step && !kind.is_common_step()
}

/// Adds terms to `start` one at a time, always the term that reduces the error most. All tried models are appended to
/// `tried`.
fn add_terms(
    folds: &JointFolds,
    columns: &[CandidateColumn],
    start: Vec<FrictionKind>,
    max_inflation: f64,
    is_permitted: &dyn Fn(FrictionKind) -> bool,
    tried: &mut Vec<ScoredCandidate>,
) {
    let mut additions: Vec<FrictionKind> = columns
        .iter()
        .map(|column| column.kind)
        .filter(|kind| matches!(kind.role, CandidateRole::InPlaceOf(_) | CandidateRole::Addition))
        .collect();
    additions.dedup();
    additions.retain(|&kind| is_permitted(kind));
    let mut at = tried.len();
    tried.push(tuned(folds, columns, start, None));
    let is_distinct =
        max_inflation == f64::INFINITY || asymmetry_inflation(folds, columns, &tried[at]) <= max_inflation;
    additions.retain(|kind| is_distinct || !is_step_by_direction(kind));
    for _ in 0..MAX_ADDED_TERMS {
        let start = tried.len();
        for &added in &additions {
            let replaced = added.replaces();
            let has = |kind: FrictionKind| tried[at].kinds.contains(&kind);
            if has(added) || replaced.is_some_and(|replaced| !has(replaced)) {
                continue;
            }
            let mut kinds: Vec<FrictionKind> =
                tried[at].kinds.iter().copied().filter(|kind| Some(*kind) != replaced).collect();
            kinds.push(added);
            kinds.sort_by_key(|kind| kind.rank());
            let with_constants_kept = tuned(folds, columns, kinds, Some(&tried[at]));
            tried.push(with_constants_kept);
        }
        let Some(best) =
            (start..tried.len()).reduce(|a, b| if tried[b].errors.rms() < tried[a].errors.rms() { b } else { a })
        else {
            break;
        };
        if tried[best].errors.rms() >= tried[at].errors.rms() {
            break;
        }
        at = best;
    }
}

/// Candidates that a search compared, and the index of the selected one.
struct Selection {
    tried: Vec<ScoredCandidate>,
    chosen: usize,
    least: usize,
    excess: Vec<[f64; 2]>,
}

impl Selection {
    /// Compares models with the permitted kinds of terms.
    fn new(
        folds: &JointFolds,
        columns: &[CandidateColumn],
        max_inflation: f64,
        is_permitted: &dyn Fn(FrictionKind) -> bool,
    ) -> Self {
        let mut tried = Vec::new();
        let of_role = |role: CandidateRole| TorqueTerm::candidates().filter(move |kind| kind.role == role);
        for start in of_role(CandidateRole::Start).filter(|&kind| is_permitted(kind)) {
            let kinds = of_role(CandidateRole::Base).chain([start]).collect();
            add_terms(folds, columns, kinds, max_inflation, is_permitted, &mut tried);
        }
        let by_error = |a: usize, b: usize| if tried[b].errors.rms() < tried[a].errors.rms() { b } else { a };
        let least = (0..tried.len()).reduce(by_error).unwrap_or(0);
        let excess: Vec<[f64; 2]> = tried.iter().map(|one| one.errors.excess_over(&tried[least].errors)).collect();
        let within = |index: &usize| *index == least || excess[*index][0] <= excess[*index][1];
        // Among equally simple candidates, the smaller error is preferred.
        let order = |a: &usize, b: &usize| {
            let complexity = |index: usize| tried[index].complexity(columns);
            complexity(*a).cmp(&complexity(*b)).then(tried[*a].errors.rms().total_cmp(&tried[*b].errors.rms()))
        };
        let chosen = (0..tried.len()).filter(within).min_by(order).unwrap_or(least);
        Self { tried, chosen, least, excess }
    }

    /// Compares models with the permitted kinds of terms. Laws with load dependence or hysteresis are selected only if
    /// they are clearly better.
    fn with_clear_gain(
        folds: &JointFolds,
        columns: &[CandidateColumn],
        max_inflation: f64,
        thresholds: &FrictionThresholds,
        is_permitted: &dyn Fn(FrictionKind) -> bool,
    ) -> Self {
        let all = Self::new(folds, columns, max_inflation, is_permitted);
        let is_simple =
            |kind: FrictionKind| of_kind(columns, kind).all(|one| !one.term.has_memory() && !one.term.needs_load());
        let best = all.best();
        if best.kinds.iter().all(|&kind| is_simple(kind) || best.present(columns, kind).is_empty()) {
            return all;
        }
        let simple = Self::new(folds, columns, max_inflation, &|kind| is_permitted(kind) && is_simple(kind));
        let is_clear = best.errors.rms() < (1.0 - thresholds.min_gain_ratio) * simple.best().errors.rms();
        if is_clear { all } else { simple }
    }

    fn best(&self) -> &ScoredCandidate {
        &self.tried[self.chosen]
    }

    fn candidates(&self, columns: &[CandidateColumn]) -> Vec<FrictionCandidate> {
        let candidate = |(index, one): (usize, &ScoredCandidate)| FrictionCandidate {
            term: one.name(),
            parameters: one.parameters(columns),
            complexity: one.complexity(columns),
            cv_error_nm: one.errors.rms(),
            excess_standard_errors: if index == self.least || self.excess[index][1] <= 0.0 {
                0.0
            } else {
                self.excess[index][0] / self.excess[index][1]
            },
            chosen: index == self.chosen,
        };
        self.tried.iter().enumerate().map(candidate).collect()
    }
}

fn of_kind(columns: &[CandidateColumn], kind: FrictionKind) -> impl Iterator<Item = &CandidateColumn> {
    columns.iter().filter(move |column| column.kind == kind)
}

/// Limits of the search for one joint.
pub(crate) struct SearchLimits<'a> {
    /// Maximum variance inflation of Coulomb friction that differs by direction.
    pub(crate) max_inflation: f64,
    pub(crate) thresholds: &'a FrictionThresholds,
}

pub(super) fn search(
    joint: String,
    scale: JointScale,
    count: usize,
    limits: &SearchLimits<'_>,
    folds: &JointFolds,
    columns: &[CandidateColumn],
) -> (JointFriction, Vec<usize>) {
    let among = |is_permitted: &dyn Fn(FrictionKind) -> bool| {
        Selection::with_clear_gain(folds, columns, limits.max_inflation, limits.thresholds, is_permitted)
    };
    let is_permitted = |kind: FrictionKind| of_kind(columns, kind).all(|one| one.is_permitted);
    let selection = among(&is_permitted);
    let best = selection.best();
    let is_restricted = columns.iter().any(|one| !one.is_permitted);
    let unrestricted = is_restricted.then(|| among(&|_| true)).map(|free| UnrestrictedFriction {
        chosen: free.best().present_name(columns),
        cv_error_nm: free.best().errors.rms(),
        restricted_cv_error_nm: best.errors.rms(),
    });
    let friction = JointFriction {
        joint,
        chosen: best.present_name(columns),
        terms: Some(with_one_step(best.terms(columns, scale))),
        constants: Vec::new(),
        folds: count,
        candidates: selection.candidates(columns),
        unrestricted,
    };
    let present = best.kinds.iter().flat_map(|&kind| best.present(columns, kind)).map(|(place, _)| place).collect();
    (friction, present)
}
