//! Sampling rate of a group of columns, from its time stamps.

/// A step longer than this number of mean steps is a gap: a pause, or the end of an episode.
const MIN_GAP_STEPS: f64 = 5.0;
/// Number of steps before the mean is reliable.
const MIN_STEPS_FOR_MEAN: u64 = 8;

/// A column without a name can be a clock if the standard deviation of its steps, relative to their mean, is at most
/// this. Stamps of recorders that are not real-time scatter by up to 0.3 steps; positions of a moving joint scatter
/// more.
const MAX_STEP_DEVIATION: f64 = 0.5;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    last: Option<f64>,
    steps: u64,
    sum: f64,
    gaps: u64,
    /// Mean step; the field below is the sum of squared deviations from it (Welford).
    mean: f64,
    squares: f64,
    /// Whether a step was not positive or a value is missing.
    falls: bool,
    /// Whether a step differs from one; otherwise the column counts the rows.
    other_than_one: bool,
}

impl Clock {
    pub(super) fn add(&mut self, time: f64) {
        if !time.is_finite() {
            self.falls = true;
            return;
        }
        if let Some(last) = self.last.replace(time) {
            let step = time - last;
            self.falls |= step <= 0.0;
            self.other_than_one |= step != 1.0;
            if self.steps >= MIN_STEPS_FOR_MEAN && step > MIN_GAP_STEPS * self.sum / self.steps as f64 {
                self.gaps += 1;
            } else {
                self.steps += 1;
                self.sum += step;
                let deviation = step - self.mean;
                self.mean += deviation / self.steps as f64;
                self.squares += deviation * (step - self.mean);
            }
        }
    }

    /// Standard deviation of the steps relative to their mean, if this column increases so evenly that it can be a
    /// clock. A counter of rows is not a clock.
    pub(super) fn step_deviation(&self) -> Option<f64> {
        let variance = self.squares / self.steps as f64;
        let deviation = variance.max(0.0).sqrt() / self.mean;
        let is_clock = !self.falls && self.other_than_one && deviation <= MAX_STEP_DEVIATION;
        is_clock.then_some(deviation)
    }

    /// Rows per unit of time: from `span` and `rows`, or from the steps without gaps.
    pub(super) fn rate(&self, rows: u64, span: f64) -> Option<f64> {
        let rate = if self.gaps == 0 { rows.saturating_sub(1) as f64 / span } else { self.steps as f64 / self.sum };
        Some(rate).filter(|rate| *rate > 0.0 && rate.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_are_no_steps() {
        let mut clock = Clock::default();
        let times: Vec<f64> = (0..50).map(|row| 0.02 * f64::from(row) + if row < 30 { 0.0 } else { 10.0 }).collect();
        for time in &times {
            clock.add(*time);
        }
        assert!((clock.rate(50, times[49]).unwrap() - 50.0).abs() < 1e-9);
        assert!(clock.step_deviation().unwrap() < 1e-9);
        let mut even = Clock::default();
        (0..5).for_each(|row| even.add(f64::from(row)));
        assert_eq!((even.rate(5, 4.0), Clock::default().rate(1, f64::INFINITY)), (Some(1.0), None));
    }

    #[test]
    fn columns_that_rise_evenly_are_clocks() {
        let deviation = |values: &dyn Fn(u32) -> f64| {
            let mut clock = Clock::default();
            (0..200).for_each(|row| clock.add(values(row)));
            clock.step_deviation()
        };
        let jitter = |row: u32| f64::from(row) * 0.004 + 0.001 * f64::from(row % 3);
        assert!(deviation(&jitter).is_some_and(|deviation| deviation > 0.1));
        assert!(deviation(&|row| 1.7e9 + 0.002 * f64::from(row)).is_some_and(|deviation| deviation < 1e-3));
        // A counter of rows, a swinging joint, a joint that speeds up, a constant.
        for column in [|row| f64::from(row), |row| f64::from(row).sin(), |row| f64::from(row).powi(4), |_| 1.0] {
            assert_eq!(deviation(&column), None);
        }
    }
}
