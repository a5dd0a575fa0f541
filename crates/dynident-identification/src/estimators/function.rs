//! A caller's own estimator: a rule on the rows as factors, which no file holds.

use super::{EstimatorError, TrainingRows};
use core::fmt::Debug;
use dynident_estimation::{Estimate, EstimatorRows, OwnEstimate, estimate_by};
use std::sync::Arc;

/// Values, and their covariance if it has one, of the rows of all joints.
pub trait EstimatorRule: Debug + Send + Sync {
    /// One value for each column of the rows.
    fn estimate(&self, rows: &EstimatorRows) -> OwnEstimate;
}

/// An [`EstimatorRule`] with its name; settings that were read from a file have the name alone.
#[derive(Clone, Debug)]
pub struct EstimatorFunction {
    /// What it is called in messages.
    pub name: String,
    /// The code.
    pub rule: Option<Arc<dyn EstimatorRule>>,
}

impl EstimatorFunction {
    /// Applies the rule ([`estimate_by`]).
    pub(super) fn estimate(&self, rows: &TrainingRows<'_>) -> Result<Estimate, EstimatorError> {
        let Some(rule) = &self.rule else {
            let message = format!(
                "the estimator is the function `{}`, and no file holds code: give it from the program that has it",
                self.name
            );
            return Err(EstimatorError::Requirement { method: "function", message });
        };
        Ok(estimate_by(rows.problem, &rows.settings.ordinary(), &self.name, |rows| rule.estimate(rows))?)
    }
}
