//! The regressor of the base parameters, as symbols.

use crate::drive_torque::{SymbolMotion, unit_torque};
use crate::equation::Equation;
use crate::error::ExportError;
use crate::graph::Input;
use crate::robot_model::{RobotModel, with_exact_right_angles};
use crate::symbol::Symbol;
use dynident_dynamics::{Column, ParametricModel, inverse_dynamics_over};
use dynident_lanes::Scalar;
use dynident_model::InertialParameters;
use dynident_model::terms::TorqueTerm;

/// Regressor `W` and base parameters `θ` of bodies and torque terms, with `τ = W θ`.
pub(crate) struct Regressor {
    /// Entries of `W`, row-major.
    entries: Vec<Symbol>,
    /// Values of `θ`.
    values: Vec<Symbol>,
    /// Each base parameter as an expression of standard parameters.
    pub(crate) names: Vec<String>,
}

impl Regressor {
    /// # Errors
    /// A torque term that is not a function of the motion.
    pub(crate) fn of(robot: &RobotModel, motion: SymbolMotion<'_>) -> Result<Self, ExportError> {
        let model = with_exact_right_angles(robot.model())?;
        let terms: Vec<TorqueTerm> = robot.terms().map(|(term, _)| term.clone()).collect();
        let parametric = ParametricModel::new(model.clone(), terms)?;
        let (base, dof) = (parametric.base(), model.dof());
        let columns = base.base_columns();
        let mut entries = vec![Symbol::ZERO; dof * columns.len()];
        for (place, column) in columns.iter().enumerate() {
            match column {
                Column::Body { body, parameter } => {
                    let mut inertials = vec![InertialParameters::ZERO; model.body_count()];
                    inertials[*body].0[*parameter] = 1.0;
                    let unit = model.with_inertials(&inertials)?;
                    let torque = inverse_dynamics_over(&unit, motion.q, motion.dq, motion.ddq);
                    for (row, torque) in torque.into_iter().enumerate() {
                        entries[row * columns.len() + place] = torque;
                    }
                }
                Column::Term(term) => {
                    for row in term.joints() {
                        entries[row * columns.len() + place] = unit_torque(term, row, motion)?;
                    }
                }
            }
        }
        let mut parameters = robot.model().parameter_vector();
        parameters.extend(robot.terms().map(|(_, value)| value));
        let values = base.values(&parameters).into_iter().map(Symbol::splat).collect();
        Ok(Self { entries, values, names: base.expressions() })
    }

    pub(crate) fn functions(self) -> [Equation; 2] {
        let columns = Some(self.values.len());
        [
            Equation {
                name: "regressor",
                about: "Regressor W of the base parameters, row by row: inverse_dynamics = W(q, dq, ddq) parameters.",
                inputs: &[Input::Position, Input::Velocity, Input::Acceleration],
                output: "regressor",
                columns,
                values: self.entries,
            },
            Equation {
                name: "parameters",
                about: "Values of the base parameters.",
                inputs: &[],
                output: "parameters",
                columns: None,
                values: self.values,
            },
        ]
    }
}
