//! Sample rate of a group from its time stamps.

/// Number of mean steps above which a step is a gap: a pause, or the end of an episode.
const MIN_GAP_STEPS: f64 = 5.0;
/// Steps before the mean is reliable.
const MIN_STEPS_FOR_MEAN: u64 = 8;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    last: Option<f64>,
    steps: u64,
    sum: f64,
    gaps: u64,
}

impl Clock {
    pub(super) fn add(&mut self, time: f64) {
        if !time.is_finite() {
            return;
        }
        if let Some(last) = self.last.replace(time) {
            let step = time - last;
            if self.steps >= MIN_STEPS_FOR_MEAN && step > MIN_GAP_STEPS * self.sum / self.steps as f64 {
                self.gaps += 1;
            } else {
                self.steps += 1;
                self.sum += step;
            }
        }
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
        let mut even = Clock::default();
        (0..5).for_each(|row| even.add(f64::from(row)));
        assert_eq!((even.rate(5, 4.0), Clock::default().rate(1, f64::INFINITY)), (Some(1.0), None));
    }
}
