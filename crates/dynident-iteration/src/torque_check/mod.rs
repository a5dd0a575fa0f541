//! Compares the logged torque of a run with the torque that its controller commanded.
//!
//! Identification uses the logged torque as the torque of the drives. The log alone cannot confirm this: a wrong
//! scale, a reversed sign or subtracted gravity yields the model of another robot, which can even track well. But
//! controller, model and reference of a run are known, so the commanded torque follows from the logged positions. For
//! a correct log both torques agree, except for noise, delays and the offset of the torque sensor:
//!
//! `τ_log,j(t) = s_j τ_cmd,j(t − l; q(t − l − d_q), q̇(t − l − d_v), (1 + ε)(t − l)) + c_j`
//!
//! `s_j` = 1 is the torque scale of joint j and `c_j` an offset. All joints share two delays of the feedback (d_q of
//! positions, d_v of velocities), a lag l of the logged torque and a relative rate error ε of the log's clock. Drives
//! with their own position loop have unknown gains `k_p`, `k_i` and `k_d`. With the feed-forward torque `τ_ff,j` and
//! the position error `e_j`, `τ_log,j = s_j τ_ff,j + k_p e_j + k_i ∫e_j + k_d ė_j + c_j`, over all good runs
//! together.
//!
//! | file | content |
//! | --- | --- |
//! | `command` | the commanded torque along a log |
//! | `separable_fit` | scales and timing by least squares |
//! | `explanation` | the candidates that explain a difference |
//! | `row_scale` | the torque scale of each joint from the parameters that several joints share |
//! | `response` | whether the motion agrees with the torque |
//! | `agreement` | one cause for all joints, if one explains them all |
//! | `causes` | combines the results of single joints |

mod agreement;
mod causes;
mod command;
mod explanation;
mod response;
mod row_scale;
mod separable_fit;

pub use causes::TorqueCause;
pub use explanation::TorqueCandidate;
pub(crate) use row_scale::{LeastDeviation, RowScale, row_scales};

use crate::setup::leg::{IterationTask, Leg};
use crate::setup::settings::RunIdentificationSettings;
use crate::setup::torque_check_settings::{CauseSettings, TorqueCheckSettings};
use agreement::agreement;
use command::{CommandLaw, ObservedLeg, shared_parameters};
use dynident_simulation::Record;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use explanation::{Explanation, JointData, explain, may_be_missing};
use response::{early_causes, limit_causes};
use separable_fit::{SHARED, SeparableFit, separable_fit};
use serde::{Deserialize, Serialize};

/// Cut-off frequency of the comparison if the identification uses no filter, Hz for an arm of 1.2 m.
const USUAL_CUTOFF_HZ: f64 = 8.0;
const MAX_POINTS: usize = 150;
/// Minimum number of periods of the cut-off frequency in a run.
const MIN_CYCLES_PER_RUN: f64 = 12.0;
/// Another timing is used if the ratio of the squared differences with and without it is at most this.
const MAX_RESIDUAL_RATIO: f64 = 0.5;
const MIN_ROWS: usize = 20;

/// Origin of the commanded torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CommandSource {
    /// Computed with the control law and its model.
    Controller,
    /// The torque that drives with their own position loop receive as feed-forward.
    FeedForward,
    /// Unknown: drives with their own position loop receive only a path. A scale that all joints share is then not
    /// checked.
    PathOnly,
}

/// Result of the comparison for one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointTorqueCheck {
    /// Ratio of logged to commanded torque; `None` if the run does not determine it.
    pub scale: Option<f64>,
    /// Standard deviation of the scale.
    pub scale_std: Option<f64>,
    /// Root mean square of the difference between logged and commanded torque without its mean, in percent of the
    /// logged torque; `None` if the commanded torque is unknown.
    pub difference_percent: Option<f64>,
    /// Torque scale relative to the other joints, from the parameters on which the torques of several joints depend;
    /// `None` if these do not determine it.
    pub row_scale: Option<f64>,
    /// Standard deviation of the relative scale.
    pub row_scale_std: Option<f64>,
    /// Commanded and logged torque of some samples, Nm (N); empty if the commanded torque is unknown.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
}

