//! DIDIM, CLIE and CLOE: estimators that simulate the closed loop of controller and robot along the commanded motion.

use super::simulated_loop::{ComparedSignal, LoopLog, SimulatedLoop};
use super::start_values::start_values;
use super::{EstimatorError, TrainingRows};
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, EstimateStatus, EstimationError, LinearProblem, SegmentedFactor, SimulatedEstimate, SimulatedMotion,
    SimulatedProblem, SimulatedSettings, simulated_least_squares, weighted_least_squares,
};
use dynident_simulation::{ControllerModel, ControllerSettings, LoopSettings, RunLimits, SensorSettings};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Minimum noise relative to the root mean square of the compared signal, so that weights are finite for noise-free
/// data.
const MIN_RELATIVE_SIGMA: f64 = 1e-4;
/// Maximum number of matrix entries (rows times columns) in memory, 8 bytes each.
const MAX_ENTRIES: usize = 100_000_000;
/// Maximum number of updates of the noise estimates of the joints.
const MAX_ROUNDS: usize = 3;
const MAX_NOISE_CHANGE: f64 = 0.1;

/// Start values of the iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SimulationStart {
    /// [`Estimate`](Self::Estimate) or [`Description`](Self::Description): the start whose simulation is closer to the
    /// record. If the iteration from this start fails, the other one is used.
    #[default]
    Nearer,
    /// The physically consistent set with the best fit to the measured rows. (A simulation with negative masses would
    /// fail.)
    Estimate,
    /// The values of the robot description.
    Description,
}

/// Settings of the simulated closed loop and of the fit.
#[derive(Clone, Debug)]
pub struct SimulatedLoopSettings {
    /// Controller that was used in the experiment.
    pub controller: ControllerSettings,
    /// Rate of the controller, hertz.
    pub rate_hz: f64,
    /// Integrator, velocity feedback, feedback delays, start and torque limits of the closed loop. Noise is not
    /// simulated.
    pub loop_settings: LoopSettings,
    /// Start values of the iteration.
    pub start: SimulationStart,
    /// Length of a step below which the iteration ends, in units of the error bars over all directions; 1e-3 is usual.
    pub tolerance: f64,
    /// Maximum number of steps; 30 are usual.
    pub max_iterations: usize,
    /// Step of the finite differences in CLIE and CLOE, relative to the size of each parameter; 1e-4 is usual.
    pub difference: f64,
}

/// Result of a fit to the simulated closed loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulatedFit {
    /// Name of the controller.
    pub controller: String,
    /// Rate of the controller, hertz.
    pub rate_hz: f64,
    /// Compared signal: `torque` or `position`.
    pub compared: String,
    /// Start values of the iteration: `estimate` (the physically consistent set with the best fit to the measured rows)
    /// or `description` (the robot description).
    pub start: String,
    /// Number of steps of the iteration.
    pub iterations: usize,
    /// Number of simulations of all logs.
    pub simulations: usize,
    /// Standard deviation of each joint's residual, Nm (N), or rad (m) for positions.
    pub residual_std: Vec<f64>,
}

