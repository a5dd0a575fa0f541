//! Threads for arrays of many samples.

use pyo3::prelude::*;
use rayon::ThreadPool;
use std::sync::{Arc, Mutex};

/// This process's threads, and its number.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Threads that wait for work: as many as there are processors, or `RAYON_NUM_THREADS`. Made anew in a process that was
/// forked, where those of the parent are not. The interpreter's lock (`_py`) keeps a fork from coming between.
pub(crate) fn pool(_py: Python<'_>) -> Option<Arc<ThreadPool>> {
    let mut kept = POOL.lock().ok()?;
    let process = std::process::id();
    if let Some((owner, pool)) = &*kept
        && *owner == process
    {
        return Some(Arc::clone(pool));
    }
    // The parent's pool would wait for its threads to end, and they are not here.
    std::mem::forget(kept.take());
    let made = Arc::new(rayon::ThreadPoolBuilder::new().build().ok()?);
    *kept = Some((process, Arc::clone(&made)));
    Some(made)
}
