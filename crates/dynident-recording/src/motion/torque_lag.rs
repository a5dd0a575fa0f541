//! Compensation of the lag of the torque behind the motion.

use core::ops::Range;

/// Number of samples for the interpolation of the torque. The polynomial of degree five has an error below 1e-3 for a
/// sinusoid of a tenth of the sampling rate.
const NODES: usize = 6;

/// Torque lag of each joint in samples: `τ(t_k)` is the logged torque at `t_k + lag`.
#[derive(Clone, Debug, Default)]
pub(crate) struct TorqueShift {
    samples: Vec<f64>,
}

impl TorqueShift {
    pub(crate) fn new(lag_s: impl Iterator<Item = f64>, rate_hz: f64) -> Self {
        // A lag below 1e-9 samples is a rounding error of the setting.
        let samples = lag_s.map(|lag_s| lag_s * rate_hz).map(|shift| if shift.abs() < 1e-9 { 0.0 } else { shift });
        Self { samples: samples.collect() }
    }

    /// Maximum distance of the samples from which the torque of a row is computed.
    pub(crate) fn reach(&self) -> usize {
        let longest = self.samples.iter().fold(0.0_f64, |longest, shift| longest.max(shift.abs()));
        if longest > 0.0 { longest.ceil() as usize + NODES / 2 } else { 0 }
    }

    /// Delay of a joint in samples.
    pub(crate) fn of(&self, joint: usize) -> f64 {
        self.samples.get(joint).copied().unwrap_or(0.0)
    }

    /// Rows that are affected if the torque at `place` of a piece is marked as invalid: the two adjacent rows, or the
    /// row at this place.
    pub(crate) fn rows_of_mark(&self, joint: usize, place: f64) -> impl Iterator<Item = u64> + use<> {
        let place = place - self.of(joint);
        // A sample on the grid is copied. A sample between grid points contributes to both of them.
        let on_grid = (place - place.round()).abs() <= 1e-6;
        let rows = if on_grid { [place.round(), place.round()] } else { [place.floor(), place.ceil()] };
        rows.into_iter().filter(|row| *row >= 0.0).map(|row| row as u64)
    }

    /// Appends the shifted torques for the rows `rows` of a joint's `signal`. Returns the indices of rows outside of
    /// the signal; they get its first or last value.
    pub(crate) fn append(&self, joint: usize, signal: &[f64], rows: Range<usize>, out: &mut Vec<f64>) -> Vec<usize> {
        let shift = self.of(joint);
        if shift == 0.0 {
            out.extend_from_slice(&signal[rows]);
            return Vec::new();
        }
        let last = signal.len() as f64 - 1.0;
        let mut unreached = Vec::new();
        let whole = shift.floor();
        let weights = lagrange(shift - whole);
        for row in rows.clone() {
            let place = row as f64 + shift;
            if !(0.0..=last).contains(&place) {
                unreached.push(row - rows.start);
                out.push(signal[place.clamp(0.0, last) as usize]);
                continue;
            }
            let first = row as i64 + whole as i64 - (NODES as i64 / 2 - 1);
            let nodes = usize::try_from(first).ok().and_then(|first| signal.get(first..first + NODES));
            out.push(if let Some(nodes) = nodes {
                nodes.iter().zip(weights).map(|(value, weight)| value * weight).sum()
            } else {
                // Linear interpolation at the ends of a piece.
                let at = place as usize;
                let next = signal[(at + 1).min(signal.len() - 1)];
                signal[at] + (place - at as f64) * (next - signal[at])
            });
        }
        unreached
    }
}

/// Weights of the nodes -2 .. 3 for the value at `x` (0 to 1).
fn lagrange(x: f64) -> [f64; NODES] {
    let node = |k: usize| k as f64 - (NODES / 2 - 1) as f64;
    core::array::from_fn(|i| {
        (0..NODES).filter(|&k| k != i).map(|k| (x - node(k)) / (node(i) - node(k))).product::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_torque_is_taken_at_the_time_of_its_motion() {
        let torque = |k: f64| 0.3 - k + 0.02 * k.powi(3) - 1e-4 * k.powi(5);
        for shift in [0.4, 7.0, -3.25, 0.0] {
            let late: Vec<f64> = (0..30).map(|k| torque(f64::from(k) - shift)).collect();
            let lag = TorqueShift::new([shift * 0.01].into_iter(), 100.0);
            let mut out = Vec::new();
            let unreached = lag.append(0, &late, 0..30, &mut out);
            let reached = |k: usize| (0.0..=29.0).contains(&(k as f64 + shift));
            assert_eq!(unreached, (0..30).filter(|&k| !reached(k)).collect::<Vec<_>>(), "{shift}");
            let inside = |k: usize| (2.0..=26.0).contains(&(k as f64 + shift));
            for k in (0..30).filter(|&k| inside(k)) {
                // Rounding of six products of values up to 2e3.
                assert!((out[k] - torque(k as f64)).abs() < 1e-9, "{shift} {k}");
            }
        }
    }

    #[test]
    fn marks_are_shifted_with_the_torque() {
        let lag = TorqueShift::new([0.02, 0.025].into_iter(), 100.0);
        assert_eq!(lag.rows_of_mark(0, 5.0).collect::<Vec<_>>(), [3, 3]);
        assert_eq!(lag.rows_of_mark(1, 5.0).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(lag.rows_of_mark(0, 1.0).count(), 0);
        assert_eq!(lag.reach(), 6);
    }
}
