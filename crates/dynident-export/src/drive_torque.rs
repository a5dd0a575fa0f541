//! Torque terms as symbols: friction, offsets and drive inertia.

use crate::declared_torque::declared_unit;
use crate::error::ExportError;
use crate::graph::{Function2, Input};
use crate::robot_model::RobotModel;
use crate::symbol::Symbol;
use dynident_lanes::{Real, Scalar};
use dynident_model::terms::{Coulomb, JointMotion, TermConstant, TorqueTerm};

/// Motion of all joints, and the torque that gears transmit, for load-dependent friction.
#[derive(Clone, Copy)]
pub(crate) struct SymbolMotion<'a> {
    pub(crate) q: &'a [Symbol],
    pub(crate) dq: &'a [Symbol],
    pub(crate) ddq: &'a [Symbol],
    /// Torque that the gear of each joint transmits; empty without load-dependent friction.
    pub(crate) load: &'a [Symbol],
}

/// Torque terms by their role in the equation of motion.
pub(crate) struct Drives {
    /// Constant contribution to the mass matrix, row-major.
    pub(crate) inertia: Vec<f64>,
    /// Friction and offset of every joint as a function of the velocities. Temperature-dependent terms are at their
    /// reference temperature.
    pub(crate) friction: Vec<Symbol>,
    /// Declared torque; `None` without a declared term.
    pub(crate) declared: Option<Vec<Symbol>>,
    /// Load-dependent friction of every joint per magnitude of the transmitted torque; `None` without such friction.
    pub(crate) load_shares: Option<Vec<Symbol>>,
    /// Friction with hysteresis, and the deflection of each element after the step.
    pub(crate) memory: Option<(Vec<Symbol>, Vec<Symbol>)>,
}

impl Drives {
    /// # Errors
    /// A term that is not a function of the motion; a term with memory unless `with_state`.
    pub(crate) fn of<'a>(
        dof: usize,
        terms: impl Iterator<Item = (&'a TorqueTerm, f64)> + Clone,
        q: &[Symbol],
        dq: &[Symbol],
        with_state: bool,
    ) -> Result<Self, ExportError> {
        let zeros = || vec![Symbol::ZERO; dof];
        let mut drives = Self {
            inertia: inertia(dof, terms.clone()),
            friction: zeros(),
            declared: None,
            load_shares: None,
            memory: None,
        };
        for (term, value) in terms {
            let scaled = |unit: Symbol| Symbol::splat(value) * unit;
            match term {
                TorqueTerm::Declared(declared) => {
                    let torque = drives.declared.get_or_insert_with(zeros);
                    torque[declared.joint] += scaled(declared_unit(declared, q, dq)?);
                }
                TorqueTerm::MaxwellSlip(slip) if with_state => {
                    let (torque, deflections) = drives.memory.get_or_insert_with(|| (zeros(), Vec::new()));
                    let deflection = deflection(deflections.len(), slip.joint, slip.yield_displacement, q);
                    torque[slip.joint] += scaled(deflection * Symbol::splat(1.0 / slip.yield_displacement));
                    deflections.push(deflection);
                }
                _ => {
                    for row in term.joints() {
                        let torque = if term.needs_load() {
                            drives.load_shares.get_or_insert_with(zeros)
                        } else {
                            &mut drives.friction
                        };
                        torque[row] += scaled(velocity_unit(term, row, dq)?);
                    }
                }
            }
        }
        Ok(drives)
    }

    /// Torque of all terms except drive inertia; with an empty `load`, also without load-dependent friction.
    pub(crate) fn torque(&self, load: &[Symbol]) -> Vec<Symbol> {
        let mut torque = self.friction.clone();
        let of_load = self.load_friction(load).filter(|_| !load.is_empty());
        let further = [self.declared.clone(), of_load, self.memory.as_ref().map(|both| both.0.clone())];
        for further in further.into_iter().flatten() {
            torque.iter_mut().zip(further).for_each(|(torque, further)| *torque += further);
        }
        torque
    }

    /// Load-dependent friction at the transmitted torque `load`.
    pub(crate) fn load_friction(&self, load: &[Symbol]) -> Option<Vec<Symbol>> {
        let shares = self.load_shares.as_ref()?;
        Some(shares.iter().zip(load).map(|(&share, load)| share * load.abs()).collect())
    }
}

