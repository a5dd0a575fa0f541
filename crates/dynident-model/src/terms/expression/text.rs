//! Canonical text of an expression with joint numbers; it parses to the same operations.

use super::{Expression, ExpressionNode};
use core::fmt;

/// Operator precedence of a text.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Strength {
    Sum,
    Product,
    Sign,
    Power,
    Atom,
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut texts: Vec<(String, Strength)> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let text = written(*node, &mut texts);
            texts.push(text);
        }
        f.write_str(texts.last().map_or("", |(text, _)| text))
    }
}

/// Text of an operation. Every operand is used once, so its text is moved.
fn written(node: ExpressionNode, texts: &mut [(String, Strength)]) -> (String, Strength) {
    let mut part = |place: usize, least: Strength| {
        let (text, strength) = core::mem::replace(&mut texts[place], (String::new(), Strength::Atom));
        if strength >= least { text } else { format!("({text})") }
    };
    match node {
        // A signed number is not an atom: `-2^x` differs from `(-2)^x`.
        ExpressionNode::Number(x) => {
            (format!("{x:?}"), if x.is_sign_negative() { Strength::Sign } else { Strength::Atom })
        }
        ExpressionNode::Position(joint) => (format!("q{}", joint + 1), Strength::Atom),
        ExpressionNode::Velocity(joint) => (format!("dq{}", joint + 1), Strength::Atom),
        ExpressionNode::Add(a, b) => {
            (format!("{} + {}", part(a, Strength::Sum), part(b, Strength::Product)), Strength::Sum)
        }
        ExpressionNode::Subtract(a, b) => {
            (format!("{} - {}", part(a, Strength::Sum), part(b, Strength::Product)), Strength::Sum)
        }
        ExpressionNode::Multiply(a, b) => {
            (format!("{} * {}", part(a, Strength::Product), part(b, Strength::Sign)), Strength::Product)
        }
        ExpressionNode::Divide(a, b) => {
            (format!("{} / {}", part(a, Strength::Product), part(b, Strength::Sign)), Strength::Product)
        }
        ExpressionNode::Negate(a) => (format!("-{}", part(a, Strength::Sign)), Strength::Sign),
        ExpressionNode::WholePower(a, exponent) => {
            (format!("{}^{:?}", part(a, Strength::Atom), f64::from(exponent)), Strength::Power)
        }
        ExpressionNode::Power(a, exponent) => (format!("{}^{exponent:?}", part(a, Strength::Atom)), Strength::Power),
        ExpressionNode::Call(function, a) => {
            (format!("{}({})", function.name(), part(a, Strength::Sum)), Strength::Atom)
        }
        ExpressionNode::Call2(function, a, b) => {
            let arguments = format!("{}, {}", part(a, Strength::Sum), part(b, Strength::Sum));
            (format!("{}({arguments})", function.name()), Strength::Atom)
        }
    }
}
