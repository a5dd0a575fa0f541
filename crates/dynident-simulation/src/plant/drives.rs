//! The terms of a simulated robot, sorted by what they do to the equation of motion.

use super::friction_unit::FrictionUnit;
use crate::error::{SimulationError, require, require_length};
use dynident_model::Model;
use dynident_model::terms::{HysteresisState, JointMotion, TermAction, TermInput, TorqueTerm};

/// Terms with their parameters: constants of the mass matrix and of the torque, linear damping, springs that slip,
/// declared torques, and friction that follows a velocity.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    /// Entries (row, column, value) that drives add to the mass matrix.
    pub(super) inertia: Vec<(usize, usize, f64)>,
    /// Constant torques.
    pub(super) constant: Vec<f64>,
    /// Entries of the viscous matrix.
    pub(super) viscous: Vec<(usize, usize, f64)>,
    /// Friction by velocities.
    pub(super) units: Vec<FrictionUnit>,
    slips: Vec<Slip>,
    states: Vec<StateTorque>,
    pub(super) by_load: bool,
}

#[derive(Clone, Debug)]
struct Slip {
    joint: usize,
    term: TorqueTerm,
    value: f64,
    memory: HysteresisState,
}

/// A torque of one joint that follows positions and velocities.
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
            slips: Vec::new(),
            states: Vec::new(),
            by_load: false,
        };
        // One unit for each joint, then those of drives that turn with two.
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
                    let slip =
                        |&joint: &usize| Slip { joint, term: term.clone(), value, memory: HysteresisState::default() };
                    drives.slips.extend(joints.iter().map(slip));
                }
                TermAction::State(_) => {
                    drives.states.extend(joints.iter().map(|&joint| StateTorque { joint, term: term.clone(), value }));
                }
                // Simulated drives are at their reference temperature.
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

    /// Takes the torques of slipping springs at positions `q` off `torque`. The deflection is that of the last
    /// [`follow`](Self::follow) moved on to `q`.
    pub(super) fn subtract_slips(&self, q: &[f64], torque: &mut [f64]) {
        for slip in &self.slips {
            torque[slip.joint] -= slip.value * deflection(&slip.term, slip.joint, q, &mut slip.memory.clone());
        }
    }

    /// Takes declared torques at positions `q` and velocities `dq` off `torque`. One without a value is not a number:
    /// the motion cannot be continued.
    pub(super) fn subtract_declared(&self, q: &[f64], dq: &[f64], torque: &mut [f64]) {
        let motion = JointMotion { samples: 1, q, dq, ddq: dq };
        for state in &self.states {
            let unit = state.term.state_function().and_then(|function| function.value(&motion, 0));
            torque[state.joint] -= state.value * unit.unwrap_or(f64::NAN);
        }
    }

    /// The springs follow the joints to `q`.
    pub(super) fn follow(&mut self, q: &[f64]) {
        for slip in &mut self.slips {
            deflection(&slip.term, slip.joint, q, &mut slip.memory);
        }
    }

    /// Undeflected springs at `q`.
    pub(super) fn restart(&mut self, q: &[f64]) {
        for slip in &mut self.slips {
            slip.memory.restart();
        }
        self.follow(q);
    }
}

/// Deflection of a slipping spring over its yield displacement.
fn deflection(term: &TorqueTerm, joint: usize, q: &[f64], memory: &mut HysteresisState) -> f64 {
    let mut out = [0.0];
    // Only positions count.
    let motion = JointMotion { samples: 1, q, dq: q, ddq: q };
    term.column_following(joint, &motion, &mut TermInput { load: None, temperature_c: None, memory }, &mut out);
    out[0]
}
