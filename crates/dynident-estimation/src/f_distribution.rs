//! The F distribution, for tests.

/// Terms of the continued fraction: it needs about √max(a, b), so a hundred thousand degrees of freedom are within reach.
const MOST_TERMS: usize = 2000;

/// The probability that an F variable with `first` and `second` degrees of freedom exceeds `f`; between 0 and 1, and 1 for an `f` that is not
/// positive.
///
/// `I_x(d₂/2, d₁/2)` at `x = d₂/(d₂ + d₁ f)`. Abramowitz and Stegun, Handbook of Mathematical Functions, 26.6.2 and 26.5.8.
///
/// ```
/// use dynident_estimation::f_tail;
/// // One and two degrees of freedom: P(F > f) = 1 − √(f/(f + 2)).
/// assert!((f_tail(1.0, 1.0, 2.0) - (1.0 - (1.0_f64 / 3.0).sqrt())).abs() < 1e-12);
/// ```
pub fn f_tail(f: f64, first: f64, second: f64) -> f64 {
    if f.is_nan() || f <= 0.0 {
        return 1.0;
    }
    if f.is_infinite() {
        return 0.0;
    }
    incomplete_beta(second / 2.0, first / 2.0, second / (second + first * f)).clamp(0.0, 1.0)
}

/// The regularised incomplete beta function I_x(a, b).
fn incomplete_beta(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    let front = (a * x.ln() + b * (-x).ln_1p() + ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b)).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(a, b, x) / a
    } else {
        1.0 - front * beta_fraction(b, a, 1.0 - x) / b
    }
}

/// The continued fraction 26.5.8 by Lentz's method.
fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1.0e-300;
    let away = |value: f64| if value.abs() < TINY { TINY } else { value };
    let (mut c, mut d) = (1.0, 1.0 / away(1.0 - (a + b) * x / (a + 1.0)));
    let mut value = d;
    for m in 1..MOST_TERMS {
        let m = m as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut step = 1.0;
        for term in [even, odd] {
            d = 1.0 / away(1.0 + term * d);
            c = away(1.0 + term / c);
            step = c * d;
            value *= step;
        }
        if (step - 1.0).abs() < 1.0e-15 {
            break;
        }
    }
    value
}

/// `ln Γ(x)` for positive x: Stirling's series (Abramowitz and Stegun 6.1.41) after the recurrence has carried x above 10.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut product) = (x, 1.0);
    while x < 10.0 {
        product *= x;
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    let series = (1.0 / 12.0
        - square * (1.0 / 360.0 - square * (1.0 / 1260.0 - square * (1.0 / 1680.0 - square * (1.0 / 1188.0)))))
        / x;
    (x - 0.5) * x.ln() - x + 0.5 * core::f64::consts::TAU.ln() + series - product.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_agree_with_tables() {
        // Abramowitz and Stegun, table 26.9: the 5 % and 1 % points, four digits; P changes by less than a unit of 1e-4 with the last one.
        for (f, first, second, tail) in
            [(4.965, 1.0, 10.0, 0.05), (2.978, 10.0, 10.0, 0.05), (10.04, 1.0, 10.0, 0.01), (1.9926, 10.0, 60.0, 0.05)]
        {
            assert!(
                (f_tail(f, first, second) - tail).abs() < 1.0e-4,
                "{f} {first} {second}: {}",
                f_tail(f, first, second)
            );
        }
        // Two and d: (1 + 2 f/d)^(-d/2) exactly, so rounding only.
        let exact = (1.0 + 2.0 * 3.0 / 40_000.0_f64).powf(-20_000.0);
        assert!((f_tail(3.0, 2.0, 40_000.0) / exact - 1.0).abs() < 1.0e-9);
        assert_eq!(
            (f_tail(-1.0, 2.0, 3.0), f_tail(f64::NAN, 2.0, 3.0), f_tail(f64::INFINITY, 2.0, 3.0)),
            (1.0, 1.0, 0.0)
        );
    }
}
