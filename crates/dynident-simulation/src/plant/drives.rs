//! The laws of a simulated robot, sorted by what they do to the equation of motion.

use super::friction_unit::FrictionUnit;
use crate::error::{SimulationError, require, require_length};
use dynident_model::Model;
use dynident_model::laws::{Coulomb, CouplingEffect, JointMotion, Law, LawInput, LawMemory};

/// Laws with their parameters: constants of the mass matrix and of the torque, linear damping, springs that slip, and friction that follows a speed.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    /// Entries (row, column, value) that drives add to the mass matrix.
    pub(super) inertia: Vec<(usize, usize, f64)>,
    /// Constant torques.
    pub(super) constant: Vec<f64>,
    /// Entries of the viscous matrix.
    pub(super) viscous: Vec<(usize, usize, f64)>,
    /// Friction by speeds.
    pub(super) units: Vec<FrictionUnit>,
    slips: Vec<Slip>,
    pub(super) by_load: bool,
}

#[derive(Clone, Debug)]
struct Slip {
    joint: usize,
    law: Law,
    value: f64,
    memory: LawMemory,
}

impl Drives {
    pub(super) fn new(model: &Model, laws: &[Law], parameters: &[f64]) -> Result<Self, SimulationError> {
        let dof = model.dof();
        require_length("parameters of laws", laws.len(), parameters.len())?;
        let mut drives = Self {
            inertia: Vec::new(),
            constant: vec![0.0; dof],
            viscous: Vec::new(),
            units: Vec::new(),
            slips: Vec::new(),
            by_load: false,
        };
        // One unit for each joint, then those of drives that turn with two.
        let mut own: Vec<FrictionUnit> = (0..dof).map(|joint| FrictionUnit::new(vec![(joint, 1.0)])).collect();
        let mut used = vec![false; dof];
        for (law, &value) in laws.iter().zip(parameters) {
            require(value.is_finite(), law.symbol(), value, "give a finite number")?;
            if law.is_nonnegative() && value < 0.0 {
                return Err(SimulationError::Negative { law: law.symbol(), value });
            }
            let joints = law.joints();
            if joints.iter().any(|&joint| joint >= dof) {
                return Err(SimulationError::LawJoint { law: law.symbol(), joints: dof });
            }
            match law {
                Law::DriveInertia(law) => drives.inertia.push((law.joint, law.joint, value)),
                Law::Offset(law) => drives.constant[law.joint] += value,
                Law::Viscous(law) => drives.viscous.push((law.joint, law.joint, value)),
                Law::MaxwellSlip(slip) => {
                    drives.slips.push(Slip {
                        joint: slip.joint,
                        law: law.clone(),
                        value,
                        memory: LawMemory::default(),
                    });
                }
                Law::Coupling(coupling) => {
                    let [first, second] = [coupling.first, coupling.second];
                    let cross = coupling.ratios[0] * coupling.ratios[1] * value;
                    match coupling.effect {
                        CouplingEffect::Inertia => {
                            drives.inertia.extend([(first, second, cross), (second, first, cross)]);
                        }
                        CouplingEffect::Viscous => {
                            drives.viscous.extend([(first, second, cross), (second, first, cross)]);
                        }
                        CouplingEffect::Coulomb(shape) => {
                            if value < 0.0 {
                                return Err(SimulationError::Negative { law: law.symbol(), value });
                            }
                            let ratios = coupling.ratios;
                            let mut unit = FrictionUnit::new(vec![(first, ratios[0]), (second, ratios[1])]);
                            unit.add(&Law::Coulomb(Coulomb { joint: 0, shape }), value);
                            drives.units.push(unit);
                        }
                    }
                }
                // Simulated drives are at their reference temperature.
                Law::TemperatureViscous(_) | Law::TemperatureCoulomb(_) => {}
                Law::Coulomb(_)
                | Law::DirectionalViscous(_)
                | Law::DirectionalCoulomb(_)
                | Law::Stribeck(_)
                | Law::Sigmoid(_)
                | Law::Power(_)
                | Law::Load(_) => {
                    own[joints[0]].add(law, value);
                    used[joints[0]] = true;
                }
            }
        }
        let joints = own.into_iter().zip(used).filter_map(|(unit, used)| used.then_some(unit));
        drives.units = joints.chain(drives.units).collect();
        drives.by_load = drives.units.iter().any(|unit| unit.by_load);
        Ok(drives)
    }

    /// Takes the torques of slipping springs at positions `q` off `torque`. The deflection is that of the last [`follow`](Self::follow) moved on to `q`.
    pub(super) fn subtract_slips(&self, q: &[f64], torque: &mut [f64]) {
        for slip in &self.slips {
            torque[slip.joint] -= slip.value * deflection(&slip.law, slip.joint, q, &mut slip.memory.clone());
        }
    }

    /// The springs follow the joints to `q`.
    pub(super) fn follow(&mut self, q: &[f64]) {
        for slip in &mut self.slips {
            deflection(&slip.law, slip.joint, q, &mut slip.memory);
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
fn deflection(law: &Law, joint: usize, q: &[f64], memory: &mut LawMemory) -> f64 {
    let mut out = [0.0];
    // Only positions count.
    let motion = JointMotion { samples: 1, q, dq: q, ddq: q };
    law.column_following(joint, &motion, &mut LawInput { load: None, temperature_c: None, memory }, &mut out);
    out[0]
}
