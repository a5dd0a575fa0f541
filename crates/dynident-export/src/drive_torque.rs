//! Torque terms as symbols: friction, offsets and the inertia of drives.

use crate::error::ExportError;
use crate::graph::Function;
use crate::robot_model::RobotModel;
use crate::symbol::Symbol;
use dynident_lanes::Scalar;
use dynident_model::terms::{CoulombShape, CouplingEffect, Direction, JointMotion, PowerExponent, TorqueTerm};

/// Torque of friction and offsets of every joint at the velocities `dq`: what the terms add that does not follow
/// accelerations. Terms that change with temperature count as being at their reference.
///
/// # Errors
/// A term that needs more than the velocity.
pub(crate) fn friction(robot: &RobotModel, dq: &[Symbol]) -> Result<Vec<Symbol>, ExportError> {
    let mut torque = vec![Symbol::ZERO; robot.model().dof()];
    for (term, value) in robot.terms() {
        let value = Symbol::splat(value);
        let needs = |needs| ExportError::Term { symbol: term.symbol(), kind: term.kind_name(), needs };
        match term {
            TorqueTerm::Viscous(term) => torque[term.joint] += value * dq[term.joint],
            TorqueTerm::Coulomb(term) => torque[term.joint] += value * step(term.shape, dq[term.joint]),
            TorqueTerm::DirectionalViscous(term) => {
                torque[term.joint] += value * part(term.direction, dq[term.joint]);
            }
            TorqueTerm::DirectionalCoulomb(term) => {
                torque[term.joint] += value * part(term.direction, step(term.shape, dq[term.joint]));
            }
            TorqueTerm::Stribeck(term) => {
                let dq = dq[term.joint];
                let ratio = (dq * Symbol::splat(1.0 / term.speed)).call(Function::Abs);
                let fading = (-power(ratio, term.exponent)).call(Function::Exp);
                torque[term.joint] += value * (fading * step(term.shape, dq));
            }
            TorqueTerm::Sigmoid(term) => {
                let logistic = |speed: Symbol| {
                    let middle = speed + Symbol::splat(term.offset_speed);
                    let half = Symbol::splat(0.5);
                    half * (Symbol::ONE + (Symbol::splat(0.5 * term.steepness) * middle).call(Function::Tanh))
                };
                torque[term.joint] += value * (logistic(dq[term.joint]) - logistic(Symbol::ZERO));
            }
            TorqueTerm::Power(term) => {
                let dq = dq[term.joint];
                let exponent = match term.exponent {
                    PowerExponent::CubeRoot => 1.0 / 3.0,
                    PowerExponent::Quadratic => 2.0,
                };
                // Half of the exponent, for the size stands squared.
                let square = dq * dq + Symbol::splat(term.rounding * term.rounding);
                torque[term.joint] += value * (dq * square.power(0.5 * (exponent - 1.0)));
            }
            TorqueTerm::Offset(term) => torque[term.joint] += value,
            TorqueTerm::Coupling(term) => {
                let (a, b) = (term.first, term.second);
                let [ka, kb] = term.ratios.map(Symbol::splat);
                match term.effect {
                    CouplingEffect::Inertia => {}
                    CouplingEffect::Viscous => {
                        let cross = value * ka * kb;
                        torque[a] += cross * dq[b];
                        torque[b] += cross * dq[a];
                    }
                    CouplingEffect::Coulomb(shape) => {
                        let felt = value * step(shape, ka * dq[a] + kb * dq[b]);
                        torque[a] += ka * felt;
                        torque[b] += kb * felt;
                    }
                }
            }
            TorqueTerm::DriveInertia(_)
            | TorqueTerm::TemperatureViscous(_)
            | TorqueTerm::TemperatureCoulomb(_)
            | TorqueTerm::Declared(_) => {}
            TorqueTerm::Load(_) => return Err(needs("the torque that the gear carries")),
            TorqueTerm::MaxwellSlip(_) => return Err(needs("the motion before")),
        }
    }
    Ok(torque)
}

/// What the drives add to the mass matrix: constants, row-major.
pub(crate) fn drive_inertia(robot: &RobotModel) -> Vec<f64> {
    let dof = robot.model().dof();
    let mut matrix = vec![0.0; dof * dof];
    for (term, value) in robot.terms() {
        for row in term.joints() {
            for column in term.joints() {
                matrix[row * dof + column] += value * term.mass_matrix_entry(row, column);
            }
        }
    }
    matrix
}

/// Temperatures at which terms are written, with their symbols: a function of the motion cannot hold more.
pub(crate) fn reference_temperatures(robot: &RobotModel) -> Vec<(String, f64)> {
    robot
        .terms()
        .filter_map(|(term, _)| match term {
            TorqueTerm::TemperatureViscous(changes) => Some((term.symbol(), changes.reference_c)),
            TorqueTerm::TemperatureCoulomb(changes) => Some((term.symbol(), changes.reference_c)),
            _ => None,
        })
        .collect()
}

fn step(shape: CoulombShape, dq: Symbol) -> Symbol {
    match shape {
        CoulombShape::Sign { dead_band } => dq.step(dead_band),
        CoulombShape::Smooth { width } => (dq * Symbol::splat(1.0 / width)).call(Function::Tanh),
    }
}

/// `max(x, 0)` forward, `min(x, 0)` backward, exactly: halves and doubles do not round.
fn part(direction: Direction, x: Symbol) -> Symbol {
    let size = x.call(Function::Abs);
    let twice = match direction {
        Direction::Forward => x + size,
        Direction::Backward => x - size,
    };
    Symbol::splat(0.5) * twice
}

/// Powers of one and two, which are usual, without a call.
fn power(x: Symbol, exponent: f64) -> Symbol {
    if exponent == 2.0 { x * x } else { x.power(exponent) }
}

/// Friction and offset of a joint at the velocity `dq`, by its own terms alone: couplings, load and changes with
/// temperature are left out; Maxwell slip is the Coulomb friction that it is once the joint has moved on by twice its
/// yield displacement.
pub(crate) fn own_friction(robot: &RobotModel, joint: usize, dq: f64) -> f64 {
    own_friction_terms(robot, joint, dq, None)
}

/// The same by all of these terms, or by the term at the place `only` for a value of one.
pub(crate) fn own_friction_terms(robot: &RobotModel, joint: usize, dq: f64, only: Option<usize>) -> f64 {
    let zeros = vec![0.0; robot.model().dof()];
    let mut velocities = zeros.clone();
    velocities[joint] = dq;
    let motion = JointMotion { samples: 1, q: &zeros, dq: &velocities, ddq: &zeros };
    let is_own = |term: &TorqueTerm| term.own_joint() == Some(joint) && !term.is_drive_inertia() && !term.is_declared();
    let own = robot.terms().enumerate().filter(|(place, (term, _))| is_own(term) && only.is_none_or(|it| it == *place));
    own.map(|(_, (term, value))| {
        let mut column = [0.0];
        match term {
            TorqueTerm::MaxwellSlip(_) => column[0] = if dq == 0.0 { 0.0 } else { dq.signum() },
            _ => term.column(joint, &motion, &mut column),
        }
        if only.is_some() { column[0] } else { value * column[0] }
    })
    .sum()
}
