//! Calls of the estimators.

use super::pipeline;
use super::rows::Rows;
use super::scenario::{RATE_HZ, Record, SERIES};
use super::trial::{Answer, Trial};
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimateStatus, EstimationError, InstrumentalSettings, RobustSettings, RowWeight,
    SimultaneousProblem, SimultaneousSettings, SplineMotionProblem, SplineMotionSettings, SplineRecord,
    instrumental_variables, robust_least_squares, simultaneous_least_squares, spline_motion_least_squares,
};
use dynident_excitation::Motion;
use dynident_identification::IdentificationError;
use dynident_identification::consistent::{ConsistencySettings, consistent_parameters};
use dynident_identification::estimators::{Estimator, PeriodicModel, PeriodicRecord, SplineTorque};
use dynident_recording::MotionBlock;

/// The estimate of `identify` for these rows.
pub(super) fn estimated(
    rows: &Rows<'_>,
    estimator: Estimator,
    covariance: CovarianceMethod,
) -> Result<Answer, IdentificationError> {
    rows.estimate(estimator, covariance).map(answer)
}

pub(super) fn weighted(rows: &Rows<'_>, covariance: CovarianceMethod) -> Result<Answer, IdentificationError> {
    estimated(rows, Estimator::Weighted, covariance)
}

/// Fit to the record with a filter of twice the automatic cut-off frequency.
pub(super) fn wide(trial: &Trial<'_>) -> Result<Answer, IdentificationError> {
    let cutoff_hz = 2.0 * trial.cutoff_hz;
    let motion = pipeline::differentiated(trial.record, cutoff_hz).map_err(|_| EstimationError::Empty)?;
    weighted(&filtered(trial, &motion, cutoff_hz)?, CovarianceMethod::Jackknife)
}

/// Fit with the regressor of the true motion: separates the error due to differentiation from that due to decimation.
pub(super) fn true_motion(trial: &Trial<'_>) -> Result<Answer, IdentificationError> {
    let rows = filtered(trial, &with_motion(trial, &trial.scenario.motion), trial.cutoff_hz)?;
    weighted(&rows, CovarianceMethod::Jackknife)
}

fn with_motion(trial: &Trial<'_>, motion: &Motion) -> MotionBlock {
    let Motion { q, dq, ddq, .. } = motion.clone();
    MotionBlock { q, dq, ddq, ..trial.motion.clone() }
}

fn filtered<'a>(trial: &Trial<'a>, motion: &MotionBlock, cutoff_hz: f64) -> Result<Rows<'a>, EstimationError> {
    // A failure of the pipeline is a failure of the estimator; its reason is not needed.
    Rows::new(trial.scenario, motion, Some(cutoff_hz)).map_err(|_| EstimationError::Empty)
}

/// Like `huber` and `tukey` of `identify`, on stored rows, with a tolerance of a hundredth of an error bar.
pub(super) fn robust(rows: &Rows<'_>, weight: RowWeight) -> Result<Answer, IdentificationError> {
    let settings =
        RobustSettings { weight, covariance: CovarianceMethod::Jackknife, tolerance: 1.0e-2, ..Default::default() };
    let found = robust_least_squares(&rows.problem, &settings, |visit| rows.pass(visit))?;
    Ok(answer(found.estimate))
}

/// Instrumental variables; the instruments are the regressor of the commanded motion.
pub(super) fn instrumental(trial: &Trial<'_>) -> Result<Answer, IdentificationError> {
    let instruments = filtered(trial, &with_motion(trial, &trial.scenario.reference), trial.cutoff_hz)?;
    let problem = trial.rows.instrumented(&instruments)?;
    Ok(answer(instrumental_variables(&problem, &InstrumentalSettings::default())?.estimate))
}

/// The best physically consistent parameters for all rows, with the motion from a Fourier series, without error bars.
pub(super) fn physical(trial: &Trial<'_>) -> Result<Answer, IdentificationError> {
    let rows = trial.shared.periodic(trial)?;
    let sigma = rows.estimate(Estimator::Weighted, CovarianceMethod::White)?.joint_sigma;
    let robot = trial.scenario.model.parametric.clone().with_nominal(trial.prior.to_vec())?;
    let settings = ConsistencySettings::default();
    let fit = consistent_parameters(&robot, &rows.problem, &sigma, &settings).map_err(|_| EstimationError::Empty)?;
    Ok(Answer { values: fit.base_values, half_width_95: None, converged: true })
}

/// Estimates motion and parameters together, starting from the Fourier fit of the positions and the pipeline's
/// parameters.
pub(super) fn simultaneous(trial: &Trial<'_>) -> Result<Answer, IdentificationError> {
    let start = trial.rows.estimate(Estimator::Weighted, CovarianceMethod::White)?;
    let record = PeriodicRecord { rate_hz: RATE_HZ, q: trial.record.q.clone(), tau: trial.record.tau.clone() };
    let mean_of = SERIES.samples_of_row(RATE_HZ);
    let mut model = PeriodicModel::new(&trial.scenario.model, &record, SERIES, mean_of);
    let motion = model.fitted_motion().ok_or(EstimationError::Empty)?;
    let joints = trial.rows.problem.joints();
    let channels: Vec<String> = ["position", "torque"]
        .into_iter()
        .flat_map(|what| joints.iter().map(move |joint| format!("{what} of {joint}")))
        .collect();
    // The model is complete, so the white-noise covariance is correct.
    let settings = SimultaneousSettings { covariance: CovarianceMethod::White, ..SimultaneousSettings::default() };
    let names = trial.rows.problem.columns().to_vec();
    let problem = SimultaneousProblem { names, channels, motion, parameters: start.values };
    Ok(answer(simultaneous_least_squares(&problem, &settings, &mut model)?.estimate))
}

/// Estimates motion and parameters together without known frequencies of the excitation, starting from the pipeline's
/// parameters.
pub(super) fn spline_motion(trial: &Trial<'_>) -> Result<Answer, IdentificationError> {
    let start = trial.rows.estimate(Estimator::Weighted, CovarianceMethod::White)?;
    let Record { q, tau, .. } = trial.record.clone();
    let names = trial.rows.problem.columns().to_vec();
    let mut held = vec![false; names.len()];
    start.rank.fixed.iter().for_each(|fixed| held[fixed.column] = true);
    let joints = trial.rows.problem.joints().to_vec();
    let records = vec![SplineRecord { log: 0, rate_hz: RATE_HZ, q, tau }];
    let problem = SplineMotionProblem { names, joints, records, parameters: start.values, held };
    let settings = SplineMotionSettings { covariance: CovarianceMethod::White, ..SplineMotionSettings::default() };
    let mut torque = SplineTorque::new(&trial.scenario.model, Vec::new());
    Ok(answer(spline_motion_least_squares(&problem, &settings, &mut torque)?.estimate))
}

fn answer(estimate: Estimate) -> Answer {
    Answer {
        converged: estimate.status != EstimateStatus::IterationLimit,
        half_width_95: Some(estimate.half_width_95),
        values: estimate.values,
    }
}
