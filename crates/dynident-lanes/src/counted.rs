//! Registers that count floating-point operations, to measure the cost of an algorithm.

use crate::portable::Portable;
use crate::register::Register;
use core::cell::Cell;

/// Floating-point operations of one thread, by kind. An operation on a register of four counts as four.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Sums, differences and unfused products.
    pub simple: u64,
    /// Multiply-adds.
    pub fused: u64,
    /// Quotients.
    pub divisions: u64,
}

impl Operations {
    /// Total number of operations in the convention of processor peaks: two per multiply-add, one per quotient.
    pub fn flops(self) -> u64 {
        self.simple + 2 * self.fused + self.divisions
    }
}

thread_local! {
    static COUNT: Cell<Operations> = const { Cell::new(Operations { simple: 0, fused: 0, divisions: 0 }) };
}

/// Operations of kernels at [`Level::counted`](crate::Level::counted) in this thread since the last call (or the
/// start). Changes of sign, comparisons and moves are not counted; sine and cosine count as their polynomials.
pub fn counted_operations() -> Operations {
    COUNT.take()
}

fn count(change: impl FnOnce(&mut Operations)) {
    let mut all = COUNT.get();
    change(&mut all);
    COUNT.set(all);
}

/// `N` numbers that count every operation.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Counted<const N: usize>(Portable<N, false>);

impl<const N: usize> Counted<N> {
    fn simple(value: Portable<N, false>) -> Self {
        count(|all| all.simple += N as u64);
        Self(value)
    }

    fn fused(value: Portable<N, false>) -> Self {
        count(|all| all.fused += N as u64);
        Self(value)
    }
}

impl<const N: usize> Register for Counted<N> {
    const LANES: usize = N;
    const ZERO: Self = Self(Portable::ZERO);
    const ONE: Self = Self(Portable::ONE);

    fn splat(value: f64) -> Self {
        Self(Portable::splat(value))
    }
    fn load(values: &[f64]) -> Self {
        Self(Portable::load(values))
    }
    fn store(self, out: &mut [f64]) {
        self.0.store(out);
    }
    fn first(self) -> f64 {
        self.0.first()
    }
    fn add(self, other: Self) -> Self {
        Self::simple(self.0.add(other.0))
    }
    fn sub(self, other: Self) -> Self {
        Self::simple(self.0.sub(other.0))
    }
    fn mul(self, other: Self) -> Self {
        Self::simple(self.0.mul(other.0))
    }
    fn div(self, other: Self) -> Self {
        count(|all| all.divisions += N as u64);
        Self(self.0.div(other.0))
    }
    fn transposed(rows: [Self; 4]) -> [Self; 4] {
        let [a, b, c, d] = Portable::transposed([rows[0].0, rows[1].0, rows[2].0, rows[3].0]);
        [Self(a), Self(b), Self(c), Self(d)]
    }
    fn neg(self) -> Self {
        Self(self.0.neg())
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self::fused(self.0.mul_add(factor.0, addend.0))
    }
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self::fused(self.0.neg_mul_add(factor.0, addend.0))
    }
    fn and(self, other: Self) -> Self {
        Self(self.0.and(other.0))
    }
    fn xor(self, other: Self) -> Self {
        Self(self.0.xor(other.0))
    }
    fn bits_plus(self, addend: u64) -> Self {
        Self(self.0.bits_plus(addend))
    }
    fn bits_shifted_by_62(self) -> Self {
        Self(self.0.bits_shifted_by_62())
    }
    fn bits_shifted_by_52(self) -> Self {
        Self(self.0.bits_shifted_by_52())
    }
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
    fn lowest_bit_mask(self) -> Self {
        Self(self.0.lowest_bit_mask())
    }
    fn all_within(self, bound: f64) -> bool {
        self.0.all_within(bound)
    }
    fn all_at_most(self, bound: Self) -> bool {
        self.0.all_at_most(bound.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Kernel, Lane, Level, dispatch, dispatch_single};

    /// Horner's rule: `degree` multiply-adds per value, then one of every other operation.
    struct Polynomial(usize);

    impl Kernel for Polynomial {
        type Output = f64;
        #[inline(always)]
        fn run<T: Lane>(self) -> f64 {
            let x = T::splat(0.5);
            let mut value = T::ONE;
            for _ in 0..self.0 {
                value = value.mul_add(x, T::ONE);
            }
            (-(value + x) * x - T::ONE).recip().lane(0)
        }
    }

    #[test]
    fn steps_are_counted_by_kind_and_lane() {
        counted_operations();
        let one = dispatch_single(Level::counted(), Polynomial(5));
        assert_eq!(counted_operations(), Operations { simple: 3, fused: 5, divisions: 1 });
        let four = dispatch(Level::counted(), Polynomial(5));
        let lanes = Level::counted().lanes() as u64;
        let count = counted_operations();
        assert_eq!(count, Operations { simple: 3 * lanes, fused: 5 * lanes, divisions: lanes });
        assert_eq!(count.flops(), 14 * lanes);
        assert_eq!(counted_operations(), Operations::default());
        // Bit-identical to other levels.
        assert_eq!(one.to_bits(), four.to_bits());
        assert_eq!(one, dispatch(Level::portable(), Polynomial(5)));
        assert_eq!(counted_operations(), Operations::default());
    }

    struct SinCos;

    impl Kernel for SinCos {
        type Output = ();
        #[inline(always)]
        fn run<T: Lane>(self) {
            let _ = T::splat(1.0).sin_cos();
        }
    }

    #[test]
    fn angles_are_counted_as_their_polynomials() {
        counted_operations();
        dispatch_single(Level::counted(), SinCos);
        // From sin_cos.rs: reduction 4 multiply-adds and 1 difference; x², x³ and x⁴; 2 · 5 for the polynomials; 1 for
        // the sine; 2 for the cosine.
        assert_eq!(counted_operations(), Operations { simple: 4, fused: 17, divisions: 0 });
    }
}
