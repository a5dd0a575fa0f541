//! Settings of a design of commands.

use crate::error::ServoError;
use serde::{Deserialize, Serialize};

/// Settings of a design of commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ServoDesignSettings {
    /// Duration of the commands, s. Default 60.
    pub duration_s: f64,
    /// Rate of the commands and of the planned log, Hz. Default 50, the rate of usual servo buses.
    pub rate_hz: f64,
    /// Duration of one segment, s. Default 6: slow reversals and sweeps need some seconds.
    pub segment_s: f64,
    /// Highest frequency of a sweep, Hz. Default 5: motion up to 2 to 5 Hz is necessary to separate delay and damping.
    pub highest_hz: f64,
    /// Random candidates for each segment. Default 40.
    pub candidates: usize,
    /// Number of times that each segment is compared with new candidates after the first selection. Default 2.
    pub exchanges: usize,
    /// Expected standard deviation of the difference between simulated and measured position, rad (m). Default 0.005:
    /// for an SO-101, it is 3 to 9 mrad for each joint after a fit.
    pub error: f64,
    /// Time over which these differences are correlated, s. Default 0.5, the value with which a fit begins (25 samples
    /// at 50 Hz).
    pub correlation_s: f64,
    /// Seed of the random candidates. Default 1.
    pub seed: u64,
}

impl Default for ServoDesignSettings {
    fn default() -> Self {
        Self {
            duration_s: 60.0,
            rate_hz: 50.0,
            segment_s: 6.0,
            highest_hz: 5.0,
            candidates: 40,
            exchanges: 2,
            error: 0.005,
            correlation_s: 0.5,
            seed: 1,
        }
    }
}

/// Minimum duration of a segment, s: the transitions to its centre and to its end need a part of it.
const LEAST_SEGMENT_S: f64 = 2.0;
/// Maximum duration of the commands, s: a search simulates them hundreds of times.
const LONGEST_S: f64 = 3600.0;
/// Range of the rate, Hz.
const RATES_HZ: [f64; 2] = [10.0, 1000.0];
/// Maximum number of candidates, and of exchanges.
const MOST: usize = 10_000;
/// Minimum number of samples in a period of the highest frequency: with fewer, a sine becomes a sequence of steps.
const LEAST_SAMPLES_OF_PERIOD: f64 = 5.0;

impl ServoDesignSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The first setting out of its range, with the range.
    pub fn validate(&self) -> Result<(), ServoError> {
        let ranges = [
            ("design.duration_s", self.duration_s, [LEAST_SEGMENT_S, LONGEST_S]),
            ("design.rate_hz", self.rate_hz, RATES_HZ),
            ("design.segment_s", self.segment_s, [LEAST_SEGMENT_S, LONGEST_S]),
            ("design.highest_hz", self.highest_hz, [0.5, self.rate_hz / LEAST_SAMPLES_OF_PERIOD]),
            ("design.candidates", self.candidates as f64, [1.0, MOST as f64]),
            ("design.exchanges", self.exchanges as f64, [0.0, MOST as f64]),
            ("design.error", self.error, [1e-9, 1e9]),
            ("design.correlation_s", self.correlation_s, [0.0, 1e3]),
        ];
        match ranges.into_iter().find(|(_, value, [least, most])| !(*least..=*most).contains(value)) {
            Some((setting, value, [least, most])) => Err(ServoError::DesignSetting { setting, value, least, most }),
            None => Ok(()),
        }
    }

    /// Number of candidates that a design simulates, without repeated batches.
    pub fn evaluations(&self) -> usize {
        self.segments() * self.candidates * (1 + self.exchanges)
    }

    /// Number of segments.
    pub(super) fn segments(&self) -> usize {
        (self.duration_s / self.segment_s).round().max(1.0) as usize
    }

    /// Samples of each segment.
    pub(super) fn samples(&self) -> usize {
        (self.duration_s * self.rate_hz / self.segments() as f64).round().max(1.0) as usize
    }

    /// Weight of one sample in the information matrix, 1/rad² (1/m²).
    pub(super) fn weight(&self) -> f64 {
        1.0 / (self.error.powi(2) * (self.correlation_s * self.rate_hz).max(1.0))
    }
}
