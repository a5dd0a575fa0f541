//! Likelihood of the position errors of one joint, robust to time periods that the model does not explain.
//!
//! A contact, a push or an effect that is missing in the drive's law causes much larger errors in single periods than
//! in others. Period `p` contains `n_p` samples, of which `N_p = n_p / c` are independent (`c` neighbouring samples
//! have equal errors). Its errors `e` are normally distributed with variance `σ² λ_p`, and `1/λ_p` has a gamma
//! distribution with mean 1 and `ν` degrees of freedom. After integration over `λ_p`, minus twice the logarithm of the
//! density is
//!
//! ```text
//! Σ_p (ν + N_p) ln(1 + S_p / (c ν σ²)) + N_p ln σ²        S_p = Σ (e² + floor²)        w_p = (ν + N_p) / (ν + S_p / (c σ²))
//! ```
//!
//! a multivariate t distribution (Lange, Little and Taylor, JASA 84, 1989). The derivative by an error `e` is
//! `2 w_p e / (c σ²)`, so `w_p` is the weight of the period. The value of `σ²` with the largest likelihood is
//! `Σ w_p S_p / Σ n_p`.

use crate::normal::PeriodError;

/// Maximum number of iterations for the variance; each iteration increases the likelihood.
const MOST_ITERATIONS: usize = 200;
/// Relative change of the variance below which the iterations end.
const LEAST_CHANGE: f64 = 1e-9;

/// Likelihood of the errors of one joint, and weights for the fit.
#[derive(Clone, Debug)]
pub(crate) struct JointLikelihood {
    /// Minus twice the logarithm of the likelihood.
    pub(crate) cost: f64,
    /// Weight of the samples of each period: `w_p / (c σ²)`.
    pub(crate) weights: Vec<f64>,
    /// `w_p`: 1 for a period with the usual error, small for one that the model does not explain.
    pub(crate) relative: Vec<f64>,
    /// Decrease of the curvature of half of the cost by the moments `m_p = w_p / (c σ²) Σ g e` of the periods, because
    /// the weights decrease with the errors: `2 / (ν + N_p)`. The curvature is lower by `2 / (ν + N_p) m_p m_pᵀ`.
    pub(crate) decrease: Vec<f64>,
    /// Decrease of the curvature because the variance follows the errors. The curvature is lower by `b bᵀ`, where
    /// `b = Σ_p variance_part_p m_p`.
    pub(crate) variance_part: Vec<f64>,
    /// Root mean square error over all periods.
    pub(crate) error: f64,
}

