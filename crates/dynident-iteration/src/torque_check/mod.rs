//! Compares the logged torque of a run with the torque that its controller commanded.
//!
//! Identification takes the logged torque as the torque of the drives. Nothing in the log alone shows that it is: a
//! wrong scale, a reversed sign or subtracted gravity gives a model of another robot, which may even track. But
//! controller, model and reference of a run are known, so that the commanded torque follows from the logged positions.
//! Of a correct log both agree up to noise, delays and the zero of the torque sensor:
//!
//! `τ_log,j(t) = s_j τ_cmd,j(t − l; q(t − l − d_q), q̇(t − l − d_v), (1 + ε)(t − l)) + c_j`
//!
//! with the scale `s_j` = 1, two delays of the feedback, a lag of the logged torque and a rate ε of the log's clock
//! that all joints share. Drives that close their own loop have unknown gains `k`: there `τ_log,j = s_j τ_ff,j + k_p
//! e_j + k_i ∫e_j + k_d ė_j + c_j`, over all good runs together.
//!
//! | file | holds |
//! | --- | --- |
//! | `command` | the commanded torque along a log |
//! | `separable_fit` | scales and timing by least squares |
//! | `explanation` | what explains a difference: the candidates, and when one is named |
//! | `row_scale` | what the parameters that several joints share show about each joint's torque |
//! | `response` | whether the robot moves as its torque says |
//! | `agreement` | one cause for all joints, where one explains them all |
//! | `causes` | from single joints to one statement |

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

use crate::leg::{IterationTask, Leg};
use crate::settings::RunIdentificationSettings;
use crate::torque_check_settings::TorqueCheckSettings;
use agreement::agreement;
use command::{CommandLaw, ObservedLeg, shared_parameters};
use dynident_simulation::Record;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use explanation::{Explanation, JointData, explain, may_be_missing};
use response::{early_causes, limit_causes};
use separable_fit::{SHARED, SeparableFit, separable_fit};
use serde::{Deserialize, Serialize};

/// Cut-off of the comparison where runs are identified without a filter, Hz of a usual arm.
const USUAL_CUTOFF_HZ: f64 = 8.0;
/// Points of each joint that are kept for the picture.
const MOST_POINTS: usize = 150;
/// Cycles of the cut-off that a run has at least.
const CYCLES_PER_RUN: f64 = 12.0;
/// Another timing is taken where it leaves less than this share of the squared differences.
const BETTER: f64 = 0.5;
/// Fewest rows per joint from which anything is concluded.
const FEWEST_ROWS: usize = 20;

/// Where the commanded torque is known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CommandSource {
    /// The control law with its model.
    Controller,
    /// The torque that is fed forward to drives with their own position loop.
    FeedForward,
    /// Not known: drives with their own position loop get nothing but a path. A scale that all joints share is not
    /// checked.
    PathOnly,
}

/// What the comparison shows of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointTorqueCheck {
    /// Logged torque per commanded torque; none where the run does not determine it.
    pub scale: Option<f64>,
    /// Its standard deviation.
    pub scale_std: Option<f64>,
    /// Difference between logged and commanded torque without its mean, root mean square as a percentage of the logged
    /// torque; none where the commanded torque is not known.
    pub difference_percent: Option<f64>,
    /// Torque scale relative to the other joints, by the parameters that their rows share; none where they determine
    /// none.
    pub row_scale: Option<f64>,
    /// Its standard deviation.
    pub row_scale_std: Option<f64>,
    /// Commanded and logged torque of some instants, Nm (N); empty where the commanded torque is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
}

/// What the comparison of logged and commanded torque shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueCheck {
    /// Where the commanded torque is known from.
    pub source: CommandSource,
    /// How late the controller saw positions and velocities, s; zero for drives with their own loop.
    pub feedback_delay_s: [f64; 2],
    /// By how much the logged torque comes after the commanded one, s.
    pub torque_lag_s: f64,
    /// Standard deviation of how far positions and torques of the log are apart, s; none where it is not known.
    #[serde(default)]
    pub torque_lag_std_s: Option<f64>,
    /// By how much the log's clock is slow compared with the controller's, percent.
    pub clock_percent: f64,
    /// Standard deviation of `clock_percent`; none where the commanded torque is not known.
    pub clock_percent_std: Option<f64>,
    /// The joints.
    pub joints: Vec<JointTorqueCheck>,
    /// What is wrong; empty if the logged torque is the commanded one.
    pub causes: Vec<TorqueCause>,
}

