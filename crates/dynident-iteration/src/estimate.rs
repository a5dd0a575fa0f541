//! One run's identification.

use crate::error::IterationError;
use crate::leg::IterationTask;
use crate::motion::{MeasuredMotion, measured_motion};
use crate::record::ModelParameters;
use crate::rows::visit_rows;
use crate::settings::{RunIdentificationSettings, Scheme};
use crate::step_by_step::{least_squares, step_by_step};
use dynident_estimation::{LinearProblem, SegmentSettings, SegmentedFactor};
use dynident_identification::consistent::consistent_parameters;
use dynident_simulation::Record;
use dynident_simulation::require_length;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// How closely given values are held, as a share of the largest of them.
const HELD: f64 = 1e-6;

/// What a run tells of the base parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunEstimate {
    /// Base parameters.
    pub values: Vec<f64>,
    /// Their standard deviations; zero for what was given or is not told by the data.
    pub std: Vec<f64>,
    /// Their covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// Rows that it was made from.
    pub rows: usize,
    /// Standard deviation of each joint's residual, Nm (N).
    pub joint_sigma: Vec<f64>,
    /// Base parameters that the data do not tell: they have the prior's values.
    pub fixed: Vec<usize>,
    /// All parameters of the possible machine that fits best, ten for each body and one for each law, if it was asked for.
    pub possible: Option<Vec<f64>>,
    /// Why there is none although it was asked for.
    pub impossible: Option<String>,
}

impl RunEstimate {
    /// What a controller gets: the possible machine if it was asked for, else the estimate as it is. None where the possible machine was asked for and does not exist.
    pub fn for_controller(&self) -> Option<ModelParameters> {
        match (&self.possible, &self.impossible) {
            (Some(parameters), _) => Some(ModelParameters::All(parameters.clone())),
            (None, None) => Some(ModelParameters::Base(self.values.clone())),
            (None, Some(_)) => None,
        }
    }

    /// How many times wider its error bars are than another's: the geometric mean over the parameters that both tell; 1 where there is none.
    pub(crate) fn wider_than(&self, other: &Self) -> f64 {
        let pairs = self.std.iter().zip(&other.std).filter(|(own, other)| **own > 0.0 && **other > 0.0);
        let (sum, count) =
            pairs.fold((0.0, 0.0_f64), |(sum, count), (own, other)| (sum + (own / other).ln(), count + 1.0));
        (sum / count.max(1.0)).exp()
    }
}

