//! C99 in one header: functions of fixed size, no allocation, only math.h.

use super::{Source, number, unused};
use crate::equation::{Equation, StepEquation};
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::{Statements, Syntax};
use core::fmt::Write;

/// Syntax of C expressions; C++ adds a namespace.
pub(super) struct CSyntax {
    /// Namespace prefix of functions: `std::` in C++, empty in C.
    pub(super) functions: &'static str,
    /// Name of the sign function.
    pub(super) sign: String,
    pub(super) float32: bool,
}

impl CSyntax {
    /// Suffix of the functions of math.h; those of C++ are overloaded.
    fn suffix(&self) -> &'static str {
        if self.float32 && self.functions.is_empty() { "f" } else { "" }
    }

    fn called(&self, name: &str, arguments: &str) -> String {
        format!("{}{name}{}({arguments})", self.functions, self.suffix())
    }
}

impl Syntax for CSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}[{joint}]", input.name())
    }

    fn call(&self, function: Function, of: &str) -> String {
        self.called(if function == Function::Abs { "fabs" } else { function.name() }, of)
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        let name = match function {
            Function2::Atan2 => "atan2",
            Function2::Min => "fmin",
            Function2::Max => "fmax",
        };
        self.called(name, &format!("{first}, {second}"))
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        if exponent == 0.5 {
            self.called("sqrt", of)
        } else {
            self.called("pow", &format!("{of}, {}", self.number(exponent)))
        }
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("{}({of}, {})", self.sign, self.number(dead_band))
    }

    fn number(&self, value: f64) -> String {
        number(value, self.float32) + if self.float32 { "f" } else { "" }
    }
}

/// One header with `static inline` functions `NAME_inverse_dynamics` and so on.
pub(crate) fn c_header(source: &Source<'_>) -> String {
    let (name, dof) = (source.robot.identifier(), source.dof());
    let real = if source.float32 { "float" } else { "double" };
    let syntax = CSyntax { functions: "", sign: format!("{name}_sign"), float32: source.float32 };
    let guard = format!("{}_DYNAMICS_H", name.to_uppercase());
    let mut text = format!("/*\n{}", source.comment(" *"));
    let state = if source.equations.step.is_some() { "no state but that of the step function" } else { "no state" };
    let _ = write!(
        text,
        "\n * C99; thread-safe; no allocation, {state}. Inputs and outputs must not overlap.\n */\n#ifndef {guard}\n#define {guard}\n\n\
         #include <math.h>\n\n#define {}_DOF {dof}\n",
        name.to_uppercase()
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        let zero = syntax.number(0.0);
        let (size, sign) =
            (syntax.called("fabs", "x"), syntax.called("copysign", &format!("{}, x", syntax.number(1.0))));
        let _ = write!(
            text,
            "\n/* Sign of x, zero while |x| is at most band. */\nstatic inline {real} {name}_sign({real} x, {real} band) {{\n    \
             return {size} <= band ? {zero} : {sign};\n}}\n"
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &syntax);
        let output = format!("{real} {}[{}]", function.output, function.values.len());
        let arguments = arguments(function, real, dof).chain([output]).collect::<Vec<_>>().join(", ");
        let _ =
            writeln!(text, "\n/* {} */\nstatic inline void {name}_{}({arguments}) {{", function.about, function.name);
        write_lines(&mut text, function, &statements, real);
        for (place, expression) in statements.outputs.iter().enumerate() {
            let _ = writeln!(text, "    {}[{place}] = {expression};", function.output);
        }
        text.push_str("}\n");
    }
    if let Some(step) = &source.equations.step {
        write_step(&mut text, source, step, &syntax, real);
    }
    let _ = writeln!(text, "\n#endif");
    text
}

fn arguments<'a>(function: &'a Equation, real: &'a str, dof: usize) -> impl Iterator<Item = String> + 'a {
    function.inputs.iter().map(move |input| format!("const {real} {}[{dof}]", input.name()))
}

/// Unused inputs and the values that outputs need, in C and C++.
pub(super) fn write_lines(text: &mut String, function: &Equation, statements: &Statements, real: &str) {
    for input in unused(function, statements) {
        let _ = writeln!(text, "    (void){input};");
    }
    for (variable, expression) in &statements.lines {
        let _ = writeln!(text, "    const {real} {variable} = {expression};");
    }
}

fn write_step(text: &mut String, source: &Source<'_>, step: &StepEquation, syntax: &CSyntax, real: &str) {
    let (name, dof, elements) = (source.robot.identifier(), source.dof(), step.elements);
    let (function, zero) = (&step.equation, syntax.number(0.0));
    let statements = source.statements(function, syntax);
    let arguments = arguments(function, real, dof).collect::<Vec<_>>().join(", ");
    let _ = write!(
        text,
        "\n/* State of {name}_step: the last positions and the deflections of the elements with memory. */\n\
         typedef struct {{\n    {real} last[{dof}];\n    {real} z[{elements}];\n    int started;\n}} {name}_state;\n\n\
         /* Starts a motion: the elements are undeflected at its first position. */\n\
         static inline void {name}_reset({name}_state *state) {{\n    \
         for (int k = 0; k < {dof}; k++) state->last[k] = {zero};\n    \
         for (int k = 0; k < {elements}; k++) state->z[k] = {zero};\n    state->started = 0;\n}}\n\n\
         /* {} */\nstatic inline void {name}_step({name}_state *state, {arguments}, {real} tau[{dof}]) {{\n    \
         {real} *last = state->last, *z = state->z;\n    if (!state->started) {{\n        \
         for (int k = 0; k < {dof}; k++) last[k] = q[k];\n        state->started = 1;\n    }}\n",
        function.about
    );
    write_lines(text, function, &statements, real);
    let (tau, deflections) = statements.outputs.split_at(dof);
    for (place, expression) in tau.iter().enumerate() {
        let _ = writeln!(text, "    tau[{place}] = {expression};");
    }
    // The deflection of an element does not depend on other elements.
    for (place, expression) in deflections.iter().enumerate() {
        let _ = writeln!(text, "    z[{place}] = {expression};");
    }
    let _ = write!(text, "    for (int k = 0; k < {dof}; k++) last[k] = q[k];\n}}\n");
}
