//! Measures the duration of a job.

use crate::cpu_time::cpu_seconds;
use std::time::Instant;

pub(super) struct Stopwatch {
    pub(super) started: Instant,
    cpu_s: Option<f64>,
}

impl Stopwatch {
    pub(super) fn start() -> Self {
        Self { started: Instant::now(), cpu_s: cpu_seconds() }
    }

    pub(super) fn cpu_s(&self) -> Option<f64> {
        self.cpu_s.zip(cpu_seconds()).map(|(start, end)| end - start)
    }
}
