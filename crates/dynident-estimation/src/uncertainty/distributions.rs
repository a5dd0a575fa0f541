//! Student's t, Fisher's F and chi-squared distributions.
//!
//! The incomplete beta and gamma functions come from `statrs`. The inverse of its Student's t distribution loses
//! digits above a thousand degrees of freedom (decision 0005), so an expansion about the normal distribution is used
//! there.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
use statrs::function::{beta::checked_beta_reg, gamma::checked_gamma_ur};

/// Half-width of the 95 % interval of a normal variable, in standard deviations.
pub const HALF_WIDTH_95: f64 = 1.959_963_984_540_054;

/// Probability that a standard normal variable is below `value`.
pub fn normal_below(value: f64) -> f64 {
    Normal::standard().cdf(value)
}

/// Probability that a chi-squared variable with `degrees_of_freedom` degrees of freedom exceeds `value`; NaN for a NaN
/// or degrees of freedom that are not positive.
pub fn chi_squared_tail(value: f64, degrees_of_freedom: f64) -> f64 {
    if value.is_nan() || degrees_of_freedom.is_nan() || degrees_of_freedom <= 0.0 {
        return f64::NAN;
    }
    if value <= 0.0 {
        return 1.0;
    }
    // The limit keeps an infinite value valid.
    checked_gamma_ur(0.5 * degrees_of_freedom, (0.5 * value).min(1.0e300)).unwrap_or(f64::NAN)
}

/// Probability that an F variable with `numerator` and `denominator` degrees of freedom exceeds `value`.
pub(crate) fn f_tail(value: f64, numerator: f64, denominator: f64) -> f64 {
    if value.is_nan() || !(numerator > 0.0 && denominator > 0.0) {
        return f64::NAN;
    }
    let share = denominator / (denominator + numerator * value.max(0.0));
    checked_beta_reg(0.5 * denominator, 0.5 * numerator, share).unwrap_or(f64::NAN)
}

/// The t for which a Student variable with `degrees_of_freedom` degrees of freedom (not necessarily whole) lies
/// between -t and t with probability `level`. Degrees of freedom are clamped to 1 to 1e6 (within 1e-6 of the normal
/// distribution). NaN unless `level` is between 0 and 1.
///
/// ```
/// let t = dynident_estimation::student_half_width(0.95, 10.0);
/// assert!((t - 2.228_139).abs() < 1e-6);
/// ```
#[doc(alias("student t", "quantile"))]
pub fn student_half_width(level: f64, degrees_of_freedom: f64) -> f64 {
    if !(level > 0.0 && level < 1.0) || degrees_of_freedom.is_nan() {
        return f64::NAN;
    }
    let (degrees_of_freedom, below) = (degrees_of_freedom.clamp(1.0, 1.0e6), 0.5 + 0.5 * level);
    if degrees_of_freedom < 500.0 {
        return StudentsT::new(0.0, 1.0, degrees_of_freedom).map_or(f64::NAN, |student| student.inverse_cdf(below));
    }
    // Abramowitz and Stegun 26.7.5; the first omitted term is below 1e-13 at 95 %.
    let x = Normal::standard().inverse_cdf(below);
    let y = x * x;
    let terms = [
        x,
        x * (y + 1.0) / 4.0,
        x * ((5.0 * y + 16.0) * y + 3.0) / 96.0,
        x * (((3.0 * y + 19.0) * y + 17.0) * y - 15.0) / 384.0,
        x * ((((79.0 * y + 776.0) * y + 1482.0) * y - 1920.0) * y - 945.0) / 92160.0,
    ];
    terms.iter().rev().fold(0.0, |sum, term| sum / degrees_of_freedom + term)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chi-squared with 2 degrees is exponential; t with 1 is Cauchy's, with 2 has an algebraic tail; F(2, n) has a
    /// power tail.
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

    #[test]
    fn tables() {
        for (x, degrees_of_freedom, p) in [(3.841_459, 1.0, 0.05), (124.342_113, 100.0, 0.05), (23.209_251, 10.0, 0.01)]
        {
            assert!((chi_squared_tail(x, degrees_of_freedom) - p).abs() < 1e-7, "{x} {degrees_of_freedom}");
        }
        for (degrees_of_freedom, t) in [(5.0, 2.570_582), (30.0, 2.042_272), (120.0, 1.979_930)] {
            assert!((student_half_width(0.95, degrees_of_freedom) - t).abs() < 1e-5);
        }
    }

    /// SciPy 1.17.1, `t.ppf(0.5 + level / 2, degrees_of_freedom)`, on both sides of the start of the expansion.
    #[test]
    fn half_widths_of_many_degrees() {
        for (level, degrees_of_freedom, t) in [
            (0.95, 21.5, 2.076_672_956_261_701_7),
            (0.95, 499.0, 1.964_729_390_987_688_6),
            (0.95, 501.0, 1.964_710_322_175_482_7),
            (0.90, 501.0, 1.647_900_748_316_431_4),
            (0.99, 501.0, 2.585_678_066_690_027_4),
            (0.95, 1.0e4, 1.960_201_239_890_626),
            (0.50, 1.0e5, 0.674_492_203_553_292),
        ] {
            assert!(
                (student_half_width(level, degrees_of_freedom) / t - 1.0).abs() < 1e-11,
                "{level} {degrees_of_freedom}"
            );
        }
    }

    #[test]
    fn invalid_arguments_give_nan_and_terminate() {
        assert!(chi_squared_tail(1.0, 0.0).is_nan() && f_tail(f64::NAN, 1.0, 1.0).is_nan());
        assert!(student_half_width(1.0, 3.0).is_nan() && student_half_width(0.95, f64::NAN).is_nan());
        assert!(chi_squared_tail(f64::NAN, 1.0).is_nan() && student_half_width(0.95, f64::INFINITY).is_finite());
        assert_eq!((chi_squared_tail(f64::INFINITY, 3.0), chi_squared_tail(0.0, 3.0)), (0.0, 1.0));
        assert_eq!((f_tail(f64::INFINITY, 3.0, 5.0), f_tail(0.0, 3.0, 5.0)), (0.0, 1.0));
    }
}
