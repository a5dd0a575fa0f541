//! A function file for MATLAB and Octave. The first argument is the name of the quantity, because a file exposes only
//! one function.

use super::Source;
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::Syntax;
use core::fmt::Write;

struct MatlabSyntax;

impl Syntax for MatlabSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}({})", input.name(), joint + 1)
    }

    fn call(&self, function: Function, of: &str) -> String {
        format!("{}({of})", function.name())
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        let name = match function {
            Function2::Atan2 => "atan2",
            Function2::Min => "min",
            Function2::Max => "max",
        };
        format!("{name}({first}, {second})")
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        format!("({of})^({exponent:?})")
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("step_({of}, {dead_band:?})")
    }
}

/// A file `NAME_dynamics.m`: `tau = NAME_dynamics('inverse_dynamics', q, dq, ddq)` and so on; results are column
/// vectors.
pub(crate) fn matlab_function(source: &Source<'_>) -> String {
    let (name, dof) = (format!("{}_dynamics", source.robot.identifier()), source.dof());
    let functions = &source.equations.functions;
    let mut text = format!("function out = {name}(quantity, varargin)\n{}\n", source.comment("%"));
    let _ = writeln!(text, "% Keep it as {name}.m. Joint vectors are columns or rows; columns come back.");
    for function in functions {
        let _ = writeln!(
            text,
            "%   {} = {name}('{}', {})  {}",
            function.output,
            function.name,
            function.arguments(),
            function.about
        );
    }
    text.push_str("  switch quantity\n");
    for function in functions {
        let arguments: Vec<String> =
            (1..=function.inputs.len()).map(|place| format!("joints_(varargin{{{place}}})")).collect();
        let _ =
            write!(text, "    case '{}'\n      out = {}_({});\n", function.name, function.name, arguments.join(", "));
    }
    let _ = write!(
        text,
        "    otherwise\n      error('{name}: no quantity %s', quantity);\n  end\nend\n\n\
         function v = joints_(v)\n  if numel(v) ~= {dof}\n    error('{name}: a joint vector has {dof} entries, not %d', numel(v));\n  end\nend\n"
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        text.push_str("\nfunction s = step_(x, band)\n  s = sign(x) * (abs(x) > band);\nend\n");
    }
    for function in functions {
        let statements = source.statements(function, &MatlabSyntax);
        let _ = writeln!(text, "\nfunction out = {}_({})", function.name, function.arguments());
        for (variable, expression) in &statements.lines {
            let _ = writeln!(text, "  {variable} = {expression};");
        }
        let _ = writeln!(text, "  out = zeros({}, 1);", function.values.len());
        for (place, expression) in statements.outputs.iter().enumerate() {
            let _ = writeln!(text, "  out({}) = {expression};", place + 1);
        }
        if function.is_matrix {
            let _ = writeln!(text, "  out = reshape(out, {dof}, {dof}).';");
        }
        text.push_str("end\n");
    }
    text
}
