//! Triangular factors of the training recordings, and the model with their columns.

use crate::consistent::nominal_covariance;
use crate::error::IdentificationError;
use crate::estimators::{EstimationSettings, Estimator, TrainingRows};
use crate::examination::PriorAgreement;
use crate::friction::JointFriction;
use crate::log_factors::log_factors;
use crate::log_noise::{LogNoise, weighted_by_log};
use crate::payload::{DriveGain, Gains, LoadColumns, Payload, Refit, drive_gains, known_loads};
use crate::settings::{GainChoice, IdentificationSettings};
use dynident_dynamics::Column;
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimationError, LinearProblem, OrdinarySettings, SegmentedFactor, Unexcited,
    WeightedValues, ordinary_least_squares, unexcited_columns, weighted_least_squares, weighted_values,
};
use dynident_recording::{MotionBlock, MotionSettings};
use dynident_rows::{
    Execution, LogError, LogStatistics, Logs, MotionRecord, ParallelFilterSettings, Recording, RegressorModel,
    RowSettings, noise_factors,
};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

pub(crate) use crate::log_factors::LogFactors;

/// Maximum number of passes for load-dependent friction.
const MAX_LOAD_PASSES: usize = 6;
/// Change of the rows between two passes, relative to the torque, below which the load has converged.
const MAX_RELATIVE_LOAD_CHANGE: f64 = 1e-3;

/// Standard deviation with which fixed values are held, relative to the largest of them.
const HELD_TOLERANCE: f64 = 1e-6;

/// Triangular factors of the training recordings, and the model with their columns.
#[derive(Clone, Debug)]
pub struct Training {
    /// The robot model with the selected friction.
    pub model: RegressorModel,
    /// Recordings, in the order of the problem's logs.
    pub logs: Vec<LogFactors>,
    /// Joints of the problem: all joints, unless time windows leave a joint without rows.
    pub joints: Vec<usize>,
    /// All rows, with one common set of columns.
    pub problem: LinearProblem,
    /// Columns in addition to the base parameters: payloads and offsets of single logs.
    pub columns: LoadColumns,
    /// Result of the selection of friction, by joint; empty if friction was stated.
    pub friction_choice: Vec<JointFriction>,
    /// Estimate together with unknown torque gains, and the gains; `None` unless requested.
    pub gains: Option<(Estimate, Vec<DriveGain>)>,
    /// Time for reading logs, and time for intermediate estimates, s.
    pub timings_s: [f64; 2],
}

impl Training {
    /// Input of the estimators: the recordings `training`, as triangular factors and as logs.
    pub fn rows<'a>(
        &'a self,
        logs: &'a Logs<'a>,
        settings: &'a IdentificationSettings,
        training: &'a [usize],
    ) -> TrainingRows<'a> {
        let (settings, consistency) = (&settings.estimation, settings.consistency.as_ref());
        TrainingRows { logs, model: &self.model, training, problem: &self.problem, settings, consistency }
    }
}

/// Computes the triangular factors of the recordings `training`. Load-dependent friction needs several passes, each
/// with the load of the previous fit. If `known_arm` is given, the arm's parameters are fixed, except those that it
/// states to be fitted again. The friction terms are those of the model; call
/// [`choose_friction`](crate::choose_friction) before to select them.
///
/// # Errors
/// Recordings cannot be read, payloads and gains contradict each other, or rows do not determine an estimate.
pub fn training_rows(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    model: RegressorModel,
    training: &[usize],
    payloads: &[Payload],
    known_arm: Option<Refit>,
) -> Result<Training, IdentificationError> {
    let job = TrainingPasses { logs, settings, training, payloads, known_arm };
    let mut fitted = job.with_gains(job.fit(model)?)?;
    if settings.log_noise == LogNoise::Own && fitted.gains.is_none() {
        fitted.problem = weighted_by_log(&settings.estimation, fitted.problem)?;
    }
    // The nominal model cannot be compared with torque in an unknown unit.
    if let Some(nominal) = fitted.model.parametric.nominal_base().filter(|_| settings.gains == GainChoice::Stated) {
        for log in &mut fitted.logs {
            log.nominal_agreement =
                Some(PriorAgreement::of_factors(&fitted.model, &log.factors, nominal, &settings.examination));
        }
    }
    Ok(fitted)
}

