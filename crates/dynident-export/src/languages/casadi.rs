//! Python with CasADi: every function as a `casadi.Function` over symbols.

use super::Source;
use crate::equation::{Equation, StepEquation};
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::Syntax;
use core::fmt::Write;

struct CasadiSyntax;

impl Syntax for CasadiSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}[{joint}]", input.name())
    }

    fn call(&self, function: Function, of: &str) -> String {
        let name = if function == Function::Abs { "fabs" } else { function.name() };
        format!("ca.{name}({of})")
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        let name = match function {
            Function2::Atan2 => "atan2",
            Function2::Min => "fmin",
            Function2::Max => "fmax",
        };
        format!("ca.{name}({first}, {second})")
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        format!("({of}) ** {exponent:?}")
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("_sign({of}, {dead_band:?})")
    }
}

/// A module with a `casadi.Function` for each quantity.
pub(crate) fn casadi_module(source: &Source<'_>) -> String {
    let dof = source.dof();
    let mut text = source.comment("#");
    let _ = write!(text, "\nimport casadi as ca\n\nDOF = {dof}\n");
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        text.push_str(
            "\n\ndef _sign(x, band):\n    \"\"\"Sign of x, zero while |x| is at most band.\"\"\"\n    \
             return ca.if_else(ca.fabs(x) <= band, 0.0, ca.sign(x))\n",
        );
    }
    for function in &source.equations.functions {
        let outputs = source.statements(function, &CasadiSyntax).outputs;
        let flat = vertical(&outputs);
        let made = match function.columns {
            // CasADi fills matrices column by column.
            Some(columns) => format!("ca.reshape({flat}, {columns}, {dof}).T"),
            None => flat,
        };
        write_function(&mut text, source, function, &[], &[(function.output, made)]);
    }
    if let Some(step) = &source.equations.step {
        write_step(&mut text, source, step);
    }
    text
}

fn vertical(values: &[String]) -> String {
    format!("ca.vertcat(\n        {},\n    )", values.join(",\n        "))
}

/// Writes a function with the inputs `before` (each with a name and a length), followed by the inputs of `function`.
fn write_function(
    text: &mut String,
    source: &Source<'_>,
    function: &Equation,
    before: &[(&str, usize)],
    outputs: &[(&str, String)],
) {
    let (name, dof) = (function.name, source.dof());
    let own = function.inputs.iter().map(|input| (input.name(), dof));
    let inputs: Vec<(&str, usize)> = before.iter().copied().chain(own).collect();
    let _ = writeln!(text, "\n\ndef _{name}():");
    for (input, length) in &inputs {
        let _ = writeln!(text, "    {input} = ca.SX.sym(\"{input}\", {length})");
    }
    for (variable, expression) in &source.statements(function, &CasadiSyntax).lines {
        let _ = writeln!(text, "    {variable} = {expression}");
    }
    for (output, expression) in outputs {
        let _ = writeln!(text, "    {output}_out = ca.SX({expression})");
    }
    let names = inputs.iter().map(|(name, _)| *name).collect::<Vec<_>>();
    let quoted = |names: &[&str]| names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    let made: Vec<&str> = outputs.iter().map(|(name, _)| *name).collect();
    let values = made.iter().map(|name| format!("{name}_out")).collect::<Vec<_>>().join(", ");
    let _ = write!(
        text,
        "    return ca.Function(\"{name}\", [{}], [{values}], [{}], [{}])\n\n\n# {}\n{name} = _{name}()\n",
        names.join(", "),
        quoted(&names),
        quoted(&made),
        function.about
    );
}

fn write_step(text: &mut String, source: &Source<'_>, step: &StepEquation) {
    let (dof, elements, function) = (source.dof(), step.elements, &step.equation);
    let outputs = source.statements(function, &CasadiSyntax).outputs;
    let (tau, deflections) = outputs.split_at(dof);
    let _ = write!(
        text,
        "\n\n# The state of step is the pair of the last positions `last` and the deflections `z`.\n\
         def reset(q):\n    \"\"\"State at the start of a motion at q: the elements with memory are undeflected.\"\"\"\n    \
         return ca.DM(q), ca.DM.zeros({elements})\n"
    );
    let before = [("last", dof), ("z", elements)];
    let outputs = [("tau", vertical(tau)), ("last_next", "q".to_owned()), ("z_next", vertical(deflections))];
    write_function(text, source, function, &before, &outputs);
}