/// Result of the comparison of logged and commanded torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueCheck {
    /// Source of the commanded torque.
    pub source: CommandSource,
    /// Delays of positions and velocities in the controller, s; zero for drives with their own loop.
    pub feedback_delay_s: [f64; 2],
    /// Delay of the logged torque relative to the commanded torque, s.
    pub torque_lag_s: f64,
    /// Standard deviation of the delay between positions and torques of the log, s; `None` if unknown.
    #[serde(default)]
    pub torque_lag_std_s: Option<f64>,
    /// Percentage by which the log's clock is slower than the controller's.
    pub clock_percent: f64,
    /// Standard deviation of `clock_percent`; `None` if the commanded torque is unknown.
    pub clock_percent_std: Option<f64>,
    /// The joints.
    pub joints: Vec<JointTorqueCheck>,
    /// Mistakes; empty if the logged torque agrees with the commanded torque.
    pub causes: Vec<TorqueCause>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CheckedRun<'a> {
    pub(crate) legs: &'a [Leg],
    pub(crate) records: &'a [Record],
    pub(crate) controller: &'a ControllerSettings,
    pub(crate) model: Option<&'a ControllerModel>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CheckWith<'a> {
    pub(crate) settings: &'a TorqueCheckSettings,
    pub(crate) identification: &'a RunIdentificationSettings,
    pub(crate) row_scales: &'a [Option<RowScale>],
    /// Largest accepted delay between positions and torques of a log, s.
    pub(crate) most_lag_s: f64,
    /// Whether drives with their own loop receive feed-forward torque in later runs, which determines the scale of
    /// each joint.
    pub(crate) feeds_forward_later: bool,
    pub(crate) ended_early: bool,
}

