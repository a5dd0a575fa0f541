//! Torque terms of a simulated robot, sorted by their effect on the equation of motion.

use super::friction_unit::FrictionUnit;
use crate::error::{SimulationError, require, require_length};
use dynident_model::Model;
use dynident_model::terms::{HysteresisState, JointMotion, TermAction, TermInput, TorqueTerm};

/// Torque terms with their parameters: constants of the mass matrix and of the torque, linear damping, friction
/// springs that slip, declared (user-defined) torques, and friction that depends on a velocity.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    /// Entries (row, column, value) that drives add to the mass matrix.
    pub(super) inertia: Vec<(usize, usize, f64)>,
    pub(super) constant: Vec<f64>,
    pub(super) viscous: Vec<(usize, usize, f64)>,
    pub(super) units: Vec<FrictionUnit>,
    springs: Vec<SlippingSpring>,
    states: Vec<StateTorque>,
    pub(super) by_load: bool,
}

#[derive(Clone, Debug)]
struct SlippingSpring {
    joint: usize,
    term: TorqueTerm,
    value: f64,
    memory: HysteresisState,
}

#[derive(Clone, Debug)]
struct StateTorque {
    joint: usize,
    term: TorqueTerm,
    value: f64,
}

impl Drives {
    pub(super) fn new(model: &Model, terms: &[TorqueTerm], parameters: &[f64]) -> Result<Self, SimulationError> {
        let dof = model.dof();
        require_length("parameters of terms", terms.len(), parameters.len())?;
        let mut drives = Self {
            inertia: Vec::new(),
            constant: vec![0.0; dof],
            viscous: Vec::new(),
            units: Vec::new(),
            springs: Vec::new(),
            states: Vec::new(),
            by_load: false,
        };
        // One unit for each joint, then one for each drive that moves with two joints.
        let mut own: Vec<FrictionUnit> = (0..dof).map(|joint| FrictionUnit::new(vec![(joint, 1.0)])).collect();
        let mut used = vec![false; dof];
        for (term, &value) in terms.iter().zip(parameters) {
            require(value.is_finite(), term.symbol(), value, "give a finite number")?;
            if term.is_nonnegative() && value < 0.0 {
                return Err(SimulationError::Negative { term: term.symbol(), value });
            }
            let joints = term.joints();
            if joints.iter().any(|&joint| joint >= dof) {
                return Err(SimulationError::TermJoint { term: term.symbol(), joints: dof });
            }
            let entries = |factor: f64| match joints[..] {
                [first, second] => vec![(first, second, factor * value), (second, first, factor * value)],
                _ => joints.iter().map(|&joint| (joint, joint, factor * value)).collect(),
            };
            match term.action() {
                TermAction::Inertia { factor } => drives.inertia.extend(entries(factor)),
                TermAction::Damping { factor } => drives.viscous.extend(entries(factor)),
                TermAction::Constant => joints.iter().for_each(|&joint| drives.constant[joint] += value),
                TermAction::Hysteresis => {
                    let spring = |&joint: &usize| SlippingSpring {
                        joint,
                        term: term.clone(),
                        value,
                        memory: HysteresisState::default(),
                    };
                    drives.springs.extend(joints.iter().map(spring));
                }
                TermAction::State(_) => {
                    drives.states.extend(joints.iter().map(|&joint| StateTorque { joint, term: term.clone(), value }));
                }
                // Simulated drives are at their reference temperature, so this term has no effect.
                TermAction::Temperature => {}
                TermAction::Friction(friction) => {
                    if value < 0.0 {
                        return Err(SimulationError::Negative { term: term.symbol(), value });
                    }
                    if let [joint] = joints[..] {
                        own[joint].add(term, &friction, value);
                        used[joint] = true;
                    } else {
                        let mut unit = FrictionUnit::new(joints.into_iter().zip(friction.ratios).collect());
                        unit.add(term, &friction, value);
                        drives.units.push(unit);
                    }
                }
            }
        }
        let joints = own.into_iter().zip(used).filter_map(|(unit, used)| used.then_some(unit));
        drives.units = joints.chain(drives.units).collect();
        drives.by_load = drives.units.iter().any(|unit| unit.by_load);
        Ok(drives)
    }

    /// Subtracts the torques of the slipping friction springs at positions `q` from `torque`. The deflection is that
    /// after the last [`follow`](Self::follow), updated to `q`.
    pub(super) fn subtract_springs(&self, q: &[f64], torque: &mut [f64]) {
        for spring in &self.springs {
            torque[spring.joint] -=
                spring.value * deflection(&spring.term, spring.joint, q, &mut spring.memory.clone());
        }
    }

    /// Subtracts declared torques at positions `q` and velocities `dq` from `torque`. An undefined torque is NaN,
    /// which ends the run.
    pub(super) fn subtract_declared(&self, q: &[f64], dq: &[f64], torque: &mut [f64]) {
        let motion = JointMotion { samples: 1, q, dq, ddq: dq };
        for state in &self.states {
            let unit = state.term.state_function().and_then(|function| function.value(&motion, 0));
            torque[state.joint] -= state.value * unit.unwrap_or(f64::NAN);
        }
    }

    pub(super) fn follow(&mut self, q: &[f64]) {
        for spring in &mut self.springs {
            deflection(&spring.term, spring.joint, q, &mut spring.memory);
        }
    }

    pub(super) fn restart(&mut self, q: &[f64]) {
        for spring in &mut self.springs {
            spring.memory.restart();
        }
        self.follow(q);
    }
}

/// Deflection of a slipping spring, relative to its yield displacement.
fn deflection(term: &TorqueTerm, joint: usize, q: &[f64], memory: &mut HysteresisState) -> f64 {
    let mut out = [0.0];
    // Only positions are used.
    let motion = JointMotion { samples: 1, q, dq: q, ddq: q };
    term.column_following(joint, &motion, &mut TermInput { load: None, temperature_c: None, memory }, &mut out);
    out[0]
}
