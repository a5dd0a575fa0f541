//! Processor time of this process.

/// Processor time of all threads, s; `None` if the operating system does not report it.
#[cfg_attr(unix, allow(clippy::unnecessary_wraps, reason = "other systems do not report it"))]
pub(crate) fn cpu_seconds() -> Option<f64> {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
    }
    #[cfg(not(unix))]
    {
        None
    }
}
