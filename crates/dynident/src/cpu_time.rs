//! The processor time of this process.

/// Seconds of processor time, all threads together; `None` where the system does not say.
#[cfg_attr(unix, allow(clippy::unnecessary_wraps, reason = "other systems do not say"))]
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
