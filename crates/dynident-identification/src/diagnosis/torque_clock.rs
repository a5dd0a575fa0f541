//! Is the torque of another moment than the motion? Two recorders that were started by hand, a buffer, a network:
//! shifts of tenths of seconds, which the lag that a fit takes off by itself does not reach.

use super::explanation::Explanation;
use super::joint_fits::{JointFits, SharedMotion};
use super::mistake::{Channels, Mistake};
use super::motion_rows::{MotionRows, MotionSamples, share_of_log};
use super::numbers::least_by_thirds;
use super::reading::{CLEARLY_BETTER, Corrected, Reading};
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

/// A reading with a channel at another moment.
pub(super) struct LateReading {
    pub(super) corrected: Corrected,
    pub(super) reading: Reading,
    /// By how much it scores better than the channel as it was logged, on the same instants.
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

    /// Instants with the torque, or the motion, of `joints` taken `lag_s` later.
    pub(super) fn rows(&self, (joints, channels): (&[usize], Channels), lag_s: f64, most: usize) -> MotionRows {
        let lags: Vec<f64> =
            (0..self.taken_off_s.len()).map(|joint| if joints.contains(&joint) { lag_s } else { 0.0 }).collect();
        let mut rows = MotionRows::empty(lags.len());
        for (place, samples) in self.samples.iter().enumerate() {
            let share = share_of_log(most, (place, self.samples.len()));
            rows.append(&samples.shifted(channels, &lags, self.reach_s, share));
        }
        rows
    }

    /// The mistake of a lag beside what is taken off; none where a fit takes off the whole of it by itself.
    pub(super) fn mistake(&self, (joints, channels): (&[usize], Channels), lag_s: f64) -> Option<Mistake> {
        let taken_off_s = match channels {
            Channels::Torque => joints.iter().map(|&joint| self.taken_off_s[joint]).sum::<f64>(),
            Channels::Position | Channels::Both => 0.0,
        };
        let whole_s = taken_off_s / joints.len().max(1) as f64 + lag_s;
        // Of positions a fit takes nothing off.
        let is_long = channels == Channels::Position || whole_s.abs() > self.least_s || lag_s.abs() > self.least_s;
        is_long.then(|| Mistake::Lag { joints: joints.to_vec(), channels, lag_s: whole_s })
    }

    /// The reading with the torque of all joints, or with torque or position of one joint beside a torque that does not
    /// belong to one robot with the others, at another moment, if it explains the recordings clearly better than the
    /// study `as_written` does. It has no mistake where a fit takes the lag off by itself.
    pub(super) fn reading(
        &self,
        robot: &ParametricModel,
        as_written: &Reading,
        consistency: &ConsistencySettings,
        instants: usize,
    ) -> Option<LateReading> {
        if as_written.left_of_all < EXPLAINED {
            return None;
        }
        let dof = robot.dof();
        let all: Vec<usize> = (0..dof).collect();
        let rows = self.rows((&all, Channels::Torque), 0.0, INSTANTS);
        let most_columns = all.iter().map(|&joint| robot.layout().joint_columns(joint).len()).max()?;
        if rows.len() < ROWS_PER_COLUMN * most_columns {
            return None;
        }
        let here = Explanation::new(robot, &rows, None).ok()?;
        let alone = here.alone_of_noise_free();
        let mut groups = vec![(all.clone(), Channels::Torque)];
        if (0..dof).any(|joint| here.free[joint] > DOUBTFUL * alone[joint]) {
            groups.extend(
                all.iter()
                    .flat_map(|&joint| [Channels::Torque, Channels::Position].map(|channels| (vec![joint], channels))),
            );
        }
        // By the fit without physical limits, which is cheap.
        let score = |(joints, channels): &(Vec<usize>, Channels), lag_s: f64| {
            let rows = self.rows((joints, *channels), lag_s, INSTANTS);
            JointFits::new(robot, &rows).and_then(|fits| fits.free_score()).unwrap_or(f64::INFINITY)
        };
        let lags_s: Vec<f64> = self.lags_s().collect();
        let late: Vec<MotionRows> =
            lags_s.iter().map(|&lag_s| self.rows((&all, Channels::Torque), lag_s, INSTANTS)).collect();
        // Other moments of the torque are torques of one motion.
        let torques = |joint: usize| [&rows].into_iter().chain(&late).map(|rows| &rows.tau[joint][..]).collect();
        let motion = SharedMotion::new(robot, &rows, torques).ok()?;
        let score_of_tried = |group: &(Vec<usize>, Channels), lag: usize| {
            if group.1 != Channels::Torque {
                return score(group, lags_s[lag]);
            }
            let chosen: Vec<(usize, f64)> =
                all.iter().map(|joint| (if group.0.contains(joint) { 1 + lag } else { 0 }, 1.0)).collect();
            let fits = JointFits::of_shared((robot, &rows), &motion, &chosen);
            fits.and_then(|fits| fits.free_score()).unwrap_or(f64::INFINITY)
        };
        let best_of = |group: &(Vec<usize>, Channels)| -> Option<(f64, f64)> {
            let is_near = |lag: &usize| group.0.len() > 1 || lags_s[*lag].abs() <= self.alone_s;
            let tried: Vec<usize> = (0..lags_s.len()).filter(is_near).collect();
            let scores: Vec<f64> = tried.par_iter().map(|&lag| score_of_tried(group, lag)).collect();
            let best = (0..tried.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
            Some((lags_s[tried[best]], scores[best]))
        };
        let found = groups.iter().filter_map(|group| best_of(group).map(|(lag_s, score)| (group, lag_s, score)));
        let (group, lag_s, least) = found.min_by(|a, b| a.2.total_cmp(&b.2))?;
        if least > here.free_score() - CLEARLY_BETTER {
            return None;
        }
        let lag_s = self.least_near(lag_s, |lag_s| score(group, lag_s));
        let (joints, channels) = group;
        let mistakes: Vec<Mistake> = self.mistake((joints, *channels), lag_s).into_iter().collect();
        // Both on the same instants, which keep away from the ends.
        let read = |lag_s: f64, mistakes: Vec<Mistake>| {
            let corrected = Corrected::new(robot.clone(), self.rows((joints, *channels), lag_s, instants), mistakes);
            let reading = corrected.reading(Some(consistency)).ok()?;
            Some((corrected, reading))
        };
        let (corrected, reading) = read(lag_s, mistakes)?;
        let (_, unshifted) = read(0.0, Vec::new())?;
        let is_better =
            reading.score() < unshifted.score() - CLEARLY_BETTER && reading.left_of_all < unshifted.left_of_all;
        let gain = unshifted.score() - reading.score();
        is_better.then_some(LateReading { corrected, reading, gain })
    }
}
