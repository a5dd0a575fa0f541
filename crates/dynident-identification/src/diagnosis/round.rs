//! One round of the search: all candidates behind a hypothesis, bounded, fitted and accepted.

use super::hypothesis::{CLEARLY_BETTER, CorrectedStudy, Explained, Hypothesis, INDISTINGUISHABLE};
use super::joint_fits::SharedMotion;
use super::mistakes::{Breadth, Mistake, Proof, Setup};
use crate::consistent::ConsistencySettings;
use rayon::prelude::*;

/// Largest ratio of the unexplained torque of all joints to that of the study as written.
const MAX_RATIO_OF_ALL: f64 = 1.05;
/// Largest ratio and increase of one joint's unexplained share. The ratio may be larger where its logarithm is a small
/// share of the gain of all joints.
const MAX_RATIO_OF_ONE: f64 = 1.25;
const MAX_INCREASE: f64 = 0.02;
const MAX_SHARE_OF_GAIN: f64 = 0.1;
/// Unexplained share from which the columns of a joint are mostly noise.
const MOSTLY_NOISE: f64 = 0.5;
/// Ratio of a joint's unexplained shares that shows its right unit.
const MAX_RATIO_OF_UNIT: f64 = 0.8;
/// Ratio of a joint's unexplained share by one robot to that by its own parameters from which it is inconsistent.
const MIN_INCONSISTENT: f64 = 1.8;
/// Gain of all joints together from which a gain of one torque needs no other evidence: on real logs a wrong one
/// reaches 0.83.
const MUCH_BETTER: f64 = 2.0 * CLEARLY_BETTER;
/// Candidates fitted at once; fixed, so that the result does not depend on the number of threads.
const BATCH: usize = 4;

/// A candidate with the lower bound of its score.
#[derive(Clone)]
struct Bounded {
    bound: f64,
    study: CorrectedStudy,
}

/// Hypotheses with one more mistake corrected.
#[derive(Clone, Default)]
pub(super) struct Round {
    /// Number of candidates.
    pub(super) tried: usize,
    /// Candidates that can win by their lower bound.
    bounded: Vec<Bounded>,
    /// Those, and gains between the candidates, that a consistent robot was fitted to.
    fitted: Vec<Explained>,
}

impl Round {
    /// Candidates of some `breadths` behind the hypothesis `at`; `known` is the round of the first of these breadths.
    pub(super) fn new(
        at: &Explained,
        consistency: &ConsistencySettings,
        breadths: &[Breadth<'_>],
        known: &Self,
    ) -> Self {
        let Explained { study, hypothesis } = at;
        let Ok(motion) = study.motion() else { return Self::default() };
        let setup = Setup { robot: &study.robot, rows: &study.rows };
        let all = breadths.iter().flat_map(|breadth| Mistake::candidates(setup, *breadth));
        let all: Vec<Mistake> = all.filter(|mistake| !study.mistakes.contains(mistake)).collect();
        let limit = hypothesis.score() - CLEARLY_BETTER;
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
            if batch[0].bound > least + INDISTINGUISHABLE {
                break;
            }
            fitted.extend(batch.par_iter().filter_map(fit).collect::<Vec<_>>());
            least = fitted.iter().map(|one| one.hypothesis.score()).fold(least, f64::min);
        }
        Self { tried: all.len(), bounded: left, fitted }
    }

    /// Those that explain the samples without worse evidence for any joint, best first.
    pub(super) fn winners(mut self, at: &Explained, consistency: &ConsistencySettings) -> Vec<Explained> {
        self.fitted.extend(twin_of_best(&self.fitted, &at.study, consistency));
        self.fitted.retain(|one| is_accepted(&one.hypothesis, &at.hypothesis));
        self.fitted.sort_by(|a, b| a.hypothesis.score().total_cmp(&b.hypothesis.score()));
        likelier_first(&mut self.fitted);
        self.fitted
    }
}

