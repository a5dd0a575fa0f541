//! Canonical text of an expression with joint numbers; it parses to the same operations.

use super::{Expression, ExpressionNode};
use core::fmt;

#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Precedence {
    Sum,
    Product,
    Sign,
    Power,
    Atom,
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut texts: Vec<(String, Precedence)> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let text = written(*node, &mut texts);
            texts.push(text);
        }
        f.write_str(texts.last().map_or("", |(text, _)| text))
    }
}

/// Text of an operation. Every operand is used only once, so its text is moved instead of copied.
fn written(node: ExpressionNode, texts: &mut [(String, Precedence)]) -> (String, Precedence) {
    let mut part = |place: usize, least: Precedence| {
        let (text, strength) = core::mem::replace(&mut texts[place], (String::new(), Precedence::Atom));
        if strength >= least { text } else { format!("({text})") }
    };
    match node {
        // A number with a minus sign needs parentheses as an operand: `-2^x` differs from `(-2)^x`.
        ExpressionNode::Number(x) => {
            (format!("{x:?}"), if x.is_sign_negative() { Precedence::Sign } else { Precedence::Atom })
        }
        ExpressionNode::Position(joint) => (format!("q{}", joint + 1), Precedence::Atom),
        ExpressionNode::Velocity(joint) => (format!("dq{}", joint + 1), Precedence::Atom),
        ExpressionNode::Add(a, b) => {
            (format!("{} + {}", part(a, Precedence::Sum), part(b, Precedence::Product)), Precedence::Sum)
        }
        ExpressionNode::Subtract(a, b) => {
            (format!("{} - {}", part(a, Precedence::Sum), part(b, Precedence::Product)), Precedence::Sum)
        }
        ExpressionNode::Multiply(a, b) => {
            (format!("{} * {}", part(a, Precedence::Product), part(b, Precedence::Sign)), Precedence::Product)
        }
        ExpressionNode::Divide(a, b) => {
            (format!("{} / {}", part(a, Precedence::Product), part(b, Precedence::Sign)), Precedence::Product)
        }
        ExpressionNode::Negate(a) => (format!("-{}", part(a, Precedence::Sign)), Precedence::Sign),
        ExpressionNode::WholePower(a, exponent) => {
            (format!("{}^{:?}", part(a, Precedence::Atom), f64::from(exponent)), Precedence::Power)
        }
        ExpressionNode::Power(a, exponent) => {
            (format!("{}^{exponent:?}", part(a, Precedence::Atom)), Precedence::Power)
        }
        ExpressionNode::Call(function, a) => {
            (format!("{}({})", function.name(), part(a, Precedence::Sum)), Precedence::Atom)
        }
        ExpressionNode::Call2(function, a, b) => {
            let arguments = format!("{}, {}", part(a, Precedence::Sum), part(b, Precedence::Sum));
            (format!("{}({arguments})", function.name()), Precedence::Atom)
        }
    }
}
