//! Rust without `std` and without dependencies. `core` has no sine, so the caller provides elementary functions.

use super::{Source, number, unused};
use crate::equation::{Equation, StepEquation};
use crate::graph::{Function, Function2, Graph, Input, Node};
use crate::statements::{Statements, Syntax};
use core::fmt::Write;

struct RustSyntax {
    float32: bool,
}

impl Syntax for RustSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}[{joint}]", input.name())
    }

    fn call(&self, function: Function, of: &str) -> String {
        match function {
            // The only elementary function that `core` has.
            Function::Abs => format!("({of}).abs()"),
            Function::Ln => format!("M::ln({of})"),
            other => format!("M::{}({of})", other.name()),
        }
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        match function {
            Function2::Atan2 => format!("M::atan2({first}, {second})"),
            Function2::Min => format!("({first}).min({second})"),
            Function2::Max => format!("({first}).max({second})"),
        }
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        format!("M::powf({of}, {})", self.number(exponent))
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("sign({of}, {})", self.number(dead_band))
    }

    fn number(&self, value: f64) -> String {
        number(value, self.float32)
    }
}

/// Names of the functions of `Math` that a robot needs, with the names of their arguments.
fn needed_functions(graph: &Graph) -> Vec<(&'static str, &'static [&'static str])> {
    let has = |function| graph.has(|node| matches!(node, Node::Call(f, _) if f == function));
    let of_one = |name, function| (name, &["x"][..], has(function));
    let all = [
        of_one("sin", Function::Sin),
        of_one("cos", Function::Cos),
        of_one("tan", Function::Tan),
        of_one("asin", Function::Asin),
        of_one("acos", Function::Acos),
        of_one("atan", Function::Atan),
        of_one("sinh", Function::Sinh),
        of_one("cosh", Function::Cosh),
        of_one("tanh", Function::Tanh),
        of_one("exp", Function::Exp),
        of_one("ln", Function::Ln),
        ("atan2", &["y", "x"], graph.has(|node| matches!(node, Node::Call2(Function2::Atan2, ..)))),
        ("powf", &["x", "exponent"], graph.has(|node| matches!(node, Node::Power(..)))),
    ];
    all.into_iter().filter(|(.., used)| *used).map(|(name, arguments, _)| (name, arguments)).collect()
}

/// A module of functions over a trait `Math` with the required elementary functions.
pub(crate) fn rust_module(source: &Source<'_>) -> String {
    let (dof, graph) = (source.dof(), &source.equations.graph);
    let real = if source.float32 { "f32" } else { "f64" };
    let syntax = RustSyntax { float32: source.float32 };
    let needed = needed_functions(graph);
    let typed =
        |arguments: &[&str]| arguments.iter().map(|name| format!("{name}: {real}")).collect::<Vec<_>>().join(", ");
    let mut text = source.comment("//");
    let _ = write!(
        text,
        "\n// No std, no dependency, no allocation, Rust 1.85 or later: `core` has no sine, so the caller names where it comes from, once:\n//\n\
         //     struct Std;\n//     impl Math for Std {{\n"
    );
    for (name, arguments) in &needed {
        let (typed, values) = (typed(arguments), arguments.join(", "));
        let _ = writeln!(text, "//         fn {name}({typed}) -> {real} {{ {real}::{name}({values}) }}");
    }
    let in_libm = if source.float32 { "libm::sinf(x)" } else { "libm::sin(x)" };
    let _ = write!(
        text,
        "//     }}\n//     let tau = inverse_dynamics::<Std>(&q, &dq, &ddq);\n//\n\
         // or with `{in_libm}` and so on in place of `{real}::sin(x)`.\n\n\
         /// Number of joints.\n#[allow(dead_code)]\npub const DOF: usize = {dof};\n\n\
         /// The elementary functions that this robot needs.\npub trait Math {{\n"
    );
    for (name, arguments) in &needed {
        let _ = writeln!(text, "    #[allow(missing_docs)]\n    fn {name}({}) -> {real};", typed(arguments));
    }
    text.push_str("}\n");
    if graph.has(|node| matches!(node, Node::Step(..))) {
        let _ = write!(
            text,
            "\n/// Sign of x, zero while |x| is at most band.\nfn sign(x: {real}, band: {real}) -> {real} {{\n    \
             if x.abs() <= band {{ 0.0 }} else {{ x.signum() }}\n}}\n"
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &syntax);
        let _ = writeln!(
            text,
            "\n/// {}\n#[allow(dead_code, clippy::all, clippy::pedantic)]\n#[rustfmt::skip]\npub fn {}<M: Math>({}) -> [{real}; {}] {{",
            function.about,
            function.name,
            arguments(function, real, dof),
            function.values.len()
        );
        write_lines(&mut text, function, &statements);
        let _ = write!(text, "    [\n        {},\n    ]\n}}\n", statements.outputs.join(",\n        "));
    }
    if let Some(step) = &source.equations.step {
        write_step(&mut text, source, step, &syntax, real);
    }
    text
}

fn arguments(function: &Equation, real: &str, dof: usize) -> String {
    let arguments = function.inputs.iter().map(|input| format!("{}: &[{real}; {dof}]", input.name()));
    arguments.collect::<Vec<_>>().join(", ")
}

fn write_lines(text: &mut String, function: &Equation, statements: &Statements) {
    for input in unused(function, statements) {
        let _ = writeln!(text, "    let _ = {input};");
    }
    for (variable, expression) in &statements.lines {
        let _ = writeln!(text, "    let {variable} = {expression};");
    }
}

fn write_step(text: &mut String, source: &Source<'_>, step: &StepEquation, syntax: &RustSyntax, real: &str) {
    let (dof, elements, function) = (source.dof(), step.elements, &step.equation);
    let statements = source.statements(function, syntax);
    let _ = write!(
        text,
        "\n/// State of [`step`]: the last positions and the deflections of the elements with memory.\n\
         #[allow(dead_code)]\n#[derive(Clone, Copy, Debug, PartialEq)]\npub struct State {{\n    \
         last: [{real}; {dof}],\n    z: [{real}; {elements}],\n    started: bool,\n}}\n\n\
         #[allow(dead_code, clippy::all, clippy::pedantic)]\nimpl State {{\n    \
         /// Before a motion: the elements are undeflected at its first position.\n    \
         pub const fn new() -> Self {{\n        \
         Self {{ last: [0.0; {dof}], z: [0.0; {elements}], started: false }}\n    }}\n\n    \
         /// Starts a motion.\n    pub fn reset(&mut self) {{\n        *self = Self::new();\n    }}\n}}\n\n\
         /// {}\n#[allow(dead_code, clippy::all, clippy::pedantic)]\n#[rustfmt::skip]\n\
         pub fn step<M: Math>(state: &mut State, {}) -> [{real}; {dof}] {{\n    \
         if !state.started {{\n        state.last = *q;\n        state.started = true;\n    }}\n    \
         let (last, z) = (state.last, state.z);\n",
        function.about,
        arguments(function, real, dof)
    );
    write_lines(text, function, &statements);
    let (tau, deflections) = statements.outputs.split_at(dof);
    let (tau, deflections) = (tau.join(",\n        "), deflections.join(",\n        "));
    let _ = write!(
        text,
        "    state.z = [\n        {deflections},\n    ];\n    state.last = *q;\n    [\n        {tau},\n    ]\n}}\n"
    );
}
