//! Python with NumPy: one state or arrays of states, with joints on the last axis.

use super::Source;
use crate::equation::{Equation, StepEquation};
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::Syntax;
use core::fmt::Write;

/// Expressions over NumPy, or over a library with its interface.
pub(super) struct ArraySyntax {
    /// Name of the imported library.
    pub(super) library: &'static str,
}

impl Syntax for ArraySyntax {
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
        format!("{}.{name}({of})", self.library)
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        let name = match function {
            Function2::Atan2 => "arctan2",
            Function2::Min => "minimum",
            Function2::Max => "maximum",
        };
        format!("{}.{name}({first}, {second})", self.library)
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        format!("{}.power({of}, {exponent:?})", self.library)
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("_sign({of}, {dead_band:?})")
    }
}

/// A string of Python: printable ASCII, everything else escaped.
pub(crate) fn python_string(text: &str) -> String {
    let escaped = text.chars().map(|c| match c {
        '"' | '\\' => format!("\\{c}"),
        ' '..='~' => c.to_string(),
        _ => format!("\\U{:08x}", u32::from(c)),
    });
    format!("\"{}\"", escaped.collect::<String>())
}

pub(crate) fn python_module(source: &Source<'_>) -> String {
    let syntax = ArraySyntax { library: "np" };
    let mut text = source.comment("#");
    let dof = source.dof();
    let _ = write!(
        text,
        "\n# One state, or any number of them: arrays of shape (..., {dof}).\nimport numpy as np\n\nDOF = {dof}\n"
    );
    write_helpers(&mut text, source, "np");
    for function in &source.equations.functions {
        write_function(&mut text, source, function, &syntax);
    }
    if let Some(step) = &source.equations.step {
        write_step(&mut text, source, step, &syntax);
    }
    text
}

/// The functions that check and combine arrays.
pub(super) fn write_helpers(text: &mut String, source: &Source<'_>, library: &str) {
    let dof = source.dof();
    let _ = write!(
        text,
        "\n\ndef _joints(vector):\n    vector = {library}.asarray(vector, dtype=float)\n    if vector.shape[-1:] != ({dof},):\n        \
         raise ValueError(f\"the last axis has {{vector.shape[-1:]}} entries in place of {dof}\")\n    return vector\n\n\n\
         def _together(values, given):\n    shape = {library}.broadcast_shapes(*(vector.shape[:-1] for vector in given))\n    \
         return {library}.stack([{library}.broadcast_to(value, shape) for value in values], axis=-1)\n"
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        let _ = write!(
            text,
            "\n\ndef _sign(x, band):\n    \"\"\"Sign of x, zero while |x| is at most band.\"\"\"\n    \
             return {library}.where({library}.abs(x) <= band, 0.0, {library}.sign(x))\n"
        );
    }
}

/// Lines that convert the arguments to arrays: in `given`, and by their names.
fn given(function: &Equation) -> String {
    let names = function.arguments();
    let tuple = if function.inputs.len() == 1 { format!("{names},") } else { names };
    format!("    {tuple} = given = [_joints(vector) for vector in ({tuple})]\n")
}

fn together(values: &[String], given: &str) -> String {
    format!("_together([\n        {},\n    ], {given})", values.join(",\n        "))
}

pub(super) fn write_function(text: &mut String, source: &Source<'_>, function: &Equation, syntax: &ArraySyntax) {
    let (dof, library) = (source.dof(), syntax.library);
    let statements = source.statements(function, syntax);
    let _ = write!(text, "\n\ndef {}({}):\n    \"\"\"{}\"\"\"\n", function.name, function.arguments(), function.about);
    if function.inputs.is_empty() {
        let _ =
            write!(text, "    return {library}.array([\n        {},\n    ])\n", statements.outputs.join(",\n        "));
        return;
    }
    text.push_str(&given(function));
    for (variable, expression) in &statements.lines {
        let _ = writeln!(text, "    {variable} = {expression}");
    }
    let together = together(&statements.outputs, "given");
    if let Some(columns) = function.columns {
        let _ = writeln!(text, "    flat = {together}\n    return flat.reshape(flat.shape[:-1] + ({dof}, {columns}))");
    } else {
        let _ = writeln!(text, "    return {together}");
    }
}

fn write_step(text: &mut String, source: &Source<'_>, step: &StepEquation, syntax: &ArraySyntax) {
    let (function, elements) = (&step.equation, step.elements);
    let statements = source.statements(function, syntax);
    let _ = write!(
        text,
        "\n\nclass State:\n    \"\"\"State of step: the last positions and the deflections of the elements with memory.\"\"\"\n\n    \
         def __init__(self):\n        reset(self)\n\n\n\
         def reset(state):\n    \"\"\"Starts a motion: the elements are undeflected at its first position.\"\"\"\n    \
         state.last, state.z = None, np.zeros({elements})\n\n\n\
         def step(state, {}):\n    \"\"\"{}\"\"\"\n{}    \
         last, z = q if state.last is None else state.last, state.z\n",
        function.arguments(),
        function.about,
        given(function)
    );
    for (variable, expression) in &statements.lines {
        let _ = writeln!(text, "    {variable} = {expression}");
    }
    let (tau, deflections) = statements.outputs.split_at(source.dof());
    let _ = writeln!(text, "    tau = {}", together(tau, "given"));
    let _ = writeln!(text, "    state.z = {}", together(deflections, "[q]"));
    text.push_str("    state.last = q.copy()\n    return tau\n");
}

/// Writes the function with state as a pure function, for libraries that transform functions.
pub(super) fn write_pure_step(text: &mut String, source: &Source<'_>, step: &StepEquation, syntax: &ArraySyntax) {
    let (function, elements, library) = (&step.equation, step.elements, syntax.library);
    let statements = source.statements(function, syntax);
    let _ = write!(
        text,
        "\n\ndef reset(q):\n    \"\"\"State at the start of a motion at q: the last positions and the deflections of the elements with memory.\"\"\"\n    \
         q = _joints(q)\n    return q, {library}.zeros(q.shape[:-1] + ({elements},))\n\n\n\
         def step(state, {}):\n    \"\"\"{} Returns the torque and the next state.\"\"\"\n{}    last, z = state\n",
        function.arguments(),
        function.about,
        given(function)
    );
    for (variable, expression) in &statements.lines {
        let _ = writeln!(text, "    {variable} = {expression}");
    }
    let (tau, deflections) = statements.outputs.split_at(source.dof());
    let _ = writeln!(text, "    tau = {}", together(tau, "given"));
    let _ = writeln!(text, "    return tau, (q, {})", together(deflections, "[q]"));
}
