//! Error bars of an estimate, as a sum of terms for the sources of error.
//!
//! An estimator returns the covariance Σ of its values that follows from the residuals. Every other source of error k
//! contributes a covariance `F_k` of the same parameters. The sources are independent of each other and of the noise,
//! so the total covariance is `Σ + Σ_k F_k`, which [`ErrorBars::total`] computes.

use dynident_estimation::Estimate;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A source of error in the estimated parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum ErrorSource {
    /// Residuals of the fit: noise, and torque that the model does not explain.
    Noise,
    /// Remaining uncertainty of the time lag between motion and torque.
    Lag,
    /// Variation of the parameters between logs, for example of friction from day to day.
    LogVariation,
    /// Uncertainty of the nonlinear constants of selected friction.
    FrictionConstants,
    /// Uncertainty of the drive gains that the study states; only for payloads.
    Gains,
    /// Uncertainty of the parameters that are held at nominal values
    /// ([`ConditionalEstimate`](crate::ConditionalEstimate)).
    NominalValues,
}

#[derive(Clone, Debug)]
struct ErrorTerm {
    source: ErrorSource,
    /// Covariance of all parameters of the estimate, or only of the first ones.
    covariance: DMatrix<f64>,
}

/// Covariance terms of an estimate for the sources of error other than noise, in the order of the sources.
#[derive(Clone, Debug, Default)]
pub struct ErrorBars {
    terms: Vec<ErrorTerm>,
}

impl ErrorBars {
    /// Adds a source of error. `covariance` has the size of the estimate, or belongs to its first parameters only; rows
    /// of fixed parameters must be zero. `None` adds nothing.
    #[must_use]
    pub fn with(mut self, source: ErrorSource, covariance: Option<DMatrix<f64>>) -> Self {
        self.terms.extend(covariance.map(|covariance| ErrorTerm { source, covariance }));
        self.terms.sort_by_key(|term| term.source);
        self
    }

    /// The estimate with all terms included in its covariance, standard deviations and intervals
    /// ([`Estimate::with_further_error`]). `noise` is the estimate as the estimator returned it.
    pub fn total(&self, noise: &Estimate) -> Estimate {
        self.terms.iter().fold(noise.clone(), |sum, term| {
            let mut sum = sum.with_further_error(&term.covariance);
            // The consistent body of a payload is computed from the covariance with and without the uncertainty of
            // gains.
            if term.source == ErrorSource::Gains {
                sum.covariance_white += &term.covariance;
            }
            sum
        })
    }

    /// Standard deviation of a parameter by source, in the parameter's unit: first noise, then every other source that
    /// is not zero. The sum of the squares is the square of the standard deviation of [`total`](Self::total).
    pub fn std_by_source(&self, noise: &Estimate, column: usize) -> Vec<(ErrorSource, f64)> {
        let of_term = |term: &ErrorTerm| {
            let variance = if column < term.covariance.nrows() { term.covariance[(column, column)] } else { 0.0 };
            (term.source, variance.max(0.0).sqrt())
        };
        let further = self.terms.iter().map(of_term).filter(|(_, std)| *std > 0.0);
        core::iter::once((ErrorSource::Noise, noise.std[column])).chain(further).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_estimation::{
        LinearProblem, SegmentSettings, SegmentedFactor, WeightedSettings, weighted_least_squares,
    };

    /// A line through 60 points with deterministic residuals.
    fn line() -> Estimate {
        let mut factor = SegmentedFactor::new(2, SegmentSettings::default()).unwrap();
        let x: Vec<f64> = (0..60).map(|k| f64::from(k) / 10.0).collect();
        let y = x.iter().map(|x| 2.0 + 3.0 * x + 0.1 * f64::sin(7.0 * x));
        let panel: Vec<f64> = x.iter().map(|_| 1.0).chain(x.iter().copied()).chain(y).collect();
        factor.absorb(&panel, x.len()).unwrap();
        let names = ["offset", "slope"].map(str::to_owned).to_vec();
        let mut problem = LinearProblem::new(names, vec!["joint".to_owned()]);
        problem.add("log", 0, vec![0, 1], factor).unwrap();
        weighted_least_squares(&problem, &WeightedSettings::default()).unwrap()
    }

    #[test]
    fn terms_add_up_and_do_not_change_the_estimate() {
        let noise = line();
        let lag = DMatrix::from_row_slice(2, 2, &[4.0e-4, 0.0, 0.0, 0.0]);
        let logs = DMatrix::from_row_slice(1, 1, &[9.0e-4]);
        let bars = ErrorBars::default()
            .with(ErrorSource::Lag, Some(lag))
            .with(ErrorSource::FrictionConstants, None)
            .with(ErrorSource::LogVariation, Some(logs));
        let total = bars.total(&noise);
        assert_eq!(total.values, noise.values);
        assert!((total.covariance[(0, 0)] - noise.covariance[(0, 0)] - 13.0e-4).abs() < 1e-15);
        // The second column has no further error.
        assert_eq!((total.std[1], total.half_width_95[1]), (noise.std[1], noise.half_width_95[1]));
        let sources = bars.std_by_source(&noise, 0);
        let names: Vec<ErrorSource> = sources.iter().map(|(source, _)| *source).collect();
        assert_eq!(names, [ErrorSource::Noise, ErrorSource::Lag, ErrorSource::LogVariation]);
        let square: f64 = sources.iter().map(|(_, std)| std * std).sum();
        assert!((square.sqrt() - total.std[0]).abs() < 1e-12 * total.std[0], "{square} {}", total.std[0]);
        assert_eq!(bars.std_by_source(&noise, 1).len(), 1);
    }
}
