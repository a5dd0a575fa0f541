//! DIDIM, CLIE and CLOE: from a study's controller and commanded motion to an estimate.

use crate::error::Error;
use crate::identify::fit::Logs;
use crate::identify::simulated_loop::{Compared, LoopLog, SimulatedLoop};
use crate::job::joint_names;
use crate::study::{EstimatorMethod, SimulationStart};
use dynident_dynamics::Column;
use dynident_estimation::{
    Estimate, EstimateStatus, EstimationError, LinearProblem, SegmentedFactor, SimulatedEstimate, SimulatedMotion,
    SimulatedProblem, WeightedSettings, simulated_least_squares, weighted_least_squares,
};
use dynident_identification::consistent::consistent_parameters;
use dynident_simulation::{ControllerModel, RunLimits, SensorSettings};
use nalgebra::DVector;
use serde::Serialize;

/// Noise of the compared signal counts as at least this share of the signal's root mean square, so that noise-free data have weights.
const LEAST_RELATIVE_SIGMA: f64 = 1e-4;
/// Rows times columns that are held in memory, of 8 bytes each.
const MOST_ENTRIES: usize = 100_000_000;
/// The noise of the joints is judged anew so often at most, until no joint's changes by more than a tenth.
const ROUNDS: usize = 3;
const SETTLED: f64 = 0.1;

/// How a fit to the simulated closed loop went.
#[derive(Clone, Debug, Serialize)]
pub struct SimulatedFit {
    /// The controller.
    pub controller: &'static str,
    /// Its samples a second.
    pub rate_hz: f64,
    /// What was compared: `torque` or `position`.
    pub compared: &'static str,
    /// Where the iteration began: at the `estimate` (the possible machine that fits the measured rows best) or the `description`.
    pub start: &'static str,
    /// Steps.
    pub iterations: usize,
    /// Simulations of all logs.
    pub simulations: usize,
    /// For each joint the standard deviation of what the simulation leaves, Nm (N), or rad (m) where positions are compared.
    pub residual_std: Vec<f64>,
}

