//! Expression graph in which every value exists once, constants are folded, and zeros are omitted.
//!
//! Nodes are simplified when they are created. `x + 0`, `x · 0`, `x · 1` and sums of constants are folded. Signs are
//! moved outward so that `a b` and `-a b` share their product. Equal nodes are merged. Adding zero and moving a sign
//! keep every bit of a finite result. Two consecutive constant factors are merged, which saves one rounding.

use std::collections::HashMap;

/// Index of a node in its graph. A node depends only on smaller indices.
pub(crate) type Id = u32;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Input {
    Position,
    Velocity,
    Acceleration,
    Torque,
    /// Position at the previous call of the function with state.
    LastPosition,
    /// Deflection of an element with hysteresis, with the index of the element.
    Deflection,
}

impl Input {
    /// Name in all languages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Position => "q",
            Self::Velocity => "dq",
            Self::Acceleration => "ddq",
            Self::Torque => "tau",
            Self::LastPosition => "last",
            Self::Deflection => "z",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Function {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Ln,
    Abs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Function2 {
    Atan2,
    Min,
    Max,
}

impl Function {
    /// Name in most languages.
    pub(crate) fn name(self) -> &'static str {
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
            Self::Ln => "log",
            Self::Abs => "abs",
        }
    }
}

/// One value. Numbers are stored as bits for comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    Constant(u64),
    Input(Input, u32),
    Add(Id, Id),
    Sub(Id, Id),
    Mul(Id, Id),
    Neg(Id),
    Recip(Id),
    Call(Function, Id),
    Call2(Function2, Id, Id),
    /// `x^p` for positive x.
    Power(Id, u64),
    /// Sign of x; zero if `|x|` is at most the dead band.
    Step(Id, u64),
}

impl Node {
    pub(crate) fn parts(self) -> impl Iterator<Item = Id> {
        let (a, b) = match self {
            Self::Constant(_) | Self::Input(..) => (None, None),
            Self::Add(a, b) | Self::Sub(a, b) | Self::Mul(a, b) | Self::Call2(_, a, b) => (Some(a), Some(b)),
            Self::Neg(a) | Self::Recip(a) | Self::Call(_, a) | Self::Power(a, _) | Self::Step(a, _) => (Some(a), None),
        };
        a.into_iter().chain(b)
    }
}

/// The graph of one robot. Zero and one have the first two indices.
#[derive(Debug)]
pub(crate) struct Graph {
    nodes: Vec<Node>,
    places: HashMap<Node, Id>,
}

impl Graph {
    pub(crate) const ZERO: Id = 0;
    pub(crate) const ONE: Id = 1;

    pub(crate) fn new() -> Self {
        let mut graph = Self { nodes: Vec::new(), places: HashMap::new() };
        graph.constant(0.0);
        graph.constant(1.0);
        graph
    }

    pub(crate) fn has(&self, kind: impl Fn(Node) -> bool) -> bool {
        self.nodes.iter().any(|&node| kind(node))
    }

    pub(crate) fn node(&self, id: Id) -> Node {
        self.nodes[id as usize]
    }

    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    fn place(&mut self, node: Node) -> Id {
        let next = self.nodes.len() as Id;
        let place = *self.places.entry(node).or_insert(next);
        if place == next {
            self.nodes.push(node);
        }
        place
    }

    /// A constant of the graph that is not finite, or larger than `most`.
    pub(crate) fn too_large(&self, most: f64) -> Option<f64> {
        self.nodes.iter().find_map(|node| match node {
            Node::Constant(bits) => Some(f64::from_bits(*bits)).filter(|value| value.is_nan() || value.abs() > most),
            _ => None,
        })
    }

