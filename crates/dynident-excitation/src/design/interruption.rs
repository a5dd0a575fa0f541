//! When the person or program that watches a search ends it.

use super::DesignProgress;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicU64, Ordering};

/// Seconds that a search has after it was ended, to bring its best motion inside the limits.
const GRACE_S: f64 = 0.5;

/// Asks the watcher of a search, from any thread, and remembers when it ended the search.
pub(super) struct Interruption<'a> {
    watch: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    elapsed_s: &'a (dyn Fn() -> f64 + Sync),
    evaluations: &'a AtomicU64,
    /// Bits of the seconds at which it was ended; infinite before.
    ended_s: AtomicU64,
}

impl<'a> Interruption<'a> {
    pub(super) fn new(
        watch: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
        elapsed_s: &'a (dyn Fn() -> f64 + Sync),
        evaluations: &'a AtomicU64,
    ) -> Self {
        Self { watch, elapsed_s, evaluations, ended_s: AtomicU64::new(f64::INFINITY.to_bits()) }
    }

    /// Reports how far the search is; whether it was ended, now or before.
    pub(super) fn reported(&self, round: &'static str, value: f64, violation: f64) -> bool {
        if self.is_ended() {
            return true;
        }
        let evaluations = self.evaluations.load(Ordering::Relaxed);
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

    fn ended(&self) -> f64 {
        f64::from_bits(self.ended_s.load(Ordering::Relaxed))
    }
}
