//! Reduction of logs to triangular factors, for fits to many logs that may be stored at different places.
//!
//! [`reduce`] converts each log to triangular factors. [`identify_reduced`] fits the model to these factors only,
//! with the same parameters as [`identify`](crate::identify()) from the logs. The samples are not read again, so the
//! settings must state cut-off, drive inertia and friction, and the estimator must be least squares.

use crate::bars::{ErrorBars, ErrorSource};
use crate::between_logs::variation_of_logs;
use crate::error::IdentificationError;
use crate::error::ReduceError;
use crate::estimators::{Estimation, Estimator, estimate};
use crate::examination::{friction_signs, sign_evidence};
use crate::identify::Identification;
use crate::lag::LagChoice;
use crate::reducible::is_reducible;
use crate::settings::{DiagnosisChoice, IdentificationSettings};
use crate::stage_times::StageTimes;
use crate::stages::{TrainingExamination, consistent_stage};
use crate::task::IdentificationTask;
use crate::training::{LogFactors, TrainingPasses};
use dynident_dynamics::ParametricModel;
use dynident_estimation::{EstimationError, SegmentedFactor};
use dynident_rows::{Execution, LogStatistics, Logs, Recording, RegressorModel, Role, of_role};
use std::time::Instant;

/// A log that was reduced to triangular factors.
#[derive(Clone, Debug)]
pub struct ReducedLog {
    /// Name of the log.
    pub name: String,
    /// One triangular factor of `[W | τ]` (regressor W, torque τ) for each joint, divided into time segments; columns
    /// as [`joint_columns`](dynident_dynamics::PanelLayout::joint_columns) of the model's layout.
    pub factors: Vec<SegmentedFactor>,
    /// Contribution of position noise to the rows, as triangular factors with the same columns; `None` if the noise is
    /// unknown.
    pub noise: Option<Vec<SegmentedFactor>>,
    /// Statistics from reading the log, without the import report.
    pub statistics: LogStatistics,
}

/// Reduces every recording with the role [`Identify`](Role::Identify) to triangular factors with at most `segments`
/// time segments for each joint. Memory does not grow with the length of a log. More segments improve the error bars of
/// few logs; with many logs, one segment per log is sufficient. A stated lag is compensated.
///
/// # Errors
/// [`ReduceError`] if the settings leave a choice to the logs; recordings cannot be read.
pub fn reduce(
    task: &IdentificationTask,
    segments: usize,
    execution: Execution<'_>,
) -> Result<Vec<ReducedLog>, IdentificationError> {
    let IdentificationTask { robot, recordings, payloads, settings } = task;
    let model = RegressorModel::from(robot.clone());
    is_reducible(&model, settings)?;
    if !payloads.is_empty() {
        return Err(ReduceError::Columns { what: "payloads" }.into());
    }
    execution.install(|| {
        let training = of_role(recordings, Role::Identify);
        let logs =
            Logs::new(robot.model(), recordings, settings.row_settings(), &[], None, execution)?.without_keeping();
        let passes = TrainingPasses { logs: &logs, settings, training: &training, payloads: &[], known_arm: None };
        let reduced = passes.factors(&model)?.into_iter().map(|log| {
            let few = |factors: Vec<SegmentedFactor>, most: usize| {
                factors.iter().map(|factor| factor.with_at_most(most)).collect::<Result<Vec<_>, EstimationError>>()
            };
            Ok(ReducedLog {
                name: recordings[log.index].name.clone(),
                factors: few(log.factors, segments)?,
                // The time segment of the noise is irrelevant.
                noise: log.noise.map(|noise| few(noise, 1)).transpose()?,
                statistics: LogStatistics { report: None, ..log.statistics },
            })
        });
        reduced.collect()
    })
}

/// Fits a model to reduced logs. The result contains the estimate (with the variation between logs in its error bars),
/// physically consistent parameters, and tests of the signs of torque and friction. Unlike the result of
/// [`identify`](crate::identify()), it lacks everything that needs samples: lags, torque over time, comparison of
/// hypotheses, and held-out tests. It does not depend on where the logs were reduced; their order only changes rounding
/// errors.
///
/// # Errors
/// [`ReduceError`] as [`reduce`]; factors of other columns; as [`identify`](crate::identify()).
pub fn identify_reduced(
    robot: &ParametricModel,
    settings: &IdentificationSettings,
    reduced: &[&ReducedLog],
    execution: Execution<'_>,
) -> Result<Identification, IdentificationError> {
    if reduced.is_empty() {
        return Err(IdentificationError::NoTrainingLog);
    }
    let model = RegressorModel::from(robot.clone());
    is_reducible(&model, settings)?;
    settings.check_names(robot).map_err(IdentificationError::Consistency)?;
    settings.thresholds.validate()?;
    settings.estimation.thresholds.validate()?;
    execution.install(|| identified(model, &without_second_look(settings), reduced, execution))
}

