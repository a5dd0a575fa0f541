//! Test for friction terms that were selected with constants on a grid but are insignificant with free constants.
//!
//! If the true width of a smoothed sign lies between two grid points, the difference looks like an additional term.
//! Therefore each additional term must remain significant after the constants are estimated together with all
//! parameters. The test is Wald's test, `xᵀ Σ⁻¹ x` compared with χ². Here x is the coefficient of the term with the
//! steps of its own constants, or for directional friction the difference of its two coefficients; the covariance Σ
//! includes the uncertainty of all other parameters and constants. In addition, there must be rows in which the term
//! acts. For example, if Stribeck friction decays below the slowest velocities of the rows, the rows contain only its
//! tail, and its coefficient (the torque at rest) is arbitrary.

use crate::thresholds::FrictionThresholds;
use dynident_dynamics::Column;
use dynident_estimation::Estimate;
use dynident_model::terms::{CandidateRole, TermAction, TorqueTerm};
use nalgebra::{DMatrix, DVector};

struct FurtherTerm {
    /// Wald statistic of the term; 0 for negative friction or without rows in which the term acts.
    wald: f64,
    degrees_of_freedom: usize,
    term: TorqueTerm,
    /// Terms of the joint without this term.
    others: Vec<TorqueTerm>,
}

impl FurtherTerm {
    fn significance(&self, critical: &[f64; 3]) -> f64 {
        self.wald / critical[self.degrees_of_freedom - 1]
    }
}

/// Test of additional terms in a fit.
pub(super) struct TermTest<'a> {
    pub(super) columns: &'a [Column],
    /// Norms of the model's columns over all rows.
    pub(super) norms: &'a [f64],
    /// Estimate of the parameters of these columns, followed by other unknowns.
    pub(super) estimate: &'a Estimate,
    pub(super) thresholds: FrictionThresholds,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weak {
    Insignificant,
    /// Only terms with negative friction or without rows in which they act.
    Unsupported,
}

impl TermTest<'_> {
    /// Additional terms (beyond viscous and Coulomb friction) of a joint, with their tests. `own_constants` returns the
    /// columns of a term's constants in the estimate, which are steps from their current values.
    fn further_terms(
        &self,
        terms: &[TorqueTerm],
        own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
    ) -> Vec<FurtherTerm> {
        let Self { columns, norms, estimate, thresholds } = self;
        let place =
            |term: &TorqueTerm| columns.iter().position(|column| matches!(column, Column::Term(own) if own == term));
        let of = |term: &TorqueTerm| -> Option<FurtherTerm> {
            let own = place(term)?;
            let without = |others: &[&TorqueTerm]| terms.iter().filter(|one| !others.contains(one)).cloned().collect();
            let further = |wald: f64, degrees_of_freedom: usize, others: Vec<TorqueTerm>| {
                Some(FurtherTerm { wald, degrees_of_freedom, term: term.clone(), others })
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
            // Rejects terms with negative friction or without rows in which they act.
            let fades = matches!(term.action(), TermAction::Friction(friction) if friction.fading.is_some());
            let is_shown = !fades || norms[own] * norms[own] >= thresholds.min_column_square_sum;
            if !is_shown || (term.is_nonnegative() && estimate.values[own] <= 0.0) {
                return further(0.0, 1, left);
            }
            let places: Vec<usize> =
                core::iter::once(own).chain(own_constants(term)).take(thresholds.term_chi_square.len()).collect();
            let x = DVector::from_iterator(places.len(), places.iter().map(|&place| estimate.values[place]));
            let covariance =
                DMatrix::from_fn(places.len(), places.len(), |a, b| estimate.covariance[(places[a], places[b])]);
            further(x.dot(&covariance.cholesky()?.solve(&x)), places.len(), left)
        };
        terms.iter().filter_map(of).collect()
    }

    /// Terms of a joint without the weakest additional term; `None` if no additional term is `weak`.
    pub(super) fn without_weakest(
        &self,
        terms: &[TorqueTerm],
        weak: Weak,
        own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
    ) -> Option<Vec<TorqueTerm>> {
        let of = |further: FurtherTerm| (further.significance(&self.thresholds.term_chi_square), further.others);
        let further = self.further_terms(terms, own_constants).into_iter().map(of);
        let (significance, others) = further.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let is_weak = match weak {
            Weak::Insignificant => significance < 1.0,
            Weak::Unsupported => significance <= 0.0,
        };
        is_weak.then_some(others)
    }

    /// Whether a joint has possibly insignificant additional terms that were not in its first selection, `before`.
    pub(super) fn has_doubtful_term(
        &self,
        terms: &[TorqueTerm],
        before: &[TorqueTerm],
        own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
    ) -> bool {
        let kind = core::mem::discriminant;
        let is_new = |further: &FurtherTerm| !before.iter().any(|one| kind(one) == kind(&further.term));
        let critical = &self.thresholds.second_selection_chi_square;
        let further = self.further_terms(terms, own_constants);
        further.iter().any(|further| is_new(further) && further.significance(critical) < 1.0)
    }
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
        // Stribeck friction is 2 Nm with a Stribeck velocity of 0.3. With the narrow Stribeck velocity, it is only
        // 1.5 Nm in the slowest row, like an outlier. A deterministic ripple is used as noise.
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
        let thresholds = FrictionThresholds::default();
        let test = TermTest { columns: &columns, norms: &norms, estimate: &estimate, thresholds };
        let without = |weak| test.without_weakest(&terms, weak, |_| Vec::new());
        assert_eq!(without(Weak::Unsupported), without(Weak::Insignificant));
        without(Weak::Insignificant)
    }

    /// Coulomb friction of 5.0 and 5.085 Nm by direction, with an error bar of 0.035 Nm for the difference. At two and
    /// a half error bars (p = 1/65) it is significant in the first selection but not in a second one.
    #[test]
    fn terms_of_a_second_selection_need_stronger_evidence() {
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
        let thresholds = FrictionThresholds::default();
        let test = TermTest { columns: &columns, norms: &norms, estimate: &estimate, thresholds };
        let further = test.further_terms(&terms, |_| Vec::new());
        assert_eq!(further.len(), 1);
        let range = thresholds.term_chi_square[0]..thresholds.second_selection_chi_square[0];
        assert!(range.contains(&further[0].wald), "{}", further[0].wald);

        let plain = [TorqueTerm::Coulomb(Coulomb { joint: 0, shape })];
        let is_doubtful = |before: &[TorqueTerm]| test.has_doubtful_term(&terms, before, |_| Vec::new());
        assert_eq!(test.without_weakest(&terms, Weak::Insignificant, |_| Vec::new()), None);
        // A weak term can still have supporting rows.
        let blurred = estimate.with_further_error(&DMatrix::from_diagonal_element(2, 2, 1.0));
        let of_blurred = TermTest { columns: &columns, norms: &norms, estimate: &blurred, thresholds };
        let without = |weak| of_blurred.without_weakest(&terms, weak, |_| Vec::new());
        assert_eq!(without(Weak::Insignificant).as_deref(), Some(&plain[..]));
        assert_eq!(without(Weak::Unsupported), None);
        assert!(is_doubtful(&plain) && !is_doubtful(&terms));
    }

    /// The coefficient is thousands of Nm and far above its error bar, although the term reaches only a hundredth of it
    /// in the rows.
    #[test]
    fn stribeck_friction_below_the_slowest_rows_is_dropped() {
        assert_eq!(left_without(0.3), None);
        assert_eq!(left_without(0.0165).map(|terms| terms.len()), Some(1));
    }
}
