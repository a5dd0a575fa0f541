//! How often a joint moved at which velocity: what friction laws are compared over once the log is out of reach.

use serde::{Deserialize, Serialize};

/// Bins on either side of rest at most: the largest velocity lies in the upper half of them.
const MOST_BINS: usize = 128;

/// The first width of a bin, rad/s (m/s): below every velocity that matters.
const LEAST_WIDTH: f64 = 1.0 / (1 << 20) as f64;

/// Samples of a joint by velocity, in bins of one width on either side of rest. The width is a power of two, the least
/// at which 128 bins hold the largest velocity, so that the counts do not depend on the order of samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct VelocityHistogram {
    /// Width of a bin, rad/s (m/s).
    pub width_rad_s: f64,
    /// Samples of velocity zero.
    pub resting: u64,
    /// Samples by positive velocity, from rest up: bin k holds `k width <= dq < (k + 1) width`.
    pub forward: Vec<u64>,
    /// Samples by negative velocity, from rest down.
    pub backward: Vec<u64>,
}

impl Default for VelocityHistogram {
    fn default() -> Self {
        Self { width_rad_s: LEAST_WIDTH, resting: 0, forward: Vec::new(), backward: Vec::new() }
    }
}

impl VelocityHistogram {
    /// Counts samples; what is no finite number is left out.
    pub fn add(&mut self, velocities: &[f64]) {
        for &dq in velocities.iter().filter(|dq| dq.is_finite()) {
            if dq == 0.0 {
                self.resting += 1;
                continue;
            }
            while dq.abs() >= self.width_rad_s * MOST_BINS as f64 {
                self.widen();
            }
            let bin = (dq.abs() / self.width_rad_s) as usize;
            let side = if dq > 0.0 { &mut self.forward } else { &mut self.backward };
            if side.len() <= bin {
                side.resize(bin + 1, 0);
            }
            side[bin] += 1;
        }
    }

    fn widen(&mut self) {
        self.width_rad_s *= 2.0;
        for side in [&mut self.forward, &mut self.backward] {
            *side = side.chunks(2).map(|pair| pair.iter().sum()).collect();
        }
    }

    /// The middle of every bin that holds samples with their number, rad/s (m/s). The bins beside rest are left out:
    /// there friction holds the joint, and noise decides the sign of its velocity.
    pub fn moving(&self) -> impl Iterator<Item = (f64, u64)> + '_ {
        let side = |counts: &'_ [u64], sign: f64| {
            let bins = counts.iter().enumerate().skip(1).filter(|(_, samples)| **samples > 0);
            let middle = bins.map(|(bin, &samples)| (sign * (bin as f64 + 0.5) * self.width_rad_s, samples));
            middle.collect::<Vec<_>>()
        };
        side(&self.backward, -1.0).into_iter().chain(side(&self.forward, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_do_not_depend_on_the_order() {
        let velocities: Vec<f64> = (0..5000).map(|k| 3.0 * (0.37 * f64::from(k)).sin().powi(3)).collect();
        let (mut forth, mut back) = (VelocityHistogram::default(), VelocityHistogram::default());
        forth.add(&velocities);
        back.add(&velocities.iter().rev().copied().collect::<Vec<_>>());
        assert_eq!(forth, back);
        // 128 bins of 1/32 reach 4, of 1/64 only 2.
        assert_eq!(forth.width_rad_s, 1.0 / 32.0);
        let counted: u64 = forth.forward.iter().chain(&forth.backward).sum();
        assert_eq!(counted + forth.resting, 5000);
        assert_eq!(forth.resting, 1);
        for (bin, &samples) in forth.backward.iter().enumerate() {
            let inside = |dq: &&f64| **dq < 0.0 && (-**dq * 32.0) as usize == bin;
            assert_eq!(velocities.iter().filter(inside).count() as u64, samples);
        }
    }

    #[test]
    fn rest_and_what_is_no_number_do_not_move() {
        let mut histogram = VelocityHistogram::default();
        histogram.add(&[0.0, f64::NAN, f64::INFINITY, 1.0, -1e-3, 0.5]);
        assert_eq!(histogram.resting, 1);
        // 1.0 fills bin 64 of 1/64; a thousandth is beside rest.
        let moving: Vec<_> = histogram.moving().collect();
        assert_eq!(moving, [(32.5 / 64.0, 1), (64.5 / 64.0, 1)]);
        assert_eq!(VelocityHistogram::default().moving().count(), 0);
    }
}
