use pyo3::prelude::*;
use rayon::ThreadPool;
use std::sync::{Arc, Mutex};

static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Returns the thread pool: as many threads as processors, or `RAYON_NUM_THREADS`. It is created again in a forked
/// process, where the parent's threads do not exist. The interpreter lock (`_py`) prevents a fork meanwhile.
pub(crate) fn pool(_py: Python<'_>) -> Option<Arc<ThreadPool>> {
    let mut kept = POOL.lock().ok()?;
    let process = std::process::id();
    if let Some((owner, pool)) = &*kept
        && *owner == process
    {
        return Some(Arc::clone(pool));
    }
    // Dropping the parent's pool would wait for its threads, which do not exist here.
    std::mem::forget(kept.take());
    let made = Arc::new(rayon::ThreadPoolBuilder::new().build().ok()?);
    *kept = Some((process, Arc::clone(&made)));
    Some(made)
}
