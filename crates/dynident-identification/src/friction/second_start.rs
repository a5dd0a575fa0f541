//! Where the constants of a joint's friction begin a second time.
//!
//! Steps of Gauss and Newton end at the best constants near their start, and two starts are known to lie in the wrong
//! valley. A dry step (the sign) has no width that could move: it is the limit of a narrow one, and noise of the
//! velocity can make it look best on a grid. (With Stribeck friction it stays: that is dry as well, and with a step of
//! its own it takes up what is at rest.) And a Coulomb step wider than half the velocity at which Stribeck friction
//! has fallen off leaves the step at rest to the Stribeck term: the two have changed places.

use super::candidates::JointScale;
use super::constants::{is_coulomb, smooth_width, step_of, with_one_step};
use dynident_model::terms::{CoulombShape, StepRole, TorqueTerm};

/// A Coulomb step this many times as wide as the Stribeck term's own step, half the Stribeck velocity, is done where
/// Stribeck friction begins to fall off.
const WIDE: f64 = 2.0;
/// Part of the Stribeck term's own step that a Coulomb step of the same friction has at least.
const NARROW: f64 = 0.5;

/// The same terms with the step at rest where the other valley is; `None` where they are in it already.
pub(crate) fn second_start(terms: &[TorqueTerm], scale: JointScale) -> Option<Vec<TorqueTerm>> {
    let step = step_of(terms.iter().find(|term| is_coulomb(term))?)?;
    let own_width = |term: &TorqueTerm| match term.kind().step_role() {
        StepRole::Own { width } => Some(width),
        _ => None,
    };
    let stribeck = terms.iter().find_map(own_width);
    let width = match (step, stribeck) {
        (CoulombShape::Sign { dead_band: 0.0 }, None) => scale.narrowest_width(),
        (CoulombShape::Smooth { width }, Some(of_stribeck)) if width > WIDE * of_stribeck => of_stribeck,
        _ => return None,
    };
    let moved = |term: &TorqueTerm| {
        if is_coulomb(term) { term.clone().with_step(|_| CoulombShape::Smooth { width }) } else { term.clone() }
    };
    Some(with_one_step(terms.iter().map(moved).collect()))
}

/// Whether Coulomb and Stribeck friction can be one friction: with a Coulomb step far narrower than that of the
/// Stribeck term the joint is dry, and Stribeck friction that is not comes out too large.
pub(crate) fn is_one_friction(terms: &[TorqueTerm]) -> bool {
    let width = |is_wanted: fn(&TorqueTerm) -> bool| terms.iter().filter(|term| is_wanted(term)).find_map(smooth_width);
    match (width(is_coulomb), width(|term| matches!(term.kind().step_role(), StepRole::Own { .. }))) {
        (Some(coulomb), Some(stribeck)) => coulomb >= NARROW * stribeck,
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
    fn a_dry_step_begins_as_a_narrow_one() {
        let viscous = TorqueTerm::Viscous(Viscous { joint: 0 });
        let found = second_start(&[viscous.clone(), coulomb(DRY)], USUAL);
        assert_eq!(found, Some(vec![viscous.clone(), coulomb(smooth(0.002))]));
        // A width that a study has stated for a dead band is its own; what is smooth and alone can move already.
        assert_eq!(second_start(&[coulomb(CoulombShape::Sign { dead_band: 0.01 })], USUAL), None);
        assert_eq!(second_start(&[viscous, coulomb(smooth(0.1))], USUAL), None);
    }

    #[test]
    fn a_step_that_changed_places_with_stribeck_friction_begins_below_it() {
        let found = second_start(&[coulomb(smooth(0.14)), stribeck(smooth(0.02)), load(smooth(0.14))], USUAL);
        // Load-dependent friction goes with it: it is one friction.
        assert_eq!(found, Some(vec![coulomb(smooth(0.02)), stribeck(smooth(0.02)), load(smooth(0.02))]));
        assert_eq!(second_start(&[coulomb(smooth(0.03)), stribeck(smooth(0.02))], USUAL), None);
        // A dry joint's Stribeck friction is dry, and stays so.
        assert_eq!(second_start(&[coulomb(DRY), stribeck(DRY)], USUAL), None);
    }

    /// The paper's arm with dry friction came out with 0.0025 beside 0.0116 and Stribeck friction 15 % too large.
    #[test]
    fn a_dry_joint_has_no_wide_stribeck_friction() {
        assert!(!is_one_friction(&[coulomb(smooth(0.0025)), stribeck(smooth(0.0116))]));
        assert!(is_one_friction(&[coulomb(smooth(0.015)), stribeck(smooth(0.0175))]));
        assert!(is_one_friction(&[coulomb(DRY), stribeck(DRY)]));
        assert!(is_one_friction(&[coulomb(smooth(0.0025))]));
    }
}
