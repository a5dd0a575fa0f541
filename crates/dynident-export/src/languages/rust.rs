//! Rust without `std` and without dependencies. `core` has no sine, so the caller provides elementary functions.

use super::{Source, unused};
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::Syntax;
use core::fmt::Write;

struct RustSyntax;

impl Syntax for RustSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}[{joint}]", input.name())
    }

    fn call(&self, function: Function, of: &str) -> String {
        match function {
            // The only function in `core`.
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
        format!("M::powf({of}, {exponent:?})")
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("step({of}, {dead_band:?})")
    }
}

/// A module of functions over a trait `Math` with the required elementary functions.
pub(crate) fn rust_module(source: &Source<'_>) -> String {
    let dof = source.dof();
    let graph = &source.equations.graph;
    let of_one =
        |name, function| (name, "x: f64", "x", graph.has(|node| matches!(node, Node::Call(f, _) if f == function)));
    let needed = [
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
        ("atan2", "y: f64, x: f64", "y, x", graph.has(|node| matches!(node, Node::Call2(Function2::Atan2, ..)))),
        ("powf", "x: f64, exponent: f64", "x, exponent", graph.has(|node| matches!(node, Node::Power(..)))),
    ];
    let mut text = source.comment("//");
    let _ = write!(
        text,
        "\n// No std, no dependency, no allocation, Rust 1.85 or later: `core` has no sine, so the caller names where it comes from, once:\n//\n\
         //     struct Std;\n//     impl Math for Std {{\n"
    );
    for (name, arguments, values, _) in needed.iter().filter(|(.., used)| *used) {
        let _ = writeln!(text, "//         fn {name}({arguments}) -> f64 {{ f64::{name}({values}) }}");
    }
    let _ = write!(
        text,
        "//     }}\n//     let tau = inverse_dynamics::<Std>(&q, &dq, &ddq);\n//\n\
         // or with `libm::sin(x)` and so on in place of `f64::sin(x)`.\n\n\
         /// Number of joints.\n#[allow(dead_code)]\npub const DOF: usize = {dof};\n\n\
         /// The elementary functions that this robot needs.\npub trait Math {{\n"
    );
    for (name, arguments, ..) in needed.iter().filter(|(.., used)| *used) {
        let _ = writeln!(text, "    #[allow(missing_docs)]\n    fn {name}({arguments}) -> f64;");
    }
    text.push_str("}\n");
    if graph.has(|node| matches!(node, Node::Step(..))) {
        text.push_str(
            "\n/// Sign of x, zero while |x| is at most band.\nfn step(x: f64, band: f64) -> f64 {\n    \
             if x.abs() <= band { 0.0 } else { x.signum() }\n}\n",
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &RustSyntax);
        let arguments: Vec<String> =
            function.inputs.iter().map(|input| format!("{}: &[f64; {dof}]", input.name())).collect();
        let _ = writeln!(
            text,
            "\n/// {}\n#[allow(dead_code, clippy::all, clippy::pedantic)]\n#[rustfmt::skip]\npub fn {}<M: Math>({}) -> [f64; {}] {{",
            function.about,
            function.name,
            arguments.join(", "),
            function.values.len()
        );
        for input in unused(function, &statements) {
            let _ = writeln!(text, "    let _ = {input};");
        }
        for (variable, expression) in &statements.lines {
            let _ = writeln!(text, "    let {variable} = {expression};");
        }
        let _ = write!(text, "    [\n        {},\n    ]\n}}\n", statements.outputs.join(",\n        "));
    }
    text
}
