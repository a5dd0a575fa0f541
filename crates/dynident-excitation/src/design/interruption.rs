//! Early end of a design, by the progress callback (watcher) or the time limit.

use super::{DesignProgress, DesignSettings, DesignWatch};
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Time to move the best motion inside the limits after the watcher has ended the search, s.
const GRACE_S: f64 = 0.5;

/// Number of evaluations of a polish after the time limit: enough to return inside the limits.
pub(super) const EVALUATIONS_AFTER_TIME_LIMIT: usize = 300;

/// Shares of the time limit after which searches and polishes end. The remaining time is for the return inside the
/// limits and the check. A search whose best motion is outside the limits ends earlier, so that there is time for two
/// short polishes, but not before the first share.
const SEARCH_SHARE: f64 = 0.7;
const SEARCH_SHARE_INSIDE: f64 = 0.8;
pub(super) const POLISH_SHARE: f64 = 0.88;

/// Calls the watcher of a design from any thread, stores whether the watcher ended the design, and compares the
/// elapsed time with the time limit.
pub(super) struct Interruption<'a> {
    watch: &'a DesignWatch<'a>,
    elapsed_s: &'a (dyn Fn() -> f64 + Sync),
    time_limit_s: Option<f64>,
    evaluations: AtomicU64,
    /// Whether the best motion so far keeps the limits well enough for the polish.
    inside: AtomicBool,
    /// Time of the end as bits of a float, s; infinite before the end.
    ended_s: AtomicU64,
}

impl<'a> Interruption<'a> {
    pub(super) fn new(
        watch: &'a DesignWatch<'a>,
        elapsed_s: &'a (dyn Fn() -> f64 + Sync),
        settings: &DesignSettings,
    ) -> Self {
        Self {
            watch,
            elapsed_s,
            time_limit_s: settings.time_limit_s,
            evaluations: AtomicU64::new(0),
            inside: AtomicBool::new(false),
            ended_s: AtomicU64::new(f64::INFINITY.to_bits()),
        }
    }

    pub(super) fn count(&self, evaluations: usize) {
        self.evaluations.fetch_add(evaluations as u64, Ordering::Relaxed);
    }

    pub(super) fn evaluations(&self) -> u64 {
        self.evaluations.load(Ordering::Relaxed)
    }

    pub(super) fn set_inside(&self, inside: bool) {
        self.inside.store(inside, Ordering::Relaxed);
    }

    /// Reports the progress of the search; returns whether the search was ended, now or before.
    pub(super) fn report(&self, round: &'static str, value: f64, violation: f64) -> bool {
        if self.is_ended() {
            return true;
        }
        let evaluations = self.evaluations();
        let ended = (self.watch)(&DesignProgress { round, value, violation, evaluations }).is_break();
        if ended {
            self.ended_s.store((self.elapsed_s)().to_bits(), Ordering::Relaxed);
        }
        ended
    }

    pub(super) fn is_ended(&self) -> bool {
        self.ended().is_finite()
    }

    pub(super) fn is_overdue(&self) -> bool {
        self.is_ended() && (self.elapsed_s)() > self.ended() + GRACE_S
    }

    pub(super) fn is_past(&self, share: f64) -> bool {
        self.time_limit_s.is_some_and(|limit| (self.elapsed_s)() > share * limit)
    }

    pub(super) fn search_is_over(&self) -> bool {
        self.is_ended() || self.search_is_late()
    }

    pub(super) fn search_is_late(&self) -> bool {
        self.is_past(self.search_share())
    }

    /// Share of the time limit after which the search ends, so that its best motion can be polished and moved inside
    /// the limits in time. A motion that is already inside needs little time.
    pub(super) fn search_share(&self) -> f64 {
        match (self.time_limit_s, self.evaluations()) {
            _ if self.inside.load(Ordering::Relaxed) => SEARCH_SHARE_INSIDE,
            // The time of the polish can be estimated after the first evaluations.
            (Some(limit), done) if done > 0 => {
                let each = (self.elapsed_s)() * rayon::current_num_threads() as f64 / done as f64;
                let back = 2.0 * (2 * EVALUATIONS_AFTER_TIME_LIMIT) as f64 * each;
                (POLISH_SHARE - back / limit).clamp(SEARCH_SHARE, SEARCH_SHARE_INSIDE)
            }
            _ => SEARCH_SHARE,
        }
    }

    fn ended(&self) -> f64 {
        f64::from_bits(self.ended_s.load(Ordering::Relaxed))
    }
}
