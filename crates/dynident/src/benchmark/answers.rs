//! How the benchmark calls each estimator.

use super::estimators::{Answer, Trial};
use super::periodic_model::PeriodicModel;
use super::pipeline;
use super::rows::Rows;
use super::scenario::{DURATION_S, HARMONICS, Record};
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimateStatus, EstimationError, InstrumentalSettings, LinearProblem,
    NoiseLevelSettings, OrdinarySettings, RankSettings, RobustSettings, RowWeight, SimultaneousProblem,
    SimultaneousSettings, TotalSettings, WeightedSettings, generalized_least_squares, instrumental_variables,
    noise_weighted_least_squares, ordinary_least_squares, robust_least_squares, simultaneous_least_squares,
    total_least_squares, weighted_least_squares,
};
use dynident_excitation::Motion;
use dynident_identification::consistent::{ConsistencySettings, consistent_parameters};
use dynident_model::sample::Random;
use dynident_recording::MotionBlock;

/// Samples in a row of the simultaneous fit: 125 rows a second, sixty times the highest harmonic of the motion.
const MEAN_OF: usize = 8;

pub(super) fn ordinary(problem: &LinearProblem) -> Result<Answer, EstimationError> {
    let settings = OrdinarySettings { covariance: CovarianceMethod::Jackknife, ..OrdinarySettings::default() };
    ordinary_least_squares(problem, &settings).map(answer)
}

pub(super) fn weighted(problem: &LinearProblem, covariance: CovarianceMethod) -> Result<Answer, EstimationError> {
    weighted_least_squares(problem, &WeightedSettings { covariance, ..WeightedSettings::default() }).map(answer)
}

/// The fit to the record filtered at twice the automatic cut-off.
pub(super) fn wide(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let cutoff_hz = 2.0 * trial.cutoff_hz;
    let motion = pipeline::differentiated(trial.record, cutoff_hz).map_err(|_| EstimationError::Empty)?;
    refitted(trial, &motion, cutoff_hz)
}

/// The fit with the regressor of the true motion: an oracle that separates what differentiation costs from what decimation costs.
pub(super) fn true_motion(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    refitted(trial, &with_motion(trial, &trial.scenario.motion), trial.cutoff_hz)
}

fn with_motion(trial: &Trial<'_>, motion: &Motion) -> MotionBlock {
    let Motion { q, dq, ddq, .. } = motion.clone();
    MotionBlock { q, dq, ddq, ..trial.motion.clone() }
}

fn refitted(trial: &Trial<'_>, motion: &MotionBlock, cutoff_hz: f64) -> Result<Answer, EstimationError> {
    weighted(&filtered(trial, motion, cutoff_hz)?.problem()?, CovarianceMethod::Jackknife)
}

fn filtered<'a>(trial: &Trial<'a>, motion: &MotionBlock, cutoff_hz: f64) -> Result<Rows<'a>, EstimationError> {
    // A pipeline that fails is a failure of the estimator; the figure does not need the reason.
    Rows::new(trial.scenario, motion, Some(cutoff_hz)).map_err(|_| EstimationError::Empty)
}

pub(super) fn robust(rows: &Rows<'_>, problem: &LinearProblem, weight: RowWeight) -> Result<Answer, EstimationError> {
    let settings =
        RobustSettings { weight, covariance: CovarianceMethod::Jackknife, tolerance: 1.0e-2, ..Default::default() };
    robust_least_squares(problem, &settings, |visit| rows.pass(visit)).map(|found| answer(found.estimate))
}

pub(super) fn noise_weighted(rows: &Rows<'_>, problem: &LinearProblem) -> Result<Answer, EstimationError> {
    let settings = NoiseLevelSettings { covariance: CovarianceMethod::Jackknife, ..NoiseLevelSettings::default() };
    noise_weighted_least_squares(problem, &settings, |visit| rows.pass(visit)).map(|found| answer(found.estimate))
}

pub(super) fn generalized(rows: &Rows<'_>) -> Result<Answer, EstimationError> {
    generalized_least_squares(&rows.cross()?, &WeightedSettings::default()).map(|found| answer(found.estimate))
}

