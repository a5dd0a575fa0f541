//! Whether a program streams its samples in real time, and how long it may then be silent.

use std::time::{Duration, Instant};

/// Sample periods that a streaming program may be silent for.
const PERIODS: f64 = 10.0;
/// It may always be silent for this long, s: schedulers and networks pause for some hundredths of a second.
const LEAST_S: f64 = 0.2;
/// Samples come in real time as long as the motion's time and the clock differ by at most this, s, and this share:
/// buffers and networks hold samples back, and clocks differ.
const LAG_S: f64 = 0.1;
const DRIFT: f64 = 0.02;
/// Times the allowed silence for which a program has streamed before it is known to.
const KNOWN_AFTER: f64 = 2.0;

/// A sample that has arrived.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    at: Instant,
    /// The motion's own time, s.
    motion_s: f64,
}

/// Follows when samples arrive. A program that sends its samples after the motion, or simulates faster or slower than
/// real time, never streams.
#[derive(Debug)]
pub(super) struct StreamWatch {
    /// The stated limit, s.
    silence_s: Option<f64>,
    stream: Option<Stream>,
}

/// The samples so far.
#[derive(Clone, Copy, Debug)]
struct Stream {
    first: Arrival,
    last: Arrival,
    samples: usize,
    /// When the first sample arrived after the last silence longer than the limit.
    since: Instant,
}

impl StreamWatch {
    pub(super) fn new(silence_s: Option<f64>) -> Self {
        Self { silence_s, stream: None }
    }

    /// A sample of the motion's time `motion_s` has arrived.
    pub(super) fn arrived(&mut self, at: Instant, motion_s: f64) {
        let new = Arrival { at, motion_s };
        let allowed = self.allowed();
        self.stream = Some(match self.stream {
            None => Stream { first: new, last: new, samples: 1, since: at },
            Some(Stream { first, last, samples, since }) => {
                let since = if at.duration_since(last.at) > allowed { at } else { since };
                Stream { first, last: new, samples: samples + 1, since }
            }
        });
    }

    /// The longest silence that is allowed, s; none where the program does not stream in real time.
    pub(super) fn limit_s(&self) -> Option<f64> {
        let Stream { first, last, since, .. } = self.stream?;
        let allowed = self.allowed();
        let elapsed_s = last.at.duration_since(first.at).as_secs_f64();
        let apart_s = (last.motion_s - first.motion_s - elapsed_s).abs();
        let is_known = last.at.duration_since(since) >= allowed.mul_f64(KNOWN_AFTER);
        (is_known && apart_s <= LAG_S + DRIFT * elapsed_s).then_some(allowed.as_secs_f64())
    }

    fn allowed(&self) -> Duration {
        let period_s = self.stream.map_or(0.0, |Stream { first, last, samples, .. }| {
            (last.motion_s - first.motion_s).max(0.0) / samples.saturating_sub(1).max(1) as f64
        });
        // At most a day: periods are numbers from outside.
        Duration::from_secs_f64(self.silence_s.unwrap_or((PERIODS * period_s).clamp(LEAST_S, 86400.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `samples` at `rate_hz` of the motion, which arrive `pace` times as fast.
    fn watched(silence_s: Option<f64>, (samples, rate_hz, pace): (u32, f64, f64)) -> StreamWatch {
        let begin = Instant::now();
        let mut watch = StreamWatch::new(silence_s);
        for sample in 0..samples {
            let motion_s = f64::from(sample) / rate_hz;
            watch.arrived(begin + Duration::from_secs_f64(motion_s / pace), motion_s);
        }
        watch
    }

    #[test]
    fn only_a_stream_in_real_time_has_a_limit() {
        let limit = |watch: StreamWatch| watch.limit_s();
        let is = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-9;
        // Half a second at 500 Hz; a second and a half at 20 Hz.
        assert!(is(limit(watched(None, (250, 500.0, 1.0))), 0.2));
        assert!(is(limit(watched(None, (31, 20.0, 1.01))), 0.5));
        assert!(is(limit(watched(Some(0.1), (250, 500.0, 1.0))), 0.1));
        // Too few yet; afterwards; a simulator in a hurry, a slow one.
        for (samples, pace) in [(100, 1.0), (5000, 50.0), (5000, 1.1), (5000, 0.9), (1, 1.0)] {
            assert_eq!(limit(watched(None, (samples, 500.0, pace))), None, "{samples} {pace}");
        }
        assert_eq!(StreamWatch::new(None).limit_s(), None);
    }

    /// A program that was held up for half a second and then catches up still streams.
    #[test]
    fn a_stream_that_catches_up_goes_on() {
        let (begin, mut watch) = (Instant::now(), StreamWatch::new(None));
        for sample in 0..1000 {
            let motion_s = f64::from(sample) / 500.0;
            let held_up_s = if (0.5..1.0).contains(&motion_s) { 1.0 } else { motion_s };
            watch.arrived(begin + Duration::from_secs_f64(held_up_s), motion_s);
        }
        assert!((watch.limit_s().unwrap() - 0.2).abs() < 1e-9);
    }

    /// A program that writes what it has once a second does not stream.
    #[test]
    fn batches_are_no_stream() {
        let begin = Instant::now();
        let mut watch = StreamWatch::new(None);
        for sample in 0..3000 {
            let motion_s = f64::from(sample) / 500.0;
            watch.arrived(begin + Duration::from_secs_f64(motion_s.ceil()), motion_s);
            assert_eq!(watch.limit_s(), None, "{sample}");
        }
    }
}