/// The estimate, and how it came about.
///
/// The simulation has the study's controller (its model, if it needs one, is the description) and the log's commanded motion, and no noise; its motion is taken at the log's instants, and what it gives
/// passes the same parallel filter as what was measured. Error bars are those of weighted least squares on the last linearised rows, so that coloured residuals count as everywhere.
pub(crate) fn simulated(logs: &Logs<'_>, problem: &LinearProblem) -> Result<(Estimate, SimulatedFit), Error> {
    let Logs { study, machine, .. } = *logs;
    let section = &study.estimator;
    let wrong = |message: String| Error::Method { path: logs.path.to_owned(), method: section.method.name(), message };
    let Some(controller) = &study.controller else {
        return Err(wrong(
            "say which controller drove the robot in [controller] (kind and gains); where it is not known, take method = \"instrumental\""
                .to_owned(),
        ));
    };
    let dof = machine.model().dof();
    controller.validate(dof).map_err(|error| wrong(format!("[controller]: {error}")))?;
    let simulation = study.simulation.clone().unwrap_or_default();
    simulation.validate(dof).map_err(|error| wrong(format!("[simulation]: {error}")))?;
    let mut settings = simulation.loop_settings(Some(machine.model()));
    settings.limits = RunLimits { torque: settings.limits.torque, ..RunLimits::default() };
    let SensorSettings { speed, feedback_delay_samples, .. } = settings.sensors;
    settings.sensors = SensorSettings { speed, feedback_delay_samples, ..SensorSettings::default() };
    let compared = match section.method {
        EstimatorMethod::Cloe => Compared::Position,
        EstimatorMethod::Clie => Compared::Torque,
        _ => Compared::TorqueRows,
    };
    settings.accelerations = compared != Compared::Torque;
    let controller_model = if controller.needs_model() {
        let unknown = machine.model().bodies_without_prior();
        if !unknown.is_empty() {
            return Err(wrong(format!(
                "the controller \"{}\" needs the model that it had, and the description has no inertial of {}",
                controller.name(),
                unknown.join(", ")
            )));
        }
        let prior = machine.nominal().to_vec();
        let model = ControllerModel::from_parameters(machine.model(), machine.laws(), &prior);
        Some(model.map_err(|error| wrong(format!("[controller]: {error}")))?)
    } else {
        None
    };
    logs.begin("instants and commanded motion");
    let read = |&index: &usize| LoopLog::read(logs, index, compared, simulation.rate_hz, &wrong);
    let loop_logs = logs.training.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    logs.options.progress.end();
    let mut simulated = SimulatedLoop {
        machine,
        controller,
        controller_model,
        settings,
        compared,
        logs: loop_logs,
        wrong: &wrong,
        failure: None,
    };
    let entries = simulated.rows() * problem.columns().len();
    if entries > MOST_ENTRIES {
        return Err(wrong(format!(
            "{} rows of {} columns are too many to hold at once: give parallel_filter.factor, or a shorter part of the log",
            simulated.rows(),
            problem.columns().len()
        )));
    }

    let weighted =
        WeightedSettings { rank: section.rank, covariance: section.covariance, ..WeightedSettings::default() };
    let plain = weighted_least_squares(problem, &weighted).map_err(|source| logs.in_study(source))?;
    let measured = simulated.measured();
    let (mut begun, mut refused) = (Vec::new(), Vec::new());
    for (values, name) in start_values(logs, problem, &plain).map_err(&wrong)? {
        match simulated.simulate(&values).map_err(|stop| stop.of(logs))? {
            Some(rows) => {
                let sigma = deviations(&simulated, &(&measured - &rows.output), &measured, 0);
                begun.push(Begun { values, name, sigma });
            }
            None => refused.push(format!("of the {name} ({})", failure(&simulated))),
        }
    }
    if begun.is_empty() {
        return Err(wrong(no_simulation(&refused.join(", nor "))));
    }
    begun.sort_by(|a, b| log_sum(&a.sigma).total_cmp(&log_sum(&b.sigma)));
    logs.options.progress.begin("simulating the closed loop", None);
    let mut best: Option<Settled> = None;
    let (mut iterations, mut simulations) = (0, 0);
    for start in begun {
        let settled = settled(logs, &mut simulated, start, (&measured, &plain.std))?;
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
    logs.options.progress.end();
    let Some(Settled { found, start: start_name, .. }) = best else {
        return Err(logs.in_study(EstimationError::NoSimulation));
    };
    let rows = linearised(logs, problem, &simulated, &found).map_err(|source| logs.in_study(source))?;
    let mut estimate = weighted_least_squares(&rows, &weighted).map_err(|source| logs.in_study(source))?;
    estimate.iterations = iterations;
    if found.status == EstimateStatus::IterationLimit {
        // The step that these rows ask for made the simulation worse: the last values that were simulated stand.
        estimate.status = EstimateStatus::IterationLimit;
        estimate.values.clone_from(&found.values);
        let relative = |(std, value): (&f64, &f64)| (*std > 0.0 && *value != 0.0).then(|| 100.0 * std / value.abs());
        estimate.relative_std_percent = estimate.std.iter().zip(&estimate.values).map(relative).collect();
    }
    let residual_std = std::mem::take(&mut estimate.joint_sigma);
    // What the model leaves of the measured torque, whatever was compared: that is what the torque's band is made of.
    estimate.joint_sigma = torque_sigma(problem, &estimate.values).map_err(|source| logs.in_study(source))?;
    let fit = SimulatedFit {
        controller: controller.name(),
        rate_hz: simulation.rate_hz,
        compared: if compared == Compared::Position { "position" } else { "torque" },
        start: start_name,
        iterations,
        simulations,
        residual_std,
    };
    Ok((estimate, fit))
}

/// For each joint the standard deviation of its measured filtered torque from the model's, `√(RSS_j / (N_j − p/n))`.
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

/// A start that can be simulated.
struct Begun {
    values: Vec<f64>,
    name: &'static str,
    sigma: Vec<f64>,
}

/// What came of one start.
struct Settled {
    found: SimulatedEstimate,
    start: &'static str,
    sigma: Vec<f64>,
    iterations: usize,
    simulations: usize,
}

fn log_sum(sigma: &[f64]) -> f64 {
    sigma.iter().map(|sigma| sigma.ln()).sum()
}

/// Iterates from one start; the joints' noise, which weighs their rows, is judged anew by what is left.
fn settled(
    logs: &Logs<'_>,
    simulated: &mut SimulatedLoop<'_>,
    start: Begun,
    (measured, std): (&DVector<f64>, &[f64]),
) -> Result<Settled, Error> {
    let section = &logs.study.estimator;
    let settings = section.simulated.settings(section);
    let Begun { values, name, mut sigma } = start;
    let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs())).max(1e-9);
    let scale = values.iter().zip(std).map(|(value, std)| value.abs().max(*std).max(1e-3 * largest)).collect();
    let mut asked = SimulatedProblem {
        names: logs.machine.layout().columns().iter().map(Column::symbol).collect(),
        start: values,
        scale,
        noise_std: by_row(simulated, &sigma),
        measured: measured.clone(),
    };
    let (mut iterations, mut simulations) = (0, 0);
    for round in 1..=ROUNDS {
        let found = simulated_least_squares(&asked, simulated, &settings).map_err(|stop| stop.of(logs))?;
        iterations += found.iterations;
        simulations += found.simulations;
        let next = deviations(simulated, &found.residual, measured, found.rank.rank);
        let changed = next.iter().zip(&sigma).any(|(new, old)| (new / old - 1.0).abs() > SETTLED);
        sigma = next;
        if !changed || round == ROUNDS || found.status == EstimateStatus::IterationLimit {
            return Ok(Settled { found, start: name, sigma, iterations, simulations });
        }
        asked.noise_std = by_row(simulated, &sigma);
        asked.start.clone_from(&found.values);
    }
    // The last round returns.
    Err(logs.in_study(EstimationError::NoSimulation))
}

