//! Clock, repetitions, and JSON lines.

use dynident_lanes::Level;

/// Repetitions of one result, and minimum duration of each: as in `bench_pinocchio.cpp`.
pub(super) const REPEATS: usize = 21;
const REPEAT_NS: f64 = 12e6;

/// Processor time of this thread, ns.
#[cfg(unix)]
pub(super) fn now_ns() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// Time since the first call, ns, because there is no portable thread clock.
#[cfg(not(unix))]
pub(super) fn now_ns() -> f64 {
    use std::{sync::OnceLock, time::Instant};
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_nanos() as f64
}

pub(crate) struct Report<'a> {
    pub(crate) robot: &'a str,
    pub(crate) dof: usize,
    pub(crate) level: Level,
    /// Measure only these quantities, or all if empty.
    pub(crate) only: &'a [String],
}

impl Report<'_> {
    /// Times `sweep`, which does the work `per` times, and prints median, minimum and maximum per unit of work; at the
    /// counting level the operations instead.
    pub(crate) fn time(&self, quantity: &str, per: usize, mut sweep: impl FnMut()) {
        if !self.only.is_empty() && !self.only.iter().any(|only| only == quantity) {
            return;
        }
        sweep();
        let start = now_ns();
        sweep();
        let sweeps = (REPEAT_NS / (now_ns() - start).max(1.0)).max(1.0) as usize;
        let mut times: Vec<f64> = (0..REPEATS)
            .map(|_| {
                let start = now_ns();
                for _ in 0..sweeps {
                    sweep();
                }
                (now_ns() - start) / (sweeps * per) as f64
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!(
            r#"{{"job":"dynident","build":"{}","robot":"{}","nv":{},"algo":"{quantity}","ns":{:.1},"min":{:.1},"max":{:.1}}}"#,
            self.level.name(),
            self.robot,
            self.dof,
            times[REPEATS / 2],
            times[0],
            times[REPEATS - 1]
        );
    }
}

/// One line about the computer. It has no key `algo`, because it is not a result.
pub(crate) fn environment(levels: &[Level]) -> String {
    let processor = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let processor = processor.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let levels: Vec<String> = levels.iter().map(|level| format!("\"{}\"", level.name())).collect();
    format!(
        r#"{{"job":"dynident","environment":{{"version":"{}","processor":"{}","arch":"{}","os":"{}","levels":[{}],"clock":"{}"}}}}"#,
        env!("CARGO_PKG_VERSION"),
        processor.map_or("unknown", |(_, name)| name.trim()).replace(['"', '\\'], ""),
        std::env::consts::ARCH,
        std::env::consts::OS,
        levels.join(","),
        if cfg!(unix) { "thread CPU time" } else { "monotonic" }
    )
}
