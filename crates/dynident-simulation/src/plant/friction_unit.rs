//! Friction as a function of one velocity: of a joint, or of a drive that moves with two joints.

use dynident_model::terms::{TermAction, TorqueTerm, VelocityCurve, VelocityFriction};

/// A friction term with its parameter; the size of a Stribeck or load-dependent term depends on the state.
#[derive(Clone, Debug)]
struct Term {
    kind: TorqueTerm,
    value: f64,
    by_load: bool,
    fading: Option<[f64; 2]>,
    /// For a sign function (which at rest holds any torque up to its level): whether it acts in forward and backward
    /// direction.
    step: Option<[bool; 2]>,
    /// Current value, including the effects of transmitted torque and of velocity (Stribeck).
    size: f64,
}

/// All friction that depends on one velocity `w = Σ ratio q̇`: the friction law `w ↦ f(w)`, a range of torques at
/// rest. The torque of a joint is `ratio f`.
#[derive(Clone, Debug, Default)]
pub(super) struct FrictionUnit {
    /// Joints that determine the velocity, and their ratios.
    pub(super) joints: Vec<(usize, f64)>,
    terms: Vec<Term>,
    /// Maximum friction torque at rest against forward and backward motion.
    level: [f64; 2],
    steps: bool,
    smooth: bool,
    pub(super) by_load: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrictionParts {
    pub(super) speed: f64,
    pub(super) torque: f64,
    /// Slope of the friction law at the velocity; `None` if friction holds the unit at rest.
    pub(super) slope: Option<f64>,
}

impl FrictionUnit {
    pub(super) fn new(joints: Vec<(usize, f64)>) -> Self {
        Self { joints, ..Self::default() }
    }

    /// Adds `term`, whose friction is `friction`, with its parameter.
    pub(super) fn add(&mut self, term: &TorqueTerm, friction: &VelocityFriction<'_>, value: f64) {
        let step = match friction.curve {
            VelocityCurve::Step { forward, backward } => Some([forward, backward]),
            VelocityCurve::Smooth(_) => None,
        };
        self.steps |= step.is_some();
        self.smooth |= step.is_none();
        let VelocityFriction { by_load, fading, .. } = *friction;
        self.by_load |= by_load;
        let size = if by_load { 0.0 } else { value };
        self.terms.push(Term { kind: term.clone(), value, by_load, fading, step, size });
        self.update(0.0, 0.0);
    }

    #[cfg(test)]
    pub(super) fn add_term(&mut self, term: &TorqueTerm, value: f64) {
        let TermAction::Friction(friction) = term.action() else { panic!("{term:?} follows no speed") };
        self.add(term, &friction, value);
    }

    pub(super) fn holds(&self) -> bool {
        self.steps
    }

    /// Updates the size of Stribeck and load-dependent terms for this velocity and this transmitted torque.
    #[inline]
    pub(super) fn update(&mut self, speed: f64, load: f64) {
        let mut level = [0.0; 2];
        for term in &mut self.terms {
            let mut size = term.value;
            if term.by_load {
                size *= load.abs();
            }
            if let Some([fade, exponent]) = term.fading {
                size *= (-(speed / fade).abs().powf(exponent)).exp();
            }
            term.size = size;
            if let Some([forward, backward]) = term.step {
                level[0] += if forward { size } else { 0.0 };
                level[1] += if backward { size } else { 0.0 };
            }
        }
        self.level = level;
    }

    #[cfg(test)]
    pub(super) fn level(&self) -> [f64; 2] {
        self.level
    }

    fn smooth(&self, speed: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        if self.smooth {
            for term in &self.terms {
                if let TermAction::Friction(VelocityFriction { curve: VelocityCurve::Smooth(curve), .. }) =
                    term.kind.action()
                {
                    sum[0] += term.size * curve.value(speed);
                    sum[1] += term.size * curve.slope(speed);
                }
            }
        }
        sum
    }

    /// Friction torque at `speed` on the forward or backward branch of the law, also if the velocity has just crossed
    /// zero.
    #[inline]
    pub(super) fn sliding(&self, speed: f64, forward: bool) -> f64 {
        let jump = if forward { self.level[0] } else { -self.level[1] };
        jump + self.smooth(speed)[0]
    }

