//! What runs say about the base parameters: the identification of several together.

use crate::differentiator_choice::DifferentiatorChoice;
use crate::error::IterationError;
use crate::leg::IterationTask;
use crate::model_parameters::ModelParameters;
use crate::near_rest::NearRest;
use crate::rests::RestMargin;
use crate::run_logs::{RunLog, identification_settings, recordings};
use crate::run_offsets::{RunOffset, choices, deviations, seen};
use crate::settings::{RunIdentificationSettings, Scheme};
use crate::step_by_step::step_by_step;
use dynident_dynamics::ParametricModel;
use dynident_estimation::{Estimate, LinearProblem};
use dynident_identification::consistent::{ConsistencySettings, consistent_parameters};
use dynident_identification::estimators::estimate;
use dynident_identification::examination::{LagChoice, LagKind, LagRounds, TorqueLag, lag_fit, lags_of_recordings};
use dynident_identification::friction::JointFriction;
use dynident_identification::{
    ErrorBars, ErrorSource, Execution, IdentificationSettings, Logs, OffsetChoice, Recording, Training,
    choose_friction, consistent_stage, schwarz, training_rows,
};
use serde::{Deserialize, Serialize};

/// What a run says about the base parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunEstimate {
    /// Base parameters.
    pub values: Vec<f64>,
    /// Their standard deviations; zero for what was given or is not determined by the data.
    pub std: Vec<f64>,
    /// Their covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// Rows that it was made from.
    pub rows: usize,
    /// Standard deviation of each joint's residual, Nm (N).
    pub joint_sigma: Vec<f64>,
    /// Base parameters that the data do not determine: they have the prior's values.
    pub fixed: Vec<usize>,
    /// All parameters of the physically consistent set that fits best, ten for each body and one for each term, if it
    /// was asked for.
    pub possible: Option<Vec<f64>>,
    /// Why no consistent set was found; none where one was found or not requested.
    pub impossible: Option<String>,
    /// The friction that this run chose, for itself and the runs after it; empty where it was stated or chosen before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub friction: Vec<JointFriction>,
    /// By how much each joint's torque comes after the motion, with what was taken off; none where the rows do not
    /// determine it. Empty step by step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_lags: Vec<Option<TorqueLag>>,
    /// The lag that was taken off the rows, and what all joints share.
    #[serde(default)]
    pub lag: LagChoice,
    /// The differentiator that the run chose; none where it was stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differentiator: Option<DifferentiatorChoice>,
    /// The joints with dry friction whose torque near rest does not count, joint by joint: where rows near rest made
    /// the fit leave more of it. Empty where they did at none, and of runs together, each of which has its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub near_rest: Vec<Option<NearRest>>,
    /// Where runs that were fitted together have constant torques of their own: by how much each deviates from the
    /// mean, which the base parameters hold. Empty where they share one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub run_offsets: Vec<RunOffset>,
}

impl RunEstimate {
    /// What a controller gets: the physically consistent set if it was asked for, else the estimate as it is. None
    /// where the physically consistent set was asked for and does not exist.
    pub fn for_controller(&self) -> Option<ModelParameters> {
        match (&self.possible, &self.impossible) {
            (Some(parameters), _) => Some(ModelParameters::All(parameters.clone())),
            (None, None) => Some(ModelParameters::Base(self.values.clone())),
            (None, Some(_)) => None,
        }
    }

    /// How far from rest the torque of each joint has to be to count; empty where only rests are set aside.
    pub fn rest_margins(&self) -> Vec<RestMargin> {
        let margin = |near_rest: &Option<NearRest>| near_rest.as_ref().map(|found| found.margin).unwrap_or_default();
        self.near_rest.iter().map(margin).collect()
    }

    /// How many times wider its error bars are than another's: the geometric mean over the parameters that both
    /// determine; 1 where there is none.
    pub(crate) fn wider_than(&self, other: &Self) -> f64 {
        let pairs = self.std.iter().zip(&other.std).filter(|(own, other)| **own > 0.0 && **other > 0.0);
        let (sum, count) =
            pairs.fold((0.0, 0.0_f64), |(sum, count), (own, other)| (sum + (own / other).ln(), count + 1.0));
        (sum / count.max(1.0)).exp()
    }
}