/// Likelihood for the variance that maximises it. `correlated` is c, the number of neighbouring samples with equal
/// errors; `freedom` is ν, the degrees of freedom.
pub(crate) fn joint_likelihood(errors: &[PeriodError], floor: f64, correlated: f64, freedom: f64) -> JointLikelihood {
    let square = |own: &PeriodError| own.squares + own.count * floor * floor;
    let samples: f64 = errors.iter().map(|own| own.count).sum();
    let weight = |own: &PeriodError, variance: f64| {
        (freedom + own.count / correlated) / (freedom + square(own) / (correlated * variance))
    };
    let mut variance = errors.iter().map(square).sum::<f64>() / samples;
    for _ in 0..MOST_ITERATIONS {
        let next = errors.iter().map(|own| weight(own, variance) * square(own)).sum::<f64>() / samples;
        let change = (next - variance).abs();
        variance = next;
        if change <= LEAST_CHANGE * variance {
            break;
        }
    }
    let relative: Vec<f64> = errors.iter().map(|own| weight(own, variance)).collect();
    let of_period = |own: &PeriodError| {
        let independent = own.count / correlated;
        let outside = (square(own) / (correlated * freedom * variance)).ln_1p();
        (freedom + independent) * outside + independent * variance.ln()
    };
    let decrease: Vec<f64> = errors.iter().map(|own| 2.0 / (freedom + own.count / correlated)).collect();
    // Second derivative of half of the cost by the logarithm of the variance, and mixed derivatives by the logarithm
    // and by the coordinates.
    let of_weight = |(relative, decrease): (&f64, &f64)| 0.5 * freedom * relative * decrease;
    let mixed: Vec<f64> = relative.iter().zip(&decrease).map(of_weight).collect();
    let scaled = errors.iter().zip(&relative).map(|(own, relative)| relative * square(own) / (correlated * variance));
    let by_variance = 0.5 * scaled.zip(&mixed).map(|(scaled, mixed)| scaled * mixed).sum::<f64>();
    JointLikelihood {
        cost: errors.iter().map(of_period).sum(),
        weights: relative.iter().map(|relative| relative / (correlated * variance)).collect(),
        relative,
        decrease,
        variance_part: mixed.iter().map(|mixed| mixed / by_variance.sqrt()).collect(),
        error: (errors.iter().map(|own| own.squares).sum::<f64>() / samples).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(bad: f64) -> Vec<PeriodError> {
        let of = |k: usize| if k == 3 { bad } else { 1.0 + 0.2 * (k as f64).sin() };
        (0..20).map(|k| PeriodError { squares: 100.0 * of(k).powi(2), count: 100.0 }).collect()
    }

    #[test]
    fn a_bad_period_has_little_weight() {
        let found = joint_likelihood(&errors(30.0), 0.0, 25.0, 4.0);
        assert!(found.relative[3] < 0.01, "{:?}", found.relative);
        assert!(
            found.relative.iter().enumerate().all(|(k, w)| k == 3 || (0.7..1.4).contains(w)),
            "{:?}",
            found.relative
        );
    }

    /// With many degrees of freedom the cost is `n / c ln(mean square)` plus a constant.
    #[test]
    fn many_degrees_of_freedom_give_the_normal_distribution() {
        let cost = |bad: f64| joint_likelihood(&errors(bad), 0.0, 25.0, 1e9).cost;
        let mean = |bad: f64| errors(bad).iter().map(|own| own.squares).sum::<f64>() / 2000.0;
        let expected = 80.0 * (mean(3.0) / mean(1.0)).ln();
        assert!(((cost(3.0) - cost(1.0)) / expected - 1.0).abs() < 1e-4, "{} {expected}", cost(3.0) - cost(1.0));
    }

    /// The weight is the derivative of the cost by the squared error.
    #[test]
    fn weights_are_derivatives() {
        let at = |add: f64| {
            let mut errors = errors(5.0);
            errors[3].squares += add;
            joint_likelihood(&errors, 0.1, 25.0, 4.0)
        };
        let difference = (at(0.5).cost - at(-0.5).cost) / 1.0;
        assert!((difference / at(0.0).weights[3] - 1.0).abs() < 1e-4, "{difference} {}", at(0.0).weights[3]);
    }

    /// The curvature with the weights and the decreases is the second derivative of half of the cost by a coordinate
    /// that changes all errors.
    #[test]
    fn curvatures_are_second_derivatives() {
        let sample = |period: usize, k: usize| {
            let place = (100 * period + k) as f64;
            let scale = if period == 3 { 8.0 } else { 1.0 };
            (scale * ((0.37 * place).sin() + 0.4 * (0.11 * place).cos()), (0.011 * place).cos())
        };
        let sum = |period: usize, of: &dyn Fn(f64, f64) -> f64| {
            (0..100).map(|k| sample(period, k)).map(|(error, g)| of(error, g)).sum::<f64>()
        };
        let at = |z: f64| {
            let own = |period| PeriodError { squares: sum(period, &|error, g| (error - g * z).powi(2)), count: 100.0 };
            joint_likelihood(&(0..20).map(own).collect::<Vec<_>>(), 0.1, 25.0, 4.0)
        };
        let z = 0.3;
        let now = at(z);
        let moments: Vec<f64> = (0..20).map(|p| now.weights[p] * sum(p, &|error, g| g * (error - g * z))).collect();
        let constant_weights: f64 = (0..20).map(|p| now.weights[p] * sum(p, &|_, g| g * g)).sum();
        let decrease: f64 = now.decrease.iter().zip(&moments).map(|(own, moment)| own * moment * moment).sum();
        let by_variance: f64 = now.variance_part.iter().zip(&moments).map(|(own, moment)| own * moment).sum();
        let curvature = constant_weights - decrease - by_variance.powi(2);
        let h = 1e-3;
        let expected = 0.5 * (at(z + h).cost - 2.0 * now.cost + at(z - h).cost) / (h * h);
        assert!((curvature / expected - 1.0).abs() < 1e-3, "{curvature} {expected}");
        assert!(constant_weights > 1.05 * expected, "{constant_weights} {expected}");
    }
}
