//! Search for channels that were logged too late or too early: two recorders that were started by hand, a buffer, a
//! network. Such shifts of tenths of a second exceed the lag that a fit compensates.

use super::channels::Channels;
use super::explanation::Explanation;
use super::hypothesis::{CorrectedStudy, Explained, Hypothesis};
use super::joint_fits::{JointFits, SharedMotion};
use super::mistakes::lag::Lag;
use super::mistakes::{Mistake, ternary_search};
use super::motion_rows::{MotionRows, MotionSamples, instants_of_log};
use crate::consistent::ConsistencySettings;
use crate::diagnosis_settings::DiagnosisSettings;
use crate::lag::LONGEST_DELAY_S;
use dynident_dynamics::ParametricModel;
use rayon::prelude::*;

/// Number of instants at which shifts are compared.
const INSTANTS: usize = 200;

pub(super) struct LateChannel {
    pub(super) explained: Explained,
    /// Improvement of the score by the shift, on the same instants.
    pub(super) gain: f64,
}

/// Tries time shifts of torque or motion in some recordings.
pub(super) struct LagSearch<'a> {
    samples: &'a [MotionSamples],
    settings: &'a DiagnosisSettings,
    /// Lag of each joint's torque that is already compensated, s.
    compensated_s: Vec<f64>,
    /// Longest shift, s.
    reach_s: f64,
    step_s: f64,
    /// Longest lag that a fit compensates, s.
    max_compensated_s: f64,
    /// Longest shift of one joint's channel, s.
    reach_of_joint_s: f64,
}

impl<'a> LagSearch<'a> {
    /// For recordings with the compensated lags `compensated_s`, one for each joint; `None` if they are too short.
    pub(super) fn new(
        robot: &ParametricModel,
        samples: &'a [MotionSamples],
        compensated_s: Vec<f64>,
        settings: &'a DiagnosisSettings,
    ) -> Option<Self> {
        let (own, limits) = (robot.model().characteristic_scale(), &settings.late_channel);
        let longest_s = samples.iter().map(MotionSamples::longest_s).fold(0.0, f64::max);
        let [reach_s, step_s, max_compensated_s, reach_of_joint_s] =
            [limits.max_lag_s, limits.lag_step_s, LONGEST_DELAY_S, limits.max_lag_of_joint_s]
                .map(|usual_s| own.seconds(usual_s));
        let reach_s = reach_s.min(limits.max_share_of_motion * longest_s);
        let lag_search =
            Self { samples, settings, compensated_s, reach_s, step_s, max_compensated_s, reach_of_joint_s };
        (reach_s > step_s).then_some(lag_search)
    }

    /// Shifts to try, in addition to the compensated lags, s.
    pub(super) fn lags_s(&self) -> impl Iterator<Item = f64> {
        let most = (self.reach_s / self.step_s) as i32;
        let step_s = self.step_s;
        (-most..=most).filter(|k| *k != 0).map(move |k| f64::from(k) * step_s)
    }

    /// The shift near `lag_s` with the smallest `value`, s.
    pub(super) fn refined_lag_s(&self, lag_s: f64, value: impl Fn(f64) -> f64) -> f64 {
        ternary_search([lag_s - self.step_s, lag_s + self.step_s], 0.02 * self.step_s, value)
            .clamp(-self.reach_s, self.reach_s)
    }

    /// At most `most` instants, for which the torque or the motion of `joints` is taken `lag_s` seconds later.
    pub(super) fn rows(&self, joints: &[usize], channels: Channels, lag_s: f64, most: usize) -> MotionRows {
        let dof = self.compensated_s.len();
        let lags: Vec<f64> = (0..dof).map(|joint| if joints.contains(&joint) { lag_s } else { 0.0 }).collect();
        let mut rows = MotionRows::empty(lags.len());
        for (place, samples) in self.samples.iter().enumerate() {
            let share = instants_of_log(most, place, self.samples.len());
            rows.append(&samples.shifted(channels, &lags, self.reach_s, share));
        }
        rows
    }

    /// The mistake "lag" for a shift in addition to the compensated lag; `None` if a fit can compensate the total lag.
    pub(super) fn mistake(&self, joints: &[usize], channels: Channels, lag_s: f64) -> Option<Mistake> {
        let compensated_s = match channels {
            Channels::Torque => joints.iter().map(|&joint| self.compensated_s[joint]).sum::<f64>(),
            Channels::Position | Channels::Both => 0.0,
        };
        let whole_s = compensated_s / joints.len().max(1) as f64 + lag_s;
        // A fit does not compensate lags of positions.
        let is_long = channels == Channels::Position
            || whole_s.abs() > self.max_compensated_s
            || lag_s.abs() > self.max_compensated_s;
        is_long.then(|| Lag { joints: joints.to_vec(), channels, lag_s: whole_s }.into())
    }

