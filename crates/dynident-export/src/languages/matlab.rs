//! A function file for MATLAB and Octave. The first argument is the name of the quantity, because a file exposes only
//! one function.

use super::Source;
use crate::equation::StepEquation;
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
        format!("sign_({of}, {dead_band:?})")
    }
}

/// A file `NAME_dynamics.m`: `tau = NAME_dynamics('inverse_dynamics', q, dq, ddq)` and so on; results are column
/// vectors.
pub(crate) fn matlab_function(source: &Source<'_>) -> String {
    let (name, dof) = (format!("{}_dynamics", source.robot.identifier()), source.dof());
    let functions = &source.equations.functions;
    let step = source.equations.step.as_ref();
    let outputs = if step.is_some() { "[out, state]" } else { "out" };
    let mut text = format!("function {outputs} = {name}(quantity, varargin)\n{}\n", source.comment("%"));
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
    if let Some(step) = step {
        let _ = writeln!(
            text,
            "%   state = {name}('reset')  Starts a motion: elements with memory are undeflected at its first position.\n\
             %   [tau, state] = {name}('step', state, {})  {}",
            step.equation.arguments(),
            step.equation.about
        );
    }
    text.push_str("  switch quantity\n");
    for function in functions {
        let arguments: Vec<String> =
            (1..=function.inputs.len()).map(|place| format!("joints_(varargin{{{place}}})")).collect();
        let _ =
            write!(text, "    case '{}'\n      out = {}_({});\n", function.name, function.name, arguments.join(", "));
    }
    if let Some(step) = step {
        let _ = write!(
            text,
            "    case 'reset'\n      out = struct('last', [], 'z', zeros({}, 1));\n    case 'step'\n      \
             [out, state] = step_(varargin{{1}}, joints_(varargin{{2}}), joints_(varargin{{3}}), joints_(varargin{{4}}));\n",
            step.elements
        );
    }
    let _ = write!(
        text,
        "    otherwise\n      error('{name}: no quantity %s', quantity);\n  end\nend\n\n\
         function v = joints_(v)\n  if numel(v) ~= {dof}\n    error('{name}: a joint vector has {dof} entries, not %d', numel(v));\n  end\nend\n"
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        text.push_str("\nfunction s = sign_(x, band)\n  s = sign(x) * (abs(x) > band);\nend\n");
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
        if let Some(columns) = function.columns {
            let _ = writeln!(text, "  out = reshape(out, {columns}, {dof}).';");
        }
        text.push_str("end\n");
    }
    if let Some(step) = step {
        write_step(&mut text, source, step);
    }
    text
}

fn write_step(text: &mut String, source: &Source<'_>, step: &StepEquation) {
    let (dof, function) = (source.dof(), &step.equation);
    let statements = source.statements(function, &MatlabSyntax);
    let _ = write!(
        text,
        "\nfunction [out, state] = step_(state, {})\n  if isempty(state.last)\n    state.last = q;\n  end\n  \
         last = state.last;\n  z = state.z;\n",
        function.arguments()
    );
    for (variable, expression) in &statements.lines {
        let _ = writeln!(text, "  {variable} = {expression};");
    }
    let _ = writeln!(text, "  out = zeros({dof}, 1);");
    let (tau, deflections) = statements.outputs.split_at(dof);
    for (place, expression) in tau.iter().enumerate() {
        let _ = writeln!(text, "  out({}) = {expression};", place + 1);
    }
    for (place, expression) in deflections.iter().enumerate() {
        let _ = writeln!(text, "  state.z({}) = {expression};", place + 1);
    }
    text.push_str("  state.last = q;\nend\n");
}
