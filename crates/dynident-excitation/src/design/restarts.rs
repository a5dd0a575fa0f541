//! Starting points of the restarts of a search. They lie around the best motion of a neighbourhood, farther away the
//! longer no improvement is found, and finally in another neighbourhood.
//!
//! Most good optima of a family are close to each other, but not all. Twelve searches for the condition number of an
//! iiwa14 stayed around their best motion. Four of them ended 2 to 6 % above the others, and one found no improvement
//! in 30 of 36 rounds.

use super::joint_scales;
use super::rounds::Candidate;
use crate::optimisers::AugmentedLagrangianState;
use dynident_model::sample::Random;

/// Noise of the restarts in alternating rounds, as a share of the root mean square of each joint's parameters. With
/// smaller noise (0.3, 0.15 and 0.08), three of four restarts returned to the motion that they started from.
const RESTART_NOISE: [f64; 2] = [0.5, 0.3];
/// Relative increase of the noise for each round without improvement.
const NOISE_GROWTH: f64 = 0.05;
/// Noise of the joints that a restart perturbs strongly.
const ONE_JOINT_NOISE: f64 = 1.0;
/// Noise of the other joints in such a restart.
const OTHER_JOINTS_NOISE: f64 = 0.02;
/// Rounds without improvement after which one more joint is perturbed strongly.
const STALE_ROUNDS_FOR_MORE_JOINTS: usize = 3;
/// Rounds without improvement after which another neighbourhood is searched, and minimum number of remaining rounds
/// for that.
const MAX_STALE_ROUNDS: usize = 5;
const MIN_ROUNDS_LEFT: usize = 4;
/// Minimum number of rounds of a search that can change the neighbourhood; the eight rounds of families with many
/// parameters are too few.
const MIN_ROUNDS_TO_RELOCATE: usize = 16;

pub(super) struct Neighbourhood {
    can_relocate: bool,
    /// Best motion of the neighbourhood and its score; `None` before the first round.
    best: Option<(AugmentedLagrangianState, f64)>,
    /// Rounds since the last improvement, counted if the neighbourhood can change.
    stale: usize,
}

impl Neighbourhood {
    pub(super) fn of_search(rounds: usize) -> Self {
        Self { can_relocate: rounds >= MIN_ROUNDS_TO_RELOCATE, best: None, stale: 0 }
    }

    pub(super) fn score(&self) -> Option<f64> {
        self.best.as_ref().map(|(_, score)| *score)
    }

    /// Updates the neighbourhood with the best motion of a round if it is better. The improvement must exceed `same`,
    /// unless the previous scores are not comparable.
    pub(super) fn take(&mut self, found: &Candidate, same: f64, is_new_measure: bool) {
        let before = self.score().filter(|_| !is_new_measure).unwrap_or(f64::INFINITY);
        let gains = found.score < before - same || before == f64::INFINITY;
        self.stale = if gains { 0 } else { self.stale + usize::from(self.can_relocate) };
        if gains || found.score < before {
            self.best = Some((found.state.clone(), found.score));
        }
    }

    /// Returns an empty neighbourhood if this one is stale and `rounds_left` are enough to search another.
    pub(super) fn replaced_if_stale(self, rounds_left: usize) -> Self {
        if self.stale >= MAX_STALE_ROUNDS && rounds_left >= MIN_ROUNDS_LEFT {
            Self { best: None, stale: 0, ..self }
        } else {
            self
        }
    }

    /// The best motion and `count` perturbed copies for the next round; `None` before the first round.
    pub(super) fn starts(
        &self,
        round: usize,
        joints: usize,
        count: usize,
        random: &mut Random,
    ) -> Option<Vec<AugmentedLagrangianState>> {
        let (best, _) = self.best.as_ref()?;
        let size = RESTART_NOISE[round % RESTART_NOISE.len()] * (1.0 + NOISE_GROWTH * self.stale as f64);
        let scales = joint_scales(&best.x, joints);
        let joints = joints.max(1);
        let each = (best.x.len() / joints).max(1);
        let moved = |restart: usize| {
            // Restarts with even numbers stay near the best motion; those with odd numbers perturb one joint
            // strongly. In every other round both kinds perturb one more joint.
            let mut draw = |is: bool| is.then(|| (random.uniform(0.0, joints as f64) as usize).min(joints - 1));
            let near = restart.is_multiple_of(2);
            let perturbed = [draw(!near), draw(round % 2 == 1), draw(self.stale >= STALE_ROUNDS_FOR_MORE_JOINTS)];
            let noise = best.x.iter().zip(&scales).enumerate().map(|(k, (p, scale))| {
                let size = match perturbed.contains(&Some(k / each)) {
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