/// As [`identify_run`](crate::identify_run) from several runs together, each weighted by its own noise joint by joint
/// ([`LogNoise::Own`](dynident_identification::LogNoise::Own)): bars narrow with every run, and a run that followed its
/// trajectory badly counts for what it tells. Residuals are those of the last run. Delays are those of all runs.
/// Where one has a constant torque that the others have not, each gets its own ([`RunOffsets`](super::RunOffsets)).
///
/// # Errors
/// As [`identify_run`](crate::identify_run).
pub fn identify_runs(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
) -> Result<RunEstimate, IterationError> {
    match (settings.scheme, choices(&task.robot, runs, settings.run_offsets)) {
        (Scheme::AllJoints, &[shared, own]) => {
            let shared = fitted(task, runs, settings, shared)?;
            // A fit that fails with more columns is no reason for any.
            let own = fitted(task, runs, settings, own).ok();
            Ok(own.filter(|own| own.impossible.is_none() && seen(&own.run_offsets, runs)).unwrap_or(shared))
        }
        (Scheme::AllJoints, &[one]) => fitted(task, runs, settings, one),
        _ => fitted(task, runs, settings, OffsetChoice::Shared),
    }
}

/// The fit with one offset of a joint for all runs, or one for each.
///
/// Friction that is chosen with a lag in the rows can make up for it, at each joint for another part, so that no common
/// lag is seen beyond its bar any more. So where friction is chosen and none was taken off, that of the stated friction
/// is, whatever its bar, and the fit counts that says most of the rows with the fewest parameters ([`schwarz`]).
fn fitted(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
    offsets: OffsetChoice,
) -> Result<RunEstimate, IterationError> {
    let recordings = recordings(task, runs, settings)?;
    let mut identification = identification_settings(task, settings, runs.len());
    identification.offsets = offsets;
    let fit = RunsFit { task, runs, settings, recordings: &recordings };
    let found = fit.rounds(&identification, LagRounds::of(identification.lags))?;
    let is_free = settings.scheme == Scheme::AllJoints && !identification.friction.is_empty();
    if !is_free || found.estimate.lag.kind == LagKind::Common {
        return Ok(found.estimate);
    }
    let mut stated = identification.clone();
    stated.friction.clear();
    let of_stated = fit.rounds(&stated, LagRounds::of(identification.lags))?.estimate.lag;
    let common_s = if of_stated.kind == LagKind::Common { of_stated.lag_s.first().copied() } else { None };
    let Some(lag_s) = common_s.or_else(|| of_stated.common.map(|common| common.lag_s)) else {
        return Ok(found.estimate);
    };
    let first = LagChoice { kind: LagKind::Common, lag_s: vec![lag_s; task.robot.dof()], ..LagChoice::default() };
    // Where the rows cannot be fitted so, they are as they were.
    let other = fit.rounds(&identification, LagRounds::of(identification.lags).after(first));
    Ok(other.ok().filter(|other| other.schwarz < found.schwarz).unwrap_or(found).estimate)
}

/// A fit and how much it says of its rows.
struct RunsEstimate {
    estimate: RunEstimate,
    schwarz: f64,
}

/// Runs that are fitted together.
struct RunsFit<'a> {
    task: &'a IterationTask,
    runs: &'a [RunLog<'a>],
    settings: &'a RunIdentificationSettings,
    recordings: &'a [Recording],
}

impl RunsFit<'_> {
    /// Fits from these rounds on, until the rows show no lag that moves parameters.
    fn rounds(
        &self,
        identification: &IdentificationSettings,
        mut rounds: LagRounds,
    ) -> Result<RunsEstimate, IterationError> {
        let Self { task, runs, settings, recordings } = self;
        let all: Vec<usize> = (0..recordings.len()).collect();
        let (robot, execution) = (&task.robot, Execution::default());
        let mut identification = identification.clone();
        loop {
            identification.motion.torque_lag_s = rounds.torque_lag_s();
            let logs = Logs::new(robot.model(), recordings, identification.row_settings(), &all, None, execution)?;
            let chosen = choose_friction(&logs, &identification, robot, &all, &settings.payloads)?;
            let mut training =
                training_rows(&logs, &identification, chosen.model.clone(), &all, &settings.payloads, None)?;
            training.friction_choice.clone_from(&chosen.joints);
            if training.problem.joint_rows().iter().sum::<usize>() == 0 {
                let problem = "no sample counts: the differentiator applies nowhere in the windows; look at its settings and at the tracking error".to_owned();
                return Err(IterationError::Record { joints: robot.joint_names(), problem });
            }
            if settings.scheme == Scheme::StepByStep {
                let estimate = joint_by_joint(task, &logs, &training, settings, &run_weights(task, runs))?;
                return Ok(RunsEstimate { estimate, schwarz: 0.0 });
            }
            let found = estimate(&training.rows(&logs, &identification, &all), None)?.estimate;
            let fit = lag_fit(&logs, &identification, &training.model, &training.columns, &found.values, &[], &all)?;
            if !rounds.again(fit.as_ref(), &found) {
                let schwarz = schwarz(&training.problem, &found);
                let of_constants = chosen.error_of_constants(training.problem.columns(), &found);
                let bars = ErrorBars::default()
                    .with(ErrorSource::Lag, rounds.error(fit.as_ref(), &found))
                    .with(ErrorSource::FrictionConstants, of_constants);
                let total = bars.total(&found);
                let estimate = all_joints(&logs, &identification, training, &all, &total, rounds.choice(), runs)?;
                return Ok(RunsEstimate { estimate, schwarz });
            }
        }
    }
}