/// Fits the stated terms to pieces of a motion by weighted least squares (by ordinary least squares if the study
/// requires it) and returns only the values.
pub(crate) fn plain_fit(
    model: RegressorModel,
    pieces: Vec<MotionBlock>,
    filter: &ParallelFilterSettings,
    settings: &IdentificationSettings,
    execution: Execution<'_>,
) -> Result<Vec<f64>, IdentificationError> {
    let recordings: Vec<Recording> = pieces.into_iter().map(of_piece).collect();
    let all: Vec<usize> = (0..recordings.len()).collect();
    let rows = RowSettings { motion: &MotionSettings::default(), parallel_filter: filter };
    let logs = Logs::new(model.model(), &recordings, rows, &[], None, execution)?;
    let job = TrainingPasses { logs: &logs, settings, training: &all, payloads: &[], known_arm: None };
    let rows = job.rows_once(model)?;
    Ok(plain_values(&settings.estimation, &rows.problem)?.values)
}

fn of_piece(motion: MotionBlock) -> Recording {
    let label = "a piece of a motion".to_owned();
    let record =
        MotionRecord { label: label.clone(), motion: Arc::new(motion), usable: Vec::new(), windows: None, raw: None };
    Recording::of_motion(label, record)
}

pub(crate) struct TrainingPasses<'a> {
    pub(crate) logs: &'a Logs<'a>,
    pub(crate) settings: &'a IdentificationSettings,
    pub(crate) training: &'a [usize],
    pub(crate) payloads: &'a [Payload],
    pub(crate) known_arm: Option<Refit>,
}

impl<'a> TrainingPasses<'a> {
    /// Prepares passes over these training logs, without a known arm.
    pub(crate) fn of_logs(
        logs: &'a Logs<'a>,
        settings: &'a IdentificationSettings,
        training: &'a [usize],
        payloads: &'a [Payload],
    ) -> Self {
        Self { logs, settings, training, payloads, known_arm: None }
    }

    /// Computes the rows of this model. If friction depends on an unknown load, the pass is repeated with the load of
    /// the previous fit until the load converges.
    pub(crate) fn fit(&self, model: RegressorModel) -> Result<Training, IdentificationError> {
        let load_is_known = model.load_parameters.is_some();
        let mut found = self.rows_once(model)?;
        if load_is_known || !found.model.needs_load() {
            return Ok(found);
        }
        for _ in 0..MAX_LOAD_PASSES {
            let started = Instant::now();
            let plain = plain_values(&self.settings.estimation, &found.problem)?;
            let estimated_s = started.elapsed().as_secs_f64();
            let with_load = found.model.clone().with_load_of_estimate(&found.model, &plain.values);
            let has_converged = has_load_converged(&found, &with_load);
            let [read_s, chosen_s] = found.timings_s;
            if has_converged {
                found.timings_s[1] += estimated_s;
                break;
            }
            found = self.rows_once(with_load)?;
            found.timings_s[0] += read_s;
            found.timings_s[1] += chosen_s + estimated_s;
        }
        Ok(found)
    }

    /// Converts the torque to newton metres if gains are unknown.
    pub(crate) fn with_gains(&self, mut rows: Training) -> Result<Training, IdentificationError> {
        if self.settings.gains == GainChoice::Unknown {
            let known = known_loads(&rows.columns, self.training)?;
            let Gains { of_joints, estimate, problem } = drive_gains(&self.settings.estimation, &known, &rows.problem)?;
            rows.model.torque_gains = of_joints.iter().map(|gain| gain.gain).collect();
            rows.problem = problem;
            rows.gains = Some((estimate, of_joints));
        }
        Ok(rows)
    }

    /// Rows with the columns of this model, from one pass.
    pub(crate) fn rows_once(&self, model: RegressorModel) -> Result<Training, IdentificationError> {
        let columns = self.columns(&model)?;
        let started = Instant::now();
        let logs = self.factors(&model)?;
        let read_s = started.elapsed().as_secs_f64();
        let mut rows = self.assembled(model, columns, logs)?;
        rows.timings_s[0] += read_s;
        Ok(rows)
    }

    /// Triangular factors of the recordings, with the contribution of position noise.
    pub(crate) fn factors(&self, model: &RegressorModel) -> Result<Vec<LogFactors>, LogError> {
        let mut logs = self.read(model)?;
        self.add_noise(model, &mut logs)?;
        Ok(logs)
    }