/// Computes the estimate.
///
/// The simulation uses the controller of the study (with the robot description, if the controller contains a model) and
/// the commanded motion of the log, without noise. Its signals are sampled at the instants of the log and pass the same
/// parallel filter as the measured signals. The error bars are computed by weighted least squares on the last
/// linearised rows, so they include correlated residuals.
pub(super) fn simulated(
    rows: &TrainingRows<'_>,
    experiment: &SimulatedLoopSettings,
    compared: ComparedSignal,
) -> Result<(Estimate, SimulatedFit), EstimatorError> {
    let TrainingRows { logs, model, problem, training, .. } = *rows;
    let estimation = rows.settings;
    let method = compared.method();
    let wrong = |message: String| EstimatorError::Requirement { method, message };
    let SimulatedLoopSettings { controller, rate_hz, .. } = experiment;
    let controller_model = controller_model(rows, controller, &wrong)?;
    rows.begin("instants and commanded motion");
    let read = |&index: &usize| LoopLog::read(rows, index, compared, *rate_hz, &wrong);
    let loop_logs = training.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    logs.end();
    let mut simulated = SimulatedLoop {
        model,
        controller,
        controller_model,
        settings: noiseless(experiment, compared),
        compared,
        logs: loop_logs,
        wrong: &wrong,
        failure: None,
    };
    let entries = simulated.rows() * problem.columns().len();
    if entries > MAX_ENTRIES {
        return Err(wrong(format!(
            "{} rows of {} columns do not fit into memory: set parallel_filter.factor, or use a shorter part of the log",
            simulated.rows(),
            problem.columns().len()
        )));
    }

    let weighted = estimation.weighted();
    let plain = weighted_least_squares(problem, &weighted)?;
    let best = best_outcome(rows, &mut simulated, experiment, &plain)?;
    let found = best.found;
    let mut estimate = weighted_least_squares(&linearised(rows, &simulated, &found)?, &weighted)?;
    estimate.iterations = best.iterations;
    if found.status == EstimateStatus::IterationLimit {
        // The last step increased the cost, so the last simulated values are kept.
        estimate.status = EstimateStatus::IterationLimit;
        estimate.values.clone_from(&found.values);
        let relative = |(std, value): (&f64, &f64)| (*std > 0.0 && *value != 0.0).then(|| 100.0 * std / value.abs());
        estimate.relative_std_percent = estimate.std.iter().zip(&estimate.values).map(relative).collect();
    }
    let residual_std = std::mem::take(&mut estimate.joint_sigma);
    // The residual of the measured torque is used even if positions were compared, because the error band of the torque
    // needs it.
    estimate.joint_sigma = torque_sigma(problem, &estimate.values)?;
    let fit = SimulatedFit {
        controller: controller.name().to_owned(),
        rate_hz: *rate_hz,
        compared: if compared == ComparedSignal::Position { "position" } else { "torque" }.to_owned(),
        start: best.start.to_owned(),
        iterations: best.iterations,
        simulations: best.simulations,
        residual_std,
    };
    Ok((estimate, fit))
}

/// The closed loop without noise, and without limits other than torque limits.
fn noiseless(experiment: &SimulatedLoopSettings, compared: ComparedSignal) -> LoopSettings {
    let mut settings = experiment.loop_settings.clone();
    settings.limits = RunLimits { torque: settings.limits.torque, ..RunLimits::default() };
    let SensorSettings { speed, feedback_delay_samples, .. } = settings.sensors;
    settings.sensors = SensorSettings { speed, feedback_delay_samples, ..SensorSettings::default() };
    settings.accelerations = compared != ComparedSignal::Torque;
    settings
}

/// Model for a controller that needs one: the robot description.
fn controller_model(
    rows: &TrainingRows<'_>,
    controller: &ControllerSettings,
    wrong: &dyn Fn(String) -> EstimatorError,
) -> Result<Option<ControllerModel>, EstimatorError> {
    if !controller.needs_model() {
        return Ok(None);
    }
    let model = rows.model;
    let unknown = model.model().bodies_without_prior();
    if !unknown.is_empty() {
        return Err(wrong(format!(
            "the controller \"{}\" needs a model, but the robot description has no inertial of {}",
            controller.name(),
            unknown.join(", ")
        )));
    }
    let described = ControllerModel::from_parameters(model.model(), model.terms(), model.parametric.nominal());
    described.map(Some).map_err(|error| wrong(format!("[controller]: {error}")))
}

/// Iterates from the start values whose simulation is closest to the record; if this does not converge, from the other
/// ones. Returns the best result, with the total numbers of iterations and simulations.
fn best_outcome(
    rows: &TrainingRows<'_>,
    simulated: &mut SimulatedLoop<'_>,
    experiment: &SimulatedLoopSettings,
    plain: &Estimate,
) -> Result<StartOutcome, EstimatorError> {
    let measured = simulated.measured();
    let begun = simulated_starts(rows, simulated, experiment.start, &measured, plain)?;
    rows.logs.execution.progress.begin("simulating the closed loop", None);
    let mut best: Option<StartOutcome> = None;
    let (mut iterations, mut simulations) = (0, 0);
    for start in begun {
        let settled = settled(rows, simulated, start, experiment, &measured, &plain.std)?;
        iterations += settled.iterations;
        simulations += settled.simulations;
        let done = settled.found.status != EstimateStatus::IterationLimit;
        if best.as_ref().is_none_or(|best| log_sum(&settled.sigma) < log_sum(&best.sigma)) {
            best = Some(settled);
        }
        if done {
            break;
        }
    }
    rows.logs.end();
    let best = best.ok_or(EstimationError::NoSimulation)?;
    Ok(StartOutcome { iterations, simulations, ..best })
}

