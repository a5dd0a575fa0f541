//! Detects whether a program sends its samples in real time, and limits the time without samples.

use std::time::Instant;

/// Longest time without samples of a program that sends in real time, in sampling periods.
const MAX_SILENCE_PERIODS: f64 = 10.0;
/// Minimum of this time limit, s; schedulers and networks can pause for some hundredths of a second.
const MIN_SILENCE_S: f64 = 0.2;
/// Samples arrive in real time if the time in the motion differs from the clock by at most this time, s, plus this
/// share of the elapsed time. Buffers and networks delay samples, and clocks differ.
const MAX_LAG_S: f64 = 0.1;
const MAX_DRIFT_SHARE: f64 = 0.02;
/// A program is known to send in real time after it did so for this multiple of the usual time limit. A simulator on
/// a busy machine can do so for some tenths of a second by chance.
const MIN_STREAMING_RATIO: f64 = 5.0;
/// Largest variation of the smallest delays of consecutive time windows (each half of the usual time limit), s, plus
/// this share of the time for clock drift. The scheduler does not delay at least one sample of each window.
const MAX_DELAY_VARIATION_S: f64 = 0.005;
const MAX_CLOCK_DRIFT_SHARE: f64 = 0.005;

#[derive(Clone, Copy, Debug)]
struct Arrival {
    at: Instant,
    motion_s: f64,
}

/// Monitors the arrival of samples. Programs that send their samples after the motion, or that simulate faster or
/// slower than real time, are never treated as sending in real time.
#[derive(Debug)]
pub(super) struct StreamWatch {
    silence_s: Option<f64>,
    stream: Option<Stream>,
}

#[derive(Clone, Copy, Debug)]
struct Stream {
    first: Arrival,
    last: Arrival,
    samples: usize,
    pace: Pace,
    is_known: bool,
}

/// Delay of the samples relative to the time in the motion, window by window.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// Begin of the interval with samples in real time, as time in the motion, s.
    since_s: f64,
    window_s: f64,
    /// Smallest delay in the current window, s.
    delay_s: f64,
    /// Smallest and largest of the windows' smallest delays, s.
    extremes: Option<(f64, f64)>,
}

impl StreamWatch {
    pub(super) fn new(silence_s: Option<f64>) -> Self {
        Self { silence_s, stream: None }
    }

    pub(super) fn arrived(&mut self, at: Instant, motion_s: f64) {
        let new = Arrival { at, motion_s };
        let usual_s = self.usual_s();
        let stream = self.stream.get_or_insert(Stream {
            first: new,
            last: new,
            samples: 0,
            pace: Pace { since_s: motion_s, window_s: motion_s, delay_s: f64::INFINITY, extremes: None },
            is_known: false,
        });
        stream.last = new;
        stream.samples += 1;
        stream.pace.follow(stream.behind_s(), motion_s, usual_s);
        stream.is_known |= motion_s - stream.pace.since_s >= MIN_STREAMING_RATIO * usual_s;
    }

    /// Longest allowed time without samples, s; `None` if the program does not send in real time.
    pub(super) fn limit_s(&self) -> Option<f64> {
        let stream = self.stream.filter(|stream| stream.is_known)?;
        let elapsed_s = stream.last.at.duration_since(stream.first.at).as_secs_f64();
        (stream.behind_s().abs() <= MAX_LAG_S + MAX_DRIFT_SHARE * elapsed_s).then(|| self.allowed_s())
    }

    fn allowed_s(&self) -> f64 {
        self.silence_s.unwrap_or_else(|| self.usual_s())
    }

    /// Default of the time limit, s. It also determines the time after which a program is known to send in real time.
    fn usual_s(&self) -> f64 {
        let period_s = self.stream.map_or(0.0, |Stream { first, last, samples, .. }| {
            (last.motion_s - first.motion_s).max(0.0) / samples.saturating_sub(1).max(1) as f64
        });
        // At most a day, because sampling periods come from external input.
        (MAX_SILENCE_PERIODS * period_s).clamp(MIN_SILENCE_S, 86400.0)
    }
}

