use crate::estimation::differentiator_choice::DifferentiatorChoice;
use crate::estimation::run_logs::{RunLog, identification_settings, recordings};
use crate::estimation::run_offsets::{RunOffset, choices, deviations, is_any_significant};
use crate::estimation::step_by_step::step_by_step;
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::model_parameters::ModelParameters;
use crate::setup::settings::{RunIdentificationSettings, Scheme};
use crate::signals::near_rest::SamplesNearRest;
use crate::signals::rests::StictionBand;
use dynident_dynamics::ParametricModel;
use dynident_estimation::{Estimate, LinearProblem};
use dynident_identification::consistent::{ConsistencySettings, consistent_parameters};
use dynident_identification::estimators::estimate;
use dynident_identification::examination::{LagChoice, LagKind, LagRounds, TorqueLag, lag_fit, lags_of_recordings};
use dynident_identification::friction::JointFriction;
use dynident_identification::{
    ErrorBars, ErrorSource, Execution, IdentificationSettings, Logs, OffsetChoice, Recording, Training, bic,
    choose_friction, consistent_stage, training_rows,
};
use serde::{Deserialize, Serialize};

/// Estimate of the base parameters from one run, or from several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunEstimate {
    /// Estimated values of the base parameters.
    pub values: Vec<f64>,
    /// Standard deviations of the values; zero for parameters that were given or that the data do not determine.
    pub std: Vec<f64>,
    /// Covariance of the values, by rows.
    pub covariance: Vec<Vec<f64>>,
    /// Number of rows in the fit.
    pub rows: usize,
    /// Standard deviation of each joint's residual, Nm (N).
    pub joint_sigma: Vec<f64>,
    /// Indices of the base parameters that the data do not determine; their values are nominal.
    pub fixed: Vec<usize>,
    /// All parameters of the best physically consistent model, ten per body and one per term, if requested.
    pub possible: Option<Vec<f64>>,
    /// Why no physically consistent model was found; `None` if one was found or not requested.
    pub impossible: Option<String>,
    /// Friction laws that were selected from this run, for it and all later runs. Empty if the study gives the
    /// friction laws or an earlier run selected them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub friction: Vec<JointFriction>,
    /// Lag of each joint's torque behind the motion, including the compensated part; `None` if the rows do not
    /// determine it. Empty if joints are identified one by one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_lags: Vec<Option<TorqueLag>>,
    /// The compensated lag and the lag that all joints share.
    #[serde(default)]
    pub lag: LagChoice,
    /// The selected differentiator; `None` if the settings define it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differentiator: Option<DifferentiatorChoice>,
    /// For each joint with dry friction, the excluded rows near zero velocity, if these rows increase the residual;
    /// `None` for other joints. Empty if no rows are excluded, and for runs that are fitted together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub near_rest: Vec<Option<SamplesNearRest>>,
    /// Deviation of each run's torque offset from the mean, if runs that are fitted together have separate offsets;
    /// the base parameters contain the mean. Empty if all runs share one offset.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub run_offsets: Vec<RunOffset>,
}

impl RunEstimate {
    /// Returns the model parameters for a controller: the physically consistent model if requested, otherwise the
    /// base parameters. `None` if the physically consistent model was requested and not found.
    pub fn for_controller(&self) -> Option<ModelParameters> {
        match (&self.possible, &self.impossible) {
            (Some(parameters), _) => Some(ModelParameters::All(parameters.clone())),
            (None, None) => Some(ModelParameters::Base(self.values.clone())),
            (None, Some(_)) => None,
        }
    }

    /// Returns the distance from rest (zero velocity) above which the rows of each joint are used; empty if only rows
    /// at rest are excluded.
    pub fn rest_margins(&self) -> Vec<StictionBand> {
        let margin =
            |near_rest: &Option<SamplesNearRest>| near_rest.as_ref().map(|found| found.margin).unwrap_or_default();
        self.near_rest.iter().map(margin).collect()
    }

    /// Geometric mean of the ratio of this estimate's error bars to those of the other, over the parameters that both
    /// determine; 1 if there are none.
    pub(crate) fn wider_than(&self, other: &Self) -> f64 {
        let pairs = self.std.iter().zip(&other.std).filter(|(own, other)| **own > 0.0 && **other > 0.0);
        let (sum, count) =
            pairs.fold((0.0, 0.0_f64), |(sum, count), (own, other)| (sum + (own / other).ln(), count + 1.0));
        (sum / count.max(1.0)).exp()
    }
}