/// Start values whose simulation succeeds, the closest to the record first.
fn simulated_starts(
    rows: &TrainingRows<'_>,
    simulated: &mut SimulatedLoop<'_>,
    choice: SimulationStart,
    measured: &DVector<f64>,
    plain: &Estimate,
) -> Result<Vec<SimulatedStart>, EstimatorError> {
    let wrong = simulated.wrong;
    let (mut begun, mut refused) = (Vec::new(), Vec::new());
    for (values, name) in start_values(rows, choice, plain).map_err(|error| wrong(error.to_string()))? {
        match simulated.simulate(&values)? {
            Some(rows) => {
                let sigma = deviations(simulated, &(measured - &rows.output), measured, 0);
                begun.push(SimulatedStart { values, name, sigma });
            }
            None => refused.push(format!("of the {name} ({})", failure(simulated))),
        }
    }
    if begun.is_empty() {
        return Err(wrong(no_simulation(&refused.join(", nor "))));
    }
    begun.sort_by(|a, b| log_sum(&a.sigma).total_cmp(&log_sum(&b.sigma)));
    Ok(begun)
}

/// Standard deviation of the residual of each joint's measured filtered torque, `√(RSS_j / (N_j − p/n))`: sum of
/// squared residuals RSS_j, N_j rows, p parameters and n joints.
pub(crate) fn torque_sigma(problem: &LinearProblem, values: &[f64]) -> Result<Vec<f64>, EstimationError> {
    let mut squares = vec![0.0; problem.joints().len()];
    for equation in problem.equations() {
        let theta: Vec<f64> = equation.columns.iter().map(|&column| values[column]).collect();
        squares[equation.joint] += equation.factor.total().residual_sum_of_squares(&theta)?;
    }
    let share = values.len() as f64 / squares.len().max(1) as f64;
    let rows = problem.joint_rows();
    Ok(squares.iter().zip(rows).map(|(sum, rows)| (sum / (rows as f64 - share).max(1.0)).sqrt()).collect())
}

struct SimulatedStart {
    values: Vec<f64>,
    name: &'static str,
    sigma: Vec<f64>,
}

struct StartOutcome {
    found: SimulatedEstimate,
    start: &'static str,
    sigma: Vec<f64>,
    iterations: usize,
    simulations: usize,
}

fn log_sum(sigma: &[f64]) -> f64 {
    sigma.iter().map(|sigma| sigma.ln()).sum()
}

/// Fits from one set of start values, with steps until convergence. After each step, the residuals of a joint determine
/// its noise, which gives the weights of its rows.
fn settled(
    rows: &TrainingRows<'_>,
    simulated: &mut SimulatedLoop<'_>,
    start: SimulatedStart,
    experiment: &SimulatedLoopSettings,
    measured: &DVector<f64>,
    std: &[f64],
) -> Result<StartOutcome, EstimatorError> {
    let settings = SimulatedSettings {
        criterion: simulated.compared.criterion(),
        rank: rows.settings.rank,
        tolerance: experiment.tolerance,
        max_iterations: experiment.max_iterations,
        difference: experiment.difference,
    };
    let SimulatedStart { values, name, mut sigma } = start;
    let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let scale = values.iter().zip(std).map(|(value, std)| value.abs().max(*std).max(1e-3 * largest)).collect();
    let mut fit = SimulatedProblem {
        names: rows.model.layout().columns().iter().map(Column::symbol).collect(),
        start: values,
        scale,
        noise_std: by_row(simulated, &sigma),
        measured: measured.clone(),
    };
    let (mut iterations, mut simulations) = (0, 0);
    for round in 1..=MAX_ROUNDS {
        let found = simulated_least_squares(&fit, &settings, simulated)?;
        iterations += found.iterations;
        simulations += found.simulations;
        let next = deviations(simulated, &found.residual, measured, found.rank.rank);
        let changed = next.iter().zip(&sigma).any(|(new, old)| (new / old - 1.0).abs() > MAX_NOISE_CHANGE);
        sigma = next;
        if !changed || round == MAX_ROUNDS || found.status == EstimateStatus::IterationLimit {
            return Ok(StartOutcome { found, start: name, sigma, iterations, simulations });
        }
        fit.noise_std = by_row(simulated, &sigma);
        fit.start.clone_from(&found.values);
    }
    Err(EstimationError::NoSimulation.into())
}

