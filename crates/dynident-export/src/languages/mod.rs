//! One file per language: syntax of expressions and surrounding code.

mod c;
mod casadi;
mod cpp;
mod jax;
mod matlab;
mod pinocchio;
mod python;
mod rust;

pub(crate) use c::c_header;
pub(crate) use casadi::casadi_module;
pub(crate) use cpp::cpp_header;
pub(crate) use jax::jax_module;
pub(crate) use matlab::matlab_function;
pub(crate) use pinocchio::pinocchio_module;
pub(crate) use python::{python_module, python_string};
pub(crate) use rust::rust_module;

use crate::equation::Equation;
use crate::equations::Equations;
use crate::graph::Input;
use crate::robot_model::RobotModel;
use crate::statements::{Statements, Syntax, statements};

pub(crate) struct Source<'a> {
    pub(crate) robot: &'a RobotModel,
    pub(crate) equations: &'a Equations,
    pub(crate) notes: &'a [String],
    /// Whether numbers have 32 bits instead of 64; in C, C++ and Rust.
    pub(crate) float32: bool,
}

/// Text of a number that parses to the same bits; with 32 bits, of the nearest 32-bit number.
fn number(value: f64, float32: bool) -> String {
    if float32 { format!("{:?}", value as f32) } else { format!("{value:?}") }
}

impl Source<'_> {
    fn dof(&self) -> usize {
        self.equations.dof
    }

    fn statements(&self, function: &Equation, syntax: &dyn Syntax) -> Statements {
        statements(&self.equations.graph, &function.values, syntax)
    }

    /// The comment at the beginning of the file, with `mark` before each line.
    fn comment(&self, mark: &str) -> String {
        let title = format!(
            "Dynamics of {} ({} joints), written by dynident {}.",
            self.robot.model().name(),
            self.dof(),
            env!("CARGO_PKG_VERSION")
        );
        let units = "SI units: rad, Nm (m, N at joints that slide); joint vectors in this order:".to_owned();
        let joints = self.robot.model().joints().iter().enumerate();
        let joints = joints.map(|(place, joint)| format!("  {place}  {}", joint.name));
        let names = self.equations.parameters.iter().enumerate();
        let parameters = names.map(|(place, name)| format!("  parameter {place}: {name}"));
        let lines = [title, units].into_iter().chain(joints).chain(self.notes.iter().cloned()).chain(parameters);
        lines.map(|line| format!("{mark} {}", dynident_text::comment(&line))).collect::<Vec<_>>().join("\n")
    }
}

fn unused<'a>(function: &'a Equation, statements: &'a Statements) -> impl Iterator<Item = &'static str> + 'a {
    function.inputs.iter().filter(|input| !statements.used.contains(input)).map(|input| Input::name(*input))
}
