//! C99 in one header: functions of fixed size, no allocation, only math.h.

use super::{Source, unused};
use crate::graph::{Function, Function2, Input, Node};
use crate::statements::Syntax;
use core::fmt::Write;

/// Syntax of C expressions; C++ adds a namespace.
pub(super) struct CSyntax {
    /// `std::` in C++.
    pub(super) functions: &'static str,
    pub(super) step: String,
}

impl Syntax for CSyntax {
    fn input(&self, input: Input, joint: usize) -> String {
        format!("{}[{joint}]", input.name())
    }

    fn call(&self, function: Function, of: &str) -> String {
        let name = if function == Function::Abs { "fabs" } else { function.name() };
        format!("{}{name}({of})", self.functions)
    }

    fn call2(&self, function: Function2, first: &str, second: &str) -> String {
        let name = match function {
            Function2::Atan2 => "atan2",
            Function2::Min => "fmin",
            Function2::Max => "fmax",
        };
        format!("{}{name}({first}, {second})", self.functions)
    }

    fn power(&self, of: &str, exponent: f64) -> String {
        if exponent == 0.5 {
            format!("{}sqrt({of})", self.functions)
        } else {
            format!("{}pow({of}, {exponent:?})", self.functions)
        }
    }

    fn step(&self, of: &str, dead_band: f64) -> String {
        format!("{}({of}, {dead_band:?})", self.step)
    }
}

/// One header with `static inline` functions `NAME_inverse_dynamics` and so on.
pub(crate) fn c_header(source: &Source<'_>) -> String {
    let (name, dof) = (source.robot.identifier(), source.dof());
    let syntax = CSyntax { functions: "", step: format!("{name}_step") };
    let guard = format!("{}_DYNAMICS_H", name.to_uppercase());
    let mut text = format!("/*\n{}", source.comment(" *"));
    let _ = write!(
        text,
        "\n * C99; thread-safe; no allocation, no state. Inputs and outputs must not overlap.\n */\n#ifndef {guard}\n#define {guard}\n\n\
         #include <math.h>\n\n#define {}_DOF {dof}\n",
        name.to_uppercase()
    );
    if source.equations.graph.has(|node| matches!(node, Node::Step(..))) {
        let _ = write!(
            text,
            "\n/* Sign of x, zero while |x| is at most band. */\nstatic inline double {name}_step(double x, double band) {{\n    \
             return fabs(x) <= band ? 0.0 : copysign(1.0, x);\n}}\n"
        );
    }
    for function in &source.equations.functions {
        let statements = source.statements(function, &syntax);
        let inputs = function.inputs.iter().map(|input| format!("const double {}[{dof}]", input.name()));
        let output = format!("double {}[{}]", function.output, function.values.len());
        let arguments = inputs.chain([output]).collect::<Vec<_>>().join(", ");
        let _ =
            writeln!(text, "\n/* {} */\nstatic inline void {name}_{}({arguments}) {{", function.about, function.name);
        for input in unused(function, &statements) {
            let _ = writeln!(text, "    (void){input};");
        }
        for (variable, expression) in &statements.lines {
            let _ = writeln!(text, "    const double {variable} = {expression};");
        }
        for (place, expression) in statements.outputs.iter().enumerate() {
            let _ = writeln!(text, "    {}[{place}] = {expression};", function.output);
        }
        text.push_str("}\n");
    }
    let _ = writeln!(text, "\n#endif");
    text
}
