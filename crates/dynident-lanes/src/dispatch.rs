//! The run-time choice of processor level: the one place with `unsafe`.

use crate::lanes::{F64x1, F64x4, F64x8, Lane};

/// Work that can run over any lane type. Implementations mark `run`, and everything it calls in its hot path,
/// `#[inline(always)]`, so that the whole body is compiled once for each processor level.
pub trait Kernel {
    /// What the work returns.
    type Output;
    /// Does the work on lanes of type `T`.
    fn run<T: Lane>(self) -> Self::Output;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Instructions {
    /// Nothing beyond the build target.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "aarch64")]
    Neon,
}

/// What this processor can do. A value of this type is the proof that the instructions it names exist: it can only be had
/// from [`Level::detect`], [`Level::available`] and [`Level::portable`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(Instructions);

impl Level {
    /// The best level of this processor.
    pub fn detect() -> Self {
        *Self::available().last().unwrap_or(&Self::portable())
    }

    /// The level that every processor of the build target has: no run-time check, no fused multiply-add.
    pub fn portable() -> Self {
        Self(Instructions::Portable)
    }

    /// All levels of this processor, from portable to best.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "nothing is pushed on architectures without a wider level")]
        let mut levels = vec![Self::portable()];
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma");
            let avx512 = avx2
                && std::is_x86_feature_detected!("avx512f")
                && std::is_x86_feature_detected!("avx512dq")
                && std::is_x86_feature_detected!("avx512vl");
            if avx2 {
                levels.push(Self(Instructions::Avx2));
            }
            if avx512 {
                levels.push(Self(Instructions::Avx512));
            }
        }
        #[cfg(target_arch = "aarch64")]
        levels.push(Self(Instructions::Neon));
        levels
    }

    /// How many samples [`dispatch`] puts side by side at this level.
    pub fn lanes(self) -> usize {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => 8,
            _ => 4,
        }
    }

    /// The level's name, for reports and benchmarks.
    pub fn name(self) -> &'static str {
        match self.0 {
            Instructions::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => "AVX-512",
            #[cfg(target_arch = "aarch64")]
            Instructions::Neon => "NEON",
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx2<K: Kernel, T: Lane>(kernel: K) -> K::Output {
    kernel.run::<T>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn with_avx512<K: Kernel, T: Lane>(kernel: K) -> K::Output {
    kernel.run::<T>()
}

/// Runs `kernel` on as many samples side by side as `level` offers.
#[inline]
pub fn dispatch<K: Kernel>(level: Level, kernel: K) -> K::Output {
    match level.0 {
        Instructions::Portable => kernel.run::<F64x4<false>>(),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => enter_avx2::<K, F64x4<true>>(kernel),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => enter_avx512::<K, F64x8<true>>(kernel),
        #[cfg(target_arch = "aarch64")]
        Instructions::Neon => kernel.run::<F64x4<true>>(),
    }
}

/// Runs `kernel` on one sample at a time, with the instructions of `level` for what is left to vectorise inside a sample.
#[inline]
pub fn dispatch_single<K: Kernel>(level: Level, kernel: K) -> K::Output {
    match level.0 {
        Instructions::Portable => kernel.run::<F64x1<false>>(),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => enter_avx2::<K, F64x1<true>>(kernel),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => enter_avx512::<K, F64x1<true>>(kernel),
        #[cfg(target_arch = "aarch64")]
        Instructions::Neon => kernel.run::<F64x1<true>>(),
    }
}

// Calling a `#[target_feature]` function is unsafe because the processor may lack the feature. A `Level` other than
// portable exists only after `Level::available` saw the features at run time, so the two calls below are sound.
#[cfg(target_arch = "x86_64")]
#[inline]
fn enter_avx2<K: Kernel, T: Lane>(kernel: K) -> K::Output {
    unsafe { with_avx2::<K, T>(kernel) }
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn enter_avx512<K: Kernel, T: Lane>(kernel: K) -> K::Output {
    unsafe { with_avx512::<K, T>(kernel) }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn every_level_computes_the_same() {
        let values: Vec<f64> = (0..64).map(f64::from).collect();
        for level in Level::available() {
            // Exact: sums of squares of small integers.
            assert_eq!(dispatch(level, SumOfSquares(&values)), 85_344.0, "{}", level.name());
            assert_eq!(dispatch_single(level, SumOfSquares(&values)), 85_344.0, "{}", level.name());
        }
    }
}