/// The [twin](Mistake::twin) of the best hypothesis, which explains about as much, if it is not among the others.
fn twin_of_best(fitted: &[Explained], at: &CorrectedStudy, consistency: &ConsistencySettings) -> Option<Explained> {
    let best = fitted.iter().min_by(|a, b| a.hypothesis.score().total_cmp(&b.hypothesis.score()))?;
    let twin = at.without(&best.study.mistakes.last()?.twin()?);
    let is_known = fitted.iter().any(|fitted| fitted.study.mistakes == twin.mistakes);
    if is_known { None } else { twin.explained(consistency).ok() }
}

/// For each joint whose torque another gain explains better, the best gain: a gain that is only nearer does not free
/// the other joints from the error of this one.
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
    nearest.par_iter().filter_map(|mistake| mistake.between(free_score)).collect()
}

/// Moves the [likelier](Mistake::likelier) of two mistakes to the first place if the logs hardly distinguish them.
fn likelier_first(fitted: &mut [Explained]) {
    let Some(first) = fitted.first() else { return };
    let limit = first.hypothesis.score() + INDISTINGUISHABLE;
    let likelier = first.study.mistakes.last().and_then(Mistake::likelier);
    let is_likelier =
        |one: &Explained| one.study.mistakes.last() == likelier.as_ref() && one.hypothesis.score() < limit;
    if let Some(found) = likelier.as_ref().and_then(|_| fitted.iter().position(is_likelier)) {
        fitted[..=found].rotate_right(1);
    }
}

/// Whether a hypothesis explains no joint clearly worse than the one that it was made from, nor all of them, and has
/// the [proof](Proof) of its mistake.
fn is_accepted(hypothesis: &Hypothesis, from: &Hypothesis) -> bool {
    let last = hypothesis.mistakes.last();
    let gain = (from.score() - hypothesis.score()).max(0.0);
    let ratio = MAX_RATIO_OF_ONE.max((MAX_SHARE_OF_GAIN * gain).exp());
    let is_sacrificed = |joint: usize| {
        let before = last.map_or(joint, |mistake| mistake.torque_from(joint));
        hypothesis.left[joint] > ratio * from.left[before] + MAX_INCREASE
    };
    hypothesis.left_of_all <= MAX_RATIO_OF_ALL * from.left_of_all
        && !(0..hypothesis.left.len()).any(is_sacrificed)
        && last.is_none_or(|mistake| is_proved(mistake.facts().proof, hypothesis, from))
}

fn is_proved(proof: Proof, hypothesis: &Hypothesis, from: &Hypothesis) -> bool {
    match proof {
        Proof::Score => true,
        Proof::Torque => hypothesis.torque_score() < from.torque_score() - INDISTINGUISHABLE,
        Proof::BaseParameters => hypothesis.free_score() < from.free_score() - CLEARLY_BETTER,
        Proof::ConsistentRobot => hypothesis.bodies_score() < from.bodies_score() - CLEARLY_BETTER,
        Proof::Joint(joint) | Proof::Travel(joint) => hypothesis.left[joint] < MOSTLY_NOISE,
        Proof::JointGain(joint) => {
            let left = hypothesis.left[joint];
            left < MOSTLY_NOISE
                && (hypothesis.consistent_score() < from.consistent_score() - MUCH_BETTER
                    || left < MAX_RATIO_OF_UNIT * from.left[joint]
                    || (0..from.left.len()).any(|joint| becomes_consistent(joint, hypothesis, from)))
        }
    }
}

/// Whether a joint's torque was inconsistent with that of the others and is consistent now, by one set of parameters or
/// by those of a consistent robot: the wrong gain of a strong joint spoils its neighbours.
fn becomes_consistent(joint: usize, hypothesis: &Hypothesis, from: &Hypothesis) -> bool {
    let is_inconsistent = |left: f64, of: &Hypothesis| left > MIN_INCONSISTENT * of.alone[joint];
    [[from.free[joint], hypothesis.free[joint]], [from.left[joint], hypothesis.left[joint]]].iter().any(
        |&[before, after]| {
            is_inconsistent(before, from) && !is_inconsistent(after, hypothesis) && after < MAX_RATIO_OF_UNIT * before
        },
    )
}