/// Deflection `z ← clamp(z + q − last, −Δ, Δ)` of an element with hysteresis, in the same order of operations as in
/// the model.
fn deflection(element: usize, joint: usize, yield_displacement: f64, q: &[Symbol]) -> Symbol {
    let [z, last] = [(Input::Deflection, element), (Input::LastPosition, joint)].map(|(of, at)| Symbol::input(of, at));
    let limit = Symbol::splat(yield_displacement);
    (z + q[joint] - last).call2(Function2::Max, -limit).call2(Function2::Min, limit)
}

/// Torque of joint `row` per unit of a term without hysteresis.
///
/// # Errors
/// A term that is not a function of the motion.
pub(crate) fn unit_torque(term: &TorqueTerm, row: usize, motion: SymbolMotion<'_>) -> Result<Symbol, ExportError> {
    if let TorqueTerm::Declared(declared) = term {
        return declared_unit(declared, motion.q, motion.dq);
    }
    let mut unit = velocity_unit(term, row, motion.dq)?;
    if term.needs_load() {
        unit = unit * motion.load[row].abs();
    }
    for (column, &acceleration) in motion.ddq.iter().enumerate() {
        unit += Symbol::splat(term.mass_matrix_entry(row, column)) * acceleration;
    }
    Ok(unit)
}

/// Dependence of a term on the velocity; for load-dependent friction its sign function.
fn velocity_unit(term: &TorqueTerm, row: usize, dq: &[Symbol]) -> Result<Symbol, ExportError> {
    let step = term.step().filter(|_| term.needs_load());
    let unit = match step {
        Some(shape) => TorqueTerm::Coulomb(Coulomb { joint: row, shape }).torque(row, dq),
        None => term.torque(row, dq),
    };
    unit.map_err(|needs| ExportError::Term { symbol: term.symbol(), kind: term.kind_name(), needs })
}

/// Constant contribution of the drives to the mass matrix, row-major.
pub(crate) fn drive_inertia(robot: &RobotModel) -> Vec<f64> {
    inertia(robot.model().dof(), robot.terms())
}

fn inertia<'a>(dof: usize, terms: impl Iterator<Item = (&'a TorqueTerm, f64)>) -> Vec<f64> {
    let mut matrix = vec![0.0; dof * dof];
    for (term, value) in terms {
        for row in term.joints() {
            for column in term.joints() {
                matrix[row * dof + column] += value * term.mass_matrix_entry(row, column);
            }
        }
    }
    matrix
}

/// Reference temperatures of the temperature-dependent terms, with their symbols; the exported functions are valid at
/// these temperatures.
pub(crate) fn reference_temperatures(robot: &RobotModel) -> Vec<(String, f64)> {
    let reference = |(term, _): (&TorqueTerm, f64)| {
        let constants = term.constants().into_iter().filter(|_| term.needs_temperature());
        let reference_c = constants.into_iter().find_map(|(name, constant)| match constant {
            TermConstant::Number(value, _) if name == "reference_c" => Some(value),
            _ => None,
        })?;
        Some((term.symbol(), reference_c))
    };
    robot.terms().filter_map(reference).collect()
}

/// Friction and offset of a joint at the velocity `dq`, in Nm (N); `dq` in rad/s (m/s). Couplings, load dependence
/// and temperature dependence are omitted. Hysteresis (Maxwell slip) is replaced by the Coulomb friction that it
/// reaches after a motion of twice its yield displacement.
///
/// # Panics
/// If the robot has no joint `joint`.
pub fn own_friction(robot: &RobotModel, joint: usize, dq: f64) -> f64 {
    own_friction_terms(robot, joint, dq, None)
}

/// Like [`own_friction`]; if `only` is given, for this term alone with a value of one.
pub(crate) fn own_friction_terms(robot: &RobotModel, joint: usize, dq: f64, only: Option<usize>) -> f64 {
    let zeros = vec![0.0; robot.model().dof()];
    let mut velocities = zeros.clone();
    velocities[joint] = dq;
    let motion = JointMotion { samples: 1, q: &zeros, dq: &velocities, ddq: &zeros };
    let is_own = |term: &TorqueTerm| term.own_joint() == Some(joint) && !term.is_drive_inertia() && !term.is_declared();
    let own = robot.terms().enumerate().filter(|(place, (term, _))| is_own(term) && only.is_none_or(|it| it == *place));
    own.map(|(_, (term, value))| {
        let mut column = [0.0];
        if term.has_memory() {
            column[0] = if dq == 0.0 { 0.0 } else { dq.signum() };
        } else {
            term.column(joint, &motion, &mut column);
        }
        if only.is_some() { column[0] } else { value * column[0] }
    })
    .sum()
}
