//! Uncertainty of written bodies, averaged over explanations of the difference from the description.

use super::description::DescriptionDifferences;
use dynident_estimation::changes::Explanation;
use dynident_estimation::{HALF_WIDTH_95, normal_below};
use nalgebra::{Cholesky, DMatrix, DVector};

/// Probability below which an explanation is left out of the mean.
const MIN_PROBABILITY: f64 = 1e-3;

/// Halvings of the interval that contains a half width: the error is then below 1e-9 of its upper limit.
const HALVINGS: usize = 30;

/// Distribution of the error of written bodies.
#[derive(Clone, Debug)]
pub struct BodyUncertainty {
    /// `E[(π̂ − π)(π̂ − π)ᵀ]` of all parameters of the bodies, ten for each.
    pub mean_square: DMatrix<f64>,
    /// Probability, mean and standard deviations of the error under each explanation.
    normals: Vec<(f64, DVector<f64>, DVector<f64>)>,
}

impl BodyUncertainty {
    /// Half width of the 95 % interval of each parameter about its written value, divided by 1.96. An improbable
    /// explanation with a large change has little effect on it, but dominates the mean square.
    pub fn std(&self) -> Vec<f64> {
        let count = self.mean_square.nrows();
        let of = |k: usize| self.normals.iter().map(move |(share, mean, std)| (*share, mean[k], std[k]));
        (0..count).map(|k| half_width_95(&of(k).collect::<Vec<_>>()) / HALF_WIDTH_95).collect()
    }
}

/// Half width h of the interval about zero that contains 95 % of a mixture of normal distributions, each with its
/// share, mean and standard deviation: `Σ p (Φ((h − μ)/σ) − Φ((−h − μ)/σ)) = 0.95`.
fn half_width_95(normals: &[(f64, f64, f64)]) -> f64 {
    let inside = |h: f64| -> f64 {
        let of = |(share, mean, std): &(f64, f64, f64)| {
            // A parameter without uncertainty.
            if *std == 0.0 {
                if mean.abs() <= h { *share } else { 0.0 }
            } else {
                share * (normal_below((h - mean) / std) - normal_below((-h - mean) / std))
            }
        };
        normals.iter().map(of).sum()
    };
    let (mut low, mut high) = (0.0, normals.iter().map(|(_, mean, std)| mean.abs() + 2.0 * std).fold(0.0, f64::max));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if inside(middle) < 0.95 { low = middle } else { high = middle }
    }
    high
}

impl DescriptionDifferences {
    /// Distribution of the error of the written bodies `π̂`, whose nominal values are `nominal`. Under each
    /// explanation e the parameters are normally distributed with mean `μ_e` and covariance `Σ_e`:
    ///
    /// ```text
    /// Π_e = P_e + s_e² Σ U Uᵀ,   K = Π_e Eᵀ (E Π_e Eᵀ + c_e² C)⁻¹,   μ_e = π₀ + K d,   Σ_e = Π_e − K E Π_e
    /// E[(π̂ − π)(π̂ − π)ᵀ] = Σ_e p_e (Σ_e + (π̂ − μ_e)(π̂ − μ_e)ᵀ)
    /// ```
    ///
    /// P_e is the covariance of the differences of all bodies ([`SPREADS`](super::SPREADS)), so a description that the
    /// logs contradict widens the bars. `None` if a matrix is singular.
    pub fn uncertainty(&self, written: &[f64], nominal: &[f64]) -> Option<BodyUncertainty> {
        let count = self.effects.ncols();
        let written = DVector::from_fn(count, |k, _| written[k] - nominal[k]);
        let (mut sum, mut total) = (DMatrix::zeros(count, count), 0.0);
        let mut normals = Vec::new();
        for own in self.explanations.iter().filter(|own| own.probability >= MIN_PROBABILITY) {
            let (mean, covariance) = self.posterior(own)?;
            let gap = &written - mean;
            let std = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
            normals.push((own.probability, gap.clone(), std));
            sum += (covariance + &gap * gap.transpose()) * own.probability;
            total += own.probability;
        }
        for (share, ..) in &mut normals {
            *share /= total;
        }
        let mean_square = sum / total;
        mean_square.iter().all(|value| value.is_finite()).then_some(BodyUncertainty { mean_square, normals })
    }

    /// Mean and covariance of the difference of all bodies from the description under an explanation.
    fn posterior(&self, explanation: &Explanation) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut prior = self.spreads[explanation.covariance].clone();
        for (&group, scale) in explanation.groups.iter().zip(&explanation.scales) {
            let (first, unknowns) = (10 * self.bodies[group], &self.unknowns[group]);
            let own = unknowns * unknowns.transpose() * scale.powi(2);
            let mut block = prior.view_mut((first, first), (10, 10));
            block += own;
        }
        let square = explanation.error_factor * explanation.error_factor;
        let of_data = &self.effects * &prior;
        let total = &of_data * self.effects.transpose() + &self.covariance * square;
        // In units of each parameter, so that friction and inertia have the same size.
        let scale = total.diagonal().map(|value| value.max(f64::MIN_POSITIVE).sqrt().recip());
        let scales = DMatrix::from_diagonal(&scale);
        let factor = Cholesky::new(&scales * total * &scales)?;
        let gain = factor.solve(&(&scales * &of_data));
        let mean = gain.tr_mul(&(scales * &self.difference));
        let half = factor.l().solve_lower_triangular(&(DMatrix::from_diagonal(&scale) * of_data))?;
        Some((mean, prior - half.tr_mul(&half)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_widths_of_mixtures() {
        // One normal distribution: 1.96 standard deviations.
        assert!((half_width_95(&[(1.0, 0.0, 2.0)]) - 2.0 * HALF_WIDTH_95).abs() < 1e-5);
        // Far from zero: the one-sided 95 % quantile, 1.6449 standard deviations above the mean.
        assert!((half_width_95(&[(1.0, 50.0, 2.0)]) - 53.2897).abs() < 1e-3);
        // 2 % of a wide one: 0.95/0.98 of the narrow one, with its quantile 2.165; the root mean square is 1.73.
        let mixed = half_width_95(&[(0.98, 0.0, 1.0), (0.02, 0.0, 1e3)]);
        assert!((mixed - 2.165).abs() < 0.01, "{mixed}");
        assert!(half_width_95(&[(1.0, 0.0, 0.0)]) < 1e-9);
        assert!((half_width_95(&[(1.0, -3.0, 0.0)]) - 3.0).abs() < 1e-6);
    }
}
