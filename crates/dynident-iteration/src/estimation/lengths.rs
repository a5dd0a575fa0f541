//! Detection of a link length that differs from the robot description.
//!
//! The size of the residual does not reveal a wrong length, because unmodelled friction causes a similar residual.
//! But only for a wrong length does another length reduce the residual. So the runs are fitted again with one length
//! changed by ±[`LENGTH_STEP`]. The sum of squared residuals relative to those of the lengths in the description,
//! `Σ_j n_j σ_j(s)² / σ_j(0)²` with n_j rows of joint j, is a parabola in the change s. The runs are fitted again at
//! its minimum.

use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_logs::{RunLog, identification_settings, recordings};
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::settings::{RunIdentificationSettings, Scheme};
use crate::setup::verdict_settings::LengthSettings;
use dynident_dynamics::ParametricModel;
use dynident_identification::estimators::estimate;
use dynident_identification::{Execution, IdentificationSettings, Logs, Recording, RegressorModel, training_rows};
use serde::{Deserialize, Serialize};

/// Relative change of a length in the trial fits.
const LENGTH_STEP: f64 = 0.03;
/// Largest relative change for which the parabola is used.
const MAX_LENGTH_CHANGE: f64 = 0.3;
/// Minimum joint offset that is tested, as a share of the longest offset; shorter offsets have too little effect on
/// the torque.
const MIN_OFFSET_SHARE: f64 = 0.02;

/// A link length that differs from the robot description, estimated from the torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct OtherLength {
    /// The joint whose distance from the previous joint differs; `None` if all lengths differ by the same factor.
    pub joint: Option<String>,
    /// Ratio of the estimated length to the length in the robot description.
    pub factor: f64,
    /// The joint whose residual decreases most.
    pub explained_joint: String,
    /// Residual of that joint with the lengths of the robot description, Nm (N), standard deviation.
    pub left_nm: f64,
    /// Residual of that joint with the estimated length, Nm (N).
    pub left_with_nm: f64,
}

/// Returns the change of one length, or of all lengths by the same factor, that explains the torque of some runs
/// best, if the improvement is significant. `task` includes the selected friction; `known` is the estimate of the
/// runs.
pub(crate) fn other_length(
    task: &IterationTask,
    runs: &[RunLog<'_>],
    settings: &RunIdentificationSettings,
    known: &RunEstimate,
    thresholds: &LengthSettings,
) -> Result<Option<OtherLength>, IterationError> {
    let model = task.robot.model();
    let cannot = settings.scheme != Scheme::AllJoints || !task.known.is_empty() || !settings.payloads.is_empty();
    if cannot || model.coupling().is_some() {
        return Ok(None);
    }
    let motions = recordings(task, runs, settings)?;
    // A fit that fails is skipped.
    let mut identification = identification_settings(task, settings, runs.len());
    identification.friction = identification.friction.without_selection();
    identification.motion.torque_lag_s = known.lag.taken_off();
    let fitted = |joint: Option<usize>, change: f64| residuals_with(task, &motions, &identification, joint, change);
    let Some(described) = fitted(None, 0.0) else { return Ok(None) };
    let misfit = |left: &Residuals| -> f64 {
        let of_joint = |((sigma, rows), own): ((&f64, &usize), &f64)| *rows as f64 * (sigma / own).powi(2);
        let moving = left.sigma.iter().zip(&left.rows).zip(&described.sigma).filter(|(_, own)| **own > 0.0);
        moving.map(of_joint).sum()
    };
    let as_described = misfit(&described);
    let length = |joint: usize| model.joints()[joint].placement.translation.norm();
    let longest = (0..model.dof()).map(length).fold(0.0, f64::max);
    // The first joint's distance from the base has no effect on the torque. If there is only one other length,
    // changing it is the same as changing all lengths.
    let long: Vec<usize> = (1..model.dof()).filter(|&joint| length(joint) > MIN_OFFSET_SHARE * longest).collect();
    let all = (long.len() > 1).then_some(None);
    let mut best: Option<(f64, OtherLength)> = None;
    for joint in long.into_iter().map(Some).chain(all) {
        let (Some(shorter), Some(longer)) = (fitted(joint, -LENGTH_STEP), fitted(joint, LENGTH_STEP)) else { continue };
        let (shorter, longer) = (misfit(&shorter), misfit(&longer));
        let (slope, bend) = (0.5 * (longer - shorter), longer - 2.0 * as_described + shorter);
        let change = (-slope / bend * LENGTH_STEP).clamp(-MAX_LENGTH_CHANGE, MAX_LENGTH_CHANGE);
        if bend <= 0.0 || change.is_nan() || change.abs() < thresholds.min_change {
            continue;
        }
        let Some(there) = fitted(joint, change) else { continue };
        let share = |place: &usize| there.sigma[*place] / described.sigma[*place];
        let explained =
            (0..model.dof()).filter(|&place| described.sigma[place] > 0.0).min_by(|a, b| share(a).total_cmp(&share(b)));
        let Some(place) = explained.filter(|place| share(place) < thresholds.max_residual_ratio) else { continue };
        let most = (1.0 - thresholds.min_explained_share) * as_described;
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

struct Residuals {
    /// Residual σ_j of each joint, Nm (N); zero for a joint without rows.
    sigma: Vec<f64>,
    rows: Vec<usize>,
}

/// Residuals with one length, or all lengths, multiplied by `1 + change`.
fn residuals_with(
    task: &IterationTask,
    motions: &[Recording],
    identification: &IdentificationSettings,
    joint: Option<usize>,
    change: f64,
) -> Option<Residuals> {
    let model = task.robot.model();
    // The first joint's distance from the base has no effect on the torque.
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
    Some(Residuals { sigma, rows })
}