    /// Rows from triangular factors that were computed elsewhere.
    pub(crate) fn of_factors(
        &self,
        model: RegressorModel,
        logs: Vec<LogFactors>,
    ) -> Result<Training, IdentificationError> {
        let columns = self.columns(&model)?;
        let mut rows = self.assembled(model, columns, logs)?;
        if self.settings.log_noise == LogNoise::Own {
            rows.problem = weighted_by_log(&self.settings.estimation, rows.problem)?;
        }
        Ok(rows)
    }

    fn assembled(
        &self,
        model: RegressorModel,
        columns: LoadColumns,
        logs: Vec<LogFactors>,
    ) -> Result<Training, IdentificationError> {
        let started = Instant::now();
        let problem = self.problem(&model, &columns, &logs)?;
        let timings_s = [0.0, started.elapsed().as_secs_f64()];
        let joints = joints_with_rows(&logs, model.dof());
        Ok(Training { model, joints, logs, problem, columns, friction_choice: Vec::new(), gains: None, timings_s })
    }

    pub(crate) fn columns(&self, model: &RegressorModel) -> Result<LoadColumns, IdentificationError> {
        Ok(LoadColumns::new(self.settings, self.logs.recordings, self.payloads, model, self.known_arm)?)
    }

    /// Reads the recordings in parallel, or a single recording with a second thread that reads the file. The results
    /// keep the order of the recordings.
    pub(crate) fn read(&self, model: &RegressorModel) -> Result<Vec<LogFactors>, LogError> {
        self.logs.begin("logs to factors", self.training);
        let alone = self.training.len() == 1;
        let one = |index: &usize| log_factors(self.logs, self.settings, model, *index, alone);
        let factors = self.logs.execution.try_map(self.training, one);
        self.logs.end();
        factors
    }

    /// Adds the contribution of position noise for these columns.
    fn add_noise(&self, model: &RegressorModel, logs: &mut [LogFactors]) -> Result<(), LogError> {
        let one = |log: &mut LogFactors| {
            let LogStatistics { report, filtered_rows, .. } = &log.statistics;
            log.noise = noise_factors(&self.logs.pass(model, log.index), model, report.as_ref(), *filtered_rows)?;
            Ok(())
        };
        if self.logs.execution.parallel() {
            logs.par_iter_mut().try_for_each(one)
        } else {
            logs.iter_mut().try_for_each(one)
        }
    }

    fn problem(
        &self,
        model: &RegressorModel,
        columns: &LoadColumns,
        logs: &[LogFactors],
    ) -> Result<LinearProblem, EstimationError> {
        let problem = self.stated_problem(model, columns, logs)?;
        // With a known arm, a parameter of the arm must not absorb the payload.
        if self.known_arm.is_some() || logs.iter().all(|log| log.noise.is_none()) {
            return Ok(problem);
        }
        let noise = self.rows_of(model, columns, logs, |log| log.noise.as_ref())?;
        let unexcited = self.unexcited(model, &problem, &noise)?;
        problem.with_unexcited(unexcited)
    }

    /// All rows, with prior knowledge of the parameters.
    pub(crate) fn stated_problem(
        &self,
        model: &RegressorModel,
        columns: &LoadColumns,
        logs: &[LogFactors],
    ) -> Result<LinearProblem, EstimationError> {
        let mut problem = self.rows_of(model, columns, logs, |log| Some(&log.factors))?;
        if let Some(nominal) = model.parametric.nominal_base() {
            let mut nominal = nominal.to_vec();
            nominal.resize(columns.count(), 0.0);
            problem = problem.with_fallback(nominal)?;
        }
        hold(problem, &self.settings.estimation.held)
    }

    fn rows_of<'l>(
        &self,
        model: &RegressorModel,
        columns: &LoadColumns,
        logs: &'l [LogFactors],
        factors: impl Fn(&'l LogFactors) -> Option<&'l Vec<SegmentedFactor>>,
    ) -> Result<LinearProblem, EstimationError> {
        let joints = joints_with_rows(logs, model.dof());
        let all_names = model.joint_names();
        let names = joints.iter().map(|&joint| all_names[joint].clone()).collect();
        let mut problem = LinearProblem::new(columns.symbols(model), names);
        let keep_known = self.settings.gains == GainChoice::Unknown && model.torque_gains.is_empty();
        for log in logs {
            // Two recordings can have the same name, so the index is part of the name.
            let name = format!("{} ({})", self.logs.recordings[log.index].name, log.index + 1);
            let Some(factors) = factors(log) else { continue };
            for (place, &joint) in joints.iter().enumerate() {
                let (own, factor) = (model.layout().joint_columns(joint), &factors[joint]);
                if factor.rows() > 0 {
                    columns.add(&mut problem, (log.index, &name), place, (own, factor), keep_known)?;
                }
            }
        }
        Ok(problem)
    }

