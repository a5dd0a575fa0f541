//! C++17 in one header: the functions in a namespace, over `std::array`.

use super::Source;
use super::c::{CSyntax, write_lines};
use crate::equation::{Equation, StepEquation};
use crate::graph::Node;
use crate::statements::Syntax;
use core::fmt::Write;

/// One header with functions in `namespace NAME_dynamics`.
pub(crate) fn cpp_header(source: &Source<'_>) -> String {
    let (name, dof) = (source.robot.identifier(), source.dof());
    let real = if source.float32 { "float" } else { "double" };
    let syntax = CSyntax { functions: "std::", sign: "sign".to_owned(), float32: source.float32 };
    let mut text = source.comment("//");
    let state = if source.equations.step.is_some() { "no state but that of the step function" } else { "no state" };
    let _ = write!(
        text,
        "\n// C++17; thread-safe; no allocation, {state}.\n#pragma once\n\n#include <array>\n#include <cmath>\n#include <cstddef>\n\n\
         namespace {name}_dynamics {{\n\ninline constexpr std::size_t dof = {dof};\nusing Vector = std::array<{real}, {dof}>;\n\
         using Matrix = std::array<{real}, {}>;\n",
        dof * dof
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        let (zero, one) = (syntax.number(0.0), syntax.number(1.0));
        let _ = write!(
            text,
            "\n// Sign of x, zero while |x| is at most band.\ninline {real} sign({real} x, {real} band) {{\n    \
             return std::fabs(x) <= band ? {zero} : std::copysign({one}, x);\n}}\n"
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &syntax);
        let count = function.values.len();
        let kind = match function.columns {
            Some(columns) if columns == dof && count == dof * dof => "Matrix".to_owned(),
            None if count == dof => "Vector".to_owned(),
            _ => format!("std::array<{real}, {count}>"),
        };
        let _ = writeln!(text, "\n// {}\ninline {kind} {}({}) {{", function.about, function.name, arguments(function));
        write_lines(&mut text, function, &statements, real);
        let outputs = statements.outputs.join(",\n        ");
        let _ = write!(text, "    return {{{{\n        {outputs},\n    }}}};\n}}\n");
    }
    if let Some(step) = &source.equations.step {
        write_step(&mut text, source, step, &syntax, real);
    }
    let _ = writeln!(text, "\n}}  // namespace {name}_dynamics");
    text
}

fn arguments(function: &Equation) -> String {
    function.inputs.iter().map(|input| format!("const Vector& {}", input.name())).collect::<Vec<_>>().join(", ")
}

fn write_step(text: &mut String, source: &Source<'_>, step: &StepEquation, syntax: &CSyntax, real: &str) {
    let (dof, elements, function) = (source.dof(), step.elements, &step.equation);
    let statements = source.statements(function, syntax);
    let _ = write!(
        text,
        "\n// State of step: the last positions and the deflections of the elements with memory.\nstruct State {{\n    \
         Vector last{{}};\n    std::array<{real}, {elements}> z{{}};\n    bool started = false;\n}};\n\n\
         // Starts a motion: the elements are undeflected at its first position.\n\
         inline void reset(State& state) {{\n    state = State{{}};\n}}\n\n\
         // {}\ninline Vector step(State& state, {}) {{\n    if (!state.started) {{\n        state.last = q;\n        \
         state.started = true;\n    }}\n    const Vector last = state.last;\n    \
         const std::array<{real}, {elements}> z = state.z;\n",
        function.about,
        arguments(function)
    );
    write_lines(text, function, &statements, real);
    let (tau, deflections) = statements.outputs.split_at(dof);
    let (tau, deflections) = (tau.join(",\n        "), deflections.join(",\n        "));
    let _ = write!(
        text,
        "    state.z = {{{{\n        {deflections},\n    }}}};\n    state.last = q;\n    \
         return {{{{\n        {tau},\n    }}}};\n}}\n"
    );
}
