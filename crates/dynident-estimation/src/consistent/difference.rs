//! Test for a significant difference between the physically consistent parameters and the unconstrained estimate.

use super::PhysicalFit;
use crate::uncertainty::{Estimate, f_tail};
use serde::{Deserialize, Serialize};

const SIGNIFICANCE_LEVEL: f64 = 0.01;

/// Test of a [`PhysicalFit`] against the unconstrained estimate from which it was computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ConsistencyTest {
    /// Squared distance between fit and estimate per parameter, relative to the variance of the estimate (residuals
    /// correlated in time). About 1 or below if the true parameters are physically consistent.
    pub f: f64,
    /// Degrees of freedom of F: number of parameters, and number of time segments (or rows) used for the error bars.
    pub degrees_of_freedom: [f64; 2],
    /// Probability of at least this distance if the consistent set contains the true parameters.
    pub p_value: f64,
    /// Whether `p_value` is below 0.01: the data contradict the consistent set.
    pub is_significant: bool,
}

impl PhysicalFit {
    /// Tests whether the data contradict this consistent set. With `p` parameters, `d²` is the squared distance from
    /// the estimate ([`moved_sigma`] squared, for white residuals). δ is the mean ratio of the parameters' variances
    /// with and without correlation in time. The variances come from [`noise_std`](Estimate::noise_std), because both
    /// sets have the same lag and friction constants, whose errors do not affect the difference:
    ///
    /// ```text
    ///     F = d² / (p δ)   against   F(p, ν),   ν = time segments − 1 (of white residuals: rows − parameters)
    /// ```
    ///
    /// This is the first-order correction of Rao and Scott (Annals of Statistics 12 (1984) 46) in its F form (Thomas
    /// and Rao, JASA 82 (1987) 630). Because the consistent set lies on or inside its limits, the test is
    /// conservative. Returns `None` without parameters or degrees of freedom. `estimate` must contain the base
    /// parameters only.
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
            is_significant: p_value < SIGNIFICANCE_LEVEL,
        })
    }
}
