//! Torque terms as symbols: friction, offsets and drive inertia.

use crate::error::ExportError;
use crate::robot_model::RobotModel;
use crate::symbol::Symbol;
use dynident_lanes::Scalar;
use dynident_model::terms::{JointMotion, TermConstant, TorqueTerm};

/// Friction and offset torque of every joint at the velocities `dq`. Temperature-dependent terms are at their
/// reference temperature.
///
/// # Errors
/// A term that needs more than the velocity.
pub(crate) fn friction(robot: &RobotModel, dq: &[Symbol]) -> Result<Vec<Symbol>, ExportError> {
    let mut torque = vec![Symbol::ZERO; robot.model().dof()];
    for (term, value) in robot.terms() {
        for row in term.joints() {
            let unit = term.torque(row, dq);
            let unit =
                unit.map_err(|needs| ExportError::Term { symbol: term.symbol(), kind: term.kind_name(), needs })?;
            torque[row] += Symbol::splat(value) * unit;
        }
    }
    Ok(torque)
}

/// Constant contribution of the drives to the mass matrix, row-major.
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

/// Reference temperatures of the temperature-dependent terms, with their symbols; the exported functions apply at these
/// temperatures.
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

/// Friction and offset of a joint at the velocity `dq`. Couplings, load and temperature dependence are omitted; Maxwell
/// slip is replaced by the Coulomb friction that it reaches after a motion of twice its yield displacement.
pub(crate) fn own_friction(robot: &RobotModel, joint: usize, dq: f64) -> f64 {
    own_friction_terms(robot, joint, dq, None)
}

/// As [`own_friction`]; if `only` is given, for one term with a value of one.
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