/// Identifies several runs together, as [`identify_run`](crate::identify_run) does for one run. Each run is weighted
/// by its own noise, joint by joint ([`LogNoise::Own`](dynident_identification::LogNoise::Own)), so that a run with
/// poor tracking has less weight. Residuals are those of the last run; delays are those of all runs. If the offset of
/// a run differs from the others, each run gets its own offset ([`RunOffsets`](crate::RunOffsets)).
///
/// # Errors
/// Same as for [`identify_run`](crate::identify_run).
pub fn identify_runs(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
) -> Result<RunEstimate, IterationError> {
    match (settings.scheme, choices(&task.robot, runs, settings.run_offsets)) {
        (Scheme::AllJoints, &[shared, own]) => {
            let shared = fitted(task, runs, settings, shared)?;
            // A failed fit with separate offsets is not an error: the shared offset is used.
            let own = fitted(task, runs, settings, own).ok();
            Ok(own
                .filter(|own| own.impossible.is_none() && is_any_significant(&own.run_offsets, runs))
                .unwrap_or(shared))
        }
        (Scheme::AllJoints, &[one]) => fitted(task, runs, settings, one),
        _ => fitted(task, runs, settings, OffsetChoice::Shared),
    }
}

/// Fits the runs with one shared offset per joint, or with one offset per joint and run.
///
/// If the rows contain a lag, the selected friction can compensate it, differently at each joint, so that the common
/// lag becomes insignificant. Therefore, if friction was selected and no lag was compensated, the fit is repeated
/// with the lag that is estimated with the given friction, independent of its error bar. The fit with the smaller
/// Bayesian information criterion ([`bic`]) is kept.
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
    let is_free = settings.scheme == Scheme::AllJoints && identification.friction.is_selected();
    if !is_free || found.estimate.lag.kind == LagKind::Common {
        return Ok(found.estimate);
    }
    let mut stated = identification.clone();
    stated.friction = stated.friction.without_selection();
    let of_stated = fit.rounds(&stated, LagRounds::of(identification.lags))?.estimate.lag;
    let common_s = if of_stated.kind == LagKind::Common { of_stated.lag_s.first().copied() } else { None };
    let Some(lag_s) = common_s.or_else(|| of_stated.common.map(|common| common.lag_s)) else {
        return Ok(found.estimate);
    };
    let first = LagChoice { kind: LagKind::Common, lag_s: vec![lag_s; task.robot.dof()], ..LagChoice::default() };
    // If the repeated fit fails, the first fit is kept.
    let other = fit.rounds(&identification, LagRounds::of(identification.lags).after(first));
    Ok(other.ok().filter(|other| other.bic < found.bic).unwrap_or(found).estimate)
}

struct RunsEstimate {
    estimate: RunEstimate,
    bic: f64,
}

struct RunsFit<'a> {
    task: &'a IterationTask,
    runs: &'a [RunLog<'a>],
    settings: &'a RunIdentificationSettings,
    recordings: &'a [Recording],
}

impl RunsFit<'_> {
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
                let problem = "no usable sample: the differentiator is valid nowhere in the windows; check its settings and the tracking error".to_owned();
                return Err(IterationError::Record { joints: robot.joint_names(), problem });
            }
            if settings.scheme == Scheme::StepByStep {
                let estimate = joint_by_joint(task, &logs, &training, settings, &run_weights(task, runs))?;
                return Ok(RunsEstimate { estimate, bic: 0.0 });
            }
            let found = estimate(&training.rows(&logs, &identification, &all), None)?.estimate;
            let fit = lag_fit(&logs, &identification, &training.model, &training.columns, &found.values, &[], &all)?;
            if !rounds.again(fit.as_ref(), &found) {
                let bic = bic(&training.problem, &found);
                let of_constants = chosen.error_of_constants(training.problem.columns(), &found);
                let bars = ErrorBars::default()
                    .with(ErrorSource::Lag, rounds.error(fit.as_ref(), &found))
                    .with(ErrorSource::FrictionConstants, of_constants);
                let total = bars.total(&found);
                let estimate = all_joints(&logs, &identification, training, &all, &total, rounds.choice(), runs)?;
                return Ok(RunsEstimate { estimate, bic });
            }
        }
    }
}

/// Row weights of each recording and joint: noise of the last run divided by noise of the recording's run.
fn run_weights(task: &IterationTask, runs: &[RunLog<'_>]) -> Vec<Vec<f64>> {
    let sigma = |log: &RunLog<'_>, joint: usize| log.joint_sigma.get(joint).copied().filter(|sigma| *sigma > 0.0);
    let of_run = |log: &RunLog<'_>| -> Vec<f64> {
        let weight = |joint: usize| Some(sigma(runs.last()?, joint)? / sigma(log, joint)?);
        (0..task.robot.dof()).map(|joint| weight(joint).unwrap_or(1.0)).collect()
    };
    runs.iter().flat_map(|log| core::iter::repeat_n(of_run(log), log.legs.len())).collect()
}

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

/// Identifies each joint from its own rows, from tip to base.
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

/// All parameters of the best physically consistent model, or the reason why it was not found.
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