fn identified(
    model: RegressorModel,
    settings: &IdentificationSettings,
    reduced: &[&ReducedLog],
    execution: Execution<'_>,
) -> Result<Identification, IdentificationError> {
    let started = Instant::now();
    let recordings: Vec<Recording> = reduced.iter().map(|log| Recording::without_samples(log.name.clone())).collect();
    let training: Vec<usize> = (0..recordings.len()).collect();
    let logs = Logs::new(model.model(), &recordings, settings.row_settings(), &[], None, execution)?;
    let factors = reduced.iter().enumerate().map(|(index, log)| log_factors(&model, index, log));
    let factors = factors.collect::<Result<Vec<_>, _>>()?;
    let passes = TrainingPasses { logs: &logs, settings, training: &training, payloads: &[], known_arm: None };
    let training_rows = passes.of_factors(model, factors)?;
    let Estimation { estimate: noise, .. } = estimate(&training_rows.rows(&logs, settings, &training), None)?;
    let variation = variation_of_logs(&training_rows, &settings.estimation, &noise);
    let (covariance, between_logs) = variation.unzip();
    let bars = ErrorBars::default().with(ErrorSource::LogVariation, covariance);
    let estimate = bars.total(&noise);
    let consistent = consistent_stage(&logs, settings, &training_rows, &estimate)?;
    let dof = training_rows.model.dof();
    let examination = TrainingExamination {
        delays: vec![vec![None; dof]; recordings.len()],
        traces: Vec::new(),
        pooled_delays: vec![None; dof],
        sign: sign_evidence(&training_rows.model.parametric, &training_rows.problem, &estimate),
        position_torques: Vec::new(),
        friction_signs: friction_signs(&training_rows.model, &training_rows.problem, &estimate),
    };
    Ok(Identification {
        payloads: Vec::new(),
        motion: logs.motion.clone(),
        cutoff: None,
        motion_hz: None,
        drive_inertia: None,
        estimator: settings.estimation.estimator.clone(),
        estimation: Estimation::plain(noise),
        bars,
        estimate,
        essential: None,
        consistent,
        examination,
        held_out: Vec::new(),
        diagnosis: None,
        forms: Vec::new(),
        torque_lag: LagChoice::default(),
        events: Vec::new(),
        between_logs,
        times: StageTimes { estimation_s: started.elapsed().as_secs_f64(), ..StageTimes::default() },
        training: training_rows,
    })
}

/// The settings without everything that reads samples again.
fn without_second_look(settings: &IdentificationSettings) -> IdentificationSettings {
    let mut own = settings.clone();
    if let Estimator::Auto(_) = own.estimation.estimator {
        own.estimation.estimator = Estimator::Weighted;
    }
    own.estimation.exogeneity_test = None;
    own.estimation.examine_exogeneity = false;
    own.diagnosis = DiagnosisChoice::Never;
    own
}

/// Triangular factors of a reduced log, after a check of their columns against the model.
fn log_factors(model: &RegressorModel, index: usize, log: &ReducedLog) -> Result<LogFactors, EstimationError> {
    let fits = |what: &str, factors: &[SegmentedFactor]| {
        let mismatch = |what: String, expected, found| Err(EstimationError::Mismatch { what, expected, found });
        if factors.len() != model.dof() {
            return mismatch(format!("log {}: joints with {what}", log.name), model.dof(), factors.len());
        }
        for (joint, factor) in factors.iter().enumerate() {
            let expected = model.layout().joint_columns(joint).len();
            if factor.columns() != expected {
                let what = format!("log {}, joint {}: columns of its {what}", log.name, model.joint_names()[joint]);
                return mismatch(what, expected, factor.columns());
            }
        }
        Ok(())
    };
    fits("factors", &log.factors)?;
    log.noise.as_ref().map_or(Ok(()), |noise| fits("noise", noise))?;
    Ok(LogFactors {
        index,
        factors: log.factors.clone(),
        statistics: log.statistics.clone(),
        noise: log.noise.clone(),
        nominal_agreement: None,
    })
}

/// Torque error of the base parameters θ (`theta`) on every reduced log: `‖τ − Wθ‖ / ‖τ‖` with torque τ and regressor
/// W, percent; `None` for a log without torque. It is exact, although it is computed from the triangular factors.
///
/// # Errors
/// Factors of other columns.
pub fn reduced_errors(
    robot: &ParametricModel,
    theta: &[f64],
    reduced: &[&ReducedLog],
) -> Result<Vec<Option<f64>>, EstimationError> {
    let model = RegressorModel::from(robot.clone());
    let columns = model.layout().columns().len();
    if theta.len() != columns {
        let what = "base parameters of the model".to_owned();
        return Err(EstimationError::Mismatch { what, expected: columns, found: theta.len() });
    }
    let of_log = |(index, log): (usize, &&ReducedLog)| {
        let (mut error, mut torque) = (0.0, 0.0);
        for (joint, factor) in log_factors(&model, index, log)?.factors.iter().enumerate() {
            let own: Vec<f64> = model.layout().joint_columns(joint).iter().map(|&column| theta[column]).collect();
            let total = factor.total();
            error += total.residual_sum_of_squares(&own)?;
            torque += total.torque_norm().powi(2);
        }
        Ok((torque > 0.0).then(|| 100.0 * (error / torque).sqrt()))
    };
    reduced.iter().enumerate().map(of_log).collect()
}
