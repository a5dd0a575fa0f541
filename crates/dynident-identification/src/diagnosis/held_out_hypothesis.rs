//! Search for a mistake that only one held-out log has, such as another format or exchanged cables. The base parameters
//! from the training logs are known, so the residual with these parameters is the only evidence.

use super::channels::Channels;
use super::explanation::predicted;
use super::joint_fits::MIN_RESIDUAL_SHARE;
use super::lag_search::LagSearch;
use super::mistakes::{Breadth, Mistake, Setup};
use super::motion_rows::{INSTANTS, MotionRows};
use super::plausibility::beyond_limits;
use crate::diagnosis_settings::DiagnosisSettings;
use dynident_dynamics::ParametricModel;
use rayon::prelude::*;

/// A mistake of one held-out log. After its correction, the parameters from the training logs explain the log.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutHypothesis {
    /// Index of the recording.
    pub log: usize,
    /// The mistake.
    pub mistake: Mistake,
    /// Other mistakes that explain the log equally well.
    pub alike: Vec<Mistake>,
    /// Root mean square residual of all joints with the study as written, Nm.
    pub left_as_written: f64,
    /// Root mean square residual of all joints after the mistake is corrected, Nm.
    pub left_without: f64,
}

#[derive(Clone, Copy)]
pub(super) struct KnownRobot<'a> {
    pub(super) robot: &'a ParametricModel,
    pub(super) theta: &'a [f64],
    /// Unexplained share of each joint's torque in the training logs.
    pub(super) left: &'a [f64],
    pub(super) settings: &'a DiagnosisSettings,
}

struct Residual {
    /// Sum `Σ_j ln(unexplained share of joint j)`, plus the cost of exceeded joint limits.
    score: f64,
    /// Root mean square residual of all joints, Nm.
    rms: f64,
    /// Unexplained share of each joint's torque, at least the share in the training logs; 1 for a joint without torque.
    left: Vec<f64>,
    /// Unexplained share of each joint's torque in the training logs, at least [`MIN_RESIDUAL_SHARE`].
    trained: Vec<f64>,
}

impl Residual {
    fn new(known: KnownRobot<'_>, rows: &MotionRows) -> Self {
        let explained = predicted(known.robot, rows, known.theta);
        let trained: Vec<f64> = known.left.iter().map(|left| left.max(MIN_RESIDUAL_SHARE)).collect();
        let (mut shares, mut sum) = (Vec::with_capacity(trained.len()), 0.0);
        for ((explained, tau), least) in explained.iter().zip(&rows.tau).zip(&trained) {
            let left = tau.iter().zip(explained).map(|(tau, explained)| tau - explained);
            let left = left.map(|left| left * left).sum::<f64>();
            let torque = tau.iter().map(|tau| tau * tau).sum::<f64>();
            sum += left;
            shares.push(if torque > 0.0 { (left / torque).sqrt().max(*least) } else { 1.0 });
        }
        let count = (rows.len() * explained.len()).max(1) as f64;
        let broken = beyond_limits(known.robot.model(), rows, &known.settings.motion).len() as f64;
        let score = shares.iter().map(|left| left.ln()).sum::<f64>() + known.settings.score.limit_cost * broken;
        Self { score, rms: (sum / count).sqrt(), left: shares, trained }
    }

    /// Whether the torque of every joint is explained about as well as in the training logs.
    fn is_explained(&self, settings: &DiagnosisSettings) -> bool {
        let max_ratio = settings.held_out.min_unexplained_ratio;
        self.left.iter().zip(&self.trained).all(|(left, trained)| *left < max_ratio * trained)
    }
}

struct Candidate {
    mistake: Mistake,
    rarity: f64,
    residual: Residual,
}

impl Candidate {
    fn score(&self) -> f64 {
        self.residual.score + self.rarity
    }

    /// Whether it is clearly better than the log `as_written`, and closes half of the gap to the training logs,
    /// explains every joint, or explains its own joints. Otherwise another cause is likelier.
    fn is_clear(&self, as_written: &Residual, settings: &DiagnosisSettings) -> bool {
        let trained: f64 = as_written.trained.iter().map(|left| left.ln()).sum();
        (self.score() < 0.5 * (as_written.score + trained)
            || self.residual.is_explained(settings)
            || self.explains_its_joints(as_written, settings))
            && self.score() <= as_written.score - settings.score.min_gain
            && self.residual.rms < as_written.rms
    }

