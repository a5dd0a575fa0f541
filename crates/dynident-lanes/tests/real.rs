//! Functions of real numbers: the same for numbers, lanes and dual numbers, with correct slopes.

use dynident_lanes::{Dual, Lane, LaneFunction, Real, Scalar, map_all};

/// Every function of `Real` once.
struct Everything;

impl Everything {
    fn over<S: Real>(x: S) -> S {
        let size = x.abs() + S::ONE;
        let parts = x.max(S::ZERO) + S::splat(3.0) * x.min(S::ZERO);
        parts * size.ln()
            + x.sign(0.2) * size.power(1.5)
            + x.over(size.power(1.0 / 3.0)) * size.decay()
            + x.smooth_step(0.7) * size.power(2.0)
            + size.power(0.5)
    }
}

impl LaneFunction for Everything {
    fn of<T: Lane>(&self, x: T) -> T {
        Self::over(x)
    }
}

#[test]
fn scalars_lanes_and_duals_have_the_same_functions() {
    let values: Vec<f64> = (-40..=40).map(|k| 0.05 * f64::from(k) + 0.01).collect();
    let mut lanes = vec![0.0; values.len()];
    map_all(&values, &mut lanes, &Everything);
    for (&x, lane) in values.iter().zip(lanes) {
        let (number, dual) = (Everything::over(x), Everything::over(Dual::variable(x)));
        assert_eq!(dual.value, number);
        assert!((lane - number).abs() <= 1e-14 * number.abs().max(1.0), "{x}: {lane} {number}");
        // A central difference with this step is accurate to about 1e-9.
        let step = 1e-5;
        let slope = (Everything::over(x + step) - Everything::over(x - step)) / (2.0 * step);
        assert!((dual.derivative - slope).abs() < 1e-7 * slope.abs().max(1.0), "{x}: {} {slope}", dual.derivative);
    }
}

#[test]
fn derivatives_at_zero_and_large_values_are_finite() {
    let at = Dual::variable;
    assert_eq!(at(0.0).abs().power(0.5), Dual::ZERO);
    assert_eq!(at(1e200).power(2.0).decay(), Dual::ZERO);
    assert_eq!([at(0.0).max(Dual::ZERO), at(0.0).min(Dual::ZERO), at(0.0).sign(0.0)], [Dual::ZERO; 3]);
}