    /// Columns that contain only noise or combinations of other columns, compared with the noise of each joint in a
    /// first fit.
    fn unexcited(
        &self,
        model: &RegressorModel,
        problem: &LinearProblem,
        noise: &LinearProblem,
    ) -> Result<Unexcited, EstimationError> {
        let weights = match weighted_values(problem, &self.settings.estimation.weighted()) {
            Ok(first) => first.joint_sigma.iter().map(|sigma| sigma.recip()).collect(),
            // If this fit fails, the estimate itself will report the error.
            Err(_) => vec![1.0; problem.joints().len()],
        };
        let robot = &model.parametric;
        let scales = robot.nominal_base().filter(|nominal| nominal.len() == robot.base().count()).map(|_| {
            let knowledge = self.settings.consistency.clone().unwrap_or_default();
            let covariance = nominal_covariance(robot, problem, &knowledge);
            let mut scales: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.sqrt()).collect();
            scales.resize(problem.columns().len(), 0.0);
            scales
        });
        unexcited_columns(problem, noise, &weights, scales.as_deref())
    }
}

/// Whether the load in `next` changes the rows only little compared with the current load.
fn has_load_converged(found: &Training, next: &RegressorModel) -> bool {
    let (Some(before), Some(after)) = (&found.model.load_parameters, &next.load_parameters) else { return false };
    let (mut change, mut torque) = (0.0, 0.0);
    for log in &found.logs {
        for (joint, factor) in log.factors.iter().enumerate() {
            let total = factor.total();
            let columns = found.model.layout().joint_columns(joint);
            let of_bodies = |&column: &usize| match found.model.layout().columns()[column] {
                Column::Term(_) => 0.0,
                Column::Body { .. } => after[column] - before[column],
            };
            let difference = DVector::from_iterator(columns.len(), columns.iter().map(of_bodies));
            change += (total.regressor_triangle() * difference).norm_squared();
            torque += total.torque_norm().powi(2);
        }
    }
    change <= MAX_RELATIVE_LOAD_CHANGE * MAX_RELATIVE_LOAD_CHANGE * torque
}

/// Joints that have rows in some recording; time windows can leave a joint without rows.
fn joints_with_rows(logs: &[LogFactors], dof: usize) -> Vec<usize> {
    (0..dof).filter(|&joint| logs.iter().any(|log| log.factors[joint].rows() > 0)).collect()
}

/// Fixes columns at given values, by a prior that is far narrower than any data.
fn hold(problem: LinearProblem, held: &[(usize, f64)]) -> Result<LinearProblem, EstimationError> {
    if held.is_empty() {
        return Ok(problem);
    }
    let largest = held.iter().fold(0.0_f64, |most, (_, value)| most.max(value.abs()));
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let count = problem.columns().len();
    let mut mean = vec![0.0; count];
    let mut information = DMatrix::zeros(held.len(), count);
    for (row, &(column, value)) in held.iter().enumerate() {
        mean[column] = value;
        information[(row, column)] = 1.0 / (HELD_TOLERANCE * largest);
    }
    problem.with_prior(mean, information)
}

/// Parameter values and joint noise, for the selection of friction and for loads.
pub(crate) fn plain_values(
    settings: &EstimationSettings,
    problem: &LinearProblem,
) -> Result<WeightedValues, EstimationError> {
    if !matches!(settings.estimator, Estimator::Ordinary) {
        return weighted_values(problem, &settings.weighted());
    }
    let white = OrdinarySettings { covariance: CovarianceMethod::White, ..settings.ordinary() };
    let Estimate { values, joint_sigma, std: white_std, iterations, .. } = ordinary_least_squares(problem, &white)?;
    Ok(WeightedValues { values, joint_sigma, white_std, iterations, converged: true })
}

/// The complete estimate with these values.
pub(crate) fn plain_estimate(
    settings: &EstimationSettings,
    problem: &LinearProblem,
) -> Result<Estimate, EstimationError> {
    match settings.estimator {
        Estimator::Ordinary => ordinary_least_squares(problem, &settings.ordinary()),
        _ => weighted_least_squares(problem, &settings.weighted()),
    }
}
