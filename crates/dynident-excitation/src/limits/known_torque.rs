//! Known torque in addition to that of the rigid bodies: friction, drive inertia, springs and declared torques.

use dynident_model::Model;
use dynident_model::terms::{
    CoulombShape, Coupling, CouplingEffect, Declared, HysteresisState, JointMotion, TermAction, TermInput, TorqueTerm,
    VelocityCurve, VelocityFriction,
};

/// Torque terms with their values. Torque and power limits apply to the sum of these terms and the rigid-body torque.
///
/// Coulomb friction has the sign of the velocity here, also if a study estimates it with a smoothed sign function. At
/// rest it can have either sign, so the torque of a joint at a sample is a range `[low, high]`, whose ends differ
/// only at rest. Friction with hysteresis (Maxwell slip) can have any value up to its yield torque at every sample.
/// Temperature dependence is not included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownTorque {
    terms: Vec<(TorqueTerm, f64)>,
}

impl KnownTorque {
    /// Creates the known torque from terms and values, in the unit of each term's parameter. Terms with the value zero
    /// are omitted.
    pub fn new(terms: impl IntoIterator<Item = (TorqueTerm, f64)>) -> Self {
        let mut known = Self::default();
        terms.into_iter().for_each(|(term, value)| known.add(term, value));
        known
    }

    /// Known torque of the robot description: viscous and Coulomb friction, drive inertia and springs of its joints.
    /// The friction and inertia of a joint that follows one or two others act on those joints.
    pub fn of_description(model: &Model) -> Self {
        let mut known = Self::default();
        for (place, joint) in model.tree_joints().iter().enumerate() {
            let drivers: Vec<(usize, f64)> = model.drivers(place).filter(|(_, share)| *share != 0.0).collect();
            let effects = [
                (CouplingEffect::Inertia, joint.drive_inertia),
                (CouplingEffect::Viscous, joint.damping),
                (CouplingEffect::Coulomb(SIGN), joint.friction),
            ];
            for (effect, value) in effects.into_iter().filter_map(|(effect, value)| Some((effect, value?))) {
                known.add_of_joint(&joint.name, &drivers, effect, value);
            }
        }
        for spring in Declared::springs(model) {
            let value = spring.nominal.unwrap_or(0.0);
            known.add(TorqueTerm::Declared(spring), value);
        }
        known
    }

    /// Adds friction or inertia of a joint of the tree that moves by `share` per unit of motion of each joint it
    /// follows.
    fn add_of_joint(&mut self, name: &str, drivers: &[(usize, f64)], effect: CouplingEffect, value: f64) {
        let is_coulomb = matches!(effect, CouplingEffect::Coulomb(_));
        if let (&[(first, a), (second, b)], true) = (drivers, drivers.len() == 2) {
            let (name, ratios) = (name.to_owned(), [a, b]);
            self.add(TorqueTerm::Coupling(Coupling { name, first, second, ratios, effect }), value);
        }
        // A coupling of two joints contains the cross terms of inertia and viscous friction, and all Coulomb
        // friction.
        if drivers.len() == 1 || (drivers.len() == 2 && !is_coulomb) {
            for &(joint, share) in drivers {
                let (term, factor) = effect.of_joint(joint, share);
                self.add(term, factor * value);
            }
        }
    }

    /// Adds a term; values of equal terms are summed.
    fn add(&mut self, term: TorqueTerm, value: f64) {
        let term = term.with_step(|_| SIGN);
        if value == 0.0 {
            return;
        }
        match self.terms.iter_mut().find(|(known, _)| *known == term) {
            Some((_, known)) => *known += value,
            None => self.terms.push((term, value)),
        }
    }

    /// Sets the value of a term, replacing an equal term.
    #[must_use]
    pub fn with(mut self, term: TorqueTerm, value: f64) -> Self {
        let term = term.with_step(|_| SIGN);
        self.terms.retain(|(known, _)| *known != term);
        self.add(term, value);
        self
    }

    /// Removes the friction of one joint.
    #[must_use]
    pub fn without_friction_of(mut self, joint: usize) -> Self {
        self.terms.retain(|(term, _)| !(term.is_joint_friction() && term.own_joint() == Some(joint)));
        self
    }

    /// The terms and their values. All Coulomb friction is a sign function of the velocity.
    pub fn terms(&self) -> &[(TorqueTerm, f64)] {
        &self.terms
    }

