//! Terms that were chosen between the points of a grid and are not seen once their constants are free.
//!
//! A step whose width lies between two points of the grid looks like a further term there. Once the constants are found
//! together with all parameters, a further term has to stand on its own: its coefficient with the steps of its own
//! constants, or for friction by direction the difference of its two coefficients, has to be as far from zero as chance
//! would not take it, with what is unknown of all other parameters and constants in the covariance: Wald's test,
//! `xᵀ Σ⁻¹ x` against χ². And the rows have to show it: Stribeck friction that falls off below the slowest velocities
//! of the rows is seen by its last tail alone, so that its coefficient, the torque at rest, is any number.

use dynident_dynamics::Column;
use dynident_estimation::Estimate;
use dynident_model::terms::{CandidateRole, TermAction, TorqueTerm};
use nalgebra::{DMatrix, DVector};

/// Squares in units of their variance that a further term needs, with 1, 2, 3 numbers of its own: chance goes beyond
/// them once in twenty times (χ²). Stricter tests drop terms that predict torque better although they are not the
/// truth.
const SEEN: [f64; 3] = [3.84, 5.99, 7.81];
/// The same for once in a hundred times: what a second look at the same motion needs to add a term that the first did
/// not show, for then every joint has been asked for every term twice.
const SEEN_AT_SECOND_LOOK: [f64; 3] = [6.63, 9.21, 11.34];

/// The sum of squares of a Stribeck term's column, `Σ e^{-2|q̇/v_s|^δ}`, below which no row shows it: less than one row
/// at rest would.
const SHOWN: f64 = 1.0;

/// A further term of a joint.
struct Further {
    /// Its square in units of its variance; 0 for what is not friction or what no row shows.
    square: f64,
    /// How many numbers are its own.
    numbers: usize,
    term: TorqueTerm,
    /// The joint's terms without it.
    left: Vec<TorqueTerm>,
}

impl Further {
    /// In units of what it needs.
    fn in_units_of(&self, needed: &[f64; 3]) -> f64 {
        self.square / needed[self.numbers - 1]
    }
}

/// The further ones among the terms of a joint. `estimate` begins with the model's `columns`, whose norms over all rows
/// are `norms`; `own_constants` tells at which of its columns the constants of a term stand, as steps from where they
/// are.
fn further_terms(
    terms: &[TorqueTerm],
    columns: &[Column],
    norms: &[f64],
    estimate: &Estimate,
    own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
) -> Vec<Further> {
    let place =
        |term: &TorqueTerm| columns.iter().position(|column| matches!(column, Column::Term(own) if own == term));
    let of = |term: &TorqueTerm| -> Option<Further> {
        let own = place(term)?;
        let without = |others: &[&TorqueTerm]| terms.iter().filter(|one| !others.contains(one)).cloned().collect();
        let further = |square: f64, numbers: usize, left: Vec<TorqueTerm>| {
            Some(Further { square, numbers, term: term.clone(), left })
        };
        if let Some([other, of_both]) = term.kind().both_directions() {
            let other_place = place(&other)?;
            let difference = estimate.values[own] - estimate.values[other_place];
            let covariance = |a: usize, b: usize| estimate.covariance[(a, b)];
            let variance =
                covariance(own, own) + covariance(other_place, other_place) - 2.0 * covariance(own, other_place);
            let mut left: Vec<TorqueTerm> = without(&[term, &other]);
            left.push(of_both);
            return further(difference * difference / variance.max(f64::MIN_POSITIVE), 1, left);
        }
        term.candidate().filter(|law| law.role == CandidateRole::Addition)?;
        let left = without(&[term]);
        // Friction that drives the joint is none, and what no row shows is none that is known.
        let fades = matches!(term.action(), TermAction::Friction(friction) if friction.fading.is_some());
        let is_shown = !fades || norms[own] * norms[own] >= SHOWN;
        if !is_shown || (term.is_nonnegative() && estimate.values[own] <= 0.0) {
            return further(0.0, 1, left);
        }
        let places: Vec<usize> = core::iter::once(own).chain(own_constants(term)).take(SEEN.len()).collect();
        let x = DVector::from_iterator(places.len(), places.iter().map(|&place| estimate.values[place]));
        let covariance =
            DMatrix::from_fn(places.len(), places.len(), |a, b| estimate.covariance[(places[a], places[b])]);
        further(x.dot(&covariance.cholesky()?.solve(&x)), places.len(), left)
    };
    terms.iter().filter_map(of).collect()
}