/// For each recording and joint what its rows are multiplied by: the noise of the last run over that of its own.
fn run_weights(task: &IterationTask, runs: &[RunLog<'_>]) -> Vec<Vec<f64>> {
    let sigma = |log: &RunLog<'_>, joint: usize| log.joint_sigma.get(joint).copied().filter(|sigma| *sigma > 0.0);
    let of_run = |log: &RunLog<'_>| -> Vec<f64> {
        let weight = |joint: usize| Some(sigma(runs.last()?, joint)? / sigma(log, joint)?);
        (0..task.robot.dof()).map(|joint| weight(joint).unwrap_or(1.0)).collect()
    };
    runs.iter().flat_map(|log| core::iter::repeat_n(of_run(log), log.legs.len())).collect()
}

/// All joints at once.
fn all_joints(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    training: Training,
    all: &[usize],
    estimate: &Estimate,
    lag: LagChoice,
    runs: &[RunLog<'_>],
) -> Result<RunEstimate, IterationError> {
    let consistent = consistent_stage(logs, settings, &training, estimate)?;
    let arm = training.columns.arm_estimate(estimate);
    let run_offsets = deviations(&training.columns.offsets, estimate, runs);
    let mut joint_sigma = vec![0.0; training.model.dof()];
    training.joints.iter().zip(&arm.joint_sigma).for_each(|(&joint, sigma)| joint_sigma[joint] = *sigma);
    let fixed = arm.rank.fixed.iter().map(|fixed| fixed.column).filter(|&column| column < arm.values.len()).collect();
    let theta = |index: usize| training.columns.base_values(index, &estimate.values);
    let torque_lags = lags_of_recordings(logs, &settings.estimation, &training.model, &theta, all)?;
    Ok(RunEstimate {
        std: (0..arm.values.len()).map(|k| arm.covariance[(k, k)].max(0.0).sqrt()).collect(),
        covariance: arm.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        rows: training.problem.joint_rows().iter().sum(),
        joint_sigma,
        fixed,
        possible: consistent.fit.map(|fit| fit.parameters),
        impossible: consistent.failure,
        friction: training.friction_choice,
        torque_lags,
        lag,
        differentiator: None,
        near_rest: Vec::new(),
        run_offsets,
        values: arm.values,
    })
}

/// The paper's order: each joint from its own rows, tip first.
fn joint_by_joint(
    task: &IterationTask,
    logs: &Logs<'_>,
    training: &Training,
    settings: &RunIdentificationSettings,
    weights: &[Vec<f64>],
) -> Result<RunEstimate, IterationError> {
    let robot = &task.robot;
    let (names, joints) = (robot.base().expressions(), robot.joint_names());
    let fallback = robot.base().values(robot.nominal());
    let steps = step_by_step(task, logs, &settings.estimation, weights, &names, &joints, &fallback)?;
    let given = task.known_values();
    let fixed = (0..names.len()).filter(|&k| !steps.found[k] && given[k].is_none()).collect();
    let sigma: Vec<f64> = training.joints.iter().map(|&joint| steps.joint_sigma[joint]).collect();
    let (possible, impossible) = match &settings.consistency {
        Some(knowledge) => consistent(robot, &training.problem, &sigma, knowledge),
        None => (None, None),
    };
    Ok(RunEstimate {
        std: (0..names.len()).map(|k| steps.covariance[(k, k)].max(0.0).sqrt()).collect(),
        covariance: steps.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        values: steps.values,
        rows: steps.rows,
        joint_sigma: steps.joint_sigma,
        fixed,
        possible,
        impossible,
        friction: Vec::new(),
        torque_lags: Vec::new(),
        lag: LagChoice::default(),
        differentiator: None,
        near_rest: Vec::new(),
        run_offsets: Vec::new(),
    })
}

/// All parameters of the consistent set that fits best, or why there is none.
fn consistent(
    robot: &ParametricModel,
    problem: &LinearProblem,
    sigma: &[f64],
    settings: &ConsistencySettings,
) -> (Option<Vec<f64>>, Option<String>) {
    match consistent_parameters(robot, problem, sigma, settings) {
        Ok(fit) => (Some(fit.parameters), None),
        Err(reason) => (None, Some(reason.to_string())),
    }
}