    /// Whether there is no known torque.
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Computes the lowest and highest torque of every joint at one state (q, q̇, q̈), Nm (N). `rigid` is the torque of
    /// the rigid bodies; `low` and `high` are overwritten.
    ///
    /// # Panics
    /// If lengths differ.
    pub fn range(&self, rigid: &[f64], motion: [&[f64]; 3], low: &mut [f64], high: &mut [f64]) {
        let [q, dq, ddq] = motion;
        low.copy_from_slice(rigid);
        high.copy_from_slice(rigid);
        let motion = JointMotion { samples: 1, q, dq, ddq };
        for (term, value) in &self.terms {
            for joint in (0..rigid.len()).filter(|&joint| term.acts_on(joint)) {
                let [least, most] = match term.action() {
                    TermAction::Temperature => continue,
                    TermAction::Hysteresis => [-value.abs(), value.abs()],
                    TermAction::Friction(friction) if matches!(friction.curve, VelocityCurve::Step { .. }) => {
                        step(term, &friction, joint, dq, rigid).map(|share| share * value)
                    }
                    TermAction::Inertia { .. }
                    | TermAction::Damping { .. }
                    | TermAction::Constant
                    | TermAction::Friction(_)
                    | TermAction::State(_) => [value * column(term, joint, &motion); 2],
                };
                low[joint] += least.min(most);
                high[joint] += least.max(most);
            }
        }
    }
}

const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };

fn column(term: &TorqueTerm, joint: usize, motion: &JointMotion<'_>) -> f64 {
    let mut out = [0.0];
    let mut input = TermInput { load: None, temperature_c: None, memory: &mut HysteresisState::default() };
    term.column_following(joint, motion, &mut input, &mut out);
    out[0]
}

/// Torque on one joint of sign-function friction with unit size: lowest and highest, with both signs at rest.
fn step(term: &TorqueTerm, friction: &VelocityFriction<'_>, joint: usize, dq: &[f64], rigid: &[f64]) -> [f64; 2] {
    let joints = term.joints();
    let velocity: f64 = joints.iter().zip(friction.ratios).map(|(&of, ratio)| ratio * dq[of]).sum();
    let own = joints.iter().position(|&of| of == joint).map_or(0.0, |place| friction.ratios[place]);
    let fading = friction.fading.map_or(1.0, |[speed, exponent]| (-(velocity / speed).abs().powf(exponent)).exp());
    let size = own * fading * if friction.by_load { rigid[joint].abs() } else { 1.0 };
    let VelocityCurve::Step { forward, backward } = friction.curve else { return [0.0; 2] };
    let (forward, backward) = (f64::from(forward) * size, -f64::from(backward) * size);
    if velocity > 0.0 {
        [forward; 2]
    } else if velocity < 0.0 {
        [backward; 2]
    } else {
        [backward, forward]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::terms::{Coulomb, Offset, Stribeck};

    /// Two joints with a follower: `q3 = 2 q1 - q2`. Its torque acts on the first with factor 2 and on the second with
    /// -1.
    #[test]
    fn friction_of_a_follower_of_two_joints() {
        let mut known = KnownTorque::default();
        let drivers = [(0, 2.0), (1, -1.0)];
        for (effect, value) in
            [(CouplingEffect::Inertia, 0.5), (CouplingEffect::Viscous, 3.0), (CouplingEffect::Coulomb(SIGN), 4.0)]
        {
            known.add_of_joint("third", &drivers, effect, value);
        }
        let (dq, ddq) = ([0.3, 0.9], [1.0, -2.0]);
        // Computed by hand: velocity 2·0.3 - 0.9 = -0.3, acceleration 2·1 + 2 = 4.
        let of_third = 0.5 * 4.0 + 3.0 * -0.3 - 4.0;
        let (mut low, mut high) = ([0.0; 2], [0.0; 2]);
        known.range(&[10.0, 20.0], [&[0.0; 2], &dq, &ddq], &mut low, &mut high);
        assert_eq!(low, high);
        assert!((low[0] - (10.0 + 2.0 * of_third)).abs() < 1e-12 && (low[1] - (20.0 - of_third)).abs() < 1e-12);
        known.range(&[0.0; 2], [&[0.0; 2], &[0.0; 2], &[0.0; 2]], &mut low, &mut high);
        assert_eq!((low, high), ([-8.0, -4.0], [8.0, 4.0]));
    }

    #[test]
    fn steps_are_signs_and_equal_terms_are_one() {
        let smooth = |joint| TorqueTerm::Coulomb(Coulomb { joint, shape: CoulombShape::Smooth { width: 0.1 } });
        let known = KnownTorque::new([(smooth(0), 2.0), (smooth(1), 0.0)]).with(smooth(0), 5.0);
        let stribeck = Stribeck { joint: 0, speed: 0.1, exponent: 2.0, shape: CoulombShape::Smooth { width: 0.1 } };
        let known = known.with(TorqueTerm::Stribeck(stribeck), 1.0);
        let known = known.with(TorqueTerm::Offset(Offset { joint: 1 }), -0.5);
        assert_eq!(known.terms().len(), 3);
        let (mut low, mut high) = ([0.0; 2], [0.0; 2]);
        known.range(&[1.0, 1.0], [&[0.0; 2], &[0.1, 0.0], &[0.0; 2]], &mut low, &mut high);
        let expected = [6.0 + (-1.0_f64).exp(), 0.5];
        assert_eq!((low, high), (expected, expected));
        assert_eq!(known.without_friction_of(0).terms().len(), 1);
    }
}
