//! Operations of expressions: values and slopes.

/// One operation; operands are indices into the list of operations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExpressionNode {
    /// A number.
    Number(f64),
    /// Position of a joint, rad or m.
    Position(usize),
    /// Velocity of a joint, rad/s or m/s.
    Velocity(usize),
    /// `a + b`.
    Add(usize, usize),
    /// `a - b`.
    Subtract(usize, usize),
    /// `a b`.
    Multiply(usize, usize),
    /// `a / b`.
    Divide(usize, usize),
    /// `-a`.
    Negate(usize),
    /// `a^p` with an integer `p` and any `a`.
    WholePower(usize, i32),
    /// `a^p` with a nonnegative `a`.
    Power(usize, f64),
    /// A function of one argument.
    Call(ExpressionFunction, usize),
    /// A function of two arguments.
    Call2(ExpressionFunction2, usize, usize),
}

/// Functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExpressionFunction {
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Inverse sine, from -π/2 to π/2.
    Asin,
    /// Inverse cosine, from 0 to π.
    Acos,
    /// Inverse tangent, from -π/2 to π/2.
    Atan,
    /// Hyperbolic sine.
    Sinh,
    /// Hyperbolic cosine.
    Cosh,
    /// Hyperbolic tangent.
    Tanh,
    /// Exponential.
    Exp,
    /// Natural logarithm.
    Ln,
    /// Square root.
    Sqrt,
    /// Absolute value.
    Abs,
}

/// Functions of two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExpressionFunction2 {
    /// Angle of the point (x, y) = (second, first) from the x axis.
    Atan2,
    /// The smaller value.
    Min,
    /// The larger value.
    Max,
}

impl ExpressionFunction {
    /// All functions of one argument.
    pub const ALL: [Self; 13] = [
        Self::Sin,
        Self::Cos,
        Self::Tan,
        Self::Asin,
        Self::Acos,
        Self::Atan,
        Self::Sinh,
        Self::Cosh,
        Self::Tanh,
        Self::Exp,
        Self::Ln,
        Self::Sqrt,
        Self::Abs,
    ];

    /// Name in expressions.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sin => "sin",
            Self::Cos => "cos",
            Self::Tan => "tan",
            Self::Asin => "asin",
            Self::Acos => "acos",
            Self::Atan => "atan",
            Self::Sinh => "sinh",
            Self::Cosh => "cosh",
            Self::Tanh => "tanh",
            Self::Exp => "exp",
            Self::Ln => "ln",
            Self::Sqrt => "sqrt",
            Self::Abs => "abs",
        }
    }

    fn value(self, x: f64) -> f64 {
        match self {
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Sinh => x.sinh(),
            Self::Cosh => x.cosh(),
            Self::Tanh => x.tanh(),
            Self::Exp => x.exp(),
            Self::Ln => x.ln(),
            Self::Sqrt => x.sqrt(),
            Self::Abs => x.abs(),
        }
    }

    fn slope(self, x: f64) -> f64 {
        match self {
            Self::Sin => x.cos(),
            Self::Cos => -x.sin(),
            Self::Tan => 1.0 + x.tan().powi(2),
            Self::Asin => 1.0 / (1.0 - x * x).sqrt(),
            Self::Acos => -1.0 / (1.0 - x * x).sqrt(),
            Self::Atan => 1.0 / (1.0 + x * x),
            Self::Sinh => x.cosh(),
            Self::Cosh => x.sinh(),
            Self::Tanh => 1.0 - x.tanh().powi(2),
            Self::Exp => x.exp(),
            Self::Ln => 1.0 / x,
            Self::Sqrt => 0.5 / x.sqrt(),
            Self::Abs if x == 0.0 => 0.0,
            Self::Abs => x.signum(),
        }
    }
}

impl ExpressionFunction2 {
    /// All functions of two arguments.
    pub const ALL: [Self; 3] = [Self::Atan2, Self::Min, Self::Max];

    /// Name in expressions.
    pub fn name(self) -> &'static str {
        match self {
            Self::Atan2 => "atan2",
            Self::Min => "min",
            Self::Max => "max",
        }
    }
}

/// Value of an operation, given the `values` of all previous operations. Positions and velocities give zero here.
pub(super) fn value(node: ExpressionNode, values: &[f64]) -> f64 {
    match node {
        ExpressionNode::Number(number) => number,
        ExpressionNode::Position(_) | ExpressionNode::Velocity(_) => 0.0,
        ExpressionNode::Add(a, b) => values[a] + values[b],
        ExpressionNode::Subtract(a, b) => values[a] - values[b],
        ExpressionNode::Multiply(a, b) => values[a] * values[b],
        ExpressionNode::Divide(a, b) => values[a] / values[b],
        ExpressionNode::Negate(a) => -values[a],
        ExpressionNode::WholePower(a, exponent) => values[a].powi(exponent),
        ExpressionNode::Power(a, exponent) => values[a].powf(exponent),
        ExpressionNode::Call(function, a) => function.value(values[a]),
        ExpressionNode::Call2(ExpressionFunction2::Atan2, a, b) => values[a].atan2(values[b]),
        ExpressionNode::Call2(ExpressionFunction2::Min, a, b) => values[a].min(values[b]),
        ExpressionNode::Call2(ExpressionFunction2::Max, a, b) => values[a].max(values[b]),
    }
}

/// Calls `add(operand, slope)` with the partial derivatives of an operation.
pub(super) fn slopes(node: ExpressionNode, values: &[f64], mut add: impl FnMut(usize, f64)) {
    match node {
        ExpressionNode::Number(_)
        | ExpressionNode::Position(_)
        | ExpressionNode::Velocity(_)
        | ExpressionNode::WholePower(_, 0) => {}
        ExpressionNode::Add(a, b) => {
            add(a, 1.0);
            add(b, 1.0);
        }
        ExpressionNode::Subtract(a, b) => {
            add(a, 1.0);
            add(b, -1.0);
        }
        ExpressionNode::Multiply(a, b) => {
            add(a, values[b]);
            add(b, values[a]);
        }
        ExpressionNode::Divide(a, b) => {
            add(a, 1.0 / values[b]);
            add(b, -values[a] / (values[b] * values[b]));
        }
        ExpressionNode::Negate(a) => add(a, -1.0),
        ExpressionNode::WholePower(a, exponent) => add(a, f64::from(exponent) * values[a].powi(exponent - 1)),
        ExpressionNode::Power(a, exponent) => add(a, exponent * values[a].powf(exponent - 1.0)),
        ExpressionNode::Call(function, a) => add(a, function.slope(values[a])),
        ExpressionNode::Call2(ExpressionFunction2::Atan2, a, b) => {
            let square = values[a] * values[a] + values[b] * values[b];
            add(a, values[b] / square);
            add(b, -values[a] / square);
        }
        // If the values are equal, the slope of the first operand is used.
        ExpressionNode::Call2(ExpressionFunction2::Min, a, b) => add(if values[b] < values[a] { b } else { a }, 1.0),
        ExpressionNode::Call2(ExpressionFunction2::Max, a, b) => add(if values[b] > values[a] { b } else { a }, 1.0),
    }
}
