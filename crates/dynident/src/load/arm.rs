//! An arm that is known from an earlier identification, with its covariance.

use crate::error::Error;
use crate::load::columns::LoadColumns;
use crate::machine::Machine;
use crate::study::{ArmSection, EstimatorSection, Refit};
use crate::validate::{StoredModel, same_machine};
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, EstimationError, KnownColumns, LinearProblem, WeightedSettings, weighted_least_squares_with_known,
};
use dynident_model::laws::Law;
use nalgebra::DMatrix;
use std::path::Path;

/// Base parameters of an arm, and how well they are known.
pub(crate) struct KnownArm {
    values: Vec<f64>,
    covariance: DMatrix<f64>,
}

impl KnownArm {
    /// The arm of an earlier result, which must be this machine's.
    ///
    /// # Errors
    /// [`Error::Result`] if it is another machine's, or has no usable covariance.
    pub(crate) fn new(path: &Path, stored: &StoredModel, machine: &Machine) -> Result<Self, Error> {
        let wrong = |message: &str| Error::Result { path: path.to_owned(), message: message.to_owned() };
        let values = same_machine(path, stored, machine)?;
        let rows = &stored.base_parameter_covariance;
        let n = values.len();
        if rows.len() != n || rows.iter().any(|row| row.len() != n || row.iter().any(|value| !value.is_finite())) {
            return Err(wrong(
                "base_parameter_covariance is not one finite number for each pair of base parameters: identify the arm again with this version",
            ));
        }
        if stored.drive_gains.is_some() {
            return Err(wrong(
                "the arm was found with unknown gains: write them as torque.scale of the format and identify it again",
            ));
        }
        Ok(Self { values, covariance: DMatrix::from_fn(n, n, |row, column| rows[row][column]) })
    }

    /// Payloads, offsets per log and what is fitted again, with the arm held.
    pub(crate) fn estimate(
        &self,
        section: &ArmSection,
        machine: &Machine,
        columns: &LoadColumns,
        problem: &LinearProblem,
        estimator: &EstimatorSection,
    ) -> Result<Estimate, EstimationError> {
        let held: Vec<usize> = (0..columns.base())
            .filter(|&column| match &machine.layout().columns()[column] {
                Column::Law(Law::Offset(_)) => section.refit == Refit::Nothing,
                Column::Law(law) if law.is_joint_friction() => section.refit != Refit::Friction,
                _ => true,
            })
            .collect();
        let known = KnownColumns {
            values: held.iter().map(|&column| self.values[column]).collect(),
            covariance: self.covariance.select_rows(&held).select_columns(&held),
            columns: held,
        };
        let settings =
            WeightedSettings { rank: estimator.rank, covariance: estimator.covariance, ..WeightedSettings::default() };
        weighted_least_squares_with_known(problem, &known, &settings)
    }
}
