//! Friction terms that were selected on the grid but are insignificant with free constants.
//!
//! A step whose width lies between two points of the grid looks like a further term there. After the constants are
//! estimated together with all parameters, a further term must be significant: Wald's test, `xᵀ Σ⁻¹ x` against χ²,
//! where x is its coefficient with the steps of its own constants, or for directional friction the difference of its
//! two coefficients. Σ includes the uncertainty of all other parameters and constants. The rows must also contain the
//! term: with Stribeck friction that decays below the slowest velocities of the rows, only its tail is visible, and the
//! coefficient, the torque at rest, is arbitrary.

use dynident_dynamics::Column;
use dynident_estimation::Estimate;
use dynident_model::terms::{CandidateRole, TermAction, TorqueTerm};
use nalgebra::{DMatrix, DVector};

/// Critical values of Wald's test for a further term with 1, 2 and 3 degrees of freedom: χ² at 5 %. Stricter tests drop
/// terms that improve the prediction although they are not the true ones.
const SEEN: [f64; 3] = [3.84, 5.99, 7.81];
/// The same at 1 %, for terms that only a second selection from the same motion adds, because every term is then tested
/// twice.
const SEEN_AT_SECOND_LOOK: [f64; 3] = [6.63, 9.21, 11.34];

/// Minimum sum of squares of a Stribeck term's column, `Σ e^{-2|q̇/v_s|^δ}`, for supporting rows: less than one row at
/// rest.
const SHOWN: f64 = 1.0;

/// A further term of a joint.
struct Further {
    /// Wald statistic; 0 for negative friction or without supporting rows.
    square: f64,
    /// Degrees of freedom.
    numbers: usize,
    term: TorqueTerm,
    /// The joint's terms without it.
    left: Vec<TorqueTerm>,
}

impl Further {
    /// Ratio to the critical value.
    fn in_units_of(&self, needed: &[f64; 3]) -> f64 {
        self.square / needed[self.numbers - 1]
    }
}

/// Further terms among the terms of a joint. `estimate` begins with the model's `columns`, whose norms over all rows
/// are `norms`. `own_constants` returns the columns of a term's constants, as steps from their current values.
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
        // Reject terms with negative friction or without supporting rows.
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

/// Criterion for weak further terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weak {
    /// Insignificant terms.
    Unseen,
    /// Only terms with negative friction or without supporting rows.
    Unshown,
}

/// The terms of a joint without the weakest further one; `None` if none is `weak`. Other arguments as in
/// [`further_terms`].
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

/// Whether a joint has possibly insignificant further terms that were not in its first selection, `before`. Other
/// arguments as in [`further_terms`].
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

    /// Result for rows at velocities from 0.05 to 1 rad/s with 5 Nm of Coulomb friction and, if visible, 2 Nm of
    /// Stribeck friction. With the narrow Stribeck velocity the term has decayed to 1e-4 at the slowest row.
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
        // 2 Nm for a Stribeck velocity of 0.3; for the narrow one 1.5 Nm in the slowest row, like an outlier. A
        // deterministic ripple is the noise.
        let size = if speed > 0.1 { 2.0 } else { 1.5 / faded(0) };
        let torque = |row: usize| 5.0 + size * faded(row) + 0.02 * (row as f64 * 2.4).sin();
        let values: Vec<f64> =
            (0..count).map(|_| 1.0).chain((0..count).map(faded)).chain((0..count).map(torque)).collect();
        let mut factor = SegmentedFactor::new(2, SegmentSettings { max_segments: 20, first_length_rows: 10 }).unwrap();
        factor.absorb(&values, count).unwrap();
        let mut problem = LinearProblem::new(vec!["fc1".to_owned(), "fs1".to_owned()], vec!["joint1".to_owned()]);
        problem.add("log", 0, vec![0, 1], factor).unwrap();
        let estimate = ordinary_least_squares(&problem, &OrdinarySettings::default()).unwrap();
        // Both estimates are far above their error bars.
        assert!(estimate.values[1] > 5.0 * estimate.std[1], "{} +- {}", estimate.values[1], estimate.std[1]);
        let norms = problem.column_norms();
        let without = |weak| without_weakest((&terms, weak), (&columns, &norms), &estimate, |_| Vec::new());
        assert_eq!(without(Weak::Unshown), without(Weak::Unseen));
        without(Weak::Unseen)
    }

    /// Coulomb friction of 5.0 and 5.085 Nm by direction, with an error bar of 0.035 Nm for the difference. At two and
    /// a half error bars (p = 1/65) it is significant in the first selection but not in a second one.
    #[test]
    fn what_a_second_look_adds_has_to_be_seen_more_clearly() {
        let shape = CoulombShape::Sign { dead_band: 0.0 };
        let of = |direction| TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint: 0, direction, shape });
        let terms = [of(Direction::Forward), of(Direction::Backward)];
        let columns: Vec<Column> = terms.iter().cloned().map(Column::Term).collect();
        let count = 400;
        let is_forward = |row: usize| f64::from(u8::from(row % 40 < 20));
        // A ripple that is not correlated with the direction, 0.35 Nm root mean square.
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
        // A weak term can still have supporting rows.
        let blurred = estimate.with_further_error(&DMatrix::from_diagonal_element(2, 2, 1.0));
        assert_eq!(without(Weak::Unseen, &blurred).as_deref(), Some(&plain[..]));
        assert_eq!(without(Weak::Unshown, &blurred), None);
        assert!(is_doubtful(&plain) && !is_doubtful(&terms));
    }

    /// The coefficient is thousands of Nm and far above its error bar, although the term reaches only a hundredth of it
    /// in the rows.
    #[test]
    fn stribeck_friction_below_the_slowest_rows_is_not_seen() {
        assert_eq!(left_without(0.3), None);
        assert_eq!(left_without(0.0165).map(|terms| terms.len()), Some(1));
    }
}