impl Stream {
    /// Delay of the last sample relative to the time in the motion, both measured since the first sample, s.
    fn behind_s(&self) -> f64 {
        self.last.at.duration_since(self.first.at).as_secs_f64() - (self.last.motion_s - self.first.motion_s)
    }
}

impl Pace {
    /// Adds a sample that arrived with a delay of `delay_s` at the time `motion_s` of the motion.
    fn follow(&mut self, delay_s: f64, motion_s: f64, usual_s: f64) {
        self.delay_s = self.delay_s.min(delay_s);
        if motion_s - self.window_s < 0.5 * usual_s {
            return;
        }
        let (least, largest) = self.extremes.unwrap_or((self.delay_s, self.delay_s));
        let (least, largest) = (least.min(self.delay_s), largest.max(self.delay_s));
        if largest - least <= MAX_DELAY_VARIATION_S + MAX_CLOCK_DRIFT_SHARE * (motion_s - self.since_s) {
            self.extremes = Some((least, largest));
        } else {
            self.extremes = Some((self.delay_s, self.delay_s));
            self.since_s = motion_s;
        }
        (self.window_s, self.delay_s) = (motion_s, f64::INFINITY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// `samples` at `rate_hz` of the motion, which arrive `pace` times as fast.
    fn watched(silence_s: Option<f64>, samples: u32, rate_hz: f64, pace: f64) -> StreamWatch {
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
        // 1.1 s at 500 Hz; 3 s at 20 Hz.
        assert!(is(limit(watched(None, 550, 500.0, 1.0)), 0.2));
        assert!(is(limit(watched(None, 61, 20.0, 1.003)), 0.5));
        assert!(is(limit(watched(Some(0.1), 550, 500.0, 1.0)), 0.1));
        // Too few samples; samples after the motion; a fast simulator, a slow one.
        for (samples, pace) in [(450, 1.0), (5000, 50.0), (5000, 1.02), (5000, 0.98), (1, 1.0)] {
            assert_eq!(limit(watched(None, samples, 500.0, pace)), None, "{samples} {pace}");
        }
        assert_eq!(StreamWatch::new(None).limit_s(), None);
    }

    /// A program that was delayed for half a second and then catches up still streams.
    #[test]
    fn a_stream_that_catches_up_goes_on() {
        let (begin, mut watch) = (Instant::now(), StreamWatch::new(None));
        for sample in 0..1500 {
            let motion_s = f64::from(sample) / 500.0;
            let held_up_s = if (0.5..1.0).contains(&motion_s) { 1.0 } else { motion_s };
            watch.arrived(begin + Duration::from_secs_f64(held_up_s), motion_s);
        }
        assert!((watch.limit_s().unwrap() - 0.2).abs() < 1e-9);
    }

    /// A simulator on a busy machine: real time on average, but alternately slower and faster.
    #[test]
    fn a_simulator_whose_pace_varies_does_not_stream() {
        let (begin, mut watch, mut at_s) = (Instant::now(), StreamWatch::new(None), 0.0);
        for sample in 0..5000 {
            at_s += if sample / 125 % 2 == 0 { 1.3 } else { 0.7 } / 500.0;
            watch.arrived(begin + Duration::from_secs_f64(at_s), f64::from(sample) / 500.0);
            assert_eq!(watch.limit_s(), None, "{sample}");
        }
    }

    /// A known stream continues through jitter of 50 ms.
    #[test]
    fn jitter_ends_no_stream() {
        let (begin, mut watch) = (Instant::now(), StreamWatch::new(None));
        for sample in 0..2500 {
            let motion_s = f64::from(sample) / 500.0;
            // Samples come in batches of 25.
            let at_s = f64::from(sample / 25 * 25 + 24) / 500.0;
            watch.arrived(begin + Duration::from_secs_f64(at_s), motion_s);
            assert_eq!(watch.limit_s().is_some(), motion_s >= 1.0, "{sample}");
        }
    }

    /// A program that writes its samples once a second does not stream.
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