    /// The best hypothesis with a lag of all torques. If one torque is inconsistent with the others, a lag of the
    /// torque or the position of this joint is tried instead. `None` unless the hypothesis is clearly better than the
    /// study `as_written`. The hypothesis contains no mistake if a fit compensates the lag.
    pub(super) fn late_channel(
        &self,
        robot: &ParametricModel,
        as_written: &Hypothesis,
        consistency: &ConsistencySettings,
        instants: usize,
    ) -> Option<LateChannel> {
        let limits = &self.settings.late_channel;
        if as_written.left_of_all < limits.min_unexplained {
            return None;
        }
        let all: Vec<usize> = (0..robot.dof()).collect();
        let rows = self.rows(&all, Channels::Torque, 0.0, INSTANTS);
        let most_columns = all.iter().map(|&joint| robot.layout().joint_columns(joint).len()).max()?;
        if rows.len() < limits.min_instants_per_column * most_columns {
            return None;
        }
        let here = Explanation::new(robot, &rows, None).ok()?;
        let alone = here.alone_of_noise_free();
        let mut groups = vec![(all.clone(), Channels::Torque)];
        if all.iter().any(|&joint| here.free[joint] > limits.min_ratio_of_joint * alone[joint]) {
            let of_one =
                |&joint: &usize| [Channels::Torque, Channels::Position].map(|channels| (vec![joint], channels));
            groups.extend(all.iter().flat_map(of_one));
        }
        let (joints, channels, lag_s) = self.best_lag(robot, &rows, &groups, here.free_score())?;
        let mistakes: Vec<Mistake> = self.mistake(joints, channels, lag_s).into_iter().collect();
        let explained = |lag_s: f64, mistakes: Vec<Mistake>| {
            let rows = self.rows(joints, channels, lag_s, instants);
            CorrectedStudy::new(robot.clone(), rows, mistakes, self.settings).explained(consistency).ok()
        };
        let (late, unshifted) = (explained(lag_s, mistakes)?, explained(0.0, Vec::new())?.hypothesis);
        let gain = unshifted.score() - late.hypothesis.score();
        let is_better = late.hypothesis.score() < unshifted.score() - self.settings.score.min_gain
            && late.hypothesis.left_of_all < unshifted.left_of_all;
        is_better.then_some(LateChannel { explained: late, gain })
    }

    /// The channels and the lag with the best fit without physical constraints; `None` unless its score is clearly
    /// better than `unshifted`.
    fn best_lag<'g>(
        &self,
        robot: &ParametricModel,
        rows: &MotionRows,
        groups: &'g [(Vec<usize>, Channels)],
        unshifted: f64,
    ) -> Option<(&'g [usize], Channels, f64)> {
        let score = |joints: &[usize], channels: Channels, lag_s: f64| {
            let rows = self.rows(joints, channels, lag_s, INSTANTS);
            JointFits::new(robot, &rows).and_then(|fits| fits.free_score()).unwrap_or(f64::INFINITY)
        };
        let all: Vec<usize> = (0..robot.dof()).collect();
        let lags_s: Vec<f64> = self.lags_s().collect();
        let late: Vec<MotionRows> =
            lags_s.iter().map(|&lag_s| self.rows(&all, Channels::Torque, lag_s, INSTANTS)).collect();
        let torques = |joint: usize| [rows].into_iter().chain(&late).map(|rows| &rows.tau[joint][..]).collect();
        let motion = SharedMotion::new(robot, rows, torques).ok()?;
        let score_of_tried = |joints: &[usize], channels: Channels, lag: usize| {
            if channels != Channels::Torque {
                return score(joints, channels, lags_s[lag]);
            }
            let chosen: Vec<(usize, f64)> =
                all.iter().map(|joint| (if joints.contains(joint) { 1 + lag } else { 0 }, 1.0)).collect();
            let fits = JointFits::of_shared(robot, rows, &motion, &chosen);
            fits.and_then(|fits| fits.free_score()).unwrap_or(f64::INFINITY)
        };
        let best_of = |(joints, channels): &'g (Vec<usize>, Channels)| {
            let is_near = |lag: &usize| joints.len() > 1 || lags_s[*lag].abs() <= self.reach_of_joint_s;
            let tried: Vec<usize> = (0..lags_s.len()).filter(is_near).collect();
            let scores: Vec<f64> = tried.par_iter().map(|&lag| score_of_tried(joints, *channels, lag)).collect();
            let best = (0..tried.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
            Some((&joints[..], *channels, lags_s[tried[best]], scores[best]))
        };
        let (joints, channels, lag_s, least) = groups.iter().filter_map(best_of).min_by(|a, b| a.3.total_cmp(&b.3))?;
        let is_clear = least <= unshifted - self.settings.score.min_gain;
        is_clear.then(|| (joints, channels, self.refined_lag_s(lag_s, |lag_s| score(joints, channels, lag_s))))
    }
}
