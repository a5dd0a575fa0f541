//! A custom estimator: a function of the caller that computes an estimate from the triangular factors of the rows.

use super::{EstimatorError, TrainingRows};
use core::fmt::Debug;
use dynident_estimation::{CustomEstimate, Estimate, EstimatorRows, estimate_by};
use std::sync::Arc;

/// Interface of a custom estimator. It computes values and an optional covariance from the rows of all joints.
pub trait EstimatorRule: Debug + Send + Sync {
    /// Returns one value for each column of the rows.
    fn estimate(&self, rows: &EstimatorRows) -> CustomEstimate;
}

/// A custom estimator ([`EstimatorRule`]) with its name. If the settings were read from a file, only the name is known.
#[derive(Clone, Debug)]
pub struct EstimatorFunction {
    /// Name in messages.
    pub name: String,
    /// The estimator; `None` if only its name is known.
    pub rule: Option<Arc<dyn EstimatorRule>>,
}

impl EstimatorFunction {
    pub(super) fn estimate(&self, rows: &TrainingRows<'_>) -> Result<Estimate, EstimatorError> {
        let Some(rule) = &self.rule else {
            let message = format!(
                "the estimator is the function `{}`, but no file holds code: give it from the program that has it",
                self.name
            );
            return Err(EstimatorError::Requirement { method: "function", message });
        };
        Ok(estimate_by(rows.problem, &rows.settings.ordinary(), &self.name, |rows| rule.estimate(rows))?)
    }
}
