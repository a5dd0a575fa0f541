//! RMS residuals at rest, at reversals and in fast motion.

use serde::{Deserialize, Serialize};

/// Sums of squared residuals in three ranges of the joint's velocity: at rest (|q̇| below 0.005 rad/s), reversal (up
/// to 0.1 rad/s) and fast (from 0.1 rad/s on). The limits suit an arm of about 1.2 m; scale the velocities of other
/// machines by their size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedRanges {
    sums: [(usize, f64); 3],
}

/// Residuals of one range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SpeedRangeFigures {
    /// Number of samples.
    pub samples: usize,
    /// RMS residual, Nm (N); `None` without samples.
    pub rmse_nm: Option<f64>,
}

/// Residuals by range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SpeedRangesReport {
    /// |q̇| below 0.005 rad/s (m/s) for an arm of 1.2 m; velocities of other machines are scaled by their size.
    pub at_rest: SpeedRangeFigures,
    /// |q̇| from 0.005 to 0.1 rad/s (m/s), scaled by the size of the machine.
    pub reversal: SpeedRangeFigures,
    /// |q̇| from 0.1 rad/s (m/s) on, scaled by the size of the machine.
    pub fast: SpeedRangeFigures,
}

impl SpeedRanges {
    /// A joint is at rest below this velocity, rad/s (m/s), for an arm of 1.2 m.
    pub const REST_BELOW: f64 = 0.005;
    /// A joint is reversing below this velocity (friction dominates), rad/s (m/s), for an arm of 1.2 m.
    pub const REVERSAL_BELOW: f64 = 0.1;

    /// Adds a residual at a velocity in rad/s (m/s), scaled to an arm of 1.2 m.
    pub fn add(&mut self, speed: f64, residual: f64) {
        let speed = speed.abs();
        let place = usize::from(speed >= Self::REST_BELOW) + usize::from(speed >= Self::REVERSAL_BELOW);
        self.sums[place].0 += 1;
        self.sums[place].1 += residual * residual;
    }

    /// The results so far.
    pub fn report(&self) -> SpeedRangesReport {
        let [at_rest, reversal, fast] = self.sums.map(|(samples, square)| SpeedRangeFigures {
            samples,
            rmse_nm: (samples > 0).then(|| (square / samples as f64).sqrt()),
        });
        SpeedRangesReport { at_rest, reversal, fast }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_speed_has_its_regime() {
        let mut regimes = SpeedRanges::default();
        for (speed, residual) in [(0.0, 1.0), (-0.05, 3.0), (0.05, 4.0), (-2.0, 5.0)] {
            regimes.add(speed, residual);
        }
        let report = regimes.report();
        assert_eq!((report.at_rest.rmse_nm, report.fast.rmse_nm), (Some(1.0), Some(5.0)));
        assert_eq!((report.reversal.samples, report.reversal.rmse_nm), (2, Some(12.5_f64.sqrt())));
    }
}
