//! Operations of a register of `f64`, used by [`Wide`](crate::lanes::Wide).

/// A register of `f64`, or an array in place of it.
pub(crate) trait Register: Copy + core::fmt::Debug + Send + Sync + 'static {
    const LANES: usize;
    /// Zero in every lane.
    const ZERO: Self;
    /// One in every lane.
    const ONE: Self;
    fn splat(value: f64) -> Self;
    /// Loads the first `LANES` values; panics if there are fewer.
    fn load(values: &[f64]) -> Self;
    /// Stores to the first `LANES` places; panics if there are fewer.
    fn store(self, out: &mut [f64]);
    /// The value in lane 0.
    fn first(self) -> f64;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// Transposes four registers of four lanes; others are returned unchanged.
    fn transposed(rows: [Self; 4]) -> [Self; 4];
    fn div(self, other: Self) -> Self;
    /// Negation, in a form that the compiler can combine with the next sum or product.
    fn neg(self) -> Self;
    /// `self * factor + addend`, fused if the level supports it.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// `addend - self * factor`, fused if the level supports it.
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self;
    /// Operations on bit patterns, as 64-bit integers per lane.
    fn and(self, other: Self) -> Self;
    fn xor(self, other: Self) -> Self;
    /// Integer `self + addend`.
    fn bits_plus(self, addend: u64) -> Self;
    /// `bits << 62`.
    fn bits_shifted_by_62(self) -> Self;
    /// `bits << 52`.
    fn bits_shifted_by_52(self) -> Self;
    /// Smaller value; `other` if one of them is NaN.
    fn min(self, other: Self) -> Self;
    /// Larger value; `other` if one of them is NaN.
    fn max(self, other: Self) -> Self;
    /// All ones if the lowest bit is set, else all zeros.
    fn lowest_bit_mask(self) -> Self;
    /// True if every |lane| is at most `bound` (false for NaN).
    fn all_within(self, bound: f64) -> bool;
    /// True if every lane is at most that of `bound` (false for NaN).
    fn all_at_most(self, bound: Self) -> bool;
}
