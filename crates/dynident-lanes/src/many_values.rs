//! Functions of many values, vectorised.

use crate::dispatch::{Level, dispatch};
use crate::kernel::Kernel;
use crate::lanes::Lane;

/// A function of one value, written over lanes.
pub trait LaneFunction {
    /// Its value at `x`. Implementations are marked `#[inline(always)]`, as those of [`Kernel::run`].
    fn of<T: Lane>(&self, x: T) -> T;
}

/// Writes `function` of the values to `out`, up to the shorter length. The result does not depend on the position of a
/// value in the slice.
pub fn map_all(values: &[f64], out: &mut [f64], function: &impl LaneFunction) {
    dispatch(Level::detect(), All { values, out, function });
}

struct All<'a, F> {
    values: &'a [f64],
    out: &'a mut [f64],
    function: &'a F,
}

impl<F: LaneFunction> Kernel for All<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let count = self.values.len().min(self.out.len());
        let whole = count - count % T::LANES;
        let (values, out) = (&self.values[..count], &mut self.out[..count]);
        for (from, to) in values.chunks_exact(T::LANES).zip(out.chunks_exact_mut(T::LANES)) {
            self.function.of(T::load(from)).store(to);
        }
        if whole < count {
            let mut last = [0.0; 8];
            last[..count - whole].copy_from_slice(&values[whole..]);
            self.function.of(T::load(&last)).store(&mut last);
            out[whole..].copy_from_slice(&last[..count - whole]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Step(f64);

    impl LaneFunction for Step {
        fn of<T: Lane>(&self, x: T) -> T {
            x.smooth_step(self.0)
        }
    }

    struct Decay;

    impl LaneFunction for Decay {
        fn of<T: Lane>(&self, x: T) -> T {
            x.decay()
        }
    }

    /// Equal to four units in the last place.
    fn near(found: f64, expected: f64) -> bool {
        found == expected || (found - expected).abs() <= 4.0 * f64::EPSILON * expected.abs()
    }

    /// Numbers of every size and sign up to 1e4.
    fn values() -> Vec<f64> {
        let sizes = (-300..=80).map(|k| 10.0_f64.powf(f64::from(k) / 20.0));
        let fine = (0..20_001).map(|k| f64::from(k) * 2.5e-3);
        sizes.chain(fine).flat_map(|x| [x, -x]).collect()
    }

    #[test]
    fn they_agree_with_the_standard_library_at_every_level() {
        let values = values();
        for level in Level::available() {
            let mut out = vec![0.0; values.len()];
            dispatch(level, All { values: &values, out: &mut out, function: &Step(0.3) });
            for (x, y) in values.iter().zip(&out) {
                assert!(near(*y, (x / 0.3).tanh()), "{}: tanh({x} / 0.3) = {y}", level.name());
            }
            let sizes: Vec<f64> = values.iter().map(|x| x.abs().min(700.0)).collect();
            dispatch(level, All { values: &sizes, out: &mut out, function: &Decay });
            for (x, y) in sizes.iter().zip(&out) {
                assert!(near(*y, (-x).exp()), "{}: e^-{x} = {y}", level.name());
            }
        }
    }

    #[test]
    fn range_limits_are_correct_and_nan_stays_nan() {
        let mut out = [0.0; 6];
        map_all(&[0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300], &mut out, &Step(1.0));
        assert_eq!(out[..4], [0.0, -0.0, 1.0, -1.0]);
        assert!(out[1].is_sign_negative() && out[4].is_nan() && out[5] == 1.0);
        map_all(&[0.0, f64::INFINITY, f64::NAN, 1e300], &mut out, &Decay);
        assert!(out[0] == 1.0 && out[1] < 1e-300 && out[2].is_nan() && out[3] < 1e-300);
    }

    #[test]
    fn values_do_not_depend_on_their_lane() {
        let values = values();
        let (mut all, mut one) = (vec![0.0; values.len()], [0.0]);
        map_all(&values, &mut all, &Step(0.02));
        for (x, y) in values.iter().zip(&all).step_by(97) {
            map_all(&[*x], &mut one, &Step(0.02));
            assert_eq!(y.to_bits(), one[0].to_bits(), "{x}");
        }
    }
}
