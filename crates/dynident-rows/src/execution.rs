//! Execution of a job: threads and progress.

use crate::progress::Progress;
use crate::progress::Silent;
use rayon::prelude::*;

/// Threads and progress of a job; the result does not depend on them.
#[derive(Clone, Copy)]
pub struct Execution<'a> {
    /// Number of worker threads, 1 or more.
    pub threads: usize,
    /// Receives the progress of the job.
    pub progress: &'a dyn Progress,
}

impl Default for Execution<'_> {
    /// The number of threads of the caller's rayon pool, without progress reports.
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
    /// Runs `work` in a pool of [`threads`](Self::threads) threads, or in the caller's pool if no pool can be created.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        if rayon::current_num_threads() == self.threads {
            return work();
        }
        match rayon::ThreadPoolBuilder::new().num_threads(self.threads.max(1)).build() {
            Ok(pool) => pool.install(work),
            Err(_) => work(),
        }
    }

    /// Maps `items` in parallel if more than one thread is available; results keep the order of the items.
    ///
    /// # Errors
    /// An error of `one`.
    pub fn try_map<T: Sync, R: Send, E: Send>(
        &self,
        items: &[T],
        one: impl Fn(&T) -> Result<R, E> + Sync + Send,
    ) -> Result<Vec<R>, E> {
        if self.parallel() { items.par_iter().map(one).collect() } else { items.iter().map(one).collect() }
    }

    /// Whether more than one thread is available.
    pub fn parallel(&self) -> bool {
        self.threads > 1
    }
}
