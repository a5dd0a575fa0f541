//! Whether the consistent set differs from the estimate by more than chance.

use super::PhysicalFit;
use crate::uncertainty::{Estimate, f_tail};
use serde::{Deserialize, Serialize};

/// Probability below which a difference counts as more than chance.
const LEVEL: f64 = 0.01;

/// The test of a [`PhysicalFit`] against the estimate that it was made from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ConsistencyTest {
    /// The squared distance per parameter, over the variance of the estimate as the residuals' correlation in time has
    /// it: about 1 or below where the difference is chance.
    pub f: f64,
    /// Parameters, and what the error bars were estimated from.
    pub degrees_of_freedom: [f64; 2],
    /// Probability of a distance as large if the consistent set were the truth.
    pub p_value: f64,
    /// Whether that is below 0.01: the logs contradict the consistent set.
    pub is_significant: bool,
}

impl PhysicalFit {
    /// Tests whether the logs contradict this set: the squared distance `d²` from the estimate ([`moved_sigma`]
    /// squared, white residuals) of `p` parameters, corrected for residuals that are correlated in time by the mean
    /// ratio `δ` of the parameters' variances with and without that ([`noise_std`](Estimate::noise_std): both sets
    /// have the same lag and the same constants of friction, whose errors tell nothing of their difference),
    ///
    /// ```text
    ///     F = d² / (p δ)   against   F(p, ν),   ν = time segments − 1 (of white residuals: rows − parameters)
    /// ```
    ///
    /// the first-order correction of Rao and Scott (Annals of Statistics 12 (1984) 46) in its F form (Thomas and Rao,
    /// JASA 82 (1987) 630). As the consistent set lies on or inside its limits, it rejects too seldom rather than
    /// too often. `None` without parameters or degrees of freedom. `estimate` is that of the base parameters alone.
    ///
    /// [`moved_sigma`]: PhysicalFit::moved_sigma
    pub fn difference(&self, estimate: &Estimate) -> Option<ConsistencyTest> {
        let white = estimate.covariance_white.diagonal();
        let ratios: Vec<f64> = (estimate.noise_std.iter().zip(white.iter()))
            .filter(|(std, white)| **std > 0.0 && **white > 0.0)
            .map(|(std, white)| std * std / white)
            .collect();
        let parameters = ratios.len() as f64;
        let inflation = ratios.iter().sum::<f64>() / parameters;
        let segments = estimate.clusters as f64;
        let rest = if segments > 1.0 { segments - 1.0 } else { estimate.degrees_of_freedom as f64 };
        let f = self.moved_sigma * self.moved_sigma / (parameters * inflation);
        let p_value = f_tail(f, parameters, rest);
        let known = f.is_finite() && p_value.is_finite();
        known.then_some(ConsistencyTest {
            f,
            degrees_of_freedom: [parameters, rest],
            p_value,
            is_significant: p_value < LEVEL,
        })
    }
}
