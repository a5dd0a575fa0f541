//! The distributions that intervals and tests are read from: Student's t, Fisher's F, chi-squared.
//!
//! Built on the regularised incomplete beta and gamma functions by continued fraction and power series (NIST Digital Library of Mathematical Functions, 8.7, 8.9, 8.17).

/// Most terms of a series or fraction; both converge in far fewer for the degrees of freedom that data have.
const MOST_TERMS: usize = 10_000;
/// A denominator of a continued fraction is never smaller (Lentz's method, modified by Thompson and Barnett).
const TINY: f64 = 1.0e-300;

/// ln Γ(x) for x > 0: Stirling's series after shifting x above 10 (DLMF 5.11.1); there its first omitted term is below 1e-15.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y * (1.0 / 1680.0 - y * (1.0 / 1188.0))))) / x;
    shift + (x - 0.5) * x.ln() - x + 0.5 * core::f64::consts::TAU.ln() + series
}

/// A continued fraction `1 / (1 + c_1 / (1 + c_2 / (1 + ..)))`.
fn fraction(coefficient: impl Fn(usize) -> f64) -> f64 {
    let guarded = |x: f64| if x.abs() < TINY { TINY } else { x };
    let (mut c, mut d, mut value) = (1.0, 0.0, 1.0);
    for k in 1..MOST_TERMS {
        let term = coefficient(k);
        d = 1.0 / guarded(1.0 + term * d);
        c = guarded(1.0 + term / c);
        let change = c * d;
        value *= change;
        if (change - 1.0).abs() < 1.0e-16 {
            break;
        }
    }
    1.0 / value
}

/// The regularised incomplete beta function I_x(a, b).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp() / a;
    // DLMF 8.17.22.
    front
        * fraction(|k| {
            let m = (k / 2) as f64;
            if k % 2 == 0 {
                m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
            } else {
                -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
            }
        })
}

/// Probability that a chi-squared variable with `freedom` degrees of freedom exceeds `value`; NaN for a NaN or for no freedom.
///
/// ```
/// let p = dynident_estimation::chi_squared_tail(18.307_038, 10.0);
/// assert!((p - 0.05).abs() < 1e-8);
/// ```
pub(crate) fn chi_squared_tail(value: f64, freedom: f64) -> f64 {
    if value.is_nan() || freedom.is_nan() || freedom <= 0.0 {
        return f64::NAN;
    }
    let (a, x) = (0.5 * freedom, 0.5 * value);
    if x <= 0.0 {
        return 1.0;
    }
    if x.is_infinite() {
        return 0.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        // DLMF 8.7.1: the lower part as a series of positive terms.
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        for _ in 0..MOST_TERMS {
            n += 1.0;
            term *= x / n;
            sum += term;
            if term < 1.0e-17 * sum {
                break;
            }
        }
        return (1.0 - front * sum).clamp(0.0, 1.0);
    }
    // DLMF 8.9.1 in the form of Legendre, evaluated by Lentz's method.
    let (mut b, mut c) = (x + 1.0 - a, 1.0 / TINY);
    let mut d = 1.0 / b;
    let mut value = d;
    for k in 1..MOST_TERMS {
        let n = k as f64;
        let term = -n * (n - a);
        b += 2.0;
        let guarded = |x: f64| if x.abs() < TINY { TINY } else { x };
        d = 1.0 / guarded(term * d + b);
        c = guarded(b + term / c);
        value *= c * d;
        if (c * d - 1.0).abs() < 1.0e-16 {
            break;
        }
    }
    (front * value).clamp(0.0, 1.0)
}

/// Probability that an F variable with `numerator` and `denominator` degrees of freedom exceeds `value`.
///
/// ```
/// let p = dynident_estimation::f_tail(3.098_391, 3.0, 20.0);
/// assert!((p - 0.05).abs() < 1e-7);
/// ```
pub(crate) fn f_tail(value: f64, numerator: f64, denominator: f64) -> f64 {
    if value.is_nan() || !(numerator > 0.0 && denominator > 0.0) {
        return f64::NAN;
    }
    if value <= 0.0 {
        return 1.0;
    }
    incomplete_beta(denominator / (denominator + numerator * value), 0.5 * denominator, 0.5 * numerator)
}