    /// Solution of `w + c f(w) = r` for c > 0, which is unique because the friction law is monotone.
    pub(super) fn resolve(&self, r: f64, c: f64) -> FrictionParts {
        let at_jump = self.resolve_jump(r, c);
        let (rest, jump) = (at_jump.speed, at_jump.torque);
        if !self.smooth || at_jump.slope.is_none() || !rest.is_finite() {
            return at_jump;
        }
        // Friction is dissipative, so the velocity is between zero and `rest`. Newton's method from zero, kept inside
        // the bracket.
        let (mut low, mut high) = if rest > 0.0 { (0.0, rest) } else { (rest, 0.0) };
        let mut speed = 0.0;
        let mut own = self.smooth(speed);
        for _ in 0..200 {
            let defect = speed + c * own[0] - rest;
            if defect > 0.0 {
                high = speed;
            } else {
                low = speed;
            }
            let mut next = speed - defect / (1.0 + c * own[1].max(0.0));
            if !(next >= low && next <= high) {
                next = 0.5 * (low + high);
            }
            let done = (next - speed).abs() <= 1e-15 * rest.abs();
            speed = next;
            own = self.smooth(speed);
            if done {
                break;
            }
        }
        FrictionParts { speed, torque: jump + own[0], slope: Some(own[1].max(0.0)) }
    }

    /// Like [`resolve`](Self::resolve), with only the jump of the friction law at zero velocity.
    #[inline]
    pub(super) fn resolve_jump(&self, r: f64, c: f64) -> FrictionParts {
        if self.steps && r <= c * self.level[0] && r >= -c * self.level[1] {
            return FrictionParts { speed: 0.0, torque: r / c, slope: None };
        }
        let torque = if r > 0.0 { self.level[0] } else { -self.level[1] };
        FrictionParts { speed: r - c * torque, torque, slope: Some(0.0) }
    }

    #[inline]
    pub(super) fn speed(&self, dq: &[f64]) -> f64 {
        self.joints.iter().map(|&(joint, ratio)| ratio * dq[joint]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::terms::{Coulomb, CoulombShape, Power, PowerExponent, Sigmoid, Stribeck};

    /// The solution satisfies w + c f(w) = r, for steep and flat maps; tolerance above the rounding of r.
    #[test]
    fn resolved_speeds_fulfil_their_equation() {
        let mut unit = FrictionUnit::new(vec![(0, 1.0)]);
        let shape = CoulombShape::Smooth { width: 1e-3 };
        unit.add_term(&TorqueTerm::Coulomb(Coulomb { joint: 3, shape: CoulombShape::Sign { dead_band: 0.1 } }), 0.5);
        unit.add_term(&TorqueTerm::Coulomb(Coulomb { joint: 3, shape }), 10.0);
        unit.add_term(&TorqueTerm::Sigmoid(Sigmoid { joint: 3, steepness: 20.0, offset_speed: 0.1 }), 0.7);
        unit.add_term(&TorqueTerm::Power(Power { joint: 3, exponent: PowerExponent::CubeRoot, rounding: 1e-6 }), 0.3);
        unit.add_term(
            &TorqueTerm::Stribeck(Stribeck {
                joint: 3,
                speed: 0.1,
                exponent: 2.0,
                shape: CoulombShape::Sign { dead_band: 0.0 },
            }),
            0.4,
        );
        for c in [1e-4, 0.05, 3.0, 200.0] {
            for r in [-50.0, -1.0, -1e-3, 0.0, 1e-9, 0.2, 4.0, 900.0] {
                let found = unit.resolve(r, c);
                assert!((found.speed + c * found.torque - r).abs() <= 1e-12 * (1.0 + r.abs()), "{r} {c} {found:?}");
                assert!(found.speed * found.torque >= 0.0);
                if found.slope.is_none() {
                    assert!(found.torque.abs() <= 0.9 + 1e-12);
                }
            }
        }
    }
}
