//! Declared (user-defined) torques as symbols: an expression operation by operation, a table piece by piece.

use crate::error::ExportError;
use crate::graph::{Function, Function2};
use crate::symbol::Symbol;
use dynident_lanes::{Real, Scalar};
use dynident_model::terms::{
    Declared, DeclaredLaw, Expression, ExpressionFunction, ExpressionFunction2, ExpressionNode, TorqueTable,
};

/// Torque of a declared term per unit of its value.
///
/// # Errors
/// [`ExportError::Term`] for the caller's code.
pub(crate) fn declared_unit(term: &Declared, q: &[Symbol], dq: &[Symbol]) -> Result<Symbol, ExportError> {
    match &term.law {
        DeclaredLaw::Expression(expression) => Ok(of_expression(expression, q, dq)),
        DeclaredLaw::Table(table) => Ok(of_table(table, q[term.joint])),
        DeclaredLaw::Function(_) => {
            let needs = "the code of a function in the calling program";
            Err(ExportError::Term { symbol: term.name.clone(), kind: "declared", needs })
        }
    }
}

fn of_expression(expression: &Expression, q: &[Symbol], dq: &[Symbol]) -> Symbol {
    let mut values: Vec<Symbol> = Vec::new();
    for node in expression.nodes() {
        let symbol = match *node {
            ExpressionNode::Number(number) => Symbol::splat(number),
            ExpressionNode::Position(joint) => q[joint],
            ExpressionNode::Velocity(joint) => dq[joint],
            ExpressionNode::Add(a, b) => values[a] + values[b],
            ExpressionNode::Subtract(a, b) => values[a] - values[b],
            ExpressionNode::Multiply(a, b) => values[a] * values[b],
            ExpressionNode::Divide(a, b) => values[a] * values[b].recip(),
            ExpressionNode::Negate(a) => -values[a],
            ExpressionNode::WholePower(a, exponent) => whole_power(values[a], exponent),
            ExpressionNode::Power(a, exponent) => values[a].power(exponent),
            ExpressionNode::Call(function, a) => call(function, values[a]),
            ExpressionNode::Call2(function, a, b) => values[a].call2(
                match function {
                    ExpressionFunction2::Atan2 => Function2::Atan2,
                    ExpressionFunction2::Min => Function2::Min,
                    ExpressionFunction2::Max => Function2::Max,
                },
                values[b],
            ),
        };
        values.push(symbol);
    }
    values.last().copied().unwrap_or(Symbol::ZERO)
}

fn call(function: ExpressionFunction, x: Symbol) -> Symbol {
    let function = match function {
        ExpressionFunction::Sqrt => return x.power(0.5),
        ExpressionFunction::Sin => Function::Sin,
        ExpressionFunction::Cos => Function::Cos,
        ExpressionFunction::Tan => Function::Tan,
        ExpressionFunction::Asin => Function::Asin,
        ExpressionFunction::Acos => Function::Acos,
        ExpressionFunction::Atan => Function::Atan,
        ExpressionFunction::Sinh => Function::Sinh,
        ExpressionFunction::Cosh => Function::Cosh,
        ExpressionFunction::Tanh => Function::Tanh,
        ExpressionFunction::Exp => Function::Exp,
        ExpressionFunction::Ln => Function::Ln,
        ExpressionFunction::Abs => Function::Abs,
    };
    x.call(function)
}

fn whole_power(x: Symbol, exponent: i32) -> Symbol {
    let (mut left, mut square, mut power) = (exponent.unsigned_abs(), x, Symbol::ONE);
    while left > 0 {
        if left & 1 == 1 {
            power = power * square;
        }
        square = square * square;
        left /= 2;
    }
    if exponent < 0 { power.recip() } else { power }
}

/// Sums the increments of all pieces up to the position, so that no language needs a branch. Beyond the ends the torque
/// is constant.
fn of_table(table: &TorqueTable, q: Symbol) -> Symbol {
    let mut torque = Symbol::splat(table.points()[0][1]);
    for piece in table.pieces() {
        let ahead = (q - Symbol::splat(piece.from)).call2(Function2::Max, Symbol::ZERO);
        let t = ahead.call2(Function2::Min, Symbol::splat(piece.width));
        let [b, c, d] = piece.factors.map(Symbol::splat);
        torque += t * (b + t * (c + t * d));
    }
    torque
}
