//! Statistics of a channel, accumulated block by block: range, and whether it is dead, quantised or saturated.

use super::jumps::{BATCH, Jump, JumpCheck, LoneSample};
use super::settings::ReportSettings;
use crate::log::Quantity;
use serde::{Deserialize, Serialize};

/// Minimum number of successive samples at an extreme value with which a torque is treated as saturated.
const MIN_SATURATED_RUN: u64 = 20;

/// Statistics of one channel of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ChannelReport {
    /// Channel.
    pub channel: Quantity,
    /// Joint name.
    pub joint: String,
    /// Smallest value (SI).
    pub min: f64,
    /// Largest value (SI).
    pub max: f64,
    /// Share of samples that are exactly zero, 0 to 1.
    pub zero_share: f64,
    /// Longest run of successive samples at the smallest or largest value.
    pub longest_run_at_extreme: u64,
    /// Quantisation step: 90 % of the differences between the first rows are multiples of it; null without such a step.
    pub quantisation_step: Option<f64>,
    /// For positions: number of differences between successive samples that are a whole turn, because the angle wraps
    /// around.
    #[serde(default)]
    pub turns: u64,
    /// Number of single samples that are far from both of their neighbours.
    #[serde(default)]
    pub lone_samples: u64,
    /// The isolated sample that deviates most.
    #[serde(default)]
    pub worst_lone_sample: Option<LoneSample>,
    /// For positions: number of jumps that are far larger than all other differences and after which the channel does
    /// not return; missing rows, or a stuck encoder.
    #[serde(default)]
    pub jumps: u64,
    /// The largest jump.
    #[serde(default)]
    pub worst_jump: Option<Jump>,
}

impl ChannelReport {
    /// Whether the channel is constant.
    pub fn constant(&self) -> bool {
        self.min >= self.max
    }

    /// Whether the torque is at a limit for many samples.
    pub fn saturated(&self) -> bool {
        self.channel == Quantity::Torque && !self.constant() && self.longest_run_at_extreme >= MIN_SATURATED_RUN
    }
}

#[derive(Clone, Debug)]
pub(crate) struct ChannelCheck {
    quantity: Quantity,
    joint: String,
    low: Extreme,
    high: Extreme,
    zeros: u64,
    samples: u64,
    jumps: JumpCheck,
    pub(crate) quantisation_step: Option<f64>,
}

/// A running maximum, and the longest run of samples at it.
#[derive(Clone, Debug)]
struct Extreme {
    value: f64,
    run: u64,
    longest: u64,
}

impl Extreme {
    fn new() -> Self {
        Self { value: f64::NEG_INFINITY, run: 0, longest: 0 }
    }

    #[inline]
    fn add_all(&mut self, largest: f64, values: impl Iterator<Item = f64>) {
        if largest < self.value {
            self.run = 0;
        } else {
            values.for_each(|value| self.add(value));
        }
    }

    #[inline]
    fn add(&mut self, value: f64) {
        if value < self.value {
            self.run = 0;
        } else {
            if value > self.value {
                *self = Self { value, run: 0, longest: 0 };
            }
            self.run += 1;
            self.longest = self.longest.max(self.run);
        }
    }
}

impl ChannelCheck {
    pub(crate) fn new(quantity: Quantity, joint: &str, limits: ReportSettings) -> Self {
        Self {
            quantity,
            joint: joint.to_owned(),
            low: Extreme::new(),
            high: Extreme::new(),
            zeros: 0,
            samples: 0,
            jumps: JumpCheck::new((quantity == Quantity::Position).then_some(core::f64::consts::TAU), limits),
            quantisation_step: None,
        }
    }

    pub(crate) fn add(&mut self, values: &[f64]) {
        // If no value of a batch is an extreme, a single comparison is sufficient.
        for run in values.chunks(BATCH) {
            let [mut low, mut high] = [f64::INFINITY, f64::NEG_INFINITY];
            for &value in run {
                low = if value < low { value } else { low };
                high = if value > high { value } else { high };
            }
            self.high.add_all(high, run.iter().copied());
            self.low.add_all(-low, run.iter().map(|value| -value));
            if low <= 0.0 && high >= 0.0 {
                self.zeros += run.iter().filter(|value| **value == 0.0).count() as u64;
            }
            self.jumps.add_all(run);
        }
        self.samples += values.len() as u64;
    }

    pub(crate) fn begin_piece(&mut self) {
        self.jumps.begin_piece();
    }

    pub(crate) fn report(&self) -> ChannelReport {
        let (lone_samples, worst_lone_sample) = self.jumps.lone();
        // Only positions are tested, because torques and derivatives may really jump.
        let (jumps, worst_jump) = if self.quantity == Quantity::Position { self.jumps.jumps() } else { (0, None) };
        ChannelReport {
            channel: self.quantity,
            joint: self.joint.clone(),
            min: -self.low.value,
            max: self.high.value,
            zero_share: self.zeros as f64 / self.samples.max(1) as f64,
            // A run at zero indicates a dead channel, which is reported separately.
            longest_run_at_extreme: [&self.low, &self.high]
                .map(|extreme| if extreme.value == 0.0 { 0 } else { extreme.longest })
                .into_iter()
                .max()
                .unwrap_or(0),
            quantisation_step: self.quantisation_step,
            turns: self.jumps.wraps(),
            lone_samples,
            worst_lone_sample,
            jumps,
            worst_jump,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipped_and_dead_channels_are_detected_across_blocks() {
        let mut check = ChannelCheck::new(Quantity::Torque, "elbow", ReportSettings::default());
        let clipped: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.05).sin().clamp(-0.5, 0.8)).collect();
        clipped.chunks(7).for_each(|block| check.add(block));
        let report = check.report();
        assert!(report.saturated() && !report.constant(), "{report:?}");
        assert_eq!((report.min, report.max), (-0.5, 0.8));
        let mut dead = ChannelCheck::new(Quantity::Torque, "wrist", ReportSettings::default());
        dead.add(&[0.0; 50]);
        assert!(dead.report().constant() && dead.report().zero_share == 1.0);
    }
}