    pub(crate) fn number(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    pub(crate) fn constant(&mut self, value: f64) -> Id {
        // Negative zero becomes zero; no sum changes.
        self.place(Node::Constant((value + 0.0).to_bits()))
    }

    pub(crate) fn input(&mut self, input: Input, joint: usize) -> Id {
        self.place(Node::Input(input, joint as u32))
    }

    pub(crate) fn neg(&mut self, a: Id) -> Id {
        match self.node(a) {
            Node::Constant(bits) => self.constant(-f64::from_bits(bits)),
            Node::Neg(inner) => inner,
            _ => self.place(Node::Neg(a)),
        }
    }

    /// The value without its sign, and whether it was negative.
    fn sign(&mut self, a: Id) -> (Id, bool) {
        match self.node(a) {
            Node::Neg(inner) => (inner, true),
            Node::Constant(bits) if f64::from_bits(bits) < 0.0 => (self.constant(-f64::from_bits(bits)), true),
            _ => (a, false),
        }
    }

    pub(crate) fn add(&mut self, a: Id, b: Id) -> Id {
        if let (Some(a), Some(b)) = (self.number(a), self.number(b)) {
            return self.constant(a + b);
        }
        if a == Self::ZERO {
            return b;
        }
        if b == Self::ZERO {
            return a;
        }
        let ((a, minus_a), (b, minus_b)) = (self.sign(a), self.sign(b));
        let sum = if minus_a == minus_b { self.place(Node::Add(a.min(b), a.max(b))) } else { self.difference(a, b) };
        if minus_a { self.neg(sum) } else { sum }
    }

    pub(crate) fn sub(&mut self, a: Id, b: Id) -> Id {
        let b = self.neg(b);
        self.add(a, b)
    }

    /// `a - b` of values without a sign, always with the smaller index first, so that `b - a` shares the node.
    fn difference(&mut self, a: Id, b: Id) -> Id {
        match a.cmp(&b) {
            core::cmp::Ordering::Less => self.place(Node::Sub(a, b)),
            core::cmp::Ordering::Equal => Self::ZERO,
            core::cmp::Ordering::Greater => {
                let turned = self.place(Node::Sub(b, a));
                self.neg(turned)
            }
        }
    }

    pub(crate) fn mul(&mut self, a: Id, b: Id) -> Id {
        if let (Some(a), Some(b)) = (self.number(a), self.number(b)) {
            return self.constant(a * b);
        }
        if a == Self::ZERO || b == Self::ZERO {
            return Self::ZERO;
        }
        let ((a, minus_a), (b, minus_b)) = (self.sign(a), self.sign(b));
        let product = match (a, b) {
            (Self::ONE, other) | (other, Self::ONE) => other,
            _ => self.product(a, b),
        };
        if minus_a == minus_b { product } else { self.neg(product) }
    }

    /// Product of values without a sign, neither zero nor one.
    fn product(&mut self, a: Id, b: Id) -> Id {
        let (constant, other) = match (self.number(a), self.number(b)) {
            (Some(value), _) => (Some(value), b),
            (_, Some(value)) => (Some(value), a),
            _ => (None, a),
        };
        if let (Some(outer), Node::Mul(x, y)) = (constant, self.node(other)) {
            let inner = [(x, y), (y, x)].into_iter().find_map(|(c, rest)| Some((self.number(c)?, rest)));
            if let Some((inner, rest)) = inner {
                let factor = self.constant(outer * inner);
                return self.mul(factor, rest);
            }
        }
        self.place(Node::Mul(a.min(b), a.max(b)))
    }

    pub(crate) fn recip(&mut self, a: Id) -> Id {
        match self.node(a) {
            Node::Constant(bits) => self.constant(1.0 / f64::from_bits(bits)),
            Node::Power(inner, exponent) => self.power(inner, -f64::from_bits(exponent)),
            _ => self.place(Node::Recip(a)),
        }
    }

    pub(crate) fn call(&mut self, function: Function, a: Id) -> Id {
        match self.number(a) {
            Some(value) => self.constant(match function {
                Function::Sin => value.sin(),
                Function::Cos => value.cos(),
                Function::Tan => value.tan(),
                Function::Asin => value.asin(),
                Function::Acos => value.acos(),
                Function::Atan => value.atan(),
                Function::Sinh => value.sinh(),
                Function::Cosh => value.cosh(),
                Function::Tanh => value.tanh(),
                Function::Exp => value.exp(),
                Function::Ln => value.ln(),
                Function::Abs => value.abs(),
            }),
            None => self.place(Node::Call(function, a)),
        }
    }

    pub(crate) fn call2(&mut self, function: Function2, a: Id, b: Id) -> Id {
        match (self.number(a), self.number(b)) {
            (Some(a), Some(b)) => self.constant(match function {
                Function2::Atan2 => a.atan2(b),
                Function2::Min => a.min(b),
                Function2::Max => a.max(b),
            }),
            _ => self.place(Node::Call2(function, a, b)),
        }
    }

    pub(crate) fn power(&mut self, a: Id, exponent: f64) -> Id {
        if exponent == 1.0 {
            return a;
        }
        match self.number(a) {
            Some(value) => self.constant(value.powf(exponent)),
            None => self.place(Node::Power(a, exponent.to_bits())),
        }
    }

    pub(crate) fn step(&mut self, a: Id, dead_band: f64) -> Id {
        match self.number(a) {
            Some(value) if value.abs() <= dead_band => Self::ZERO,
            Some(value) => self.constant(value.signum()),
            None => self.place(Node::Step(a, dead_band.to_bits())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_ones_and_signs_leave_no_nodes() {
        let mut graph = Graph::new();
        let x = graph.input(Input::Position, 0);
        let y = graph.input(Input::Velocity, 0);
        let before = graph.len();
        let minus_zero = graph.constant(-0.0);
        assert_eq!(minus_zero, Graph::ZERO);
        assert_eq!([graph.add(x, Graph::ZERO), graph.mul(x, Graph::ONE)], [x, x]);
        assert_eq!([graph.mul(x, Graph::ZERO), graph.sub(x, x)], [Graph::ZERO; 2]);
        assert_eq!(graph.len(), before + 1, "only the sign of x");
        let product = graph.mul(x, y);
        let minus = graph.neg(x);
        let turned = graph.mul(minus, y);
        assert_eq!(graph.node(turned), Node::Neg(product));
        let (forth, back) = (graph.sub(x, y), graph.sub(y, x));
        assert_eq!(graph.node(back), Node::Neg(forth));
    }

    #[test]
    fn constant_factors_become_one() {
        let mut graph = Graph::new();
        let x = graph.input(Input::Position, 0);
        let (two, minus_four) = (graph.constant(2.0), graph.constant(-4.0));
        let twice = graph.mul(x, two);
        let all = graph.mul(minus_four, twice);
        let eight = graph.constant(8.0);
        let expected = graph.mul(x, eight);
        assert_eq!(graph.node(all), Node::Neg(expected));
    }
}