/// Which further terms are weak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weak {
    /// Those that are not seen: chance would make as much.
    Unseen,
    /// Those alone that drive the joint or that no row shows.
    Unshown,
}

/// The terms of a joint without the further one that is seen least; `None` where none is `weak`. The estimate, its
/// columns and the constants are as in [`further_terms`].
pub(super) fn without_weakest(
    (terms, weak): (&[TorqueTerm], Weak),
    columns: (&[Column], &[f64]),
    estimate: &Estimate,
    own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
) -> Option<Vec<TorqueTerm>> {
    let of = |further: Further| (further.in_units_of(&SEEN), further.left);
    let further = further_terms(terms, columns.0, columns.1, estimate, own_constants).into_iter().map(of);
    let (seen, left) = further.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_weak = match weak {
        Weak::Unseen => seen < 1.0,
        Weak::Unshown => seen <= 0.0,
    };
    is_weak.then_some(left)
}

/// Whether further terms of a joint of which a first look at the same motion had none, whose terms are `before`, may
/// be chance. The estimate, its columns and the constants are as in [`further_terms`].
pub(super) fn has_doubtful_term(
    (terms, before): (&[TorqueTerm], &[TorqueTerm]),
    columns: (&[Column], &[f64]),
    estimate: &Estimate,
    own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
) -> bool {
    let kind = core::mem::discriminant;
    let is_new = |further: &Further| !before.iter().any(|one| kind(one) == kind(&further.term));
    let further = further_terms(terms, columns.0, columns.1, estimate, own_constants);
    further.iter().any(|further| is_new(further) && further.in_units_of(&SEEN_AT_SECOND_LOOK) < 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_estimation::{
        CovarianceMethod, LinearProblem, OrdinarySettings, SegmentSettings, SegmentedFactor, ordinary_least_squares,
    };
    use dynident_model::terms::{Coulomb, CoulombShape, Direction, DirectionalCoulomb, Stribeck};

    /// Rows at velocities from 0.05 to 1 rad/s of a joint with 5 Nm of Coulomb and, where that is seen, 2 Nm of
    /// Stribeck friction, and what an iteration's search made of such rows: a term that has faded to 1e-4 at the
    /// slowest.
    fn left_without(speed: f64) -> Option<Vec<TorqueTerm>> {
        let shape = CoulombShape::Sign { dead_band: 0.0 };
        let terms = [
            TorqueTerm::Coulomb(Coulomb { joint: 0, shape }),
            TorqueTerm::Stribeck(Stribeck { joint: 0, speed, exponent: 2.0, shape }),
        ];
        let columns: Vec<Column> = terms.iter().cloned().map(Column::Term).collect();
        let count = 200;
        let velocity = |row: usize| 0.05 + 0.95 * row as f64 / count as f64;
        let faded = |row: usize| (-(velocity(row) / speed).powi(2)).exp();
        // 2 Nm where a Stribeck velocity of 0.3 shows them; of the narrow one 1.5 Nm in the slowest row, as an outlier
        // would be; a deterministic ripple is the noise.
        let size = if speed > 0.1 { 2.0 } else { 1.5 / faded(0) };
        let torque = |row: usize| 5.0 + size * faded(row) + 0.02 * (row as f64 * 2.4).sin();
        let values: Vec<f64> =
            (0..count).map(|_| 1.0).chain((0..count).map(faded)).chain((0..count).map(torque)).collect();
        let mut factor = SegmentedFactor::new(2, SegmentSettings { max_segments: 20, first_length_rows: 10 }).unwrap();
        factor.absorb(&values, count).unwrap();
        let mut problem = LinearProblem::new(vec!["fc1".to_owned(), "fs1".to_owned()], vec!["joint1".to_owned()]);
        problem.add("log", 0, vec![0, 1], factor).unwrap();
        let estimate = ordinary_least_squares(&problem, &OrdinarySettings::default()).unwrap();
        // Far beyond its own bar, both times.
        assert!(estimate.values[1] > 5.0 * estimate.std[1], "{} +- {}", estimate.values[1], estimate.std[1]);
        let norms = problem.column_norms();
        let without = |weak| without_weakest((&terms, weak), (&columns, &norms), &estimate, |_| Vec::new());
        assert_eq!(without(Weak::Unshown), without(Weak::Unseen));
        without(Weak::Unseen)
    }

    /// Steps of Coulomb friction of 5.0 and 5.085 Nm by direction in rows that know the difference to 0.035: two and a
    /// half bars from zero, which chance shows once in 65 times: seen at one look, and maybe chance at a second.
    #[test]
    fn what_a_second_look_adds_has_to_be_seen_more_clearly() {
        let shape = CoulombShape::Sign { dead_band: 0.0 };
        let of = |direction| TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint: 0, direction, shape });
        let terms = [of(Direction::Forward), of(Direction::Backward)];
        let columns: Vec<Column> = terms.iter().cloned().map(Column::Term).collect();
        let count = 400;
        let is_forward = |row: usize| f64::from(u8::from(row % 40 < 20));
        // A ripple of no period that the direction has, 0.35 Nm root mean square.
        let ripple = |row: usize| 0.5 * (row as f64 * 2.4).sin();
        let torque = |row: usize| 5.085 * is_forward(row) - 5.0 * (1.0 - is_forward(row)) + ripple(row);
        let rows = 0..count;
        let values: Vec<f64> = (rows.clone().map(is_forward))
            .chain(rows.clone().map(|row| is_forward(row) - 1.0))
            .chain(rows.map(torque))
            .collect();
        let mut factor = SegmentedFactor::new(2, SegmentSettings { max_segments: 2, first_length_rows: 200 }).unwrap();
        factor.absorb(&values, count).unwrap();
        let mut problem = LinearProblem::new(vec!["fcp1".to_owned(), "fcn1".to_owned()], vec!["joint1".to_owned()]);
        problem.add("log", 0, vec![0, 1], factor).unwrap();
        let settings = OrdinarySettings { covariance: CovarianceMethod::White, ..OrdinarySettings::default() };
        let estimate = ordinary_least_squares(&problem, &settings).unwrap();
        let norms = problem.column_norms();
        let further = further_terms(&terms, &columns, &norms, &estimate, |_| Vec::new());
        assert_eq!(further.len(), 1);
        assert!((SEEN[0]..SEEN_AT_SECOND_LOOK[0]).contains(&further[0].square), "{}", further[0].square);

        let plain = [TorqueTerm::Coulomb(Coulomb { joint: 0, shape })];
        let is_doubtful =
            |before: &[TorqueTerm]| has_doubtful_term((&terms, before), (&columns, &norms), &estimate, |_| Vec::new());
        let without =
            |weak, estimate: &_| without_weakest((&terms, weak), (&columns, &norms), estimate, |_| Vec::new());
        assert_eq!(without(Weak::Unseen, &estimate), None);
        // What is too weak is shown all the same.
        let blurred = estimate.with_further_error(&DMatrix::from_diagonal_element(2, 2, 1.0));
        assert_eq!(without(Weak::Unseen, &blurred).as_deref(), Some(&plain[..]));
        assert_eq!(without(Weak::Unshown, &blurred), None);
        assert!(is_doubtful(&plain) && !is_doubtful(&terms));
    }

    /// Its coefficient is thousands of Nm, many bars from zero, and no row has shown a hundredth of it.
    #[test]
    fn stribeck_friction_below_the_slowest_rows_is_not_seen() {
        assert_eq!(left_without(0.3), None);
        assert_eq!(left_without(0.0165).map(|terms| terms.len()), Some(1));
    }
}
