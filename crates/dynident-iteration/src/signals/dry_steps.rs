//! Friction whose smoothed sign function is too narrow to be identified: it is simulated as dry friction.

use crate::signals::rests::MOVING;
use dynident_identification::friction::JointFriction;
use dynident_model::terms::{CoulombShape, TorqueTerm};

/// Replaces narrow smoothed sign functions of friction by dry friction with stiction, for a simulation along a motion
/// with these highest velocities. A function is narrow if its width is below the velocity at which a joint is treated
/// as at rest. Runs do not determine such a width. Dry friction holds a joint at rest and needs no short integration
/// steps.
pub(crate) fn with_dry_steps(terms: &[TorqueTerm], fastest: &[f64]) -> Vec<TorqueTerm> {
    let dry = |term: &TorqueTerm| {
        let fastest = term.joints().into_iter().map(|joint| fastest[joint]).fold(0.0, f64::max);
        term.clone().with_step(|step| match step {
            CoulombShape::Smooth { width } if width > MOVING * fastest => step,
            CoulombShape::Smooth { .. } | CoulombShape::Sign { .. } => CoulombShape::Sign { dead_band: 0.0 },
        })
    };
    terms.iter().map(dry).collect()
}

/// The terms and parameters with joints that can stick: joints whose narrowest sign function may be dry friction, by
/// its width or by the 95 % interval of the width that the runs selected (`chose`) for the joint with this name. All
/// friction terms of such a joint become dry, because their separate widths are not reliable if smoothing of the
/// motion hides the transition. `None` if no joint is added to those of [`with_dry_steps`].
pub(crate) fn with_sticking_joints(
    terms: &[TorqueTerm],
    parameters: &[f64],
    names: &[String],
    chose: &[JointFriction],
    fastest: &[f64],
) -> Option<(Vec<TorqueTerm>, Vec<f64>)> {
    let sticks = |joint: usize| {
        let own = terms.iter().filter(|term| term.is_joint_friction() && term.own_joint() == Some(joint));
        let chosen = chose.iter().filter(|one| one.joint == names[joint]).flat_map(|one| &one.constants);
        let of_choice = |term: &TorqueTerm| {
            chosen.clone().filter_map(|constant| constant.narrowest_step(term)).min_by(f64::total_cmp)
        };
        let widths = own.flat_map(|term| [term.step_width(), of_choice(term)]).flatten();
        widths.fold(f64::INFINITY, f64::min) <= MOVING * fastest[joint]
    };
    let sticking: Vec<bool> = (0..fastest.len()).map(sticks).collect();
    let dry = |(term, &parameter): (&TorqueTerm, &f64)| {
        let Some(joint) = term.own_joint().filter(|&joint| sticking[joint]) else { return (term.clone(), parameter) };
        match term.kind().dry(MOVING * fastest[joint]) {
            Some((dry, share)) => (dry, share * parameter),
            None => (term.clone().with_step(|_| CoulombShape::Sign { dead_band: 0.0 }), parameter),
        }
    };
    let (found, parameters): (Vec<TorqueTerm>, Vec<f64>) = terms.iter().zip(parameters).map(dry).unzip();
    let found = with_dry_steps(&found, fastest);
    (found != with_dry_steps(terms, fastest)).then_some((found, parameters))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_identification::friction::FrictionConstant;
    use dynident_model::terms::{Coulomb, Sigmoid, Stribeck, Viscous};

    const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };

    fn coulomb(joint: usize, shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Coulomb(Coulomb { joint, shape })
    }

    fn stribeck(shape: CoulombShape) -> TorqueTerm {
        TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.1, exponent: 2.0, shape })
    }

    #[test]
    fn a_step_that_no_run_can_tell_from_dry_friction_is_dry() {
        let (narrow, wide) = (CoulombShape::Smooth { width: 0.02 }, CoulombShape::Smooth { width: 0.05 });
        let viscous = TorqueTerm::Viscous(Viscous { joint: 0 });
        // The first joint reaches 2 rad/s and rests below 0.04, the second 0.5 and below 0.01.
        let terms = [coulomb(0, narrow), coulomb(0, wide), coulomb(1, narrow), stribeck(narrow), viscous.clone()];
        let simulated = with_dry_steps(&terms, &[2.0, 0.5]);
        assert_eq!(simulated, [coulomb(0, SIGN), coulomb(0, wide), coulomb(1, narrow), stribeck(SIGN), viscous]);
    }

    #[test]
    fn a_joint_that_may_stick_sticks_with_all_of_its_friction() {
        let smooth = |width| CoulombShape::Smooth { width };
        let names = ["a", "b"].map(str::to_owned);
        let sigmoid = TorqueTerm::Sigmoid(Sigmoid { joint: 1, steepness: 50.0, offset_speed: 0.0 });
        let terms = [coulomb(0, smooth(0.005)), stribeck(smooth(0.02)), sigmoid.clone()];
        let parameters = [1.0, 0.5, 3.0];
        let fastest = [0.5, 0.5];
        let sticking = |chose: &[JointFriction]| with_sticking_joints(&terms, &parameters, &names, chose, &fastest);

        // The first joint's Coulomb friction is dry by its width; then all of its friction is dry.
        let of_width = (vec![coulomb(0, SIGN), stribeck(SIGN), sigmoid], parameters.to_vec());
        assert_eq!(sticking(&[]), Some(of_width));

        // The second joint's may be dry by the interval of its steepness: half a step of both directions together.
        let steepness = FrictionConstant {
            term: "sigmoid".to_owned(),
            constant: "steepness".to_owned(),
            value: 50.0,
            interval_95: [10.0, 250.0],
        };
        let chosen = |interval_95| {
            let constants = vec![FrictionConstant { interval_95, ..steepness.clone() }];
            [JointFriction { constants, ..JointFriction::as_stated("b", "a test") }]
        };
        let of_interval = (vec![coulomb(0, SIGN), stribeck(SIGN), coulomb(1, SIGN)], vec![1.0, 0.5, 1.5]);
        assert_eq!(sticking(&chosen([10.0, 250.0])), Some(of_interval));
        assert_ne!(sticking(&chosen([10.0, 150.0])), sticking(&chosen([10.0, 250.0])));

        // Wide steps are not dry friction; steps that are already dry change nothing.
        let plain = [coulomb(0, smooth(0.02)), coulomb(1, smooth(0.005))];
        assert_eq!(with_sticking_joints(&plain, &[1.0, 1.0], &names, &[], &fastest), None);
    }
}
