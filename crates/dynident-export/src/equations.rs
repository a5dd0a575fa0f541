//! The functions of all languages as graphs: runs the recursive Newton-Euler and composite-rigid-body algorithms over
//! symbols.

use crate::declared_torque::declared_torque;
use crate::drive_torque::{drive_inertia, friction};
use crate::error::ExportError;
use crate::graph::{Graph, Input};
use crate::robot_model::RobotModel;
use crate::symbol::{Symbol, record};
use dynident_dynamics::{inverse_dynamics_over, mass_matrix_over};
use dynident_lanes::Scalar;
use dynident_model::{Model, Vec3};

/// One function: inputs are joint vectors, the output is a joint vector or a row-major square matrix.
#[derive(Debug)]
pub(crate) struct Equation {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) inputs: &'static [Input],
    pub(crate) output: &'static str,
    pub(crate) is_matrix: bool,
    pub(crate) values: Vec<Symbol>,
}

impl Equation {
    pub(crate) fn arguments(&self) -> String {
        self.inputs.iter().map(|input| input.name()).collect::<Vec<_>>().join(", ")
    }
}

#[derive(Debug)]
pub(crate) struct Equations {
    pub(crate) dof: usize,
    pub(crate) graph: Graph,
    pub(crate) functions: Vec<Equation>,
}

impl Equations {
    /// # Errors
    /// A torque term that is not a function of the motion, a joint without inertia, or an overflow.
    pub(crate) fn of(robot: &RobotModel) -> Result<Self, ExportError> {
        let reduced = robot.reduced()?;
        let weightless = reduced.clone().with_gravity(Vec3::ZERO)?;
        let (graph, values) = record(|| Values::of(robot, &reduced, &weightless));
        let functions = values?.functions();
        match graph.not_finite() {
            Some(value) => Err(ExportError::Overflow { value }),
            None => Ok(Self { dof: robot.model().dof(), graph, functions }),
        }
    }
}

struct Inputs {
    q: Vec<Symbol>,
    dq: Vec<Symbol>,
    ddq: Vec<Symbol>,
    tau: Vec<Symbol>,
    rest: Vec<Symbol>,
}

impl Inputs {
    fn new(dof: usize) -> Self {
        let [q, dq, ddq, tau] = [Input::Position, Input::Velocity, Input::Acceleration, Input::Torque]
            .map(|input| Symbol::inputs(input, dof));
        Self { q, dq, ddq, tau, rest: vec![Symbol::ZERO; dof] }
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
}

impl Values {
    /// Runs the algorithms; `weightless` is the reduced robot without gravity.
    fn of(robot: &RobotModel, reduced: &Model, weightless: &Model) -> Result<Self, ExportError> {
        let inputs = Inputs::new(robot.model().dof());
        let Inputs { q, dq, rest, .. } = &inputs;
        let rotors = drive_inertia(robot);
        let friction = friction(robot, dq)?;
        let declared = declared_torque(robot, q, dq)?;
        // Torques other than those of rigid bodies and drive inertia.
        let other: Vec<Symbol> = match &declared {
            Some(declared) => friction.iter().zip(declared).map(|(&friction, &declared)| friction + declared).collect(),
            None => friction.clone(),
        };
        let mass_matrix = mass_matrix(reduced, q, &rotors);
        let inverse = inverse(reduced, &inputs, &rotors, &other);
        let forward = forward(reduced, &inputs, &mass_matrix, &other)?;
        Ok(Self {
            inverse,
            gravity: inverse_dynamics_over(reduced, q, rest, rest),
            coriolis: inverse_dynamics_over(weightless, q, dq, rest),
            friction,
            mass_matrix,
            forward,
            declared,
        })
    }

    fn functions(self) -> Vec<Equation> {
        let function = |name, about, inputs, output, values: Vec<Symbol>| Equation {
            name,
            about,
            inputs,
            output,
            is_matrix: name == "mass_matrix",
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
        functions
    }
}

fn mass_matrix(reduced: &Model, q: &[Symbol], rotors: &[f64]) -> Vec<Symbol> {
    let mut mass_matrix = mass_matrix_over(reduced, q);
    for (entry, &rotor) in mass_matrix.iter_mut().zip(rotors) {
        *entry += Symbol::splat(rotor);
    }
    mass_matrix
}

fn inverse(reduced: &Model, inputs: &Inputs, rotors: &[f64], other: &[Symbol]) -> Vec<Symbol> {
    let Inputs { q, dq, ddq, .. } = inputs;
    let mut inverse = inverse_dynamics_over(reduced, q, dq, ddq);
    for (row, torque) in inverse.iter_mut().enumerate() {
        for (column, &acceleration) in ddq.iter().enumerate() {
            *torque += Symbol::splat(rotors[row * ddq.len() + column]) * acceleration;
        }
        *torque += other[row];
    }
    inverse
}

fn forward(
    reduced: &Model,
    inputs: &Inputs,
    mass_matrix: &[Symbol],
    other: &[Symbol],
) -> Result<Vec<Symbol>, ExportError> {
    let Inputs { q, dq, tau, rest, .. } = inputs;
    let bias = inverse_dynamics_over(reduced, q, dq, rest);
    let left = (0..tau.len()).map(|joint| tau[joint] - (bias[joint] + other[joint])).collect();
    solved(mass_matrix.to_vec(), left)
        .map_err(|joint| ExportError::NoInertia { joint: reduced.joints()[joint].name.clone() })
}

/// `M⁻¹ b` by `M = Lᵀ D L`, from the tip to the base, so that the zeros between independent branches are kept
/// (Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 6.5). Fails with the index of a joint whose pivot is
/// constant and not positive.
fn solved(mut m: Vec<Symbol>, mut b: Vec<Symbol>) -> Result<Vec<Symbol>, usize> {
    let dof = b.len();
    let mut inverses = vec![Symbol::ZERO; dof];
    for k in (0..dof).rev() {
        let pivot = m[k * dof + k];
        if pivot.number().is_some_and(|pivot| pivot <= 0.0) {
            return Err(k);
        }
        inverses[k] = pivot.recip();
        for i in 0..k {
            let factor = m[k * dof + i] * inverses[k];
            if factor.is_zero() {
                continue;
            }
            for j in 0..=i {
                let taken = factor * m[k * dof + j];
                m[i * dof + j] -= taken;
            }
        }
        for i in 0..k {
            m[k * dof + i] = m[k * dof + i] * inverses[k];
        }
    }
    for k in (0..dof).rev() {
        for i in 0..k {
            let taken = m[k * dof + i] * b[k];
            b[i] -= taken;
        }
    }
    for k in 0..dof {
        b[k] = b[k] * inverses[k];
        for i in 0..k {
            let taken = m[k * dof + i] * b[i];
            b[k] -= taken;
        }
    }
    Ok(b)
}
