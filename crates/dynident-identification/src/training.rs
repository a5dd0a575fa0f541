//! From training recordings to triangular factors, and the model whose terms they were made with.

use crate::consistent::nominal_covariance;
use crate::error::IdentificationError;
use crate::estimators::{EstimationSettings, Estimator, TrainingRows};
use crate::examination::PriorAgreement;
use crate::friction::JointFriction;
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
    Execution, JointRows, LogError, LogPass, LogStatistics, Logs, MotionRecord, ParallelFilterSettings, Recording,
    RegressorModel, RowBlock, RowConsumer, RowSettings, noise_factors,
};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Passes that the load behind load-dependent friction takes at most, and the change from one to the next, in units of
/// the torque, at which it has settled.
const LOAD_PASSES: usize = 6;
const LOAD_SETTLED: f64 = 1e-3;

/// How closely given values are held, as a share of the largest of them.
const HELD: f64 = 1e-6;

/// What is left of one recording for fitting.
#[derive(Clone, Debug)]
pub struct LogFactors {
    /// Number of the recording.
    pub index: usize,
    /// One factor of `[W | τ]` for each joint, cut into time segments.
    pub factors: Vec<SegmentedFactor>,
    /// How the recording was read.
    pub statistics: LogStatistics,
    /// What noise of the positions adds to the rows, one factor for each joint: known once the model is chosen, and
    /// where the recording shows its noise.
    pub noise: Option<Vec<SegmentedFactor>>,
    /// How well the nominal values explain it, where they are known and torque is in newton metres: what
    /// [`training_rows`] says of the model that it is given.
    pub nominal_agreement: Option<PriorAgreement>,
}

/// The training recordings as factors, and the model that they were made with.
#[derive(Clone, Debug)]
pub struct Training {
    /// The model, with the friction that was chosen.
    pub model: RegressorModel,
    /// The recordings, in the order of the problem's logs.
    pub logs: Vec<LogFactors>,
    /// The joints that the problem's joints are: all of them, unless windows leave some without a row.
    pub joints: Vec<usize>,
    /// All of them over one set of columns.
    pub problem: LinearProblem,
    /// Columns beside the base parameters: payloads and offsets of single logs.
    pub columns: LoadColumns,
    /// How friction was chosen, joint by joint; empty where it was stated.
    pub friction_choice: Vec<JointFriction>,
    /// Where gains were asked for: what was found, and the estimate with them.
    pub gains: Option<(Estimate, Vec<DriveGain>)>,
    /// Seconds spent on reading logs, and on estimates that choose.
    pub timings_s: [f64; 2],
}

impl Training {
    /// What estimators are given: the recordings `training`, as factors and to come back to.
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

/// Makes the factors of the recordings `training`; where friction depends on the load, again with what the fit before
/// says of it. `known_arm` where the arm is held, with what of it is fitted again. Friction is the model's own:
/// [`choose_friction`](crate::choose_friction) comes before.
///
/// # Errors
/// Recordings that cannot be read, payloads and gains that do not go together, rows that do not carry an estimate.
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
    // Torque in a unit that nobody knows says nothing about the description.
    if let Some(nominal) = fitted.model.parametric.nominal_base().filter(|_| settings.gains == GainChoice::Stated) {
        for log in &mut fitted.logs {
            log.nominal_agreement =
                Some(PriorAgreement::of_factors(&fitted.model, &log.factors, nominal, &settings.examination));
        }
    }
    Ok(fitted)
}

/// The values of weighted least squares (ordinary where the study asks for it) with the stated terms on pieces of a
/// motion.
///
/// # Errors
/// Rows that do not carry an estimate.
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

/// A piece of a motion as a recording.
fn of_piece(motion: MotionBlock) -> Recording {
    let label = "a piece of a motion".to_owned();
    let record =
        MotionRecord { label: label.clone(), motion: Arc::new(motion), usable: Vec::new(), windows: None, raw: None };
    Recording::of_motion(label, record)
}

/// Passes over the training recordings.
pub(crate) struct TrainingPasses<'a> {
    pub(crate) logs: &'a Logs<'a>,
    pub(crate) settings: &'a IdentificationSettings,
    pub(crate) training: &'a [usize],
    pub(crate) payloads: &'a [Payload],
    pub(crate) known_arm: Option<Refit>,
}