    /// Whether the residual of each joint that the mistake concerns becomes much smaller, and no residual of another
    /// joint larger. With other motion than in the training logs, all joints can have a larger residual without a
    /// mistake.
    fn explains_its_joints(&self, as_written: &Residual, settings: &DiagnosisSettings) -> bool {
        let (before, after) = (&as_written.left, &self.residual.left);
        let joints = self.mistake.joints(before.len());
        let max_ratio = settings.held_out.max_ratio_of_corrected_joint;
        let is_right = |joint: usize| {
            let limit = if joints.contains(&joint) { max_ratio } else { 1.0 + MIN_RESIDUAL_SHARE };
            after[joint] <= limit * before[joint]
        };
        joints.len() < before.len() && (0..before.len()).all(is_right)
    }
}

/// Searches for one mistake in recording number `log` that explains why its residual is larger than in the training
/// logs. `rows` contains motion and torque of this log at some instants. `lag_search` provides them with the torque
/// shifted in time, if the log is long enough.
pub(super) fn held_out_hypothesis(
    known: KnownRobot<'_>,
    rows: &MotionRows,
    lag_search: Option<&LagSearch<'_>>,
    log: usize,
) -> Option<HeldOutHypothesis> {
    let settings = known.settings;
    let as_written = Residual::new(known, rows);
    if as_written.is_explained(settings) {
        return None;
    }
    let setup = Setup { robot: known.robot, rows, settings };
    let explained = predicted(known.robot, rows, known.theta);
    let breadths = [Breadth::Usual, Breadth::Rare, Breadth::KnownRobot(&explained)];
    let all = breadths.iter().flat_map(|breadth| Mistake::candidates(setup, *breadth));
    let all: Vec<Mistake> = all.filter(|mistake| !mistake.facts().is_of_all_logs).collect();
    let without = |mistake: Mistake| {
        let residual = Residual::new(known, &mistake.corrected(known.robot, rows));
        Candidate { rarity: mistake.facts().rarity, mistake, residual }
    };
    let mut tried: Vec<Candidate> = all.into_par_iter().map(without).collect();
    tried.sort_by(|a, b| a.score().total_cmp(&b.score()));
    let least = tried.first().map_or(f64::INFINITY, Candidate::score);
    let late = lag_search.and_then(|lag_search| late_torque(known, lag_search));
    let late = late.filter(|late| late.score() < least && late.is_clear(&as_written, settings));
    let others = if late.is_some() { &tried[..] } else { tried.get(1..)? };
    let best = late.as_ref().or(tried.first()).filter(|best| best.is_clear(&as_written, settings))?;
    // With known parameters, the residual determines every free number to within the noise.
    let between = best.mistake.with_best_number(|mistake| without(mistake.clone()).residual.score).map(without);
    let limit = best.residual.score - settings.held_out.min_gain_of_number;
    let between = between.filter(|found| found.residual.score < limit);
    let max_score = best.score() + settings.score.max_indistinguishable;
    let alike = others.iter().take_while(|other| other.score() < max_score);
    let alike = alike.map(|other| other.mistake.clone()).collect();
    let Candidate { mistake, residual, .. } = between.as_ref().unwrap_or(best);
    let mistake = mistake.clone();
    Some(HeldOutHypothesis { log, mistake, alike, left_as_written: as_written.rms, left_without: residual.rms })
}

/// The log with its torques shifted by the lag that gives the smallest residual; `None` if the lag is short enough to
/// be compensated by a fit.
fn late_torque(known: KnownRobot<'_>, lag_search: &LagSearch<'_>) -> Option<Candidate> {
    let joints: Vec<usize> = (0..known.robot.dof()).collect();
    let at = |lag_s: f64| Residual::new(known, &lag_search.rows(&joints, Channels::Torque, lag_s, INSTANTS));
    let tried: Vec<f64> = lag_search.lags_s().collect();
    let scores: Vec<f64> = tried.par_iter().map(|&lag_s| at(lag_s).score).collect();
    let best = (0..tried.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
    let lag_s = lag_search.refined_lag_s(tried[best], |lag_s| at(lag_s).score);
    let mistake = lag_search.mistake(&joints, Channels::Torque, lag_s)?;
    Some(Candidate { rarity: mistake.facts().rarity, mistake, residual: at(lag_s) })
}