fn failure(simulated: &SimulatedLoop<'_>) -> String {
    simulated.failure.clone().unwrap_or_else(|| "the motion diverges".to_owned())
}

fn no_simulation(why: &str) -> String {
    format!(
        "the closed loop does not get through with the starting values {why}; check kind, gains and rate of the controller, the log's reference, and simulated.start"
    )
}

/// Standard deviation of the part of `residual` that belongs to each joint.
fn deviations(
    simulated: &SimulatedLoop<'_>,
    residual: &DVector<f64>,
    measured: &DVector<f64>,
    free: usize,
) -> Vec<f64> {
    let joints = simulated.model.model().dof();
    let (mut squares, mut signal, mut count) = (vec![0.0; joints], vec![0.0; joints], vec![0_usize; joints]);
    let mut at = 0;
    for log in &simulated.logs {
        for (joint, &rows) in log.rows.iter().enumerate() {
            squares[joint] += residual.rows(at, rows).norm_squared();
            signal[joint] += measured.rows(at, rows).norm_squared();
            count[joint] += rows;
            at += rows;
        }
    }
    let share = free as f64 / joints as f64;
    (0..joints)
        .map(|joint| {
            let rows = count[joint] as f64;
            let least = MIN_RELATIVE_SIGMA * (signal[joint] / rows.max(1.0)).sqrt();
            let sigma = (squares[joint] / (rows - share).max(1.0)).sqrt().max(least);
            // A joint without torque and without residual gets weight 1.
            if sigma > 0.0 { sigma } else { 1.0 }
        })
        .collect()
}

/// Repeats the value of each joint for all rows of the joint.
fn by_row(simulated: &SimulatedLoop<'_>, values: &[f64]) -> DVector<f64> {
    let all = simulated.logs.iter().flat_map(|log| log.rows.iter().zip(values));
    let repeated = all.flat_map(|(&rows, &value)| std::iter::repeat_n(value, rows));
    DVector::from_iterator(simulated.rows(), repeated)
}

/// The last linearised rows `J θ' ≈ residual + J θ` (J: derivative of the simulated signals by the parameters θ), by
/// log, joint and time segment.
fn linearised(
    training: &TrainingRows<'_>,
    simulated: &SimulatedLoop<'_>,
    found: &SimulatedEstimate,
) -> Result<LinearProblem, EstimationError> {
    let columns: Vec<usize> = (0..found.values.len()).collect();
    let target = &found.residual + &found.jacobian * DVector::from_column_slice(&found.values);
    let problem = training.problem;
    let mut rows = LinearProblem::new(problem.columns().to_vec(), training.model.joint_names());
    let mut at = 0;
    for (place, log) in simulated.logs.iter().enumerate() {
        for (joint, &count) in log.rows.iter().enumerate() {
            let mut factor = SegmentedFactor::new(columns.len(), training.settings.segments)?;
            let own = found.jacobian.rows(at, count);
            let panel: Vec<f64> = own.iter().copied().chain(target.rows(at, count).iter().copied()).collect();
            factor.absorb(&panel, count)?;
            rows.add(&problem.logs()[place], joint, columns.clone(), factor)?;
            at += count;
        }
    }
    rows.with_fallback(found.values.clone())
}