impl<'a> TrainingPasses<'a> {
    /// Passes over these training logs, without a known arm.
    pub(crate) fn of_logs(
        logs: &'a Logs<'a>,
        settings: &'a IdentificationSettings,
        training: &'a [usize],
        payloads: &'a [Payload],
    ) -> Self {
        Self { logs, settings, training, payloads, known_arm: None }
    }

    /// The rows of this model; where friction depends on a load that is not known yet, again and again with the load
    /// of the fit before, until it settles.
    pub(crate) fn fit(&self, model: RegressorModel) -> Result<Training, IdentificationError> {
        let load_is_known = model.load_parameters.is_some();
        let mut found = self.rows_once(model)?;
        if load_is_known || !found.model.needs_load() {
            return Ok(found);
        }
        for _ in 0..LOAD_PASSES {
            let started = Instant::now();
            let plain = plain_values(&self.settings.estimation, &found.problem)?;
            let estimated_s = started.elapsed().as_secs_f64();
            let with_load = found.model.clone().with_load_of_estimate(&found.model, &plain.values);
            let has_settled = load_has_settled(&found, &with_load);
            let [read_s, chosen_s] = found.timings_s;
            if has_settled {
                found.timings_s[1] += estimated_s;
                break;
            }
            found = self.rows_once(with_load)?;
            found.timings_s[0] += read_s;
            found.timings_s[1] += chosen_s + estimated_s;
        }
        Ok(found)
    }

    /// The rows with their torque in newton metres, where gains are to be found.
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

    /// The rows with this model's columns.
    pub(crate) fn rows_once(&self, model: RegressorModel) -> Result<Training, IdentificationError> {
        let columns = self.columns(&model)?;
        let started = Instant::now();
        let logs = self.factors(&model)?;
        let read_s = started.elapsed().as_secs_f64();
        let mut rows = self.assembled(model, columns, logs)?;
        rows.timings_s[0] += read_s;
        Ok(rows)
    }

    /// The recordings as factors, with what noise adds to them.
    pub(crate) fn factors(&self, model: &RegressorModel) -> Result<Vec<LogFactors>, LogError> {
        let mut logs = self.read(model)?;
        self.add_noise(model, &mut logs)?;
        Ok(logs)
    }

    /// The rows that factors made elsewhere hold.
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

    /// Factors of all logs over one set of columns.
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

    /// Recordings side by side, or one with its reader on a second thread; results stand in their order either way.
    pub(crate) fn read(&self, model: &RegressorModel) -> Result<Vec<LogFactors>, LogError> {
        self.logs.begin("logs to factors", self.training);
        let alone = self.training.len() == 1;
        let one = |index: &usize| log_factors(self.logs, self.settings, model, *index, alone);
        let factors = if !alone && self.logs.execution.parallel() {
            self.training.par_iter().map(one).collect()
        } else {
            self.training.iter().map(one).collect()
        };
        self.logs.end();
        factors
    }

    /// What noise adds to the rows, once it is clear which columns they have.
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
        // Of an arm that is known nothing is estimated that the payload could be taken for.
        if self.known_arm.is_some() || logs.iter().all(|log| log.noise.is_none()) {
            return Ok(problem);
        }
        let noise = self.rows_of(model, columns, logs, |log| log.noise.as_ref())?;
        let unexcited = self.unexcited(model, &problem, &noise)?;
        problem.with_unexcited(unexcited)
    }

    /// All rows, with what is known of the parameters beforehand.
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

    /// The factors of all logs over one set of columns.
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
            // Two recordings may share a name; their numbers keep them apart.
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

    /// The columns that are nothing but noise and other columns, by the noise that a first fit leaves in each joint.
    fn unexcited(
        &self,
        model: &RegressorModel,
        problem: &LinearProblem,
        noise: &LinearProblem,
    ) -> Result<Unexcited, EstimationError> {
        let weights = match weighted_values(problem, &self.settings.estimation.weighted()) {
            Ok(first) => first.joint_sigma.iter().map(|sigma| sigma.recip()).collect(),
            // What is wrong is said where the estimate itself is made.
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

/// Whether the load that `next` has hardly differs, on the rows, from the one that they were made with.
fn load_has_settled(found: &Training, next: &RegressorModel) -> bool {
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
    change <= LOAD_SETTLED * LOAD_SETTLED * torque
}

/// Joints of which some recording has rows: where windows leave a joint none, it is not in the problem.
fn joints_with_rows(logs: &[LogFactors], dof: usize) -> Vec<usize> {
    (0..dof).filter(|&joint| logs.iter().any(|log| log.factors[joint].rows() > 0)).collect()
}

/// The problem with columns held at given values, by a prior that is far narrower than any data.
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
        information[(row, column)] = 1.0 / (HELD * largest);
    }
    problem.with_prior(mean, information)
}