/// Where the iteration may begin, and what each is called.
fn start_values(
    logs: &Logs<'_>,
    problem: &LinearProblem,
    plain: &Estimate,
) -> Result<Vec<(Vec<f64>, &'static str)>, String> {
    let machine = logs.machine;
    let choice = logs.study.estimator.simulated.start;
    let mut starts = Vec::new();
    let mut why = Vec::new();
    if choice != SimulationStart::Description {
        let settings = logs.study.estimator.physical.settings().unwrap_or_default();
        match consistent_parameters(&machine.parametric, problem, &plain.joint_sigma, &settings) {
            Ok(fit) => starts.push((fit.base_values, "estimate")),
            Err(reason) => why.push(format!("there is no possible machine to start from: {reason}")),
        }
    }
    if choice != SimulationStart::Estimate {
        if let Some(prior) = machine.nominal_base() {
            starts.push((prior.to_vec(), "description"));
        } else {
            let unknown = machine.model().bodies_without_prior().join(", ");
            why.push(format!("the description, which could be started from, has no inertial of {unknown}"));
        }
    }
    if starts.is_empty() { Err(why.join("; ")) } else { Ok(starts) }
}

fn failure(simulated: &SimulatedLoop<'_>) -> String {
    simulated.failure.clone().unwrap_or_else(|| "its motion has grown beyond all numbers".to_owned())
}

fn no_simulation(why: &str) -> String {
    format!(
        "the closed loop does not get through with the starting values {why}; check kind, gains and rate of the controller, the log's reference, and simulated.start"
    )
}

/// Standard deviation of each joint's share of `residual`.
fn deviations(
    simulated: &SimulatedLoop<'_>,
    residual: &DVector<f64>,
    measured: &DVector<f64>,
    free: usize,
) -> Vec<f64> {
    let joints = simulated.machine.model().dof();
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
            let least = LEAST_RELATIVE_SIGMA * (signal[joint] / rows.max(1.0)).sqrt();
            (squares[joint] / (rows - share).max(1.0)).sqrt().max(least).max(1e-12)
        })
        .collect()
}

/// One number per joint as one per row.
fn by_row(simulated: &SimulatedLoop<'_>, values: &[f64]) -> DVector<f64> {
    let all = simulated.logs.iter().flat_map(|log| log.rows.iter().zip(values));
    let repeated = all.flat_map(|(&rows, &value)| std::iter::repeat_n(value, rows));
    DVector::from_iterator(simulated.rows(), repeated)
}

/// The last linearised rows `J θ' ≈ residual + J θ`, by log, joint and time segment.
fn linearised(
    logs: &Logs<'_>,
    problem: &LinearProblem,
    simulated: &SimulatedLoop<'_>,
    found: &SimulatedEstimate,
) -> Result<LinearProblem, EstimationError> {
    let columns: Vec<usize> = (0..found.values.len()).collect();
    let target = &found.residual + &found.jacobian * DVector::from_column_slice(&found.values);
    let mut rows = LinearProblem::new(problem.columns().to_vec(), joint_names(logs.machine));
    let mut at = 0;
    for (place, log) in simulated.logs.iter().enumerate() {
        for (joint, &count) in log.rows.iter().enumerate() {
            let mut factor = SegmentedFactor::new(columns.len(), logs.study.estimator.segments)?;
            let own = found.jacobian.rows(at, count);
            let panel: Vec<f64> = own.iter().copied().chain(target.rows(at, count).iter().copied()).collect();
            factor.absorb(&panel, count)?;
            rows.add(&problem.logs()[place], joint, columns.clone(), factor)?;
            at += count;
        }
    }
    rows.with_fallback(found.values.clone())
}
