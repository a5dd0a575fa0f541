//! Is the torque of another moment than the motion? Two recorders that were started by hand, a buffer, a network:
//! shifts of tenths of seconds, which the lag that a fit takes off by itself does not reach.

use super::channels::Channels;
use super::explanation::Explanation;
use super::hypothesis::{CLEARLY_BETTER, CorrectedStudy, Explained, Hypothesis};
use super::joint_fits::{JointFits, SharedMotion};
use super::mistakes::lag::Lag;
use super::mistakes::{Mistake, least_by_thirds};
use super::motion_rows::{MotionRows, MotionSamples, share_of_log};
use crate::consistent::ConsistencySettings;
use crate::lag::LONGEST_DELAY_S;
use dynident_dynamics::ParametricModel;
use rayon::prelude::*;

/// Longest shift that is looked for, seconds of a usual arm, and how finely: arms move at a hertz or so.
const REACH_S: f64 = 2.0;
const STEP_S: f64 = 0.1;
/// The same of one joint's channel alone: more of it is half a turn of its motion, which looks like another sign.
const REACH_ALONE_S: f64 = 0.5;
/// Share of a piece of motion that instants keep away from its ends for that: torque is known on both sides of them.
const SHARE_OF_PIECE: f64 = 1.0 / 6.0;
/// Instants that shifts are compared on.
const INSTANTS: usize = 200;
/// Times what parameters of its own leave of a joint's torque that one robot leaves, from which its torque is shifted
/// by itself.
const DOUBTFUL: f64 = 1.5;
/// Share of all torque below which nothing is left that a shift would explain.
const EXPLAINED: f64 = 0.02;

/// Instants for each column of a joint below which shifts are not compared: parameters would follow them.
const ROWS_PER_COLUMN: usize = 2;

/// A hypothesis with a channel at another moment.
pub(super) struct LateChannel {
    pub(super) explained: Explained,
    /// Improvement of the score over the channel as it was logged, on the same instants.
    pub(super) gain: f64,
}

/// Shifts of the torque that are looked for in some recordings.
pub(super) struct TorqueClock<'a> {
    samples: &'a [MotionSamples],
    /// What is taken off already, joint by joint.
    taken_off_s: Vec<f64>,
    /// Seconds.
    reach_s: f64,
    step_s: f64,
    least_s: f64,
    alone_s: f64,
}

impl<'a> TorqueClock<'a> {
    /// For recordings of a robot with the lags `taken_off_s` taken off, joint by joint; none where they are too short.
    pub(super) fn new(robot: &ParametricModel, samples: &'a [MotionSamples], taken_off_s: Vec<f64>) -> Option<Self> {
        let own = robot.model().own_scale();
        let longest_s = samples.iter().map(MotionSamples::longest_s).fold(0.0, f64::max);
        let [reach_s, step_s, least_s, alone_s] =
            [REACH_S, STEP_S, LONGEST_DELAY_S, REACH_ALONE_S].map(|usual_s| own.seconds(usual_s));
        let reach_s = reach_s.min(SHARE_OF_PIECE * longest_s);
        (reach_s > step_s).then_some(Self { samples, taken_off_s, reach_s, step_s, least_s, alone_s })
    }

    /// Lags that are tried beside what is taken off.
    pub(super) fn lags_s(&self) -> impl Iterator<Item = f64> {
        let most = (self.reach_s / self.step_s) as i32;
        let step_s = self.step_s;
        (-most..=most).filter(|k| *k != 0).map(move |k| f64::from(k) * step_s)
    }

    /// The lag near `lag_s` of which `value` is least.
    pub(super) fn least_near(&self, lag_s: f64, value: impl Fn(f64) -> f64) -> f64 {
        least_by_thirds([lag_s - self.step_s, lag_s + self.step_s], 0.02 * self.step_s, value)
            .clamp(-self.reach_s, self.reach_s)
    }

    /// At most `most` instants with the torque, or the motion, of `joints` taken `lag_s` later.
    pub(super) fn rows(&self, joints: &[usize], channels: Channels, lag_s: f64, most: usize) -> MotionRows {
        let lags: Vec<f64> =
            (0..self.taken_off_s.len()).map(|joint| if joints.contains(&joint) { lag_s } else { 0.0 }).collect();
        let mut rows = MotionRows::empty(lags.len());
        for (place, samples) in self.samples.iter().enumerate() {
            let share = share_of_log(most, place, self.samples.len());
            rows.append(&samples.shifted(channels, &lags, self.reach_s, share));
        }
        rows
    }

