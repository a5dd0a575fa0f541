//! Where the restarts of a search begin: around the best motion of a neighbourhood, farther from it the longer nothing
//! better is found, and in the end in another neighbourhood.
//!
//! Most of a family's good basins lie near each other, but not all: of twelve searches for the condition number of an
//! iiwa14 that stayed around their best, four ended 2 to 6 % above the others, and in one of them 30 rounds of 36
//! found nothing.

use super::joint_scales;
use super::rounds::Candidate;
use crate::optimisers::AugmentedLagrangianState;
use dynident_model::sample::Random;

/// Noise of the restarts, as shares of each joint's root mean square, round after round. With 0.3, 0.15 and 0.08 three
/// of four restarts came back to the motion that they began around.
const NOISE: [f64; 2] = [0.5, 0.3];
/// What each round that found nothing adds to it, as a share.
const NOISE_GROWTH: f64 = 0.05;
/// Noise of the restarts in which one joint moves otherwise.
const ONE_JOINT_NOISE: f64 = 1.0;
/// Noise of the other joints in them.
const OTHER_JOINTS_NOISE: f64 = 0.02;
/// Rounds that found nothing after which one more joint moves otherwise.
const MORE_JOINTS: usize = 3;
/// The same after which another neighbourhood is tried, if so many rounds are left for it.
const STALE: usize = 5;
const LEAST_LEFT: usize = 4;
/// Rounds of a search that goes farther at all: with the eight that rich families have, the search stays near.
const FAR_ROUNDS: usize = 16;

/// The neighbourhood that is searched.
pub(super) struct Neighbourhood {
    /// Whether the search has the rounds to go farther.
    goes_far: bool,
    /// Its best motion and that one's score; none before its first round.
    best: Option<(AugmentedLagrangianState, f64)>,
    /// Rounds in it since the last gain, where the search goes far.
    stale: usize,
}

impl Neighbourhood {
    /// None yet, of a search of so many rounds.
    pub(super) fn of_search(rounds: usize) -> Self {
        Self { goes_far: rounds >= FAR_ROUNDS, best: None, stale: 0 }
    }

    /// What its best motion scores; none before its first round.
    pub(super) fn score(&self) -> Option<f64> {
        self.best.as_ref().map(|(_, score)| *score)
    }

    /// Learns of the best of a round. It becomes the neighbourhood's if it is better, which is a gain if it is by more
    /// than `same`, or if scores so far are no measure.
    pub(super) fn take(&mut self, found: &Candidate, same: f64, is_new_measure: bool) {
        let before = self.score().filter(|_| !is_new_measure).unwrap_or(f64::INFINITY);
        let gains = found.score < before - same || before == f64::INFINITY;
        self.stale = if gains { 0 } else { self.stale + usize::from(self.goes_far) };
        if gains || found.score < before {
            self.best = Some((found.state.clone(), found.score));
        }
    }

    /// Another one, where this one has nothing better and `rounds_left` are enough for it.
    pub(super) fn left_when_stale(self, rounds_left: usize) -> Self {
        if self.stale >= STALE && rounds_left >= LEAST_LEFT { Self { best: None, stale: 0, ..self } } else { self }
    }

    /// Its best motion and `count` others around it, to follow round number `round`; none before its first.
    pub(super) fn starts(
        &self,
        round: usize,
        joints: usize,
        count: usize,
        random: &mut Random,
    ) -> Option<Vec<AugmentedLagrangianState>> {
        let (best, _) = self.best.as_ref()?;
        let size = NOISE[round % NOISE.len()] * (1.0 + NOISE_GROWTH * self.stale as f64);
        let scales = joint_scales(&best.x, joints);
        let joints = joints.max(1);
        let each = (best.x.len() / joints).max(1);
        let moved = |restart: usize| {
            // One restart near all of the best, the next with one of its joints moving otherwise; in every other round
            // both have one more joint that does.
            let mut draw = |is: bool| is.then(|| (random.uniform(0.0, joints as f64) as usize).min(joints - 1));
            let near = restart.is_multiple_of(2);
            let otherwise = [draw(!near), draw(round % 2 == 1), draw(self.stale >= MORE_JOINTS)];
            let noise = best.x.iter().zip(&scales).enumerate().map(|(k, (p, scale))| {
                let size = match otherwise.contains(&Some(k / each)) {
                    true => ONE_JOINT_NOISE,
                    false if near => size,
                    false => OTHER_JOINTS_NOISE,
                };
                p + size * scale * random.normal()
            });
            noise.collect::<Vec<f64>>().into()
        };
        Some(core::iter::once(best.clone()).chain((0..count).map(moved)).collect())
    }
}
