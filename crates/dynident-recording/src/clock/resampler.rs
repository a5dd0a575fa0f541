//! Interpolation of channels to a uniform grid. Samples on the grid are copied; others are interpolated by local
//! cubics.

use super::{MIN_STEP_RATIO, lagrange};

/// Interpolates one uninterrupted segment of channels, sample by sample, to the grid `first + k` (time in steps).
///
/// Between samples, it evaluates the cubic through the two samples on either side; at the ends of the segment, the
/// cubic through the four nearest samples. The result is continuous and exact for cubics, with the error
/// `(9/384) h⁴ |q''''|` for even spacing h. A sample within 1e-6 steps of a grid point is copied.
#[derive(Clone, Debug)]
pub(crate) struct Resampler {
    /// Stamps of the samples that are still needed, in steps.
    stamps: Vec<f64>,
    channels: Vec<Vec<f64>>,
    next: f64,
    /// Index of the last sample at or before the next grid point.
    at: usize,
}

impl Resampler {
    pub(crate) fn new(channels: usize) -> Self {
        Self { stamps: Vec::new(), channels: vec![Vec::new(); channels], next: 0.0, at: 0 }
    }

    /// Adds the samples of `columns` from `index` on, with the time stamps `stamps`. It stops at the first stamp that
    /// is too close to the previous one (never for infinite stamps) and returns the number of added samples.
    pub(crate) fn push<'a>(
        &mut self,
        stamps: impl Iterator<Item = f64>,
        index: usize,
        columns: impl Iterator<Item = &'a Vec<f64>>,
    ) -> usize {
        let before = self.stamps.len();
        for stamp in stamps {
            match self.stamps.last() {
                None => self.next = stamp,
                Some(last) if stamp - last >= MIN_STEP_RATIO => {}
                Some(_) => break,
            }
            self.stamps.push(stamp);
        }
        let added = self.stamps.len() - before;
        for (channel, column) in self.channels.iter_mut().zip(columns) {
            channel.extend_from_slice(&column[index..index + added]);
        }
        added
    }

    /// Appends to `out` the values at every grid point that later samples cannot change; if the segment `ended`, at all
    /// remaining grid points.
    pub(crate) fn drain(&mut self, ended: bool, out: &mut [Vec<f64>]) {
        let n = self.stamps.len();
        // The weights depend only on differences of stamps, so the origin of the stamps is arbitrary.
        let ahead = if ended { 1 } else { 3 };
        while self.at + ahead <= n && (ended || n >= 4) {
            while self.at + 1 < n && self.stamps[self.at + 1] <= self.next + 1e-6 {
                self.at += 1;
            }
            if self.at + ahead > n {
                break;
            }
            let on_grid = self.run_on_grid(ahead);
            if on_grid > 0 {
                for (channel, out) in self.channels.iter().zip(out.iter_mut()) {
                    out.extend_from_slice(&channel[self.at..self.at + on_grid]);
                }
                for _ in 1..on_grid {
                    self.next += 1.0;
                }
                self.at += on_grid - 1;
            } else if self.at + 1 < n {
                self.interpolate(out);
            } else {
                break;
            }
            self.next += 1.0;
        }
        if ended {
            *self = Self::new(self.channels.len());
            return;
        }
        let used = self.at.saturating_sub(3);
        self.at -= used;
        self.stamps.drain(..used);
        for channel in &mut self.channels {
            channel.drain(..used);
        }
    }

    /// Number of samples, from the current one on, that are exactly on successive grid points, limited by `ahead`.
    fn run_on_grid(&self, ahead: usize) -> usize {
        let mut next = self.next;
        let is_on_grid = |stamp: &&f64| {
            let is_near = (**stamp - next).abs() <= 1e-6;
            next += 1.0;
            is_near
        };
        self.stamps[self.at..=self.stamps.len() - ahead].iter().take_while(is_on_grid).count()
    }

    fn interpolate(&self, out: &mut [Vec<f64>]) {
        let n = self.stamps.len();
        if n < 4 {
            let (t0, t1) = (self.stamps[self.at], self.stamps[self.at + 1]);
            let share = (self.next - t0) / (t1 - t0);
            for (channel, out) in self.channels.iter().zip(out) {
                out.push(channel[self.at] + share * (channel[self.at + 1] - channel[self.at]));
            }
            return;
        }
        let from = self.at.saturating_sub(1).min(n - 4);
        let weights = lagrange(self.next, [0, 1, 2, 3].map(|k| self.stamps[from + k]));
        for (channel, out) in self.channels.iter().zip(out) {
            out.push((0..4).map(|k| weights[k] * channel[from + k]).sum());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resampled(stamps: &[f64], signal: impl Fn(f64) -> f64, piece: usize) -> Vec<f64> {
        let values = [stamps.iter().map(|t| signal(*t)).collect::<Vec<f64>>()];
        let (mut resampler, mut out) = (Resampler::new(1), vec![Vec::new()]);
        for (index, stamp) in stamps.iter().enumerate() {
            resampler.push(core::iter::once(*stamp), index, values.iter());
            if index % piece == 0 {
                resampler.drain(false, &mut out);
            }
        }
        resampler.drain(true, &mut out);
        out.swap_remove(0)
    }

    #[test]
    fn cubics_are_reproduced_however_the_samples_arrive() {
        let stamps: Vec<f64> = (0..50).map(|i| f64::from(i) + 0.3 * f64::from(i * i % 7) / 7.0).collect();
        let cubic = |t: f64| 1.0 + t * (0.5 - t * (0.1 - 0.01 * t));
        for piece in [1, 7, 100] {
            let out = resampled(&stamps, cubic, piece);
            assert_eq!(out.len(), 50);
            for (k, value) in out.iter().enumerate() {
                // Values up to 1e3 with weights of order one.
                assert!((value - cubic(k as f64)).abs() < 1e-10, "{piece} {k} {value}");
            }
        }
    }

    #[test]
    fn samples_on_the_grid_are_copied_and_holes_are_bridged() {
        let out = resampled(&[5.0, 6.0, 7.0, 9.0, 10.0, 11.0], |t| t * t, 2);
        assert_eq!(out.len(), 7);
        assert_eq!(out[0], 25.0);
        assert!((out[3] - 64.0).abs() < 1e-12);
        assert_eq!(resampled(&[0.0, 2.0], |t| t, 1), [0.0, 1.0, 2.0]);
        assert_eq!(resampled(&[3.5], |t| t, 1), [3.5]);
    }
}