/// The values that friction is chosen and loads are taken by, and the noise of the joints there.
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

/// The estimate with these values.
pub(crate) fn plain_estimate(
    settings: &EstimationSettings,
    problem: &LinearProblem,
) -> Result<Estimate, EstimationError> {
    match settings.estimator {
        Estimator::Ordinary => ordinary_least_squares(problem, &settings.ordinary()),
        _ => weighted_least_squares(problem, &settings.weighted()),
    }
}

impl LogFactors {
    /// The same rows, each joint's as one segment: all that values and bars by white noise need.
    pub(crate) fn as_one_segment(&self) -> Self {
        let factors = self.factors.par_iter().map(SegmentedFactor::as_one_segment).collect();
        let (statistics, nominal_agreement) = (self.statistics.clone(), self.nominal_agreement.clone());
        Self { index: self.index, factors, statistics, noise: self.noise.clone(), nominal_agreement }
    }

    /// The same rows as another model sees them, whose columns are among those of `wide`.
    pub(crate) fn of(mut self, wide: &RegressorModel, model: &RegressorModel) -> Result<Self, EstimationError> {
        self.factors.par_iter_mut().enumerate().try_for_each(|(joint, factor)| {
            let seen = wide.layout().joint_columns(joint);
            // A column that is not there gets a number out of range, which the selection refuses.
            let place = |&column: &usize| {
                let wanted = &model.layout().columns()[column];
                seen.iter().position(|&global| wide.layout().columns()[global] == *wanted).unwrap_or(usize::MAX)
            };
            let places: Vec<usize> = model.layout().joint_columns(joint).iter().map(place).collect();
            *factor = factor.selected(&places)?;
            Ok(())
        })?;
        Ok(self)
    }
}

/// Makes a factor for each joint.
struct FactorConsumer(Vec<JointFactor>);

/// The factor of one joint in the making.
struct JointFactor {
    log: String,
    factor: SegmentedFactor,
    block: RowBlock,
    counted: Vec<f64>,
}

impl RowConsumer for FactorConsumer {
    fn reads_samples(&self) -> bool {
        false
    }

    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0[rows.joint].filtered(rows)
    }

    fn joints(&mut self) -> Option<Vec<&mut (dyn RowConsumer + Send)>> {
        Some(self.0.iter_mut().map(|joint| joint as &mut (dyn RowConsumer + Send)).collect())
    }
}

impl RowConsumer for JointFactor {
    fn reads_samples(&self) -> bool {
        false
    }

    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        let rows = rows.counted(&mut self.counted);
        self.block
            .push(rows.panel, rows.rows, |panel, rows| self.factor.absorb(panel, rows))
            .map_err(|source| LogError::Rows { log: self.log.clone(), source })
    }
}

/// The factors of recording number `index`; `alone` lets a second thread read.
///
/// # Errors
/// What reading it can give.
pub fn log_factors(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    model: &RegressorModel,
    index: usize,
    alone: bool,
) -> Result<LogFactors, LogError> {
    let log = logs.recordings[index].label();
    let in_rows = |source| LogError::Rows { log: log.clone(), source };
    let joint = |joint: usize| {
        let columns = model.layout().joint_columns(joint);
        let factor = SegmentedFactor::new(columns.len(), settings.estimation.segments).map_err(in_rows)?;
        let block = RowBlock::new(columns.len() + 1);
        Ok(JointFactor { log: log.clone(), factor, block, counted: Vec::new() })
    };
    let mut consumer = FactorConsumer((0..model.dof()).map(joint).collect::<Result<_, LogError>>()?);
    let pass = LogPass { reader_thread: alone && logs.execution.parallel(), ..logs.pass(model, index) };
    let statistics = pass.run(&mut consumer)?;
    let mut factors = Vec::with_capacity(model.dof());
    for JointFactor { mut factor, block, .. } in consumer.0 {
        block.finish(|panel, rows| factor.absorb(panel, rows)).map_err(in_rows)?;
        factors.push(factor);
    }
    Ok(LogFactors { index, factors, statistics, noise: None, nominal_agreement: None })
}
