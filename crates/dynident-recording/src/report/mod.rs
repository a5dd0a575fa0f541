//! What was found in a log, for people and for robots.
//!
//! `ChannelCheck` looks at every channel (dead, saturated, quantised), `TimeCheck` at the steps of the stamps,
//! `Comparison` holds logged velocities and accelerations against the derivatives of the position, shifted by
//! [`best_lag`]. [`ImportReport`] is all of it, with [`Finding`]s as sentences where something matters.

pub(crate) mod channels;
pub(crate) mod comparison;
mod findings;
mod held_rows;
mod jumps;
mod lag;
pub(crate) mod steps;

pub use channels::ChannelReport;
pub use comparison::DerivativeComparison;
pub(crate) use held_rows::rows_to_a_value;
pub use jumps::{Jump, LoneSample};
pub use lag::{Lag, best_lag};

use crate::cleaning::{Reason, SetAside};
use crate::clock::Clock;
use crate::filter::CutoffChoice;
use crate::log::LinesDropped;
use serde::{Deserialize, Serialize};

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Good to know.
    Info,
    /// May harm the result.
    Warning,
    /// Harms the result.
    Problem,
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Finding {
    /// How much it matters.
    pub level: Level,
    /// Where: `time`, `rows`, or a quantity and joint such as `torque arm_5`.
    pub channel: String,
    /// What, in a sentence.
    pub message: String,
}

/// A step between successive samples that is longer than three median steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Gap {
    /// 0-based data row before the gap.
    pub row: u64,
    /// Seconds after the first row of the file at which it begins.
    pub time_s: f64,
    /// Its length in seconds.
    pub length_s: f64,
}

/// Time steps between successive rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Steps {
    /// Shortest, in seconds.
    pub min_s: f64,
    /// Median over the first rows, in seconds.
    pub median_s: f64,
    /// Longest, in seconds.
    pub max_s: f64,
    /// Standard deviation, in seconds.
    pub std_s: f64,
}

/// Everything the importer found in a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ImportReport {
    /// The main file.
    pub file: String,
    /// Rows used.
    pub rows: u64,
    /// Sampling rate of the motion that was made of them.
    pub rate_hz: f64,
    /// How stamps were understood, and why.
    pub clock: Clock,
    /// Time steps; all equal without a time column.
    pub steps: Steps,
    /// Number of [`Gap`]s.
    pub gap_count: u64,
    /// The first hundred of them.
    pub gaps: Vec<Gap>,
    /// Stamps that are not later than the one before: equal ones.
    pub duplicate_stamps: u64,
    /// Stamps that are earlier than the one before.
    pub backward_stamps: u64,
    /// Samples left out for standing too close to the one before.
    pub crowded_samples: u64,
    /// Lines left out.
    pub dropped: LinesDropped,
    /// Uninterrupted pieces that were used.
    pub segments: usize,
    /// Pieces too short for the filter, and the samples in them.
    pub short_segments: [u64; 2],
    /// Samples left out because the differentiator does not apply there.
    pub unmapped_samples: u64,
    /// Rows to a new set of positions, where the recorder repeats them; none where every row may have new ones.
    #[serde(default)]
    pub rows_to_a_position: Option<u64>,
    /// The same of torques.
    #[serde(default)]
    pub rows_to_a_torque: Option<u64>,
    /// Samples whose torque does not count, and positions that were replaced, by joint.
    #[serde(default)]
    pub set_aside: Vec<SetAside>,
    /// Gaps that were filled because they are short against the motion, and the samples in them, which count as no
    /// rows.
    #[serde(default)]
    pub bridged: [u64; 2],
    /// Every channel of every joint.
    pub channels: Vec<ChannelReport>,
    /// Logged velocities against the derivative of the position.
    pub velocity: Vec<DerivativeComparison>,
    /// Logged accelerations against the second derivative of the position.
    pub acceleration: Vec<DerivativeComparison>,
    /// The cut-off that the data suggest (in force unless the settings name one).
    pub cutoff: CutoffChoice,
    /// For every joint the standard deviation of one sample's position noise (rad, m), taken for white, as far as it
    /// stands below the cut-off in force: see [`position_noise()`](crate::position_noise()). Zero for a channel that
    /// never changes.
    #[serde(default)]
    pub position_noise: Vec<f64>,
    /// All of this as sentences, where it matters.
    pub findings: Vec<Finding>,
}

impl ImportReport {
    /// Whether the lone samples of a channel were set aside: left out, or replaced by what their neighbours say.
    pub fn sets_aside(&self, channel: &ChannelReport) -> bool {
        self.set_aside.iter().any(|found| {
            found.channel == channel.channel
                && found.joint == channel.joint
                && matches!(found.reason, Reason::Outlier | Reason::Spike)
        })
    }
}
