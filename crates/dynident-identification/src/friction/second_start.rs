//! Second start values of friction constants.
//!
//! The Gauss-Newton method finds the local minimum near its start values. Two kinds of start values are known to be
//! near the wrong minimum. First, the exact sign function has no width that could change. It is the limit of a narrow
//! smoothed sign, and velocity noise can make it look best on a grid. (With Stribeck friction it is kept, because a
//! separate smoothed sign of the Stribeck term would absorb the friction at rest.) Second, if the smoothed sign of
//! Coulomb friction is wider than half the Stribeck velocity, the two terms have exchanged their roles: the Stribeck
//! term then describes the sign change at rest.

use super::candidates::JointScale;
use super::constants::{is_coulomb, smooth_width, step_of, with_one_step};
use dynident_model::terms::{CoulombShape, StepRole, TorqueTerm};

/// Ratio of the width of the Coulomb sign to that of the Stribeck term (half the Stribeck velocity) above which both
/// terms have exchanged their roles.
const MAX_WIDTH_RATIO: f64 = 2.0;
/// Minimum ratio of the width of the Coulomb sign to that of the Stribeck term.
const MIN_WIDTH_RATIO: f64 = 0.5;

/// The same terms with constants near the other local minimum; `None` if they are already near it.
pub(crate) fn second_start(terms: &[TorqueTerm], scale: JointScale) -> Option<Vec<TorqueTerm>> {
    let step = step_of(terms.iter().find(|term| is_coulomb(term))?)?;
    let own_width = |term: &TorqueTerm| match term.kind().step_role() {
        StepRole::Own { width } => Some(width),
        _ => None,
    };
    let stribeck = terms.iter().find_map(own_width);
    let width = match (step, stribeck) {
        (CoulombShape::Sign { dead_band: 0.0 }, None) => scale.narrowest_width(),
        (CoulombShape::Smooth { width }, Some(of_stribeck)) if width > MAX_WIDTH_RATIO * of_stribeck => of_stribeck,
        _ => return None,
    };
    let moved = |term: &TorqueTerm| {
        if is_coulomb(term) { term.clone().with_step(|_| CoulombShape::Smooth { width }) } else { term.clone() }
    };
    Some(with_one_step(terms.iter().map(moved).collect()))
}

/// Whether Coulomb and Stribeck friction can be one friction. If the smoothed sign of Coulomb friction is far narrower
/// than that of the Stribeck term, the joint has dry friction, and Stribeck friction with a wide sign is overestimated.
pub(crate) fn is_one_friction(terms: &[TorqueTerm]) -> bool {
    let width = |is_wanted: fn(&TorqueTerm) -> bool| terms.iter().filter(|term| is_wanted(term)).find_map(smooth_width);
    match (width(is_coulomb), width(|term| matches!(term.kind().step_role(), StepRole::Own { .. }))) {
        (Some(coulomb), Some(stribeck)) => coulomb >= MIN_WIDTH_RATIO * stribeck,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::terms::{Coulomb, LoadFriction, Stribeck, Viscous};

    const USUAL: JointScale = JointScale::usual(0);
    const DRY: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };

    fn smooth(width: f64) -> CoulombShape {
        CoulombShape::Smooth { width }
    }

    fn coulomb(shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Coulomb(Coulomb { joint: 0, shape })
    }

    fn load(shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Load(LoadFriction { joint: 0, shape })
    }

    fn stribeck(shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.08, exponent: 1.0, shape })
    }

    #[test]
    fn second_start_of_a_dry_step_is_narrow() {
        let viscous = TorqueTerm::Viscous(Viscous { joint: 0 });
        let found = second_start(&[viscous.clone(), coulomb(DRY)], USUAL);
        assert_eq!(found, Some(vec![viscous.clone(), coulomb(smooth(0.002))]));
        // A width that is stated as a dead band is kept; a single smoothed sign can already change its width.
        assert_eq!(second_start(&[coulomb(CoulombShape::Sign { dead_band: 0.01 })], USUAL), None);
        assert_eq!(second_start(&[viscous, coulomb(smooth(0.1))], USUAL), None);
    }

    #[test]
    fn second_start_of_exchanged_terms_is_below_the_stribeck_velocity() {
        let found = second_start(&[coulomb(smooth(0.14)), stribeck(smooth(0.02)), load(smooth(0.14))], USUAL);
        // Load-dependent friction has the same smoothed sign, because both terms describe one friction.
        assert_eq!(found, Some(vec![coulomb(smooth(0.02)), stribeck(smooth(0.02)), load(smooth(0.02))]));
        assert_eq!(second_start(&[coulomb(smooth(0.03)), stribeck(smooth(0.02))], USUAL), None);
        // Stribeck friction of a dry joint stays dry.
        assert_eq!(second_start(&[coulomb(DRY), stribeck(DRY)], USUAL), None);
    }

    /// An arm with dry friction had fitted widths of 0.0025 and 0.0116, and its Stribeck friction was 15 % too large.
    #[test]
    fn wide_stribeck_friction_of_a_dry_joint_is_rejected() {
        assert!(!is_one_friction(&[coulomb(smooth(0.0025)), stribeck(smooth(0.0116))]));
        assert!(is_one_friction(&[coulomb(smooth(0.015)), stribeck(smooth(0.0175))]));
        assert!(is_one_friction(&[coulomb(DRY), stribeck(DRY)]));
        assert!(is_one_friction(&[coulomb(smooth(0.0025))]));
    }
}
