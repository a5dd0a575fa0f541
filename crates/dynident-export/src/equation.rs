//! One function of the exported equations, and its inputs as symbols.

use crate::drive_torque::SymbolMotion;
use crate::graph::Input;
use crate::symbol::Symbol;
use dynident_dynamics::inverse_dynamics_over;
use dynident_lanes::Scalar;
use dynident_model::Model;

/// One function: inputs are joint vectors, the output is a vector or a row-major matrix.
#[derive(Debug)]
pub(crate) struct Equation {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) inputs: &'static [Input],
    pub(crate) output: &'static str,
    /// Number of columns of a matrix; `None` for a vector.
    pub(crate) columns: Option<usize>,
    pub(crate) values: Vec<Symbol>,
}

impl Equation {
    pub(crate) fn arguments(&self) -> String {
        self.inputs.iter().map(|input| input.name()).collect::<Vec<_>>().join(", ")
    }
}

/// The function with state: torque of a motion, and the deflections of the elements with hysteresis after it.
#[derive(Debug)]
pub(crate) struct StepEquation {
    /// The inputs are the motion; positions and deflections before it are further inputs. In the output the
    /// deflections follow the torque.
    pub(crate) equation: Equation,
    /// Number of elements with hysteresis.
    pub(crate) elements: usize,
}

pub(crate) struct Inputs {
    pub(crate) q: Vec<Symbol>,
    pub(crate) dq: Vec<Symbol>,
    pub(crate) ddq: Vec<Symbol>,
    pub(crate) tau: Vec<Symbol>,
    pub(crate) rest: Vec<Symbol>,
}

impl Inputs {
    pub(crate) fn new(dof: usize) -> Self {
        let [q, dq, ddq, tau] = [Input::Position, Input::Velocity, Input::Acceleration, Input::Torque]
            .map(|input| Symbol::inputs(input, dof));
        Self { q, dq, ddq, tau, rest: vec![Symbol::ZERO; dof] }
    }

    /// Torque of the bodies that determines load-dependent friction; empty without such friction.
    pub(crate) fn load(&self, load: Option<&Model>) -> Vec<Symbol> {
        load.map_or_else(Vec::new, |load| inverse_dynamics_over(load, &self.q, &self.dq, &self.ddq))
    }

    pub(crate) fn motion<'a>(&'a self, load: &'a [Symbol]) -> SymbolMotion<'a> {
        SymbolMotion { q: &self.q, dq: &self.dq, ddq: &self.ddq, load }
    }
}
