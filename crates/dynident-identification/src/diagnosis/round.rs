//! One round of the search for mistakes: bounds, fits and acceptance of all candidates that correct one more mistake.

use super::hypothesis::{CorrectedStudy, Explained, Hypothesis};
use super::joint_fits::SharedMotion;
use super::mistakes::{Breadth, Mistake, Proof, Setup};
use crate::consistent::ConsistencySettings;
use rayon::prelude::*;

/// Number of candidates that are fitted in parallel. It is fixed, so that the result does not depend on the number of
/// threads.
const BATCH: usize = 4;

#[derive(Clone)]
struct Bounded {
    bound: f64,
    study: CorrectedStudy,
}

#[derive(Clone, Default)]
pub(super) struct Round {
    pub(super) tried: usize,
    /// Candidates whose lower bound of the score is good enough.
    bounded: Vec<Bounded>,
    /// Physically consistent fits of these candidates, and of torque gains between two candidates.
    fitted: Vec<Explained>,
}

impl Round {
    /// Fits all candidates from the groups `breadths` that correct one more mistake than the hypothesis `at`. `known`
    /// is the round with only the first of these groups.
    pub(super) fn new(
        at: &Explained,
        consistency: &ConsistencySettings,
        breadths: &[Breadth<'_>],
        known: &Self,
    ) -> Self {
        let Explained { study, hypothesis } = at;
        let Ok(motion) = study.motion() else { return Self::default() };
        let score = &study.settings.score;
        let setup = Setup { robot: &study.robot, rows: &study.rows, settings: &study.settings };
        let all = breadths.iter().flat_map(|breadth| Mistake::candidates(setup, *breadth));
        let all: Vec<Mistake> = all.filter(|mistake| !study.mistakes.contains(mistake)).collect();
        let limit = hypothesis.score() - score.min_gain;
        let bounded = |mistake: &Mistake| {
            let study = study.without(mistake);
            study.lower_bound_within(limit, &motion).map(|bound| Bounded { bound, study })
        };
        let mut left = known.bounded.clone();
        left.extend(all[known.tried..].par_iter().filter_map(bounded).collect::<Vec<_>>());
        let gains: Vec<Bounded> = gains_of_torques(study, &motion, &left).par_iter().filter_map(bounded).collect();
        let mut can_win: Vec<&Bounded> = left.iter().chain(&gains).collect();
        can_win.sort_by(|a, b| a.bound.total_cmp(&b.bound));
        let fit = |candidate: &&Bounded| {
            let is_same = |fitted: &&Explained| fitted.study.mistakes == candidate.study.mistakes;
            let known = known.fitted.iter().find(is_same).cloned();
            known.or_else(|| candidate.study.clone().explained(consistency).ok())
        };
        let (mut fitted, mut least): (Vec<Explained>, f64) = (Vec::new(), f64::INFINITY);
        for batch in can_win.chunks(BATCH) {
            if batch[0].bound > least + score.max_indistinguishable {
                break;
            }
            fitted.extend(batch.par_iter().filter_map(fit).collect::<Vec<_>>());
            least = fitted.iter().map(|one| one.hypothesis.score()).fold(least, f64::min);
        }
        Self { tried: all.len(), bounded: left, fitted }
    }

    /// The accepted hypotheses, the best first.
    pub(super) fn winners(mut self, at: &Explained, consistency: &ConsistencySettings) -> Vec<Explained> {
        self.fitted.extend(twin_of_best(&self.fitted, &at.study, consistency));
        self.fitted.retain(|one| is_accepted(&one.hypothesis, &at.hypothesis));
        self.fitted.sort_by(|a, b| a.hypothesis.score().total_cmp(&b.hypothesis.score()));
        likelier_first(&mut self.fitted);
        self.fitted
    }
}

/// The [twin](Mistake::twin) of the best hypothesis, which usually has a similar score, if it was not fitted yet.
fn twin_of_best(fitted: &[Explained], at: &CorrectedStudy, consistency: &ConsistencySettings) -> Option<Explained> {
    let best = fitted.iter().min_by(|a, b| a.hypothesis.score().total_cmp(&b.hypothesis.score()))?;
    let twin = at.without(&best.study.mistakes.last()?.twin()?);
    let is_known = fitted.iter().any(|fitted| fitted.study.mistakes == twin.mistakes);
    if is_known { None } else { twin.explained(consistency).ok() }
}

/// Torque factors of all joints for which a factor is among the tried corrections, each refined to its best value. (A
/// factor that is only nearly right leaves an error at its joint, which disturbs the fit of the other joints.)
fn gains_of_torques(at: &CorrectedStudy, motion: &SharedMotion, tried: &[Bounded]) -> Vec<Mistake> {
    let free_score = |mistake: &Mistake| at.without(mistake).free_score(motion);
    let mut nearest: Vec<Option<(f64, &Mistake)>> = vec![None; at.robot.dof()];
    for mistake in tried.iter().filter_map(|one| one.study.mistakes.last()) {
        let Some(joint) = mistake.facts().torque_gain else { continue };
        let score = free_score(mistake);
        if nearest[joint].is_none_or(|(least, _)| score < least) {
            nearest[joint] = Some((score, mistake));
        }
    }
    let nearest: Vec<&Mistake> = nearest.into_iter().flatten().map(|(_, mistake)| mistake).collect();
    nearest.par_iter().filter_map(|mistake| mistake.with_best_number(free_score)).collect()
}

/// If the logs hardly distinguish two mistakes, moves the [likelier](Mistake::likelier) one to the first place.
fn likelier_first(fitted: &mut [Explained]) {
    let Some(first) = fitted.first() else { return };
    let limit = first.hypothesis.score() + first.study.settings.score.max_indistinguishable;
    let likelier = first.study.mistakes.last().and_then(Mistake::likelier);
    let is_likelier =
        |one: &Explained| one.study.mistakes.last() == likelier.as_ref() && one.hypothesis.score() < limit;
    if let Some(found) = likelier.as_ref().and_then(|_| fitted.iter().position(is_likelier)) {
        fitted[..=found].rotate_right(1);
    }
}

/// Whether a hypothesis is accepted: its residual is not clearly larger than that of `from` for any joint or for all
/// joints together, and it meets the [`Proof`] of its last mistake.
fn is_accepted(hypothesis: &Hypothesis, from: &Hypothesis) -> bool {
    let limits = &hypothesis.settings.acceptance;
    let last = hypothesis.mistakes.last();
    let gain = (from.score() - hypothesis.score()).max(0.0);
    let ratio = limits.max_ratio_of_joint.max((limits.max_share_of_gain * gain).exp());
    let is_worse = |joint: usize| {
        let before = last.map_or(joint, |mistake| mistake.torque_from(joint));
        hypothesis.left[joint] > ratio * from.left[before] + limits.max_increase_of_joint
    };
    hypothesis.left_of_all <= limits.max_ratio_of_all * from.left_of_all
        && !(0..hypothesis.left.len()).any(is_worse)
        && last.is_none_or(|mistake| is_proved(mistake.facts().proof, hypothesis, from))
}

fn is_proved(proof: Proof, hypothesis: &Hypothesis, from: &Hypothesis) -> bool {
    let (score, limits) = (&hypothesis.settings.score, &hypothesis.settings.acceptance);
    match proof {
        Proof::Score => true,
        Proof::Torque => hypothesis.torque_score() < from.torque_score() - score.max_indistinguishable,
        Proof::BaseParameters => hypothesis.free_score() < from.free_score() - score.min_gain,
        Proof::ConsistentRobot => hypothesis.bodies_score() < from.bodies_score() - score.min_gain,
        Proof::Joint(joint) | Proof::Travel(joint) => hypothesis.left[joint] < limits.max_unexplained_of_joint,
        Proof::JointGain(joint) => {
            let left = hypothesis.left[joint];
            left < limits.max_unexplained_of_joint
                && (hypothesis.consistent_score() < from.consistent_score() - score.min_gain_of_torque_gain
                    || left < limits.max_ratio_of_unit * from.left[joint]
                    || (0..from.left.len()).any(|joint| becomes_consistent(joint, hypothesis, from)))
        }
    }
}

/// Whether a joint's torque becomes consistent with the other joints, either for one set of base parameters or for a
/// physically consistent robot. (A wrong gain of a joint with large torque disturbs the fit of its neighbours.)
fn becomes_consistent(joint: usize, hypothesis: &Hypothesis, from: &Hypothesis) -> bool {
    let limits = &hypothesis.settings.acceptance;
    let is_inconsistent = |left: f64, of: &Hypothesis| left > limits.min_inconsistent_ratio * of.alone[joint];
    let is_corrected = |&[before, after]: &[f64; 2]| {
        is_inconsistent(before, from)
            && !is_inconsistent(after, hypothesis)
            && after < limits.max_ratio_of_unit * before
    };
    [[from.free[joint], hypothesis.free[joint]], [from.left[joint], hypothesis.left[joint]]].iter().any(is_corrected)
}
