//! Uncertainty of the exported bodies, averaged over explanations of the differences from the robot description.

use super::differences::Differences;
use super::parts::Part;
use dynident_estimation::changes::Explanation;
use dynident_estimation::{HALF_WIDTH_95, normal_below};
use nalgebra::{Cholesky, DMatrix, DVector};

/// Probability below which an explanation is omitted from the average.
const MIN_AVERAGED_PROBABILITY: f64 = 1e-3;

/// Number of bisections of the interval that contains a half-width. The error is then below 1e-9 of its upper limit.
const HALVINGS: usize = 30;

/// Probability distribution of the error of the exported bodies.
#[derive(Clone, Debug)]
pub struct BodyUncertainty {
    /// Mean square error `E[(π̂ − π)(π̂ − π)ᵀ]` of all inertial parameters π, ten for each body; π̂ are the exported
    /// values.
    pub mean_square: DMatrix<f64>,
    /// For each explanation its probability, and the mean and standard deviations of the error if the explanation is
    /// true.
    normals: Vec<(f64, DVector<f64>, DVector<f64>)>,
}

impl BodyUncertainty {
    /// Half-width of the 95 % interval of each parameter around its exported value, divided by 1.96. An improbable
    /// explanation with a large change has little effect on the half-width, although it dominates the mean square.
    pub fn std(&self) -> Vec<f64> {
        let count = self.mean_square.nrows();
        let of = |k: usize| self.normals.iter().map(move |(share, mean, std)| (*share, mean[k], std[k]));
        (0..count).map(|k| half_width_95(&of(k).collect::<Vec<_>>()) / HALF_WIDTH_95).collect()
    }
}

/// Half-width h of the interval around zero that contains 95 % of a mixture of normal distributions. Each has its share
/// p, mean μ and standard deviation σ: `Σ p (Φ((h − μ)/σ) − Φ((−h − μ)/σ)) = 0.95`.
fn half_width_95(normals: &[(f64, f64, f64)]) -> f64 {
    let inside = |h: f64| -> f64 {
        let of = |(share, mean, std): &(f64, f64, f64)| {
            // A parameter without uncertainty has a step at its value.
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

impl Differences {
    /// Distribution of the error of the exported bodies `π̂` (`written`), whose values in the robot description are
    /// `nominal`. If explanation e is true, the parameters are normally distributed with mean `μ_e` and covariance
    /// `Σ_e`:
    ///
    /// ```text
    /// Π_e = P_e + s_e² Σ U Uᵀ,   K = Π_e Eᵀ (E Π_e Eᵀ + c_e² C)⁻¹,   μ_e = π₀ + K d,   Σ_e = Π_e − K E Π_e
    /// E[(π̂ − π)(π̂ − π)ᵀ] = Σ_e p_e (Σ_e + (π̂ − μ_e)(π̂ − μ_e)ᵀ)
    /// ```
    ///
    /// P_e is the covariance of the differences of all bodies from the description ([`SPREADS`](super::SPREADS)). If
    /// the logs contradict the description, P_e and the error bars are larger. `None` if a matrix is singular.
    pub fn uncertainty(&self, written: &[f64], nominal: &[f64]) -> Option<BodyUncertainty> {
        let count = self.effects.ncols();
        let written = DVector::from_fn(count, |k, _| written[k] - nominal[k]);
        let (mut sum, mut total) = (DMatrix::zeros(count, count), 0.0);
        let mut normals = Vec::new();
        for own in self.explanations.iter().filter(|own| own.probability >= MIN_AVERAGED_PROBABILITY) {
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

    /// Mean and covariance of the difference of all bodies from the description if an explanation is true.
    fn posterior(&self, explanation: &Explanation) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut prior = self.spreads[explanation.covariance].clone();
        for (&group, scale) in explanation.groups.iter().zip(&explanation.scales) {
            let Part::Body(body) = self.parts[group] else { continue };
            let (first, unknowns) = (10 * body, &self.unknowns[group]);
            let own = unknowns * unknowns.transpose() * scale.powi(2);
            let mut block = prior.view_mut((first, first), (10, 10));
            block += own;
        }
        let square = explanation.error_factor * explanation.error_factor;
        let of_data = &self.effects * &prior;
        let total = &of_data * self.effects.transpose() + &self.covariance * square;
        // Each parameter is scaled, so that friction and inertia have similar sizes.
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
        // Far from zero, the half-width is the one-sided 95 % quantile: 1.6449 standard deviations above the mean.
        assert!((half_width_95(&[(1.0, 50.0, 2.0)]) - 53.2897).abs() < 1e-3);
        // 2 % of a wide distribution: the half-width is the quantile 2.165 for 0.95/0.98 of the narrow distribution;
        // the root mean square is 1.73.
        let mixed = half_width_95(&[(0.98, 0.0, 1.0), (0.02, 0.0, 1e3)]);
        assert!((mixed - 2.165).abs() < 0.01, "{mixed}");
        assert!(half_width_95(&[(1.0, 0.0, 0.0)]) < 1e-9);
        assert!((half_width_95(&[(1.0, -3.0, 0.0)]) - 3.0).abs() < 1e-6);
    }
}
