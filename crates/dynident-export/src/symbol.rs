//! Symbolic scalar with which the dynamics algorithms build the graph of their result.

use crate::graph::{Function, Function2, Graph, Id, Input};
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};
use dynident_lanes::{Real, Scalar};
use std::cell::RefCell;

thread_local! {
    /// Graph of the current thread. Symbols are copied by value, so they cannot contain it.
    static GRAPH: RefCell<Graph> = RefCell::new(Graph::new());
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Symbol(Id);

/// Runs `write` on an empty graph; returns the graph and the result of `write`.
pub(crate) fn record<R>(write: impl FnOnce() -> R) -> (Graph, R) {
    let before = GRAPH.replace(Graph::new());
    let written = write();
    (GRAPH.replace(before), written)
}

fn in_graph(make: impl FnOnce(&mut Graph) -> Id) -> Symbol {
    GRAPH.with_borrow_mut(|graph| Symbol(make(graph)))
}

impl Symbol {
    pub(crate) fn id(self) -> Id {
        self.0
    }

    pub(crate) fn input(input: Input, place: usize) -> Self {
        in_graph(|graph| graph.input(input, place))
    }

    pub(crate) fn inputs(input: Input, dof: usize) -> Vec<Self> {
        (0..dof).map(|joint| Self::input(input, joint)).collect()
    }

    pub(crate) fn is_zero(self) -> bool {
        self == Self::ZERO
    }

    pub(crate) fn number(self) -> Option<f64> {
        GRAPH.with_borrow(|graph| graph.number(self.0))
    }

    pub(crate) fn call(self, function: Function) -> Self {
        in_graph(|graph| graph.call(function, self.0))
    }

    pub(crate) fn call2(self, function: Function2, other: Self) -> Self {
        in_graph(|graph| graph.call2(function, self.0, other.0))
    }
}

impl Scalar for Symbol {
    const ZERO: Self = Self(Graph::ZERO);
    const ONE: Self = Self(Graph::ONE);

    fn splat(value: f64) -> Self {
        in_graph(|graph| graph.constant(value))
    }

    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }

    fn sin_cos(self) -> (Self, Self) {
        (self.call(Function::Sin), self.call(Function::Cos))
    }

    fn recip(self) -> Self {
        in_graph(|graph| graph.recip(self.0))
    }
}

impl Real for Symbol {
    fn over(self, divisor: Self) -> Self {
        self * divisor.recip()
    }

    fn abs(self) -> Self {
        self.call(Function::Abs)
    }

    fn min(self, other: Self) -> Self {
        Self::splat(0.5) * (self + other - (self - other).abs())
    }

    /// The result is exact if `other` is zero, because halving and doubling do not round.
    fn max(self, other: Self) -> Self {
        Self::splat(0.5) * (self + other + (self - other).abs())
    }

    fn sign(self, dead_band: f64) -> Self {
        in_graph(|graph| graph.step(self.0, dead_band))
    }

    fn smooth_step(self, width: f64) -> Self {
        (self * Self::splat(1.0 / width)).call(Function::Tanh)
    }

    fn decay(self) -> Self {
        (-self).call(Function::Exp)
    }

    fn ln(self) -> Self {
        self.call(Function::Ln)
    }

    /// A square, the most common power, is written as a product.
    fn power(self, exponent: f64) -> Self {
        if exponent == 2.0 { self * self } else { in_graph(|graph| graph.power(self.0, exponent)) }
    }
}

impl Add for Symbol {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        in_graph(|graph| graph.add(self.0, other.0))
    }
}
impl Sub for Symbol {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        in_graph(|graph| graph.sub(self.0, other.0))
    }
}
impl Mul for Symbol {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        in_graph(|graph| graph.mul(self.0, other.0))
    }
}
impl Neg for Symbol {
    type Output = Self;
    fn neg(self) -> Self {
        in_graph(|graph| graph.neg(self.0))
    }
}
impl AddAssign for Symbol {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl SubAssign for Symbol {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
