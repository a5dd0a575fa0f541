//! Python with NumPy: one state or arrays of states, with joints on the last axis.

use super::Source;
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::Syntax;
use core::fmt::Write;

struct PythonSyntax;

impl Syntax for PythonSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}[..., {joint}]", input.name())
    }

    fn call(&self, function: Function, of: &str) -> String {
        let name = match function {
            Function::Asin => "arcsin",
            Function::Acos => "arccos",
            Function::Atan => "arctan",
            other => other.name(),
        };
        format!("np.{name}({of})")
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        let name = match function {
            Function2::Atan2 => "arctan2",
            Function2::Min => "minimum",
            Function2::Max => "maximum",
        };
        format!("np.{name}({first}, {second})")
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        format!("np.power({of}, {exponent:?})")
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("_step({of}, {dead_band:?})")
    }
}

pub(crate) fn python_module(source: &Source<'_>) -> String {
    let dof = source.dof();
    let mut text = source.comment("#");
    let _ = write!(
        text,
        "\n# One state, or any number of them: arrays of shape (..., {dof}).\nimport numpy as np\n\nDOF = {dof}\n\n\n\
         def _joints(vector):\n    vector = np.asarray(vector, dtype=float)\n    if vector.shape[-1:] != ({dof},):\n        \
         raise ValueError(f\"the last axis has {{vector.shape[-1:]}} entries in place of {dof}\")\n    return vector\n\n\n\
         def _together(values, given):\n    shape = np.broadcast_shapes(*(vector.shape[:-1] for vector in given))\n    \
         return np.stack([np.broadcast_to(value, shape) for value in values], axis=-1)\n"
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        text.push_str(
            "\n\ndef _step(x, band):\n    \"\"\"Sign of x, zero while |x| is at most band.\"\"\"\n    \
             return np.where(np.abs(x) <= band, 0.0, np.sign(x))\n",
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &PythonSyntax);
        let names = function.arguments();
        let _ = write!(text, "\n\ndef {}({names}):\n    \"\"\"{}\"\"\"\n", function.name, function.about);
        let given = if function.inputs.len() == 1 { format!("{names},") } else { names };
        let _ = writeln!(text, "    {given} = given = [_joints(vector) for vector in ({given})]");
        for (variable, expression) in &statements.lines {
            let _ = writeln!(text, "    {variable} = {expression}");
        }
        let together = format!("_together([\n        {},\n    ], given)", statements.outputs.join(",\n        "));
        if function.is_matrix {
            let _ = writeln!(text, "    flat = {together}\n    return flat.reshape(flat.shape[:-1] + ({dof}, {dof}))");
        } else {
            let _ = writeln!(text, "    return {together}");
        }
    }
    text
}
