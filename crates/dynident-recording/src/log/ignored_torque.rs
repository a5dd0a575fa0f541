//! Time intervals of a log whose torque is ignored.

use core::ops::Range;

/// A time interval in which the torque of some joints is ignored like an outlier: a fit excludes these samples from
/// torque and regressor. The motion keeps all samples, so that no filter starts again.
#[derive(Clone, Debug, PartialEq)]
pub struct IgnoredTorque {
    /// Start and end, s after the first data row of the file, on the clock of the torque.
    pub time_s: [f64; 2],
    /// Indices of the joints in the log.
    pub joints: Vec<usize>,
}

impl IgnoredTorque {
    /// Rows inside the interval, for a block of `rows` rows that begins at `first_s` with the rate `rate_hz`.
    pub(crate) fn rows(&self, first_s: f64, rate_hz: f64, rows: usize) -> Range<usize> {
        let [from_s, to_s] = self.time_s;
        // The tolerance is a millionth of a step, for rounding errors of the times.
        let row = |time_s: f64, rounded: fn(f64) -> f64| rounded((time_s - first_s) * rate_hz).clamp(0.0, rows as f64);
        let (from, to) = (row(from_s - 1e-6 / rate_hz, f64::ceil), row(to_s + 1e-6 / rate_hz, f64::floor));
        let behind = if (to_s - first_s) * rate_hz < -1e-6 { 0 } else { (to as usize + 1).min(rows) };
        from as usize..behind.max(from as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_include_both_ends_and_stay_in_the_block() {
        let rows = |from: f64, to: f64| IgnoredTorque { time_s: [from, to], joints: vec![0] }.rows(2.0, 100.0, 50);
        assert_eq!(rows(2.1, 2.2), 10..21);
        assert_eq!(rows(2.101, 2.199), 11..20);
        assert_eq!(rows(0.0, 2.0), 0..1);
        assert_eq!(rows(0.0, 9.0), 0..50);
        assert!(rows(0.0, 1.9).is_empty() && rows(2.6, 3.0).is_empty());
    }
}
