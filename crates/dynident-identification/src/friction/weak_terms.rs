//! Terms that were chosen between the points of a grid and are not seen once their constants are free.
//!
//! A step whose width lies between two points of the grid looks like a further term there. Once the constants are found
//! together with all parameters, a further term has to stand on its own: its coefficient with the steps of its own
//! constants, or for friction by direction the difference of its two coefficients, has to be as far from zero as chance
//! would not take it, with what is unknown of all other parameters and constants in the covariance: Wald's test,
//! `xᵀ Σ⁻¹ x` against χ².

use dynident_dynamics::Column;
use dynident_estimation::Estimate;
use dynident_model::terms::{Coulomb, Direction, DirectionalCoulomb, DirectionalViscous, TorqueTerm, Viscous};
use nalgebra::{DMatrix, DVector};

/// Squares in units of their variance that a further term needs, with 1, 2, 3 numbers of its own: chance goes beyond
/// them once in twenty times (χ²). Stricter tests drop terms that predict torque better although they are not the
/// truth.
const SEEN: [f64; 3] = [3.84, 5.99, 7.81];

/// The terms of a joint without the further one that is seen least; `None` where all of them are seen. `estimate`
/// begins with the model's `columns`; `own_constants` tells at which of its columns the constants of a term stand, as
/// steps from where they are.
pub(super) fn without_weakest(
    terms: &[TorqueTerm],
    columns: &[Column],
    estimate: &Estimate,
    own_constants: impl Fn(&TorqueTerm) -> Vec<usize>,
) -> Option<Vec<TorqueTerm>> {
    let place =
        |term: &TorqueTerm| columns.iter().position(|column| matches!(column, Column::Term(own) if own == term));
    // How far from zero in units of what it needs, and what is left without it.
    let seen = |term: &TorqueTerm| -> Option<(f64, Vec<TorqueTerm>)> {
        let own = place(term)?;
        let without = |others: &[&TorqueTerm]| terms.iter().filter(|one| !others.contains(one)).cloned().collect();
        if let Some((other, of_both)) = other_direction(term) {
            let other_place = place(&other)?;
            let difference = estimate.values[own] - estimate.values[other_place];
            let covariance = |a: usize, b: usize| estimate.covariance[(a, b)];
            let variance =
                covariance(own, own) + covariance(other_place, other_place) - 2.0 * covariance(own, other_place);
            let mut left: Vec<TorqueTerm> = without(&[term, &other]);
            left.push(of_both);
            return Some((difference * difference / variance.max(f64::MIN_POSITIVE) / SEEN[0], left));
        }
        if !matches!(
            term,
            TorqueTerm::Stribeck(_) | TorqueTerm::Power(_) | TorqueTerm::Load(_) | TorqueTerm::MaxwellSlip(_)
        ) {
            return None;
        }
        let left = without(&[term]);
        // Friction that drives the joint is none.
        if term.is_nonnegative() && estimate.values[own] <= 0.0 {
            return Some((0.0, left));
        }
        let places: Vec<usize> = core::iter::once(own).chain(own_constants(term)).take(SEEN.len()).collect();
        let x = DVector::from_iterator(places.len(), places.iter().map(|&place| estimate.values[place]));
        let covariance =
            DMatrix::from_fn(places.len(), places.len(), |a, b| estimate.covariance[(places[a], places[b])]);
        let square = x.dot(&covariance.cholesky()?.solve(&x));
        Some((square / SEEN[places.len() - 1], left))
    };
    let weakest = terms.iter().filter_map(seen).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (weakest.0 < 1.0).then_some(weakest.1)
}

/// For a forward term that of the other direction, and the one that is the same for both.
fn other_direction(term: &TorqueTerm) -> Option<(TorqueTerm, TorqueTerm)> {
    match term {
        TorqueTerm::DirectionalViscous(own) if own.direction == Direction::Forward => {
            let other = DirectionalViscous { direction: Direction::Backward, ..*own };
            Some((TorqueTerm::DirectionalViscous(other), TorqueTerm::Viscous(Viscous { joint: own.joint })))
        }
        TorqueTerm::DirectionalCoulomb(own) if own.direction == Direction::Forward => {
            let other = DirectionalCoulomb { direction: Direction::Backward, ..*own };
            let of_both = Coulomb { joint: own.joint, shape: own.shape };
            Some((TorqueTerm::DirectionalCoulomb(other), TorqueTerm::Coulomb(of_both)))
        }
        _ => None,
    }
}
