//! The exported functions of all languages as graphs: runs the recursive Newton-Euler and composite-rigid-body
//! algorithms over symbols.

use crate::drive_torque::Drives;
use crate::equation::{Equation, Inputs, StepEquation};
use crate::error::ExportError;
use crate::forward::{forward, mass_matrix};
use crate::graph::{Graph, Input};
use crate::regressor::Regressor;
use crate::robot_model::RobotModel;
use crate::symbol::{Symbol, record};
use dynident_dynamics::inverse_dynamics_over;
use dynident_lanes::Scalar;
use dynident_model::{Model, Vec3};

#[derive(Debug)]
pub(crate) struct Equations {
    pub(crate) dof: usize,
    pub(crate) graph: Graph,
    pub(crate) functions: Vec<Equation>,
    pub(crate) step: Option<StepEquation>,
    /// Names of the regressor's columns; empty without a regressor.
    pub(crate) parameters: Vec<String>,
}

impl Equations {
    /// Creates the functions, with the regressor on request. Constants must not exceed `most`.
    ///
    /// # Errors
    /// A torque term that is not a function of the motion, a joint without inertia, or an overflow.
    pub(crate) fn of(robot: &RobotModel, with_regressor: bool, most: f64) -> Result<Self, ExportError> {
        let reduced = robot.reduced()?;
        let weightless = reduced.clone().with_gravity(Vec3::ZERO)?;
        let load = robot.load_model()?;
        let (graph, made) = record(|| -> Result<_, ExportError> {
            let inputs = Inputs::new(robot.model().dof());
            let load = load.as_ref();
            let values = Values::of(robot, &reduced, &weightless, load, &inputs)?;
            let step = step(robot, &reduced, load, &inputs)?;
            let of_load = inputs.load(load);
            let regressor = with_regressor.then(|| Regressor::of(robot, inputs.motion(&of_load)));
            Ok((values.functions(), step, regressor.transpose()?))
        });
        let (mut functions, step, regressor) = made?;
        let parameters = regressor.as_ref().map_or_else(Vec::new, |regressor| regressor.names.clone());
        functions.extend(regressor.into_iter().flat_map(Regressor::functions));
        match graph.too_large(most) {
            Some(value) => Err(ExportError::Overflow { value }),
            None => Ok(Self { dof: robot.model().dof(), graph, functions, step, parameters }),
        }
    }
}

struct Values {
    inverse: Vec<Symbol>,
    gravity: Vec<Symbol>,
    coriolis: Vec<Symbol>,
    friction: Vec<Symbol>,
    mass_matrix: Vec<Symbol>,
    forward: Vec<Symbol>,
    declared: Option<Vec<Symbol>>,
    load_friction: Option<Vec<Symbol>>,
}

impl Values {
    /// Runs the algorithms. `weightless` is the reduced robot without gravity; `load` has the bodies for
    /// load-dependent friction.
    fn of(
        robot: &RobotModel,
        reduced: &Model,
        weightless: &Model,
        load: Option<&Model>,
        inputs: &Inputs,
    ) -> Result<Self, ExportError> {
        let Inputs { q, dq, rest, .. } = inputs;
        let drives = Drives::of(robot.model().dof(), robot.terms(), q, dq, false)?;
        let of_load = inputs.load(load);
        let mass_matrix = mass_matrix(reduced, q, &drives.inertia);
        let inverse = inverse(reduced, inputs, &drives, &of_load);
        let forward = forward(reduced, load, inputs, &mass_matrix, &drives)?;
        Ok(Self {
            inverse,
            gravity: inverse_dynamics_over(reduced, q, rest, rest),
            coriolis: inverse_dynamics_over(weightless, q, dq, rest),
            load_friction: drives.load_friction(&of_load),
            friction: drives.friction,
            mass_matrix,
            forward,
            declared: drives.declared,
        })
    }

    fn functions(self) -> Vec<Equation> {
        let dof = self.friction.len();
        let function = |name, about, inputs, output, values: Vec<Symbol>| Equation {
            name,
            about,
            inputs,
            output,
            columns: (name == "mass_matrix").then_some(dof),
            values,
        };
        let mut functions = vec![
            function(
                "inverse_dynamics",
                "Torque of a motion: tau = M(q) ddq + C(q, dq) dq + g(q) + friction(dq).",
                &[Input::Position, Input::Velocity, Input::Acceleration],
                "tau",
                self.inverse,
            ),
            function("gravity", "Torque against gravity, g(q).", &[Input::Position], "tau", self.gravity),
            function(
                "coriolis",
                "Coriolis and centrifugal torque, the vector C(q, dq) dq.",
                &[Input::Position, Input::Velocity],
                "tau",
                self.coriolis,
            ),
            function(
                "friction",
                "Friction and constant offsets of the drives.",
                &[Input::Velocity],
                "tau",
                self.friction,
            ),
            function(
                "mass_matrix",
                "Mass matrix M(q) with the inertia of the drives, row by row.",
                &[Input::Position],
                "mass",
                self.mass_matrix,
            ),
            function(
                "forward_dynamics",
                "Accelerations for given torques: M(q) ddq = tau - C(q, dq) dq - g(q) - friction(dq).",
                &[Input::Position, Input::Velocity, Input::Torque],
                "ddq",
                self.forward,
            ),
        ];
        functions.extend(self.declared.map(|declared| {
            function(
                "declared",
                "Declared torque of the study (springs, counterbalances); included in inverse_dynamics and forward_dynamics.",
                &[Input::Position, Input::Velocity],
                "tau",
                declared,
            )
        }));
        functions.extend(self.load_friction.map(|friction| {
            function(
                "load_friction",
                "Friction that depends on the torque on the gear; included in inverse_dynamics and forward_dynamics, not in friction.",
                &[Input::Position, Input::Velocity, Input::Acceleration],
                "tau",
                friction,
            )
        }));
        functions
    }
}

/// The function with state; `None` without a term with hysteresis.
fn step(
    robot: &RobotModel,
    reduced: &Model,
    load: Option<&Model>,
    inputs: &Inputs,
) -> Result<Option<StepEquation>, ExportError> {
    let terms = robot.state_terms().iter().map(|(term, value)| (term, *value));
    let drives = Drives::of(robot.model().dof(), terms, &inputs.q, &inputs.dq, true)?;
    let mut values = inverse(reduced, inputs, &drives, &inputs.load(load));
    Ok(drives.memory.map(|(_, deflections)| {
        let elements = deflections.len();
        values.extend(deflections);
        let equation = Equation {
            name: "step",
            about: "Torque of a motion with the friction that has a memory; call it once for each sample, in their order.",
            inputs: &[Input::Position, Input::Velocity, Input::Acceleration],
            output: "tau",
            columns: None,
            values,
        };
        StepEquation { equation, elements }
    }))
}

fn inverse(reduced: &Model, inputs: &Inputs, drives: &Drives, load: &[Symbol]) -> Vec<Symbol> {
    let Inputs { q, dq, ddq, .. } = inputs;
    let mut inverse = inverse_dynamics_over(reduced, q, dq, ddq);
    let other = drives.torque(load);
    for (row, torque) in inverse.iter_mut().enumerate() {
        for (column, &acceleration) in ddq.iter().enumerate() {
            *torque += Symbol::splat(drives.inertia[row * ddq.len() + column]) * acceleration;
        }
        *torque += other[row];
    }
    inverse
}
