//! A custom estimator: a rule of the caller that uses the factors of the rows.

use super::{EstimatorError, TrainingRows};
use core::fmt::Debug;
use dynident_estimation::{CustomEstimate, Estimate, EstimatorRows, estimate_by};
use std::sync::Arc;

/// A custom estimator on the rows of all joints. It returns values and an optional covariance.
pub trait EstimatorRule: Debug + Send + Sync {
    /// Returns one value for each column of the rows.
    fn estimate(&self, rows: &EstimatorRows) -> CustomEstimate;
}

/// An [`EstimatorRule`] with its name. Settings that were read from a file only have the name.
#[derive(Clone, Debug)]
pub struct EstimatorFunction {
    /// Name in messages.
    pub name: String,
    /// The rule.
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
