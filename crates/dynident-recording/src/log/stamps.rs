//! Time stamps from a counter that overflows and starts again from zero.

/// Maximum step at an overflow of the counter, relative to the step before it.
const MAX_STEPS: f64 = 10.0;
/// Number of counts of 16-bit and 32-bit counters.
const COUNTS: [f64; 2] = [65_536.0, 4_294_967_296.0];
/// Length of a day, s.
const DAY_S: f64 = 86_400.0;

/// Continues the time stamps of a counter that overflows, and of the time of day at midnight. A stamp is treated as a
/// continuation only if this gives a step of usual size. Otherwise (for example in a log that was started again) the
/// stamps are unchanged.
#[derive(Debug)]
pub(super) struct ContinuedStamps {
    /// Ranges after which a counter starts again, in units of the stamps.
    spans: Vec<f64>,
    last: Option<f64>,
    step: f64,
    added: f64,
}

impl ContinuedStamps {
    /// Creates the continuation for stamps with a unit of this length.
    pub(super) fn new(unit_s: f64) -> Self {
        // For example, a counter of microseconds that a recorder converts to seconds starts again at 4294.967296.
        let converted = [1e-3, 1e-6, 1e-9].map(|tick_s| COUNTS[1] * tick_s / unit_s);
        Self { spans: [&COUNTS[..], &converted, &[DAY_S / unit_s]].concat(), last: None, step: 0.0, added: 0.0 }
    }

    /// The stamp on the continued time axis.
    pub(super) fn next(&mut self, stamp: f64) -> f64 {
        if let Some(last) = self.last.filter(|_| stamp.is_finite()) {
            let step = stamp - last;
            if step > 0.0 {
                self.step = step;
            } else if step < 0.0 {
                let is_usual =
                    |span: &&f64| (0.0..=MAX_STEPS * self.step).contains(&(step + **span)) && self.step > 0.0;
                self.added += self.spans.iter().find(is_usual).unwrap_or(&0.0);
            }
        }
        if stamp.is_finite() {
            self.last = Some(stamp);
        }
        self.continued(stamp)
    }

    /// A stamp within the present range of the counter, on the continued time axis.
    pub(super) fn continued(&self, stamp: f64) -> f64 {
        stamp + self.added
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn continued(unit_s: f64, stamps: &[f64]) -> Vec<f64> {
        let mut continued = ContinuedStamps::new(unit_s);
        stamps.iter().map(|stamp| continued.next(*stamp)).collect()
    }

    #[test]
    fn counters_and_the_time_of_day_are_continued() {
        let end = 4_294_967_295.0;
        assert_eq!(
            continued(1e-6, &[end - 16e3, end - 8e3, 0.0, 8e3]),
            [end - 16e3, end - 8e3, end + 1.0, end + 8_001.0]
        );
        assert_eq!(continued(1e-3, &[65_527.0, 65_531.0, 0.0, 4.0]), [65_527.0, 65_531.0, 65_536.0, 65_540.0]);
        assert_eq!(continued(1.0, &[86_399.5, 86_399.75, 0.0, 0.25]), [86_399.5, 86_399.75, 86_400.0, 86_400.25]);
        // Signed counters, and two starts.
        let signed = continued(1e-6, &[2_147_482_647.0, 2_147_483_647.0, -2_147_483_648.0 + 999.0]);
        assert_eq!(signed[2] - signed[1], 1_000.0);
        let twice = [65_526.0, 65_531.0, 0.0, 65_526.0, 65_531.0, 0.0];
        assert_eq!(continued(1e-3, &twice)[5], 131_072.0);
    }

    #[test]
    fn other_stamps_remain() {
        // A log that was started again, a stamp out of order, a missing stamp.
        for stamps in [&[0.0, 0.008, 20.0, 0.0, 0.008][..], &[3.0, 1.0, 2.0], &[4_294_967_000.0, 0.0, 4_000.0]] {
            assert_eq!(continued(1e-6, stamps), stamps);
        }
        assert!(continued(1.0, &[1.0, f64::NAN, 2.0])[1].is_nan());
    }
}