/// The errors of columns are what noise as strong as the record's leaves of the regressor of the reference motion behind the same filter.
pub(super) fn total(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let reference = &trial.scenario.reference;
    let mut random = Random::new(1);
    let mut q = reference.q.clone();
    let fitted = &trial.shared.periodic(trial)?.motion;
    for joint in 0..reference.joints {
        let own = reference.of(joint);
        let square: f64 = own.clone().map(|k| (trial.record.q[k] - fitted.q[k]).powi(2)).sum();
        let std = (square / own.len() as f64).sqrt();
        q[own].iter_mut().for_each(|q| *q += std * random.normal());
    }
    let made = |q: Vec<f64>| {
        let record = Record { q, ..trial.record.clone() };
        pipeline::differentiated(&record, trial.cutoff_hz).map_err(|_| EstimationError::Empty)
    };
    let [clean, noisy] = [made(reference.q.clone())?, made(q)?];
    let column_std =
        filtered(trial, &noisy, trial.cutoff_hz)?.column_differences(&filtered(trial, &clean, trial.cutoff_hz)?);
    let white = WeightedSettings { covariance: CovarianceMethod::White, ..WeightedSettings::default() };
    let settings = TotalSettings {
        column_std,
        torque_std: weighted_least_squares(trial.problem, &white)?.joint_sigma,
        rank: RankSettings::default(),
        covariance: CovarianceMethod::Segments,
    };
    total_least_squares(trial.problem, &settings).map(|found| answer(found.estimate))
}

/// Instruments are the regressor of what the controller was told to do.
pub(super) fn instrumental(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let instruments = filtered(trial, &with_motion(trial, &trial.scenario.reference), trial.cutoff_hz)?;
    let problem = trial.rows.instrumented(&instruments)?;
    instrumental_variables(&problem, &InstrumentalSettings::default()).map(|found| answer(found.estimate))
}

/// The possible machine that fits all rows of the Fourier series' motion best. It comes without error bars.
pub(super) fn physical(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let problem = &trial.shared.periodic(trial)?.problem;
    let white = WeightedSettings { covariance: CovarianceMethod::White, ..WeightedSettings::default() };
    let sigma = weighted_least_squares(problem, &white)?.joint_sigma;
    let scenario = trial.scenario;
    let robot = scenario.parametric.clone().with_nominal(trial.prior.to_vec()).map_err(|_| EstimationError::Empty)?;
    let settings = ConsistencySettings::default();
    let fit = consistent_parameters(&robot, problem, &sigma, &settings).map_err(|_| EstimationError::Empty)?;
    Ok(Answer { values: fit.base_values, half_width_95: None, converged: true })
}

/// Motion and parameters together, from the Fourier fit of the positions and the pipeline's parameters on.
pub(super) fn simultaneous(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let white = WeightedSettings { covariance: CovarianceMethod::White, ..WeightedSettings::default() };
    let start = weighted_least_squares(trial.problem, &white)?;
    let record = (&trial.record.q[..], &trial.record.tau[..]);
    let mut model = PeriodicModel::new(trial.scenario, record, (DURATION_S, HARMONICS), MEAN_OF);
    let motion = model.fitted_motion().ok_or(EstimationError::Empty)?;
    let joints = trial.problem.joints();
    let channels: Vec<String> = ["position", "torque"]
        .into_iter()
        .flat_map(|what| joints.iter().map(move |joint| format!("{what} of {joint}")))
        .collect();
    // Whitened rows of a model that leaves nothing out: their own information is right.
    let settings = SimultaneousSettings { covariance: CovarianceMethod::White, ..SimultaneousSettings::default() };
    let names = trial.problem.columns().to_vec();
    let problem = SimultaneousProblem { names, channels, motion, parameters: start.values };
    simultaneous_least_squares(&problem, &settings, &mut model).map(|found| answer(found.estimate))
}

fn answer(estimate: Estimate) -> Answer {
    Answer {
        converged: estimate.status != EstimateStatus::IterationLimit,
        half_width_95: Some(estimate.half_width_95),
        values: estimate.values,
    }
}
