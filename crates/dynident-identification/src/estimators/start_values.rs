//! Start values of the fits to a simulated closed loop.

use super::{SimulationStart, TrainingRows};
use crate::consistent::{ConsistencyError, ConsistencySettings, consistent_parameters};
use dynident_estimation::Estimate;
use thiserror::Error;

#[derive(Debug, Error)]
pub(super) enum NoStartError {
    /// The estimator needs start values, and the physically consistent fit that gives them failed. The text has the
    /// cause.
    #[error("no physically consistent set is available as start: {0}")]
    Inconsistent(#[source] ConsistencyError),
    /// The estimator needs start values for all bodies, and the robot description has no `<inertial>` for these. Add it
    /// with rough values.
    #[error("the robot description cannot be the start, because it has no inertial of {}", .0.join(", "))]
    Undescribed(Vec<String>),
    /// Neither the fit nor the robot description can give start values for the estimator. Correct one of the two
    /// causes.
    #[error("{first}; {second}", first = .0, second = .1)]
    Both(Box<Self>, Box<Self>),
}

pub(super) fn start_values(
    rows: &TrainingRows<'_>,
    choice: SimulationStart,
    plain: &Estimate,
) -> Result<Vec<(Vec<f64>, &'static str)>, NoStartError> {
    let (model, problem) = (rows.model, rows.problem);
    let mut starts = Vec::new();
    let mut why = Vec::new();
    if choice != SimulationStart::Description {
        let default = ConsistencySettings::default();
        let settings = rows.consistency.unwrap_or(&default);
        match consistent_parameters(&model.parametric, problem, &plain.joint_sigma, settings) {
            Ok(fit) => starts.push((fit.base_values, "estimate")),
            Err(reason) => why.push(NoStartError::Inconsistent(reason)),
        }
    }
    if choice != SimulationStart::Estimate {
        if let Some(nominal) = model.parametric.nominal_base() {
            starts.push((nominal.to_vec(), "description"));
        } else {
            let unknown = model.model().bodies_without_prior().into_iter().map(str::to_owned);
            why.push(NoStartError::Undescribed(unknown.collect()));
        }
    }
    let both = |first, second| NoStartError::Both(Box::new(first), Box::new(second));
    match why.into_iter().reduce(both) {
        Some(error) if starts.is_empty() => Err(error),
        _ => Ok(starts),
    }
}
