//! Whether a link of another length than the description's would explain the torque better.
//!
//! A wrong length is not told by the size of what is left: friction that no law describes leaves as much. But of all
//! that a model may lack it is what a fit with another length mends. So the runs are fitted again with one length
//! changed by [`STEP`] either way. `Σ_j n_j σ_j(s)² / σ_j(0)²`, the squares that are left in units of those as
//! described, is a parabola in the change s; at its least the runs are fitted once more.

use crate::error::IterationError;
use crate::estimate::RunEstimate;
use crate::leg::IterationTask;
use crate::run_logs::{RunLog, identification_settings, recordings};
use crate::settings::{RunIdentificationSettings, Scheme};
use dynident_dynamics::ParametricModel;
use dynident_identification::estimators::estimate;
use dynident_identification::{Execution, IdentificationSettings, Logs, Recording, RegressorModel, training_rows};
use serde::{Deserialize, Serialize};

/// Change of a length that is tried, as a share of it.
const STEP: f64 = 0.03;
/// The furthest change that the parabola is believed.
const FURTHEST: f64 = 0.3;
/// A smaller change is none: bearings and tables of dimensions are not better.
const LEAST_CHANGE: f64 = 0.01;
/// What is left of some joint's torque is then at most this share of what was. Friction that the model has no law for
/// takes no length for one: chance moves residuals by some tenths of a percent for each number that is fitted.
const LEFT: f64 = 0.8;
/// Share of the squares of all joints that another length explains at least: a length enters the torque of several
/// joints, while friction without a law in one light joint takes a length for it alone. An honest arm of the campaign
/// reaches 0.06.
const LEAST_EXPLAINED: f64 = 0.12;
/// Offsets shorter than this share of the longest move too little torque to be looked at.
const SHORTEST: f64 = 0.02;

/// A link whose length is not the description's, by the torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct OtherLength {
    /// The joint whose distance from the one before it is another; none where all are by the same share.
    pub joint: Option<String>,
    /// How many times as long it is.
    pub factor: f64,
    /// The joint whose torque this explains best.
    pub explained_joint: String,
    /// What the fit leaves of that joint's torque as described, Nm (N), standard deviation.
    pub left_nm: f64,
    /// The same with the other length.
    pub left_with_nm: f64,
}

/// The change of one length, or of all by the same share, that explains the torque of some runs best, where one does
/// clearly. `task` is with the friction in force, `known` what the runs have told.
///
/// # Errors
/// Records that do not belong to the task.
pub(crate) fn other_length(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
    known: &RunEstimate,
) -> Result<Option<OtherLength>, IterationError> {
    let model = task.robot.model();
    let cannot = settings.scheme != Scheme::AllJoints || !task.known.is_empty() || !settings.payloads.is_empty();
    if cannot || model.coupling().is_some() {
        return Ok(None);
    }
    let motions = recordings(task, runs, settings)?;
    // A fit that does not come about is none that explains more.
    let mut identification = identification_settings(task, settings, runs.len());
    identification.friction.clear();
    identification.motion.torque_lag_s = known.lag.taken_off();
    let fitted = |joint: Option<usize>, change: f64| left_with(task, &motions, &identification, joint, change);
    let Some(described) = fitted(None, 0.0) else { return Ok(None) };
    let misfit = |left: &Left| -> f64 {
        let of_joint = |((sigma, rows), own): ((&f64, &usize), &f64)| *rows as f64 * (sigma / own).powi(2);
        let moving = left.sigma.iter().zip(&left.rows).zip(&described.sigma).filter(|(_, own)| **own > 0.0);
        moving.map(of_joint).sum()
    };
    let as_described = misfit(&described);
    let length = |joint: usize| model.joints()[joint].placement.translation.norm();
    let longest = (0..model.dof()).map(length).fold(0.0, f64::max);
    // The first joint's distance from the base is no matter of its torque; of an arm with one length all is that one.
    let long: Vec<usize> = (1..model.dof()).filter(|&joint| length(joint) > SHORTEST * longest).collect();
    let all = (long.len() > 1).then_some(None);
    let mut best: Option<(f64, OtherLength)> = None;
    for joint in long.into_iter().map(Some).chain(all) {
        let (Some(shorter), Some(longer)) = (fitted(joint, -STEP), fitted(joint, STEP)) else { continue };
        let (shorter, longer) = (misfit(&shorter), misfit(&longer));
        let (slope, bend) = (0.5 * (longer - shorter), longer - 2.0 * as_described + shorter);
        let change = (-slope / bend * STEP).clamp(-FURTHEST, FURTHEST);
        if bend <= 0.0 || change.is_nan() || change.abs() < LEAST_CHANGE {
            continue;
        }
        let Some(there) = fitted(joint, change) else { continue };
        let share = |place: &usize| there.sigma[*place] / described.sigma[*place];
        let explained =
            (0..model.dof()).filter(|&place| described.sigma[place] > 0.0).min_by(|a, b| share(a).total_cmp(&share(b)));
        let Some(place) = explained.filter(|place| share(place) < LEFT) else { continue };
        let most = (1.0 - LEAST_EXPLAINED) * as_described;
        if misfit(&there) < best.as_ref().map_or(most, |(least, _)| *least) {
            let name = |joint: usize| model.joints()[joint].name.clone();
            let found = OtherLength {
                joint: joint.map(name),
                factor: 1.0 + change,
                explained_joint: name(place),
                left_nm: described.sigma[place],
                left_with_nm: there.sigma[place],
            };
            best = Some((misfit(&there), found));
        }
    }
    Ok(best.map(|(_, found)| found))
}

/// What a fit leaves.
struct Left {
    /// σ_j, Nm (N); zero of a joint that has no rows.
    sigma: Vec<f64>,
    /// How many each joint has.
    rows: Vec<usize>,
}

/// What a fit leaves with one length, or all, longer by a share.
fn left_with(
    task: &IterationTask,
    motions: &[Recording],
    identification: &IdentificationSettings,
    joint: Option<usize>,
    change: f64,
) -> Option<Left> {
    let model = task.robot.model();
    // The first joint's distance from the base moves no torque.
    let joints = joint.map_or_else(|| (1..model.dof()).collect(), |joint| vec![joint]);
    let model = model.clone().with_joint_distances(&joints, 1.0 + change).ok()?;
    let robot = ParametricModel::new(model, task.robot.terms().to_vec()).ok()?;
    let all: Vec<usize> = (0..motions.len()).collect();
    let logs =
        Logs::new(robot.model(), motions, identification.row_settings(), &all, None, Execution::default()).ok()?;
    let training = training_rows(&logs, identification, RegressorModel::from(robot), &all, &[], None).ok()?;
    let found = estimate(&training.rows(&logs, identification, &all), None).ok()?.estimate;
    let (mut sigma, mut rows) = (vec![0.0; task.robot.dof()], vec![0; task.robot.dof()]);
    let of_joints = training.joints.iter().zip(found.joint_sigma.iter().zip(training.problem.joint_rows()));
    of_joints.for_each(|(&joint, (own, count))| (sigma[joint], rows[joint]) = (*own, count));
    Some(Left { sigma, rows })
}