    /// The mistake of a lag in addition to the compensated one; none where a fit compensates the whole lag.
    pub(super) fn mistake(&self, joints: &[usize], channels: Channels, lag_s: f64) -> Option<Mistake> {
        let taken_off_s = match channels {
            Channels::Torque => joints.iter().map(|&joint| self.taken_off_s[joint]).sum::<f64>(),
            Channels::Position | Channels::Both => 0.0,
        };
        let whole_s = taken_off_s / joints.len().max(1) as f64 + lag_s;
        // A fit compensates no lag of positions.
        let is_long = channels == Channels::Position || whole_s.abs() > self.least_s || lag_s.abs() > self.least_s;
        is_long.then(|| Lag { joints: joints.to_vec(), channels, lag_s: whole_s }.into())
    }

    /// The hypothesis that the torque of all joints was logged at another moment, or, where a torque is inconsistent
    /// with the others, torque or position of one joint, if it is clearly better than the study `as_written`. It has
    /// no mistake where a fit compensates the lag.
    pub(super) fn late_channel(
        &self,
        robot: &ParametricModel,
        as_written: &Hypothesis,
        consistency: &ConsistencySettings,
        instants: usize,
    ) -> Option<LateChannel> {
        if as_written.left_of_all < EXPLAINED {
            return None;
        }
        let all: Vec<usize> = (0..robot.dof()).collect();
        let rows = self.rows(&all, Channels::Torque, 0.0, INSTANTS);
        let most_columns = all.iter().map(|&joint| robot.layout().joint_columns(joint).len()).max()?;
        if rows.len() < ROWS_PER_COLUMN * most_columns {
            return None;
        }
        let here = Explanation::new(robot, &rows, None).ok()?;
        let alone = here.alone_of_noise_free();
        let mut groups = vec![(all.clone(), Channels::Torque)];
        if all.iter().any(|&joint| here.free[joint] > DOUBTFUL * alone[joint]) {
            let of_one =
                |&joint: &usize| [Channels::Torque, Channels::Position].map(|channels| (vec![joint], channels));
            groups.extend(all.iter().flat_map(of_one));
        }
        let (joints, channels, lag_s) = self.best_lag(robot, &rows, &groups, here.free_score())?;
        let mistakes: Vec<Mistake> = self.mistake(joints, channels, lag_s).into_iter().collect();
        // Both on the same instants, which keep away from the ends.
        let explained = |lag_s: f64, mistakes: Vec<Mistake>| {
            let rows = self.rows(joints, channels, lag_s, instants);
            CorrectedStudy::new(robot.clone(), rows, mistakes).explained(consistency).ok()
        };
        let (late, unshifted) = (explained(lag_s, mistakes)?, explained(0.0, Vec::new())?.hypothesis);
        let gain = unshifted.score() - late.hypothesis.score();
        let is_better = late.hypothesis.score() < unshifted.score() - CLEARLY_BETTER
            && late.hypothesis.left_of_all < unshifted.left_of_all;
        is_better.then_some(LateChannel { explained: late, gain })
    }

    /// The channels and the lag of the best fit without physical limits, which is cheap, if it is clearly better than
    /// `unshifted`.
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
        // Torques of other moments are torques of one motion.
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
            let is_near = |lag: &usize| joints.len() > 1 || lags_s[*lag].abs() <= self.alone_s;
            let tried: Vec<usize> = (0..lags_s.len()).filter(is_near).collect();
            let scores: Vec<f64> = tried.par_iter().map(|&lag| score_of_tried(joints, *channels, lag)).collect();
            let best = (0..tried.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
            Some((&joints[..], *channels, lags_s[tried[best]], scores[best]))
        };
        let (joints, channels, lag_s, least) = groups.iter().filter_map(best_of).min_by(|a, b| a.3.total_cmp(&b.3))?;
        let is_clear = least <= unshifted - CLEARLY_BETTER;
        is_clear.then(|| (joints, channels, self.least_near(lag_s, |lag_s| score(joints, channels, lag_s))))
    }
}
