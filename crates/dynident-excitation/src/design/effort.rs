//! Evaluation budget of a search whose settings do not define it. It depends on criterion and family, and is limited
//! for large robots.

use super::{DesignSettings, DesignTask};
use crate::limits::LimitKind;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Effort {
    pub(super) starts: usize,
    pub(super) rounds: usize,
    pub(super) evaluations_per_start: usize,
    pub(super) evaluations_per_restart: usize,
}

impl Effort {
    /// For criteria whose converged starts end close to each other. On UR10, Panda and iiwa14 (five harmonics, three
    /// seeds), log det is higher than with many short starts in eight of nine cases, in half the time.
    const FEW_LONG: Self = Self { starts: 8, rounds: 1, evaluations_per_start: 1_000, evaluations_per_restart: 1_000 };
    /// For criteria with many local optima. Descents that have enough evaluations to move outside the limits reach
    /// better optima than four times as many short descents. Restarts around the best motion improve more than
    /// further starts. Restarts of 500 evaluations are as good as restarts of 1,000. More rounds improved nothing on
    /// the arms of docs/src/designs-compared.md.
    const RESTARTS: Self = Self { starts: 4, rounds: 36, evaluations_per_start: 600, evaluations_per_restart: 500 };
    /// For criteria with many local optima and families with many parameters: descents are long, starts end close to
    /// each other, and restarts around the best motion improve more than further starts.
    const LONG_RESTARTS: Self =
        Self { starts: 2, rounds: 8, evaluations_per_start: 2_000, evaluations_per_restart: 2_000 };

    pub(super) fn of(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> Self {
        let many_optima = task.criteria.last().is_some_and(|criterion| criterion.has_many_optima());
        let each = task.family.parameters() / task.family.joints().max(1);
        let usual = match (many_optima, each >= MIN_PARAMETERS_FOR_LONG_RESTARTS) {
            (false, _) => Self::FEW_LONG,
            (true, false) => Self::RESTARTS,
            (true, true) => Self::LONG_RESTARTS,
        };
        let usual =
            if is_open(settings) { usual.within(affordable_evaluations(task, samples, SEARCH_SHARE)) } else { usual };
        Self {
            starts: settings.starts.unwrap_or(usual.starts).max(1),
            rounds: settings.rounds.unwrap_or(usual.rounds),
            evaluations_per_start: settings.evaluations_per_start.unwrap_or(usual.evaluations_per_start),
            evaluations_per_restart: settings.evaluations_per_start.unwrap_or(usual.evaluations_per_restart),
        }
    }

    /// Reduces the effort to `most` evaluations: first the restarts, then the starts, finally the evaluations of each.
    fn within(mut self, most: usize) -> Self {
        while self.evaluations() > most {
            if self.rounds > 0 {
                self.rounds /= 2;
            } else if self.starts > MIN_STARTS {
                self.starts = (self.starts / 2).max(MIN_STARTS);
            } else {
                let searches = self.evaluations() / self.evaluations_per_start.max(1);
                self.evaluations_per_start = (most / searches.max(1)).max(MIN_EVALUATIONS);
                self.evaluations_per_restart = self.evaluations_per_restart.min(self.evaluations_per_start);
                break;
            }
        }
        self
    }

    fn evaluations(&self) -> usize {
        let followed = |starts: usize| starts + starts.div_ceil(super::rounds::STARTS_PER_FOLLOWED);
        followed(self.starts) * self.evaluations_per_start
            + self.rounds * followed(1 + self.restarts()) * self.evaluations_per_restart
    }

    pub(super) fn restarts(&self) -> usize {
        (self.starts / 2).max(2)
    }
}

/// Parameters per joint from which a family uses [`Effort::LONG_RESTARTS`].
const MIN_PARAMETERS_FOR_LONG_RESTARTS: usize = 24;

/// Minimum numbers of starts and evaluations, also for the most expensive robot.
const MIN_STARTS: usize = 2;
const MIN_EVALUATIONS: usize = 60;

/// Maximum number of products (floating-point multiplications) of a design whose effort is not set, about a minute on
/// one core. Arms stay below it; a humanoid with self-collision limits does not.
const MAX_PRODUCTS: f64 = 1e12;

/// Shares of [`MAX_PRODUCTS`] for: searches, polishes, search for feasibility alone, and search for changes of
/// limits.
const SEARCH_SHARE: f64 = 0.4;
const POLISH_SHARE: f64 = 0.25;
const RESTORATION_SHARE: f64 = 0.2;
const CHANGES_SHARE: f64 = 0.15;

/// Cost of computing the distance of two links at one sample, as a number of products, for bodies with some dozen
/// corners. Includes a share of the check between samples after a search.
const PRODUCTS_PER_PAIR: f64 = 4000.0;

fn is_open(settings: &DesignSettings) -> bool {
    settings.starts.is_none()
        && settings.rounds.is_none()
        && settings.evaluations_per_start.is_none()
        && settings.time_limit_s.is_none()
}

/// Number of evaluations on `samples` samples for a share of [`MAX_PRODUCTS`]. The cost is counted, not timed, so that
/// the result does not depend on the computer.
fn affordable_evaluations(task: &DesignTask<'_>, samples: usize, share: f64) -> usize {
    let columns = task.layout.columns().len() as f64;
    let panels: f64 =
        (0..task.layout.dof()).map(|joint| 2.0 * (task.layout.joint_columns(joint).len() as f64).powi(2)).sum();
    let pairs = task.limits.constraints().iter().filter(|row| row.kind == LimitKind::SelfCollision).count() as f64;
    let one = samples as f64 * (panels + PRODUCTS_PER_PAIR * pairs) + 2.0 * columns.powi(3);
    (share * MAX_PRODUCTS / one.max(1.0)) as usize
}

/// Number of evaluations of all polishes together if the effort of the search is not set; otherwise unlimited.
pub(super) fn polish_budget(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> usize {
    if is_open(settings) { affordable_evaluations(task, samples, POLISH_SHARE) } else { usize::MAX }
}

/// Number of evaluations of the search for feasibility alone if the effort is not set; otherwise unlimited.
pub(super) fn restoration_budget(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> usize {
    if is_open(settings) { affordable_evaluations(task, samples, RESTORATION_SHARE) } else { usize::MAX }
}

/// Number of evaluations of the search for changes of limits if the effort is not set; otherwise unlimited.
pub(super) fn single_change_budget(task: &DesignTask<'_>, settings: &DesignSettings, samples: usize) -> usize {
    if is_open(settings) { affordable_evaluations(task, samples, CHANGES_SHARE) } else { usize::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effort_fits_the_budget() {
        let usual = Effort::FEW_LONG;
        assert_eq!(usual.within(usize::MAX), usual);
        for usual in [Effort::FEW_LONG, Effort::RESTARTS, Effort::LONG_RESTARTS] {
            for most in [20_000, 5_000, 1_000, 300] {
                let less = usual.within(most);
                assert!(less.evaluations() <= most, "{less:?} for {most}");
                assert!(less.starts >= MIN_STARTS && less.evaluations_per_start >= MIN_EVALUATIONS);
            }
            assert_eq!(usual.within(0).evaluations_per_start, MIN_EVALUATIONS);
        }
    }
}