/// Compares the logged with the commanded torque; `None` if too little was recorded. `runs` contains all runs, the
/// newest last; earlier runs are only used to determine the gains of drives with their own loop. `task` includes the
/// selected friction.
pub(crate) fn check_torque(task: &IterationTask, runs: &[CheckedRun<'_>], with: &CheckWith<'_>) -> Option<TorqueCheck> {
    let check = compared(task, runs, with);
    let is_explained = check.as_ref().is_some_and(|check| check.causes.iter().any(TorqueCause::is_determined));
    let newest = runs
        .last()
        .filter(|newest| with.ended_early && !is_explained && source_of(newest) == CommandSource::Controller);
    let Some(newest) = newest else { return check };
    let causes = early_causes(task, newest);
    if causes.is_empty() {
        return check;
    }
    let check = check.unwrap_or_else(|| TorqueCheck::without_command(CommandSource::Controller, with.row_scales));
    Some(TorqueCheck { causes, ..check })
}

fn compared(task: &IterationTask, runs: &[CheckedRun<'_>], with: &CheckWith<'_>) -> Option<TorqueCheck> {
    let newest = runs.last()?;
    let source = source_of(newest);
    let dof = task.robot.dof();
    let cutoff_hz = cutoff_hz(task, with.identification, newest);
    // The gains of drives with their own loop are the same in all runs.
    let used = if source == CommandSource::Controller { &runs[runs.len() - 1..] } else { runs };
    let observed = Observed::of(used, dof, cutoff_hz);
    let mut check = TorqueCheck::without_command(source, with.row_scales);
    if observed.rows() < MIN_ROWS {
        return None;
    }
    let torque = observed.joined(&|leg| leg.torque.clone());
    let motion = [0, 1, 2].map(|place| observed.joined(&|leg| leg.filtered_motion()[place].clone()));
    let (parameters, starts) = (shared_parameters(), observed.legs[0].0.starts());
    let mut fit = separable_fit(&torque, &parameters, &starts, &mut |timing| observed.columns(timing));
    if fit.columns.iter().zip(&torque).any(|(columns, y)| columns.iter().any(|column| column.len() != y.len())) {
        return None;
    }
    let explained = |columns: &[Vec<Vec<f64>>]| -> Vec<Explanation> {
        let data = JointData { task, torque: &torque, columns, q: &motion[0], dq: &motion[1], ddq: &motion[2] };
        (0..dof).map(|joint| explain(&data, joint, with.settings)).collect()
    };
    let mut explanations = explained(&fit.columns);
    let mut found = agreement(&explanations, &with.settings.causes);
    if explanations.iter().any(|own| own.matters) {
        // Torque that is missing in the log biases the timing, so the timing is fitted again together with the
        // torques that may be missing.
        let data =
            JointData { task, torque: &torque, columns: &fit.columns, q: &motion[0], dq: &motion[1], ddq: &motion[2] };
        for extra in may_be_missing(&data) {
            let other = separable_fit(&torque, &parameters, &starts, &mut |timing| {
                let own = observed.columns(timing).into_iter().zip(&extra);
                own.map(|(own, extra)| own.into_iter().chain(extra.iter().cloned()).collect()).collect()
            });
            let own = other.columns.iter().zip(&fit.columns);
            let columns: Vec<Vec<Vec<f64>>> = own.map(|(all, base)| all[..base.len()].to_vec()).collect();
            let then = explained(&columns);
            let agreed = agreement(&then, &with.settings.causes);
            if agreed.left < MAX_RESIDUAL_RATIO * found.left {
                (explanations, found) = (then, agreed);
                fit = SeparableFit { columns, ..other };
            }
        }
    }
    check.show(&fit, &explanations, &torque);
    check.causes = causes::causes(task, &check, &explanations, &found.named, with);
    // Saturation also changes the scale of the joint's rows.
    let is_open = |cause: &TorqueCause| matches!(cause, TorqueCause::JointScale { .. });
    if source == CommandSource::Controller && check.causes.iter().all(is_open) {
        let data =
            JointData { task, torque: &torque, columns: &fit.columns, q: &motion[0], dq: &motion[1], ddq: &motion[2] };
        let limits = limit_causes(&data);
        if !limits.is_empty() {
            check.causes = limits;
        }
    }
    Some(check)
}

struct Observed<'a> {
    dof: usize,
    legs: Vec<(CommandLaw<'a>, ObservedLeg<'a>)>,
}

impl<'a> Observed<'a> {
    fn of(runs: &[CheckedRun<'a>], dof: usize, cutoff_hz: f64) -> Self {
        let mut legs = Vec::new();
        for run in runs {
            let law = law_of(run);
            for (leg, record) in run.legs.iter().zip(run.records) {
                legs.extend(ObservedLeg::new(leg, record, cutoff_hz).map(|leg| (law, leg)));
            }
        }
        Self { dof, legs }
    }

    fn rows(&self) -> usize {
        self.legs.iter().map(|(_, leg)| leg.rows()).sum()
    }

    fn joined(&self, of: &dyn Fn(&ObservedLeg<'_>) -> Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut out = vec![Vec::new(); self.dof];
        for (_, leg) in &self.legs {
            out.iter_mut().zip(of(leg)).for_each(|(out, values)| out.extend(values));
        }
        out
    }

    fn columns(&self, timing: &[f64; SHARED]) -> Vec<Vec<Vec<f64>>> {
        let mut out: Vec<Vec<Vec<f64>>> = vec![Vec::new(); self.dof];
        for (law, leg) in &self.legs {
            for (own, of_joint) in out.iter_mut().zip(leg.columns(*law, timing)) {
                own.resize(of_joint.len().max(own.len()), Vec::new());
                own.iter_mut().zip(of_joint).for_each(|(out, values)| out.extend(values));
            }
        }
        out
    }
}

impl TorqueCheck {
    fn show(&mut self, fit: &SeparableFit, explanations: &[Explanation], torque: &[Vec<f64>]) {
        let [position_s, velocity_s, lag_s, clock, _] = fit.shared;
        self.feedback_delay_s = [position_s, velocity_s];
        self.torque_lag_s = lag_s;
        self.clock_percent = 100.0 * clock;
        self.clock_percent_std = Some(100.0 * fit.std_of([0.0, 0.0, 0.0, 1.0, 0.0]));
        self.torque_lag_std_s = Some(fit.std_of([f64::from(position_s < 0.0), 0.0, 1.0, 0.0, 0.0]));
        for (joint, explanation) in explanations.iter().enumerate() {
            let shown = &mut self.joints[joint];
            (shown.scale, shown.scale_std) = (explanation.scale, explanation.scale_std);
            shown.difference_percent = Some(explanation.difference_percent);
            let step = torque[joint].len().div_ceil(MAX_POINTS).max(1);
            let commanded = explanation.commanded.iter().step_by(step);
            shown.points = commanded.zip(torque[joint].iter().step_by(step)).map(|(a, b)| [*a, *b]).collect();
        }
    }
}

impl TorqueCheck {
    /// The result without a commanded torque, from the regressor rows alone.
    fn without_command(source: CommandSource, row_scales: &[Option<RowScale>]) -> Self {
        let joint = |scale: &Option<RowScale>| JointTorqueCheck {
            row_scale: scale.as_ref().map(|scale| scale.value),
            row_scale_std: scale.as_ref().map(|scale| scale.std),
            ..JointTorqueCheck::without_command()
        };
        Self {
            source,
            feedback_delay_s: [0.0; 2],
            torque_lag_s: 0.0,
            torque_lag_std_s: None,
            clock_percent: 0.0,
            clock_percent_std: None,
            joints: row_scales.iter().map(joint).collect(),
            causes: Vec::new(),
        }
    }
}

impl JointTorqueCheck {
    fn without_command() -> Self {
        Self {
            scale: None,
            scale_std: None,
            difference_percent: None,
            row_scale: None,
            row_scale_std: None,
            points: Vec::new(),
        }
    }
}

fn source_of(run: &CheckedRun<'_>) -> CommandSource {
    match (run.controller, run.model) {
        (ControllerSettings::PositionLoop(own), Some(_)) if own.feed_forward => CommandSource::FeedForward,
        (ControllerSettings::PositionLoop(_), _) => CommandSource::PathOnly,
        _ => CommandSource::Controller,
    }
}

fn law_of<'a>(run: &CheckedRun<'a>) -> CommandLaw<'a> {
    match source_of(run) {
        CommandSource::Controller => CommandLaw::Known { controller: run.controller, model: run.model },
        CommandSource::FeedForward => CommandLaw::OwnLoop { model: run.model },
        CommandSource::PathOnly => CommandLaw::OwnLoop { model: None },
    }
}

/// The cut-off frequency below which torques are compared: that of the identification, if it has one. For a run that
/// ended early it is higher, so that enough rows remain.
fn cutoff_hz(task: &IterationTask, identification: &RunIdentificationSettings, run: &CheckedRun<'_>) -> f64 {
    let stated = identification.parallel_filter.as_ref().and_then(|filter| filter.cutoff_hz);
    let usual = stated.unwrap_or_else(|| task.robot.model().characteristic_scale().hertz(USUAL_CUTOFF_HZ));
    let duration = |record: &Record| record.times_s.last().zip(record.times_s.first()).map_or(0.0, |(a, b)| a - b);
    let longest = run.records.iter().map(duration).fold(0.0, f64::max);
    if longest > 0.0 { usual.max(MIN_CYCLES_PER_RUN / longest) } else { usual }
}
