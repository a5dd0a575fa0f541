//! Smoothed sign functions of a joint's friction terms, and means of terms with different constants.

use super::candidates::JointScale;
use dynident_dynamics::ParametricModel;
use dynident_model::terms::{CoulombShape, StepRole, TorqueTerm};

/// Smoothed sign of the velocity in a term that changes its sign at rest; `None` for other terms.
pub(super) fn step_of(term: &TorqueTerm) -> Option<CoulombShape> {
    term.step().filter(|_| term.kind().step_role() != StepRole::Fixed)
}

/// Smoothed sign of a joint's dry friction; the exact sign function by default.
pub(crate) fn step_of_joint(robot: &ParametricModel, joint: usize) -> CoulombShape {
    let mut own = robot.terms().iter().filter(|term| term.own_joint() == Some(joint));
    own.find_map(step_of).unwrap_or(CoulombShape::Sign { dead_band: 0.0 })
}

/// Whether a term is Coulomb friction, in one or both directions.
pub(crate) fn is_coulomb(term: &TorqueTerm) -> bool {
    term.kind().step_role() == StepRole::Joint
}

/// Width of the smoothed sign in a term that changes its sign at rest, rad/s (m/s); `None` for an exact sign.
pub(crate) fn smooth_width(term: &TorqueTerm) -> Option<f64> {
    match step_of(term)? {
        CoulombShape::Smooth { width } => Some(width),
        CoulombShape::Sign { .. } => None,
    }
}

/// Gives all friction terms of a joint the smoothed sign s of its Coulomb friction, because they describe one friction,
/// `(F_c + F_s e^{-|q̇/v_s|^δ} + μ |τ|) s(q̇)`. Stribeck friction keeps a separate smoothed sign unless Coulomb
/// friction has the exact sign function: real joints creep before they break away, and the data distinguish both
/// widths.
pub(super) fn with_one_step(terms: Vec<TorqueTerm>) -> Vec<TorqueTerm> {
    let Some(step) = terms.iter().find(|term| is_coulomb(term)).and_then(step_of) else { return terms };
    let with_step = |term: TorqueTerm| match (term.kind().step_role(), step) {
        (StepRole::Own { .. }, CoulombShape::Sign { .. })
        | (StepRole::AsJointIfSmooth, CoulombShape::Smooth { .. }) => term.with_step(|_| step),
        _ => term,
    };
    terms.into_iter().map(with_step).collect()
}

/// Mean of terms that differ only in their constants: the weighted mean of these constants, in the coordinates of the
/// grid.
///
/// # Panics
/// If `weighted` is empty.
pub(super) fn mean_term(weighted: &[(&TorqueTerm, f64)], scale: JointScale) -> TorqueTerm {
    let total: f64 = weighted.iter().map(|(_, weight)| weight).sum();
    let mut mean = weighted[0].0.kind().coordinates();
    for (place, value) in mean.iter_mut().enumerate() {
        let sum: f64 = weighted
            .iter()
            .map(|(term, weight)| weight * term.kind().coordinates().get(place).copied().unwrap_or(*value))
            .sum();
        *value = sum / total;
    }
    weighted[0].0.at(&mean, scale.velocity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::terms::{Coulomb, LoadFriction, Stribeck};

    const SMOOTH: CoulombShape = CoulombShape::Smooth { width: 0.03 };
    const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };
    fn stribeck(shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.1, exponent: 1.5, shape })
    }

    #[test]
    fn friction_terms_of_a_joint_share_one_step() {
        let narrow = CoulombShape::Smooth { width: 0.01 };
        let load = |shape| TorqueTerm::Load(LoadFriction { joint: 0, shape });
        for step in [SMOOTH, SIGN] {
            let coulomb = TorqueTerm::Coulomb(Coulomb { joint: 0, shape: step });
            let found = with_one_step(vec![coulomb.clone(), stribeck(narrow), load(narrow)]);
            let [of_stribeck, of_load] = if step == SIGN { [SIGN, narrow] } else { [narrow, SMOOTH] };
            assert_eq!(found, [coulomb, stribeck(of_stribeck), load(of_load)]);
        }
        // Without Coulomb friction every term has a separate step.
        assert_eq!(with_one_step(vec![stribeck(narrow)]), [stribeck(narrow)]);
    }
}
