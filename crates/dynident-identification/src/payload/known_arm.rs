//! An arm from an earlier identification, with its covariance.

use super::columns::LoadColumns;
use super::error::PayloadError;
use super::refit::Refit;
use crate::estimators::EstimationSettings;
use dynident_dynamics::Column;
use dynident_estimation::{Estimate, EstimationError, KnownColumns, LinearProblem, weighted_least_squares_with_known};
use dynident_model::terms::TorqueTerm;
use dynident_rows::RegressorModel;
use nalgebra::DMatrix;

/// Base parameters of an arm with their uncertainty.
#[derive(Clone, Debug)]
pub struct KnownArm {
    values: Vec<f64>,
    covariance: DMatrix<f64>,
    refit: Refit,
    cutoff_hz: Option<f64>,
}

impl KnownArm {
    /// Creates an arm with these base parameters and their covariance. `cutoff_hz` is the cut-off of the positions in
    /// the identification of the arm.
    ///
    /// # Errors
    /// The covariance has the wrong size.
    pub fn new(
        values: Vec<f64>,
        covariance: DMatrix<f64>,
        refit: Refit,
        cutoff_hz: Option<f64>,
    ) -> Result<Self, PayloadError> {
        if covariance.shape() != (values.len(), values.len()) {
            return Err(PayloadError::ArmCovariance { expected: values.len(), found: covariance.nrows() });
        }
        Ok(Self { values, covariance, refit, cutoff_hz })
    }

    /// Parameters of the arm that are fitted again together with the payload.
    pub fn refit(&self) -> Refit {
        self.refit
    }

    /// Cut-off of the positions in the earlier identification.
    pub fn cutoff_hz(&self) -> Option<f64> {
        self.cutoff_hz
    }

    pub(crate) fn held(&self, model: &RegressorModel, columns: &LoadColumns) -> Vec<usize> {
        let is_held = |column: &usize| match &model.layout().columns()[*column] {
            Column::Term(TorqueTerm::Offset(_)) => self.refit == Refit::Nothing,
            Column::Term(term) if term.is_joint_friction() => self.refit != Refit::Friction,
            _ => true,
        };
        (0..columns.base()).filter(is_held).collect()
    }

    /// Estimates payloads, offsets per log and refitted parameters, with the other parameters of the arm fixed.
    pub(crate) fn estimate(
        &self,
        model: &RegressorModel,
        columns: &LoadColumns,
        problem: &LinearProblem,
        settings: &EstimationSettings,
    ) -> Result<Estimate, EstimationError> {
        let held = self.held(model, columns);
        let known = KnownColumns {
            values: held.iter().map(|&column| self.values[column]).collect(),
            covariance: self.covariance.select_rows(&held).select_columns(&held),
            columns: held,
        };
        weighted_least_squares_with_known(problem, &known, &settings.weighted())
    }
}
