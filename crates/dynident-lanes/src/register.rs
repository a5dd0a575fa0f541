//! What a register of `f64` must offer so that [`Wide`](crate::lanes::Wide) can be a scalar.

/// A register (or an array that stands for one) of `f64`.
pub(crate) trait Register: Copy + core::fmt::Debug + Send + Sync + 'static {
    const LANES: usize;
    /// Zero in every lane.
    const ZERO: Self;
    /// One in every lane.
    const ONE: Self;
    fn splat(value: f64) -> Self;
    /// The first `LANES` values; panics if there are fewer.
    fn load(values: &[f64]) -> Self;
    /// To the first `LANES` places; panics if there are fewer.
    fn store(self, out: &mut [f64]);
    /// The value in lane 0.
    fn first(self) -> f64;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// Lane `k` of row `i` at lane `i` of row `k`, for registers of four lanes; others are given back as they are.
    fn transposed(rows: [Self; 4]) -> [Self; 4];
    fn div(self, other: Self) -> Self;
    /// The other sign. As the compiler knows it, which makes it part of the next sum or product where it can.
    fn neg(self) -> Self;
    /// `self * factor + addend`, fused where the level has it.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// `addend - self * factor`, fused where the level has it.
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self;
    /// Bit patterns, as 64-bit integers a lane.
    fn and(self, other: Self) -> Self;
    fn xor(self, other: Self) -> Self;
    /// Integer `self + addend`.
    fn bits_plus(self, addend: u64) -> Self;
    /// `bits << 62`.
    fn bits_shifted_by_62(self) -> Self;
    /// `bits << 52`.
    fn bits_shifted_by_52(self) -> Self;
    /// The lesser of the two; `other` where one of them is not a number.
    fn min(self, other: Self) -> Self;
    /// The greater of the two; `other` where one of them is not a number.
    fn max(self, other: Self) -> Self;
    /// All ones where the lowest bit is set, else all zeros.
    fn lowest_bit_mask(self) -> Self;
    /// True when every |lane| is at most `bound` (false when one is not a number).
    fn all_within(self, bound: f64) -> bool;
    /// True when every lane is at most that of `bound` (false when one of the two is not a number).
    fn all_at_most(self, bound: Self) -> bool;
}
