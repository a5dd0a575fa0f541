//! How a job runs; not what it computes.

use crate::progress::Progress;
use crate::progress::Silent;

/// How a job runs; the result is the same for any choice.
#[derive(Clone, Copy)]
pub struct Execution<'a> {
    /// Threads that compute, 1 or more.
    pub threads: usize,
    /// Hears how far the job has come.
    pub progress: &'a dyn Progress,
}

impl Default for Execution<'_> {
    /// As many threads as the caller's rayon pool has, in silence.
    fn default() -> Self {
        Self { threads: rayon::current_num_threads(), progress: &Silent }
    }
}

impl core::fmt::Debug for Execution<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Execution").field("threads", &self.threads).finish_non_exhaustive()
    }
}

impl Execution<'_> {
    /// Runs `work` where parallel iterators have just [`threads`](Self::threads) threads. Where no pool can be made,
    /// the caller's serves.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        if rayon::current_num_threads() == self.threads {
            return work();
        }
        match rayon::ThreadPoolBuilder::new().num_threads(self.threads.max(1)).build() {
            Ok(pool) => pool.install(work),
            Err(_) => work(),
        }
    }

    /// Whether there is a second thread.
    pub fn parallel(&self) -> bool {
        self.threads > 1
    }
}
