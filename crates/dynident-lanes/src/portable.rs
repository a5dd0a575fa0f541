//! Registers of the build target: arrays, and single numbers.

use crate::register::Register;

/// `N` numbers without instructions beyond the build target. `FUSED` allows the fused multiply-add; use it only for
/// processors with this instruction, because otherwise it is a slow library call.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Portable<const N: usize, const FUSED: bool>([f64; N]);

impl<const N: usize, const FUSED: bool> Portable<N, FUSED> {
    #[inline(always)]
    fn zip(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for i in 0..N {
            self.0[i] = f(self.0[i], other.0[i]);
        }
        self
    }

    #[inline(always)]
    fn zip_bits(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        self.zip(other, |a, b| f64::from_bits(f(a.to_bits(), b.to_bits())))
    }

    #[inline(always)]
    fn map_bits(mut self, f: impl Fn(u64) -> u64) -> Self {
        for i in 0..N {
            self.0[i] = f64::from_bits(f(self.0[i].to_bits()));
        }
        self
    }
}

impl<const N: usize, const FUSED: bool> Register for Portable<N, FUSED> {
    const LANES: usize = N;
    const ZERO: Self = Self([0.0; N]);
    const ONE: Self = Self([1.0; N]);

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; N])
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let mut lanes = [0.0; N];
        lanes.copy_from_slice(&values[..N]);
        Self(lanes)
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        out[..N].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn first(self) -> f64 {
        self.0[0]
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
    #[inline(always)]
    fn transposed(mut rows: [Self; 4]) -> [Self; 4] {
        if N == 4 {
            for i in 0..4 {
                for k in 0..i {
                    (rows[i].0[k], rows[k].0[i]) = (rows[k].0[i], rows[i].0[k]);
                }
            }
        }
        rows
    }
    #[inline(always)]
    fn neg(mut self) -> Self {
        for i in 0..N {
            self.0[i] = -self.0[i];
        }
        self
    }
    #[inline(always)]
    fn mul_add(mut self, factor: Self, addend: Self) -> Self {
        for i in 0..N {
            self.0[i] =
                if FUSED { self.0[i].mul_add(factor.0[i], addend.0[i]) } else { self.0[i] * factor.0[i] + addend.0[i] };
        }
        self
    }
    #[inline(always)]
    fn neg_mul_add(mut self, factor: Self, addend: Self) -> Self {
        for i in 0..N {
            self.0[i] = if FUSED {
                (-self.0[i]).mul_add(factor.0[i], addend.0[i])
            } else {
                addend.0[i] - self.0[i] * factor.0[i]
            };
        }
        self
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| a & b)
    }
    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| a ^ b)
    }
    #[inline(always)]
    fn bits_plus(self, addend: u64) -> Self {
        self.map_bits(|bits| bits.wrapping_add(addend))
    }
    #[inline(always)]
    fn bits_shifted_by_62(self) -> Self {
        self.map_bits(|bits| bits << 62)
    }
    #[inline(always)]
    fn bits_shifted_by_52(self) -> Self {
        self.map_bits(|bits| bits << 52)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(core::array::from_fn(|k| if self.0[k] < other.0[k] { self.0[k] } else { other.0[k] }))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn lowest_bit_mask(self) -> Self {
        self.map_bits(|bits| 0_u64.wrapping_sub(bits & 1))
    }
    #[inline(always)]
    fn all_within(self, bound: f64) -> bool {
        self.0.iter().all(|x| x.abs() <= bound)
    }
    #[inline(always)]
    fn all_at_most(self, bound: Self) -> bool {
        self.0.iter().zip(&bound.0).all(|(x, bound)| x <= bound)
    }
}

#[cfg(test)]
mod tests {
    use crate::dispatch::{Level, dispatch_single};
    use crate::kernel::Kernel;
    use crate::lanes::Lane;

    /// The numbers 0 to 15 by rows, transposed in bundles of four.
    struct Square;

    impl Kernel for Square {
        type Output = Vec<f64>;
        #[inline(always)]
        fn run<T: Lane>(self) -> Vec<f64> {
            let numbers: Vec<f64> = (0..20).map(f64::from).collect();
            let row = |k: usize| T::Bundle::load(&numbers[4 * k..]);
            let mut out = vec![0.0; 16];
            for (to, row) in out.chunks_exact_mut(4).zip(T::Bundle::transposed([row(0), row(1), row(2), row(3)])) {
                row.store(to);
            }
            out
        }
    }

    #[test]
    fn a_square_is_transposed_at_every_level() {
        let expected: Vec<f64> = (0..16).map(|k| f64::from(k / 4 + 4 * (k % 4))).collect();
        for level in Level::available() {
            assert_eq!(dispatch_single(level, Square), expected, "{}", level.name());
        }
    }
}