/// The t for which a Student variable with `freedom` degrees of freedom (they need not be whole) lies between -t and t with probability `level`. Below one degree it is that of one; infinite
/// freedom gives the normal distribution's. NaN unless `level` lies between 0 and 1.
///
/// ```
/// let t = dynident_estimation::student_half_width(0.95, 10.0);
/// assert!((t - 2.228_139).abs() < 1e-6);
/// ```
pub fn student_half_width(level: f64, freedom: f64) -> f64 {
    if !(level > 0.0 && level < 1.0) || freedom.is_nan() {
        return f64::NAN;
    }
    // Beyond a million degrees the normal distribution's differs by less than 1e-6.
    let freedom = freedom.clamp(1.0, 1.0e6);
    let outside = |t: f64| incomplete_beta(freedom / (freedom + t * t), 0.5 * freedom, 0.5);
    // Twice Student's density: how fast the tails lose.
    let constant =
        ln_gamma(0.5 * freedom + 0.5) - ln_gamma(0.5 * freedom) - 0.5 * (freedom * core::f64::consts::PI).ln();
    let loss = |t: f64| 2.0 * (constant - (0.5 * freedom + 0.5) * (t * t / freedom).ln_1p()).exp();
    let (mut low, mut high) = (0.0, 1.0);
    while outside(high) > 1.0 - level && high < 1.0e12 {
        low = high;
        high *= 2.0;
    }
    // The tails are convex: from below Newton's steps never go too far, but for rounding.
    let mut t = low;
    for _ in 0..100 {
        let above = outside(t) - (1.0 - level);
        (low, high) = if above > 0.0 { (t, high) } else { (low, t) };
        let newton = t + above / loss(t);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let still = (next - t).abs() <= 1.0e-15 * next;
        t = next;
        if still || high - low <= 1.0e-15 * high {
            break;
        }
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms: chi-squared with 2 degrees is exponential; t with 1 is Cauchy's, with 2 has an algebraic tail; F(2, n) has a power tail. Rounding of the series only.
    #[test]
    fn closed_forms() {
        for x in [0.01, 0.7, 3.0, 12.0, 80.0_f64] {
            let expected = (-0.5 * x).exp();
            assert!((chi_squared_tail(x, 2.0) - expected).abs() <= 1e-13 + 1e-11 * expected, "{x}");
            let expected = (1.0 + 2.0 * x / 7.0_f64).powf(-3.5);
            assert!((f_tail(x, 2.0, 7.0) - expected).abs() <= 1e-13 + 1e-11 * expected, "{x}");
        }
        for level in [0.5, 0.9, 0.95, 0.99_f64] {
            let cauchy = (core::f64::consts::FRAC_PI_2 * level).tan();
            assert!((student_half_width(level, 1.0) / cauchy - 1.0).abs() < 1e-9);
            let two = level * (2.0 / (1.0 - level * level)).sqrt();
            assert!((student_half_width(level, 2.0) / two - 1.0).abs() < 1e-9);
        }
        assert!((student_half_width(0.95, f64::INFINITY) - 1.959_964).abs() < 1e-5);
    }

    /// Values of printed tables.
    #[test]
    fn tables() {
        for (x, freedom, p) in [(3.841_459, 1.0, 0.05), (124.342_113, 100.0, 0.05), (23.209_251, 10.0, 0.01)] {
            assert!((chi_squared_tail(x, freedom) - p).abs() < 1e-7, "{x} {freedom}");
        }
        for (freedom, t) in [(5.0, 2.570_582), (30.0, 2.042_272), (120.0, 1.979_930)] {
            assert!((student_half_width(0.95, freedom) - t).abs() < 1e-5);
        }
    }

    #[test]
    fn nonsense_is_not_a_number_and_never_hangs() {
        assert!(chi_squared_tail(1.0, 0.0).is_nan() && f_tail(f64::NAN, 1.0, 1.0).is_nan());
        assert!(student_half_width(1.0, 3.0).is_nan() && student_half_width(0.95, f64::NAN).is_nan());
        assert_eq!(chi_squared_tail(f64::INFINITY, 3.0), 0.0);
    }
}