/// Base parameters from the records of one run, one record for each leg of the task: differentiate, make rows within the windows that count, fit all joints at once or step by step, and find the
/// possible machine that fits the same rows best.
///
/// # Errors
/// Records that do not belong to the task, a differentiator that cannot be applied, rows that do not carry an estimate. A possible machine that does not exist is part of the result.
pub fn identify_run(
    task: &IterationTask,
    records: &[Record],
    settings: &RunIdentificationSettings,
) -> Result<RunEstimate, IterationError> {
    require_length("records of the run's legs", task.legs.len(), records.len())?;
    let joints: Vec<String> = task.machine.model().joints().iter().map(|joint| joint.name.clone()).collect();
    let motions = task
        .legs
        .iter()
        .zip(records)
        .map(|(leg, record)| measured_motion(record, leg, settings))
        .collect::<Result<Vec<_>, _>>()?;
    let names = task.machine.base().expressions();
    let fallback = task.machine.base().values(task.machine.nominal());
    let Rows { problem, joints: with_rows } = all_rows(task, &motions, settings, &names, &joints, &fallback)?;
    let count = names.len();
    if problem.joint_rows().iter().sum::<usize>() == 0 {
        let problem = "no sample counts: the differentiator applies nowhere in the windows; look at its settings and at the tracking error".to_owned();
        return Err(IterationError::Record { joints, problem });
    }
    let (values, covariance, joint_sigma, fixed, rows) = match settings.scheme {
        Scheme::AllJoints => {
            let estimate = least_squares(&problem, settings)?;
            let fixed = estimate.rank.fixed.iter().map(|fixed| fixed.column).collect();
            let rows = problem.joint_rows().iter().sum();
            let mut joint_sigma = vec![0.0; joints.len()];
            with_rows.iter().zip(&estimate.joint_sigma).for_each(|(&joint, sigma)| joint_sigma[joint] = *sigma);
            (estimate.values, estimate.covariance, joint_sigma, fixed, rows)
        }
        Scheme::StepByStep => {
            let steps = step_by_step(task, &motions, settings, &names, &joints, &fallback)?;
            let given = task.known_values();
            let fixed = (0..count).filter(|&k| !steps.found[k] && given[k].is_none()).collect();
            (steps.values, steps.covariance, steps.joint_sigma, fixed, steps.rows)
        }
    };
    let (possible, impossible) = if settings.physical {
        let own_sigma: Vec<f64> = with_rows.iter().map(|&joint| joint_sigma[joint]).collect();
        match consistent_parameters(&task.machine, &problem, &own_sigma, &settings.possible) {
            Ok(fit) => (Some(fit.parameters), None),
            Err(reason) => (None, Some(reason.to_string())),
        }
    } else {
        (None, None)
    };
    let std = (0..count).map(|k| covariance[(k, k)].max(0.0).sqrt()).collect();
    let covariance = covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    Ok(RunEstimate { values, std, covariance, rows, joint_sigma, fixed, possible, impossible })
}

/// Rows, and which joints have any.
struct Rows {
    problem: LinearProblem,
    joints: Vec<usize>,
}

/// The problem of all rows that count, over the joints that have any; given values as a prior that holds them.
fn all_rows(
    task: &IterationTask,
    motions: &[MeasuredMotion],
    settings: &RunIdentificationSettings,
    names: &[String],
    joints: &[String],
    fallback: &[f64],
) -> Result<Rows, IterationError> {
    let layout = task.machine.layout();
    let mut all = Vec::new();
    for (leg, motion) in task.legs.iter().zip(motions) {
        let mut factors = (0..joints.len())
            .map(|joint| SegmentedFactor::new(layout.joint_columns(joint).len(), SegmentSettings::default()))
            .collect::<Result<Vec<_>, _>>()?;
        visit_rows(task, leg, motion, settings.parallel_filter.as_ref(), |joint, rows, panel| {
            factors[joint].absorb(panel, rows)?;
            Ok(())
        })?;
        all.push(factors);
    }
    let has_rows = |joint: usize| all.iter().any(|factors| factors[joint].rows() > 0);
    let with_rows: Vec<usize> = (0..joints.len()).filter(|&joint| has_rows(joint)).collect();
    let own_names = with_rows.iter().map(|&joint| joints[joint].clone()).collect();
    let mut problem = LinearProblem::new(names.to_vec(), own_names).with_fallback(fallback.to_vec())?;
    for (number, factors) in all.into_iter().enumerate() {
        for (joint, factor) in factors.into_iter().enumerate().filter(|(_, factor)| factor.rows() > 0) {
            let Some(place) = with_rows.iter().position(|&other| other == joint) else { continue };
            problem.add(&format!("leg {}", number + 1), place, layout.joint_columns(joint).to_vec(), factor)?;
        }
    }
    if task.known.is_empty() {
        return Ok(Rows { problem, joints: with_rows });
    }
    let largest = task.known.iter().fold(0.0_f64, |most, (_, value)| most.max(value.abs()));
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let mut mean = vec![0.0; names.len()];
    let mut information = DMatrix::zeros(task.known.len(), names.len());
    for (row, (column, value)) in task.known.iter().enumerate() {
        mean[*column] = *value;
        information[(row, *column)] = 1.0 / (HELD * largest);
    }
    Ok(Rows { problem: problem.with_prior(mean, information)?, joints: with_rows })
}
