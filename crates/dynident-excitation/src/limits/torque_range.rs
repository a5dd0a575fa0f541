//! Lowest and highest torque of a motion, for a search: known torque in which continuous ramps bound the sign
//! functions of friction.
//!
//! A sign function has no useful slope. In the highest torque, the change from -1 to 1 is a ramp that ends at zero
//! velocity; in the lowest torque, the ramp begins at zero velocity. Both ramps bound the sign function, and differ
//! from it only at velocities below the width of the ramp.

use super::known_torque::KnownTorque;
use crate::motion::{Motion, MotionAdjoint};
use dynident_model::Model;
use dynident_model::terms::{CoulombShape, TermAction, TorqueTerm, VelocityCurve};

/// Lowest and highest torques of a motion, joint-major, Nm (N).
#[derive(Clone, Debug, Default)]
pub(crate) struct TorqueRange {
    pub(crate) low: Vec<f64>,
    pub(crate) high: Vec<f64>,
}

impl TorqueRange {
    /// Sets the range to the rigid-body torque `rigid`, without known torque.
    pub(crate) fn of_bodies(&mut self, rigid: &[f64]) {
        for values in [&mut self.low, &mut self.high] {
            values.clear();
            values.extend_from_slice(rigid);
        }
    }

    pub(crate) fn reset(&mut self, count: usize) {
        for values in [&mut self.low, &mut self.high] {
            values.clear();
            values.resize(count, 0.0);
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct SmoothTorque {
    terms: Vec<SmoothTerm>,
    dof: usize,
}

#[derive(Clone, Debug)]
struct SmoothTerm {
    term: TorqueTerm,
    value: f64,
    joints: Vec<usize>,
    /// Sign function of friction that depends on the direction of a velocity.
    step: Option<Step>,
}

#[derive(Clone, Debug)]
struct Step {
    ratios: [f64; 2],
    /// Friction torque at positive and at negative velocity.
    ends: [f64; 2],
    by_load: bool,
    fading: Option<[f64; 2]>,
    /// Width of the ramp, rad/s (m/s).
    width: f64,
}

impl SmoothTorque {
    pub(crate) fn new(known: &KnownTorque, model: &Model) -> Self {
        let own = model.characteristic_scale();
        let terms = known.terms().iter().map(|(term, value)| {
            let joints = term.joints();
            let step = match term.action() {
                TermAction::Friction(friction) => match friction.curve {
                    VelocityCurve::Step { forward, backward } => {
                        let usual =
                            |joint: usize| own.velocity(model.joints()[joint].is_rotary(), CoulombShape::USUAL_WIDTH);
                        let widths =
                            joints.iter().zip(friction.ratios).map(|(&joint, ratio)| ratio.abs() * usual(joint));
                        Some(Step {
                            ratios: friction.ratios,
                            ends: [f64::from(forward), -f64::from(backward)],
                            by_load: friction.by_load,
                            fading: friction.fading,
                            width: widths.fold(f64::MIN_POSITIVE, f64::max),
                        })
                    }
                    VelocityCurve::Smooth(_) => None,
                },
                TermAction::Inertia { .. }
                | TermAction::Damping { .. }
                | TermAction::Constant
                | TermAction::Hysteresis
                | TermAction::Temperature
                | TermAction::State(_) => None,
            };
            SmoothTerm { term: term.clone(), value: *value, joints, step }
        });
        Self { terms: terms.collect(), dof: model.dof() }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Widens the range, which contains the rigid-body torque `rigid`, by the known torque along `motion`.
    pub(crate) fn add(&self, motion: &Motion, rigid: &[f64], range: &mut TorqueRange) {
        let mut column = vec![0.0; motion.samples];
        for SmoothTerm { term, value, joints, step } in &self.terms {
            for (place, &joint) in joints.iter().enumerate() {
                let at = motion.of(joint);
                if let Some(step) = step {
                    for (sample, at) in at.enumerate() {
                        let [low, high] = step.at(joints, motion, sample);
                        let (size, _) = step.size(place, *value, step.velocity(joints, motion, sample), rigid[at]);
                        let (least, most) = if size >= 0.0 { (low.0, high.0) } else { (high.0, low.0) };
                        range.low[at] += size * least;
                        range.high[at] += size * most;
                    }
                    continue;
                }
                match term.action() {
                    TermAction::Temperature => {}
                    TermAction::Hysteresis => {
                        range.low[at.clone()].iter_mut().for_each(|low| *low -= value.abs());
                        range.high[at].iter_mut().for_each(|high| *high += value.abs());
                    }
                    TermAction::Inertia { .. }
                    | TermAction::Damping { .. }
                    | TermAction::Constant
                    | TermAction::Friction(_)
                    | TermAction::State(_) => {
                        term.column(joint, &motion.view(), &mut column);
                        for values in [&mut range.low, &mut range.high] {
                            values[at.clone()].iter_mut().zip(&column).for_each(|(to, unit)| *to += value * unit);
                        }
                    }
                }
            }
        }
    }

    /// Adds the derivatives of a cost, given its derivatives `by_range` with respect to both ends of the torque
    /// range. Derivatives with respect to the motion are added to `adjoint`, those with respect to the rigid-body
    /// torque to `by_torque`. The direct effect of the rigid-body torque on both ends (the sum of both derivatives)
    /// is not added.
    pub(crate) fn apply_adjoint(
        &self,
        motion: &Motion,
        rigid: &[f64],
        by_range: &TorqueRange,
        by_torque: &mut [f64],
        adjoint: &mut MotionAdjoint,
    ) {
        debug_assert_eq!(motion.joints, self.dof);
        for SmoothTerm { term, value, joints, step } in &self.terms {
            for (place, &joint) in joints.iter().enumerate() {
                let own = motion.of(joint);
                let Some(step) = step else {
                    let by_both = by_range.low[own.clone()].iter().zip(&by_range.high[own]);
                    let weights: Vec<f64> = by_both.map(|(low, high)| value * (low + high)).collect();
                    if weights.iter().any(|weight| *weight != 0.0) {
                        let gradient = [&mut adjoint.q[..], &mut adjoint.dq[..], &mut adjoint.ddq[..]];
                        term.apply_adjoint(joint, &motion.view(), &weights, gradient);
                    }
                    continue;
                };
                for (sample, at) in own.enumerate() {
                    let (by_low, by_high) = (by_range.low[at], by_range.high[at]);
                    if by_low == 0.0 && by_high == 0.0 {
                        continue;
                    }
                    let velocity = step.velocity(joints, motion, sample);
                    let [low, high] = step.at(joints, motion, sample);
                    let (size, by_velocity) = step.size(place, *value, velocity, rigid[at]);
                    let (least, most) = if size >= 0.0 { (low, high) } else { (high, low) };
                    let of_size = by_low * least.0 + by_high * most.0;
                    let slope = size * (by_low * least.1 + by_high * most.1) + by_velocity * of_size;
                    for (&other, ratio) in joints.iter().zip(step.ratios) {
                        adjoint.dq[other * motion.samples + sample] += ratio * slope;
                    }
                    if step.by_load && rigid[at] != 0.0 {
                        by_torque[at] += size / rigid[at] * of_size;
                    }
                }
            }
        }
    }
}

impl Step {
    fn velocity(&self, joints: &[usize], motion: &Motion, sample: usize) -> f64 {
        joints.iter().zip(self.ratios).map(|(joint, ratio)| ratio * motion.dq[joint * motion.samples + sample]).sum()
    }

    /// The lower and the upper ramp, each with its slope.
    fn at(&self, joints: &[usize], motion: &Motion, sample: usize) -> [(f64, f64); 2] {
        let velocity = self.velocity(joints, motion, sample);
        let [forward, backward] = self.ends;
        let rise = (forward - backward) / self.width;
        let ramp = |from: f64| {
            let share = (velocity - from) / self.width;
            if share <= 0.0 {
                (backward, 0.0)
            } else if share >= 1.0 {
                (forward, 0.0)
            } else {
                (backward + share * (forward - backward), rise)
            }
        };
        [ramp(0.0), ramp(-self.width)]
    }

    /// Factor of the sign function in the torque of the joint at `place`, and its derivative with respect to the
    /// velocity.
    fn size(&self, place: usize, value: f64, velocity: f64, rigid: f64) -> (f64, f64) {
        let size = value * self.ratios[place] * if self.by_load { rigid.abs() } else { 1.0 };
        let Some([speed, exponent]) = self.fading else { return (size, 0.0) };
        let x = (velocity / speed).abs();
        let share = (-x.powf(exponent)).exp();
        let falling =
            if x > 0.0 && share > 0.0 { exponent * x.powf(exponent - 1.0) / speed * velocity.signum() } else { 0.0 };
        (size * share, -size * share * falling)
    }
}
