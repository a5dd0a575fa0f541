//! C++17 in one header: the functions in a namespace, over `std::array`.

use super::c::CSyntax;
use super::{Source, unused};
use crate::graph::Node;
use core::fmt::Write;

/// One header with functions in `namespace NAME_dynamics`.
pub(crate) fn cpp_header(source: &Source<'_>) -> String {
    let (name, dof) = (source.robot.identifier(), source.dof());
    let syntax = CSyntax { functions: "std::", step: "step".to_owned() };
    let mut text = source.comment("//");
    let _ = write!(
        text,
        "\n// C++17; thread-safe; no allocation, no state.\n#pragma once\n\n#include <array>\n#include <cmath>\n#include <cstddef>\n\n\
         namespace {name}_dynamics {{\n\ninline constexpr std::size_t dof = {dof};\nusing Vector = std::array<double, {dof}>;\n\
         using Matrix = std::array<double, {}>;\n",
        dof * dof
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        text.push_str(
            "\n// Sign of x, zero while |x| is at most band.\ninline double step(double x, double band) {\n    \
             return std::fabs(x) <= band ? 0.0 : std::copysign(1.0, x);\n}\n",
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &syntax);
        let inputs = function.inputs.iter().map(|input| format!("const Vector& {}", input.name()));
        let arguments = inputs.collect::<Vec<_>>().join(", ");
        let kind = if function.is_matrix { "Matrix" } else { "Vector" };
        let _ = writeln!(text, "\n// {}\ninline {kind} {}({arguments}) {{", function.about, function.name);
        for input in unused(function, &statements) {
            let _ = writeln!(text, "    (void){input};");
        }
        for (variable, expression) in &statements.lines {
            let _ = writeln!(text, "    const double {variable} = {expression};");
        }
        let outputs = statements.outputs.join(",\n        ");
        let _ = write!(text, "    return {{{{\n        {outputs},\n    }}}};\n}}\n");
    }
    let _ = writeln!(text, "\n}}  // namespace {name}_dynamics");
    text
}
