//! How many evaluations a search takes when its settings leave it open: as many as suit criterion and family, and no
//! more than end in reasonable time on a large robot.

use super::{DesignSettings, DesignTask};
use crate::limits::LimitKind;

/// How many searches, and how long each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Effort {
    pub(super) starts: usize,
    pub(super) rounds: usize,
    pub(super) evaluations_per_start: usize,
    /// Of a restart around the best.
    pub(super) evaluations_per_restart: usize,
}

impl Effort {
    /// For criteria whose starts end near each other if each goes to its end. UR10, Panda and iiwa14, five harmonics,
    /// three seeds: log det higher than by many short ones in eight of nine cases, in half the time.
    const FEW_LONG: Self = Self { starts: 8, rounds: 1, evaluations_per_start: 1_000, evaluations_per_restart: 1_000 };
    /// For criteria with many local optima. Descents that have the time to wander outside the limits end in better ones
    /// than four times as many that have not, and restarts around the best find more than further starts; restarts of
    /// 500 end no worse than of 1,000. Further rounds found nothing on the arms of docs/src/designs-compared.md, which
    /// has what these end at.
    const RESTARTS: Self = Self { starts: 4, rounds: 36, evaluations_per_start: 600, evaluations_per_restart: 500 };
    /// The same for families with many numbers, whose descents are long: their starts end near each other, and restarts
    /// around the best find more than further starts.
    const LONG_RESTARTS: Self =
        Self { starts: 2, rounds: 8, evaluations_per_start: 2_000, evaluations_per_restart: 2_000 };

    /// How the search's evaluations are shared out: as the settings say, or as suits criterion and family.
    pub(super) fn of(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> Self {
        let many_optima = task.criteria.last().is_some_and(|criterion| criterion.has_many_optima());
        let each = task.family.parameters() / task.family.joints().max(1);
        let usual = match (many_optima, each >= RICH) {
            (false, _) => Self::FEW_LONG,
            (true, false) => Self::RESTARTS,
            (true, true) => Self::LONG_RESTARTS,
        };
        let usual = if is_open(settings) { usual.within(affordable(task, samples, SEARCH_SHARE)) } else { usual };
        Self {
            starts: settings.starts.unwrap_or(usual.starts).max(1),
            rounds: settings.rounds.unwrap_or(usual.rounds),
            evaluations_per_start: settings.evaluations_per_start.unwrap_or(usual.evaluations_per_start),
            evaluations_per_restart: settings.evaluations_per_start.unwrap_or(usual.evaluations_per_restart),
        }
    }

    /// Less of everything until the evaluations are no more than `most`: first of restarts, then of starts, last of
    /// each one's evaluations.
    fn within(mut self, most: usize) -> Self {
        while self.evaluations() > most {
            if self.rounds > 0 {
                self.rounds /= 2;
            } else if self.starts > LEAST_STARTS {
                self.starts = (self.starts / 2).max(LEAST_STARTS);
            } else {
                let searches = self.evaluations() / self.evaluations_per_start.max(1);
                self.evaluations_per_start = (most / searches.max(1)).max(LEAST_EVALUATIONS);
                self.evaluations_per_restart = self.evaluations_per_restart.min(self.evaluations_per_start);
                break;
            }
        }
        self
    }

    /// Evaluations of all searches at most.
    fn evaluations(&self) -> usize {
        let followed = |starts: usize| starts + starts.div_ceil(super::rounds::FOLLOWED);
        followed(self.starts) * self.evaluations_per_start
            + self.rounds * followed(1 + self.restarts()) * self.evaluations_per_restart
    }

    /// Restarts around the best in a round.
    pub(super) fn restarts(&self) -> usize {
        (self.starts / 2).max(2)
    }
}

/// Numbers of a joint from which a family counts as rich.
const RICH: usize = 24;

/// Starts and evaluations that even the dearest robot gets.
const LEAST_STARTS: usize = 2;
const LEAST_EVALUATIONS: usize = 60;

/// Products that a design of open length costs at most, about a minute of a core: the defaults of an arm are below it,
/// a humanoid with its links kept apart is not.
const MOST_PRODUCTS: f64 = 1e12;

/// Shares of [`MOST_PRODUCTS`]: of the searches, of the polishes, and of a search for the limits alone.
const SEARCH_SHARE: f64 = 0.4;
const POLISH_SHARE: f64 = 0.25;
const RESTORATION_SHARE: f64 = 0.2;
const CHANGES_SHARE: f64 = 0.15;

/// Products that the distance of two links at one sample counts for, bodies of some dozen corners: with its share of
/// what comes after a search, where every limit is looked at between samples.
const PRODUCTS_OF_A_PAIR: f64 = 4000.0;

/// Whether the settings leave it open how long the search may take.
fn is_open(settings: &DesignSettings) -> bool {
    settings.starts.is_none()
        && settings.rounds.is_none()
        && settings.evaluations_per_start.is_none()
        && settings.time_limit_s.is_none()
}

/// Evaluations on so many samples for a share of [`MOST_PRODUCTS`]. Counted, not timed: the result must not depend on
/// the computer.
fn affordable(task: &DesignTask<'_>, samples: usize, share: f64) -> usize {
    let columns = task.layout.columns().len() as f64;
    // Information and its way back.
    let panels: f64 =
        (0..task.layout.dof()).map(|joint| 2.0 * (task.layout.joint_columns(joint).len() as f64).powi(2)).sum();
    let pairs = task.limits.constraints().iter().filter(|row| row.kind == LimitKind::SelfCollision).count() as f64;
    let one = samples as f64 * (panels + PRODUCTS_OF_A_PAIR * pairs) + 2.0 * columns.powi(3);
    (share * MOST_PRODUCTS / one.max(1.0)) as usize
}

/// Evaluations of all polishes of an open search together; no bound for others.
pub(super) fn most_of_polishes(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> usize {
    if is_open(settings) { affordable(task, samples, POLISH_SHARE) } else { usize::MAX }
}

/// The same for the search for the limits alone.
pub(super) fn most_of_restoration(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> usize {
    if is_open(settings) { affordable(task, samples, RESTORATION_SHARE) } else { usize::MAX }
}

/// The same for the search for changes of limits.
pub(super) fn most_of_changes(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> usize {
    if is_open(settings) { affordable(task, samples, CHANGES_SHARE) } else { usize::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_is_taken_where_less_can_be_paid() {
        let usual = Effort::FEW_LONG;
        assert_eq!(usual.within(usize::MAX), usual);
        for usual in [Effort::FEW_LONG, Effort::RESTARTS, Effort::LONG_RESTARTS] {
            for most in [20_000, 5_000, 1_000, 300] {
                let less = usual.within(most);
                assert!(less.evaluations() <= most, "{less:?} for {most}");
                assert!(less.starts >= LEAST_STARTS && less.evaluations_per_start >= LEAST_EVALUATIONS);
            }
            // The dearest still look.
            assert_eq!(usual.within(0).evaluations_per_start, LEAST_EVALUATIONS);
        }
    }
}
