//! The run-time choice of processor level.

use crate::kernel::Kernel;
use crate::lanes::Wide;
use crate::portable::Portable;
#[cfg(target_arch = "x86_64")]
use crate::x86::{Avx2, Avx512, HasAvx2, HasAvx512, enter_avx2, enter_avx512};
use std::sync::OnceLock;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Instructions {
    /// No instructions beyond the build target.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(HasAvx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(HasAvx512),
}

/// The level of [`Level::detect`].
static CHOSEN: OnceLock<Level> = OnceLock::new();

/// Processor level. A value is a proof that the processor supports the instructions, because it can only be created by
/// [`Level::detect`], [`Level::available`] and [`Level::portable`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(Instructions);

impl Level {
    /// The best level of this processor, or a lower one from the environment variable `DYNIDENT_INSTRUCTIONS`
    /// (`portable`, `avx2` or `avx512`), for tests and comparisons. Other values of the variable are ignored.
    pub fn detect() -> Self {
        *CHOSEN.get_or_init(|| {
            let named = std::env::var("DYNIDENT_INSTRUCTIONS").ok();
            let most = named.and_then(|name| ["portable", "avx2", "avx512"].iter().position(|known| *known == name));
            let levels = Self::available();
            levels[most.unwrap_or(levels.len()).min(levels.len() - 1)]
        })
    }

    /// The level that every processor of the build target supports. On 64-bit ARM it includes NEON and the fused
    /// multiply-add.
    pub fn portable() -> Self {
        Self(Instructions::Portable)
    }

    /// All levels of this processor, from portable to best.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "nothing is pushed on architectures without a wider level")]
        let mut levels = vec![Self::portable()];
        #[cfg(target_arch = "x86_64")]
        {
            levels.extend(HasAvx2::detect().map(|proof| Self(Instructions::Avx2(proof))));
            levels.extend(HasAvx512::detect().map(|proof| Self(Instructions::Avx512(proof))));
        }
        levels
    }

    /// Number of samples that [`dispatch`] processes together at this level.
    pub fn lanes(self) -> usize {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(_) => 8,
            _ => 4,
        }
    }

    /// The level's name, for reports and benchmarks.
    pub fn name(self) -> &'static str {
        match self.0 {
            Instructions::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(_) => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(_) => "AVX-512",
        }
    }
}

/// Every 64-bit ARM processor has the fused multiply-add.
const FUSED: bool = cfg!(target_arch = "aarch64");

/// Runs `kernel` on the number of samples of `level` at a time.
#[inline]
pub fn dispatch<K: Kernel>(level: Level, kernel: K) -> K::Output {
    match level.0 {
        Instructions::Portable => kernel.run::<Wide<Portable<4, FUSED>>>(),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(proof) => enter_avx2::<K, Wide<Avx2>>(proof, kernel),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(proof) => enter_avx512::<K, Wide<Avx512>>(proof, kernel),
    }
}

/// Runs `kernel` on one sample at a time; code that vectorises inside a sample uses the instructions of `level`.
#[inline]
pub fn dispatch_single<K: Kernel>(level: Level, kernel: K) -> K::Output {
    match level.0 {
        Instructions::Portable => kernel.run::<Wide<Portable<1, FUSED>, Portable<4, FUSED>>>(),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(proof) => enter_avx2::<K, Wide<Portable<1, true>, Avx2>>(proof, kernel),
        #[cfg(target_arch = "x86_64")]
        // Measured: inside one sample four lanes are faster than eight (half-empty registers, slower shuffles).
        Instructions::Avx512(proof) => enter_avx512::<K, Wide<Portable<1, true>, Avx2>>(proof, kernel),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Lane;

    struct SumOfSquares<'a>(&'a [f64]);
    impl Kernel for SumOfSquares<'_> {
        type Output = f64;
        #[inline(always)]
        fn run<T: Lane>(self) -> f64 {
            let mut sum = T::ZERO;
            for chunk in self.0.chunks_exact(T::LANES) {
                let x = T::load(chunk);
                sum = x.mul_add(x, sum);
            }
            sum.sum()
        }
    }

    struct Comparisons;
    impl Kernel for Comparisons {
        type Output = ();
        #[inline(always)]
        fn run<T: Lane>(self) {
            let values = [-3.0, 2.0, -0.0, f64::INFINITY, 1.0, -1.0, 0.5, 4.0];
            let (x, last) = (T::load(&values), T::LANES - 1);
            for (index, value) in values[..T::LANES].iter().enumerate() {
                assert_eq!(x.abs().lane(index), value.abs());
                assert_eq!(x.max(T::ONE).lane(index), value.max(1.0));
                assert_eq!(x.min(T::ONE).lane(index), value.min(1.0));
            }
            assert!(x.all_at_most(x) && x.all_at_most(T::splat(f64::INFINITY)));
            let none = x.with_lane(last, f64::NAN);
            assert!(!none.all_at_most(T::splat(f64::INFINITY)) && !T::splat(-9.0).all_at_most(none));
            assert!(!x.with_lane(last, 3.0).all_at_most(x.with_lane(last, 2.9)));
            assert_eq!(none.max(T::ONE).lane(last), 1.0);
            assert_eq!(none.min(T::ONE).lane(last), 1.0);
        }
    }

    #[test]
    fn lanes_are_compared_one_by_one() {
        for level in Level::available() {
            dispatch(level, Comparisons);
            dispatch_single(level, Comparisons);
        }
    }

    #[test]
    fn every_level_computes_the_same() {
        let values: Vec<f64> = (0..64).map(f64::from).collect();
        for level in Level::available() {
            assert_eq!(dispatch(level, SumOfSquares(&values)), 85_344.0, "{}", level.name());
            assert_eq!(dispatch_single(level, SumOfSquares(&values)), 85_344.0, "{}", level.name());
        }
    }
}
