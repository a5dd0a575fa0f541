//! Velocity histograms of joints. They allow comparing friction laws without the log.

use serde::{Deserialize, Serialize};

/// Maximum number of bins on each side of zero. The bin of the largest velocity is in the upper half of the bins.
const MAX_BINS: usize = 128;

/// Initial bin width, rad/s (m/s), smaller than any relevant velocity.
const MIN_BIN_WIDTH_RAD_S: f64 = 1.0 / (1 << 20) as f64;

/// Number of samples of a joint by velocity, in bins of equal width on each side of zero. The bin width is the smallest
/// power of two with which 128 bins cover the largest velocity, so that the result does not depend on the order of
/// samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct VelocityHistogram {
    /// Bin width, rad/s (m/s).
    pub width_rad_s: f64,
    /// Number of samples with velocity zero.
    pub resting: u64,
    /// Numbers of samples with positive velocity: bin k contains `k width <= dq < (k + 1) width`.
    pub forward: Vec<u64>,
    /// Numbers of samples with negative velocity: bin k contains `k width <= -dq < (k + 1) width`.
    pub backward: Vec<u64>,
}

impl Default for VelocityHistogram {
    fn default() -> Self {
        Self { width_rad_s: MIN_BIN_WIDTH_RAD_S, resting: 0, forward: Vec::new(), backward: Vec::new() }
    }
}

impl VelocityHistogram {
    /// Adds samples; values that are not finite are ignored.
    pub fn add(&mut self, velocities: &[f64]) {
        for &dq in velocities.iter().filter(|dq| dq.is_finite()) {
            if dq == 0.0 {
                self.resting += 1;
                continue;
            }
            while dq.abs() >= self.width_rad_s * MAX_BINS as f64 {
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

    /// Centre (rad/s, m/s) and sample count of every non-empty bin, except the bins next to zero: there the joint
    /// sticks, and noise determines the sign of its velocity.
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
        // 128 bins of width 1/32 reach a velocity of 4; of width 1/64, only 2.
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
    fn resting_and_non_finite_velocities_are_not_moving() {
        let mut histogram = VelocityHistogram::default();
        histogram.add(&[0.0, f64::NAN, f64::INFINITY, 1.0, -1e-3, 0.5]);
        assert_eq!(histogram.resting, 1);
        // 1.0 is in bin 64 of width 1/64; a thousandth is in the bin next to zero.
        let moving: Vec<_> = histogram.moving().collect();
        assert_eq!(moving, [(32.5 / 64.0, 1), (64.5 / 64.0, 1)]);
        assert_eq!(VelocityHistogram::default().moving().count(), 0);
    }
}
