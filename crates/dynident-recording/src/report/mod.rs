//! Findings about a log, for people and programs.
//!
//! `ChannelCheck` tests whether channels are dead, saturated or quantised, and `TimeCheck` tests the steps between time
//! stamps. `Comparison` compares logged velocities and accelerations with the derivatives of the position, and finds
//! their lag with [`best_lag`]. [`ImportReport`] contains all results, and the important ones as [`Finding`]s in
//! sentences.

pub(crate) mod channels;
pub(crate) mod comparison;
mod findings;
mod held_rows;
mod jumps;
mod lag;
mod settings;
pub(crate) mod steps;

pub use channels::ChannelReport;
pub use comparison::DerivativeComparison;
pub(crate) use held_rows::rows_to_a_value;
pub use jumps::{Jump, LoneSample};
pub use lag::{Lag, best_lag};
pub use settings::ReportSettings;

use crate::cleaning::{Reason, RejectedSamples};
use crate::clock::Clock;
use crate::filter::CutoffChoice;
use crate::log::LinesDropped;
use serde::{Deserialize, Serialize};

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Information only.
    Info,
    /// May make the result worse.
    Warning,
    /// Makes the result worse.
    Problem,
}

/// A finding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Finding {
    /// Severity.
    pub level: Level,
    /// Subject: `time`, `rows`, or a quantity and joint such as `torque arm_5`.
    pub channel: String,
    /// Description in one sentence.
    pub message: String,
    /// Code of the finding; `dynident docs CODE` explains it. Empty in results of older versions.
    #[serde(default)]
    pub code: String,
}

/// A gap: a step between successive samples that is longer than three median steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Gap {
    /// Data row before the gap, from 0.
    pub row: u64,
    /// Start of the gap, s after the first row of the file.
    pub time_s: f64,
    /// Length, s.
    pub length_s: f64,
}

/// Time steps between successive rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Steps {
    /// Minimum, s.
    pub min_s: f64,
    /// Median over the first rows, s.
    pub median_s: f64,
    /// Maximum, s.
    pub max_s: f64,
    /// Standard deviation, s.
    pub std_s: f64,
}

/// Results of reading a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ImportReport {
    /// The main file.
    pub file: String,
    /// Number of rows used.
    pub rows: u64,
    /// Sample rate of the motion, Hz.
    pub rate_hz: f64,
    /// The clock, with its evidence.
    pub clock: Clock,
    /// Time steps; all equal without a time column.
    pub steps: Steps,
    /// Number of [`Gap`]s.
    pub gap_count: u64,
    /// The first hundred gaps.
    pub gaps: Vec<Gap>,
    /// Number of stamps equal to the previous one.
    pub duplicate_stamps: u64,
    /// Number of stamps earlier than the previous one.
    pub backward_stamps: u64,
    /// Number of samples that were omitted because they are too close to the previous one.
    pub crowded_samples: u64,
    /// Rows and lines that were omitted.
    pub dropped: LinesDropped,
    /// Number of uninterrupted pieces used.
    pub segments: usize,
    /// Number of pieces too short for the filter, and of samples in them.
    pub short_segments: [u64; 2],
    /// Number of samples that were omitted because the differentiator is not valid for them.
    pub unmapped_samples: u64,
    /// Number of rows per new set of positions, if the recorder repeats positions.
    #[serde(default)]
    pub rows_to_a_position: Option<u64>,
    /// Number of rows per new set of torques, if the recorder repeats torques.
    #[serde(default)]
    pub rows_to_a_torque: Option<u64>,
    /// Samples whose torque is ignored, and positions that were replaced, by joint.
    #[serde(default)]
    pub set_aside: Vec<RejectedSamples>,
    /// Number of gaps that were filled because they are short compared with the motion, and number of samples in them.
    /// These samples are not used as rows of the fit.
    #[serde(default)]
    pub bridged: [u64; 2],
    /// Statistics of every channel of every joint.
    pub channels: Vec<ChannelReport>,
    /// Comparison of logged velocities with the derivative of the position.
    pub velocity: Vec<DerivativeComparison>,
    /// Comparison of logged accelerations with the second derivative of the position.
    pub acceleration: Vec<DerivativeComparison>,
    /// The cut-off estimated from the data (used unless the settings contain one).
    pub cutoff: CutoffChoice,
    /// For every joint, the standard deviation of the position noise in one sample (rad, m), if the noise in the pass
    /// band were white: see [`position_noise()`](crate::position_noise()). Zero for a channel that never changes.
    #[serde(default)]
    pub position_noise: Vec<f64>,
    /// The important results in sentences.
    pub findings: Vec<Finding>,
}

impl ImportReport {
    /// Whether the isolated samples of a channel were excluded or replaced.
    pub fn sets_aside(&self, channel: &ChannelReport) -> bool {
        self.set_aside.iter().any(|found| {
            found.channel == channel.channel
                && found.joint == channel.joint
                && matches!(found.reason, Reason::Outlier | Reason::Spike)
        })
    }
}
