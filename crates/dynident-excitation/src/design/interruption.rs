//! Reasons to end a design before it has used all of its evaluations: the watcher stops it, or the time limit is
//! reached.

use super::{DesignProgress, DesignSettings, DesignWatch};
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Seconds that a search has after it was ended, to bring its best motion inside the limits.
const GRACE_S: f64 = 0.5;

/// Evaluations of a polish once the time is up: enough to come back inside the limits.
pub(super) const LAST_EVALUATIONS: usize = 300;

/// Shares of the time limit after which searches and polishes end; the rest is for the way back inside the limits and
/// the check. A search whose best lies outside still ends in time for two short polishes, after the first share at
/// least.
const SEARCH_SHARE: f64 = 0.7;
const SEARCH_SHARE_INSIDE: f64 = 0.8;
pub(super) const POLISH_SHARE: f64 = 0.88;

/// Calls the watcher of a design from any thread, remembers when it ended the design, and compares the time with the
/// limit of the settings.
pub(super) struct Interruption<'a> {
    watch: &'a DesignWatch<'a>,
    elapsed_s: &'a (dyn Fn() -> f64 + Sync),
    time_limit_s: Option<f64>,
    evaluations: AtomicU64,
    /// Whether the best motion up to now keeps the limits well enough for the polish.
    inside: AtomicBool,
    /// Bits of the seconds at which it was ended; infinite before.
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

    /// Adds to the number of evaluations.
    pub(super) fn count(&self, evaluations: usize) {
        self.evaluations.fetch_add(evaluations as u64, Ordering::Relaxed);
    }

    /// Number of evaluations up to now.
    pub(super) fn evaluations(&self) -> u64 {
        self.evaluations.load(Ordering::Relaxed)
    }

    /// Records whether the best motion up to now keeps the limits well enough for the polish.
    pub(super) fn set_inside(&self, inside: bool) {
        self.inside.store(inside, Ordering::Relaxed);
    }

    /// Reports how far the search is; whether it was ended, now or before.
    pub(super) fn reported(&self, round: &'static str, value: f64, violation: f64) -> bool {
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

    /// Whether the search was ended.
    pub(super) fn is_ended(&self) -> bool {
        self.ended().is_finite()
    }

    /// Whether it was ended and has used up the time to come back inside the limits.
    pub(super) fn is_overdue(&self) -> bool {
        self.is_ended() && (self.elapsed_s)() > self.ended() + GRACE_S
    }

    /// Whether this share of the time limit has passed.
    pub(super) fn is_past(&self, share: f64) -> bool {
        self.time_limit_s.is_some_and(|limit| (self.elapsed_s)() > share * limit)
    }

    /// Whether the search was ended or its share of the time has passed.
    pub(super) fn search_is_over(&self) -> bool {
        self.is_ended() || self.search_is_late()
    }

    /// Whether the search's share of the time has passed.
    pub(super) fn search_is_late(&self) -> bool {
        self.is_past(self.search_share())
    }

    /// Share of the time limit after which the search ends: early enough that its best can be polished and taken back
    /// inside the limits in time. A motion inside needs little of it.
    pub(super) fn search_share(&self) -> f64 {
        match (self.time_limit_s, self.evaluations()) {
            _ if self.inside.load(Ordering::Relaxed) => SEARCH_SHARE_INSIDE,
            // The time of the way back inside is known once some evaluations have been counted.
            (Some(limit), done) if done > 0 => {
                let each = (self.elapsed_s)() * rayon::current_num_threads() as f64 / done as f64;
                // On twice the samples.
                let back = 2.0 * (2 * LAST_EVALUATIONS) as f64 * each;
                (POLISH_SHARE - back / limit).clamp(SEARCH_SHARE, SEARCH_SHARE_INSIDE)
            }
            _ => SEARCH_SHARE,
        }
    }

    fn ended(&self) -> f64 {
        f64::from_bits(self.ended_s.load(Ordering::Relaxed))
    }
}