/// One run as the comparison takes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CheckedRun<'a> {
    pub(crate) legs: &'a [Leg],
    pub(crate) records: &'a [Record],
    pub(crate) controller: &'a ControllerSettings,
    pub(crate) model: Option<&'a ControllerModel>,
}

/// What the comparison is made with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CheckWith<'a> {
    pub(crate) settings: &'a TorqueCheckSettings,
    pub(crate) identification: &'a RunIdentificationSettings,
    /// What the estimate of all runs shows of each joint.
    pub(crate) row_scales: &'a [Option<RowScale>],
    /// How far positions and torques of a log may be apart, s.
    pub(crate) most_lag_s: f64,
    /// Whether drives with their own loop get torque fed forward in later runs, which shows each joint's own scale.
    pub(crate) feeds_forward_later: bool,
    /// Whether the newest run ended before its motion did.
    pub(crate) ended_early: bool,
}

/// Compares logged with commanded torque; none where too little was recorded. `runs` are the runs so far, the newest
/// last; earlier ones only serve to determine the gains of drives with their own loop. `task` is with the friction in
/// force.
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

/// Compares the torques where enough was recorded.
fn compared(task: &IterationTask, runs: &[CheckedRun<'_>], with: &CheckWith<'_>) -> Option<TorqueCheck> {
    let newest = runs.last()?;
    let source = source_of(newest);
    let dof = task.robot.dof();
    let cutoff_hz = cutoff_hz(task, with.identification, newest);
    // The gains of drives with their own loop are the same in all runs.
    let used = if source == CommandSource::Controller { &runs[runs.len() - 1..] } else { runs };
    let observed = Observed::of(used, dof, cutoff_hz);
    let mut check = TorqueCheck::without_command(source, with.row_scales);
    if observed.rows() < FEWEST_ROWS {
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
    let mut found = agreement(&explanations);
    if explanations.iter().any(|own| own.matters) {
        // What is missing in the torque bends the timing: it is found again beside what may be missing.
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
            let agreed = agreement(&then);
            if agreed.left < BETTER * found.left {
                (explanations, found) = (then, agreed);
                fit = SeparableFit { columns, ..other };
            }
        }
    }
    check.show(&fit, &explanations, &torque);
    check.causes = causes::causes(task, &check, &explanations, &found.named, with);
    // A drive at its limit also changes the scale of its joint's rows.
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

/// The legs that are compared, each with the law that commanded it.
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

    /// A quantity of each joint, over all legs.
    fn joined(&self, of: &dyn Fn(&ObservedLeg<'_>) -> Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut out = vec![Vec::new(); self.dof];
        for (_, leg) in &self.legs {
            out.iter_mut().zip(of(leg)).for_each(|(out, values)| out.extend(values));
        }
        out
    }

    /// The columns of each joint with this timing, over all legs.
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
    /// Takes over timing, scales and points of a fit.
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
            let step = torque[joint].len().div_ceil(MOST_POINTS).max(1);
            let commanded = explanation.commanded.iter().step_by(step);
            shown.points = commanded.zip(torque[joint].iter().step_by(step)).map(|(a, b)| [*a, *b]).collect();
        }
    }
}

impl TorqueCheck {
    /// What the rows alone show.
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

/// The cut-off below which torques are compared: that of the identification, where it states one. A run that ended
/// early is compared up to a higher one, so that enough rows are left.
fn cutoff_hz(task: &IterationTask, identification: &RunIdentificationSettings, run: &CheckedRun<'_>) -> f64 {
    let stated = identification.parallel_filter.as_ref().and_then(|filter| filter.cutoff_hz);
    let usual = stated.unwrap_or_else(|| task.robot.model().own_scale().hertz(USUAL_CUTOFF_HZ));
    let duration = |record: &Record| record.times_s.last().zip(record.times_s.first()).map_or(0.0, |(a, b)| a - b);
    let longest = run.records.iter().map(duration).fold(0.0, f64::max);
    if longest > 0.0 { usual.max(CYCLES_PER_RUN / longest) } else { usual }
}
