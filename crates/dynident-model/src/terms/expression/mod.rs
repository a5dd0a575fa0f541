//! Expressions of the joints' positions and velocities that a user writes: `25 * sin(q - 0.3)`.
//!
//! [`parse`] makes a list of operations from a text; here is what it means: values, slopes by one reverse sweep, and
//! the text in which every joint stands by its number. A value that does not exist (the root of a negative number, a
//! division by zero) is none, never NaN.

mod operations;
mod parse;
mod text;

pub use operations::{ExpressionFunction, ExpressionFunction2, ExpressionNode};
pub use parse::{ExpressionError, ExpressionProblem, JointNames};

use operations::{slopes, value};
use serde::{Deserialize, Serialize};

/// The most operations of an expression.
const MOST_NODES: usize = 256;
/// Values beyond this size are none: squares and sums of them would leave the range of numbers.
pub(super) const LARGEST: f64 = 1e12;

/// An expression of the joints' positions and velocities, SI units.
///
/// Serialised as its text, with joints by their numbers from 1.
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
    /// Every one after its parts; the last is the value.
    nodes: Vec<ExpressionNode>,
}

impl Expression {
    /// Reads an expression.
    ///
    /// `+ - * / ^`, parentheses, numbers, `pi`; `sin cos tan asin acos atan sinh cosh tanh exp ln sqrt abs` of one
    /// value, `atan2 min max` of two. `q` and `dq` are position and velocity of the joint itself, `q3` those of the
    /// third joint, `q(elbow)` or `q("elbow joint")` those of a joint by its name. An exponent is a number.
    ///
    /// # Errors
    /// With the character and what belongs there. At most 10 000 characters and 256 operations.
    pub fn parse(text: &str, joints: &JointNames<'_>) -> Result<Self, ExpressionError> {
        parse::parse(text, joints).map(|nodes| Self { nodes })
    }

    /// Its operations, every one after its parts; the last is the value.
    pub fn nodes(&self) -> &[ExpressionNode] {
        &self.nodes
    }

    /// The joints whose positions or velocities it follows, ascending.
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

    /// Its value where joint `j` stands at `q(j)` and moves at `dq(j)` (rad, rad/s; m, m/s). `None` where one of its
    /// operations has no finite value, or one beyond 1e12 in size. Allocates nothing.
    pub fn value(&self, q: impl Fn(usize) -> f64, dq: impl Fn(usize) -> f64) -> Option<f64> {
        let mut values = [0.0; MOST_NODES];
        self.values(q, dq, &mut values)
    }

    fn values(
        &self,
        q: impl Fn(usize) -> f64,
        dq: impl Fn(usize) -> f64,
        values: &mut [f64; MOST_NODES],
    ) -> Option<f64> {
        for (place, node) in self.nodes.iter().enumerate() {
            let of_node = match *node {
                ExpressionNode::Position(joint) => q(joint),
                ExpressionNode::Velocity(joint) => dq(joint),
                operation => value(operation, values),
            };
            // Not a number is no smaller than anything.
            if of_node.is_nan() || of_node.abs() > LARGEST {
                return None;
            }
            values[place] = of_node;
        }
        self.nodes.len().checked_sub(1).map(|last| values[last])
    }

    /// Hands `∂value/∂q_j` and `∂value/∂q̇_j` of every place where a joint stands to `take(joint, is_velocity, slope)`,
    /// by a reverse sweep; nothing where it has no value, and no slope that is not finite (that of a root at zero).
    pub fn slopes(&self, q: impl Fn(usize) -> f64, dq: impl Fn(usize) -> f64, mut take: impl FnMut(usize, bool, f64)) {
        let mut values = [0.0; MOST_NODES];
        if self.values(q, dq, &mut values).is_none() {
            return;
        }
        let mut pulls = [0.0_f64; MOST_NODES];
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
