//! User expressions of the joints' positions and velocities: `25 * sin(q - 0.3)`.
//!
//! [`parse`] converts a text into a list of operations. This module evaluates them, computes slopes by one reverse
//! sweep, and writes the canonical text with joint numbers. A value that does not exist (square root of a negative
//! number, division by zero) is `None`, never NaN.

mod operations;
mod parse;
mod text;

pub use operations::{ExpressionFunction, ExpressionFunction2, ExpressionNode};
pub use parse::{ExpressionError, ExpressionProblem, JointNames};

use operations::{slopes, value};
use serde::{Deserialize, Serialize};

const MAX_OPERATIONS: usize = 256;
/// Largest valid magnitude, so that squares and sums stay within the range of numbers.
pub(super) const MAX_VALUE: f64 = 1e12;

/// An expression of the joints' positions and velocities, SI units.
///
/// Serialised as text, with joint numbers from 1.
///
/// ```
/// use dynident_model::terms::{Expression, JointNames};
/// let names = ["shoulder".to_owned(), "elbow".to_owned()];
/// // `q` is the position of the joint that the torque acts on, here the second.
/// let expression = Expression::parse("q * cos(q(shoulder))^2", &JointNames { own: Some(1), names: &names })?;
/// assert_eq!(expression.to_string(), "q2 * cos(q1)^2.0");
/// assert_eq!(expression.value(|joint| [0.0, 3.0][joint], |_| 0.0), Some(3.0));
/// # Ok::<(), dynident_model::terms::ExpressionError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(with = "String"))]
#[serde(try_from = "String", into = "String")]
pub struct Expression {
    /// Operations; each comes after its operands, and the last one gives the value.
    nodes: Vec<ExpressionNode>,
}

impl Expression {
    /// Reads an expression.
    ///
    /// Syntax: `+ - * / ^`, parentheses, numbers, `pi`; `sin cos tan asin acos atan sinh cosh tanh exp ln sqrt abs`
    /// of one argument, `atan2 min max` of two. `q` and `dq` are position and velocity of the joint itself, `q3` the
    /// position of the third joint, `q(elbow)` or `q("elbow joint")` the position of a joint by its name. An exponent
    /// must be a number.
    ///
    /// # Errors
    /// Syntax error with its character and the expected element; more than 10 000 characters or 256 operations.
    pub fn parse(text: &str, joints: &JointNames<'_>) -> Result<Self, ExpressionError> {
        parse::parse(text, joints).map(|nodes| Self { nodes })
    }

    /// Operations; each comes after its operands, and the last one gives the value.
    pub fn nodes(&self) -> &[ExpressionNode] {
        &self.nodes
    }

    /// Joints whose position or velocity occurs, ascending.
    pub fn joints(&self) -> Vec<usize> {
        let of_node = |node: &ExpressionNode| match *node {
            ExpressionNode::Position(joint) | ExpressionNode::Velocity(joint) => Some(joint),
            _ => None,
        };
        let mut joints: Vec<usize> = self.nodes.iter().filter_map(of_node).collect();
        joints.sort_unstable();
        joints.dedup();
        joints
    }

    /// Value at positions `q(j)` and velocities `dq(j)` of the joints `j` (rad, rad/s; m, m/s). `None` if an operation
    /// has no finite value, or a magnitude beyond 1e12. Does not allocate.
    pub fn value(&self, q: impl Fn(usize) -> f64, dq: impl Fn(usize) -> f64) -> Option<f64> {
        let mut values = [0.0; MAX_OPERATIONS];
        self.values(q, dq, &mut values)
    }

    fn values(
        &self,
        q: impl Fn(usize) -> f64,
        dq: impl Fn(usize) -> f64,
        values: &mut [f64; MAX_OPERATIONS],
    ) -> Option<f64> {
        for (place, node) in self.nodes.iter().enumerate() {
            let of_node = match *node {
                ExpressionNode::Position(joint) => q(joint),
                ExpressionNode::Velocity(joint) => dq(joint),
                operation => value(operation, values),
            };
            // NaN compares false, so it is checked first.
            if of_node.is_nan() || of_node.abs() > MAX_VALUE {
                return None;
            }
            values[place] = of_node;
        }
        self.nodes.len().checked_sub(1).map(|last| values[last])
    }

    /// Calls `take(joint, is_velocity, slope)` with `∂value/∂q_j` or `∂value/∂q̇_j` for every occurrence of a joint, by
    /// a reverse sweep. Does nothing where the expression has no value, and skips slopes that are not finite (square
    /// root at zero).
    pub fn slopes(&self, q: impl Fn(usize) -> f64, dq: impl Fn(usize) -> f64, mut take: impl FnMut(usize, bool, f64)) {
        let mut values = [0.0; MAX_OPERATIONS];
        if self.values(q, dq, &mut values).is_none() {
            return;
        }
        let mut pulls = [0.0_f64; MAX_OPERATIONS];
        pulls[self.nodes.len() - 1] = 1.0;
        for (place, node) in self.nodes.iter().enumerate().rev() {
            let pull = pulls[place];
            if !pull.is_finite() || pull == 0.0 {
                continue;
            }
            match *node {
                ExpressionNode::Position(joint) => take(joint, false, pull),
                ExpressionNode::Velocity(joint) => take(joint, true, pull),
                operation => slopes(operation, &values, |part, slope| pulls[part] += pull * slope),
            }
        }
    }
}

impl TryFrom<String> for Expression {
    type Error = ExpressionError;

    fn try_from(text: String) -> Result<Self, ExpressionError> {
        Self::parse(&text, &JointNames { own: None, names: &[] })
    }
}

impl From<Expression> for String {
    fn from(expression: Expression) -> Self {
        expression.to_string()
    }
}
