//! What was found in a log, for people and for robots.
//!
//! `ChannelCheck` looks at every channel (dead, saturated, quantised), `TimeCheck` at the steps of the stamps,
//! `Comparison` holds logged velocities and accelerations against the derivatives of the position, shifted by
//! [`best_lag`]. [`ImportReport`] is all of it, with [`Finding`]s as sentences where something matters.

pub(crate) mod channels;
pub(crate) mod comparison;
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
use crate::log::{LinesDropped, Quantity};
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

/// Share of samples set aside below which they are good to know and no more.
const FEW: f64 = 5e-3;

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

/// `2nd`, `3rd`, `4th`, ..
fn ordinal(number: u64) -> String {
    let ending = match (number % 100, number % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    };
    format!("{number}{ending}")
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

    /// The joints whose positions jump, and what to do about it.
    fn position_jumps(&self) -> Option<(String, String)> {
        let jumping = |channel: &ChannelReport| Some((channel.joint.clone(), channel.jumps, channel.worst_jump?));
        let all: Vec<(String, u64, Jump)> = self.channels.iter().filter_map(jumping).collect();
        let (_, most, worst) = all.iter().max_by(|a, b| {
            let times = |jump: &Jump| (jump.after - jump.before).abs() / jump.largest_other;
            times(&a.2).total_cmp(&times(&b.2))
        })?;
        let wrap = all.iter().find_map(|(joint, _, jump)| Some((joint, jump, jump.period?)));
        if let Some((joint, jump, period)) = wrap {
            let message = format!(
                "jumps from one end of its range to the other, {:.6} to {:.6} at row {} of those used: it wraps around with a \
                 period of about {period:.4}, as a counter does that overflows; unwrap it (numpy.unwrap with that `period`) \
                 before it is read",
                jump.before, jump.after, jump.row
            );
            return Some((joint.clone(), message));
        }
        let joints = all.iter().map(|(joint, ..)| &joint[..]).collect::<Vec<_>>().join(", ");
        let cause = if all.iter().filter(|(.., jump)| jump.row == worst.row).count() > 1 {
            "rows are missing there without a gap of the stamps, or the log is put together from pieces"
        } else {
            "the encoder stood still or lost counts, or rows are missing there"
        };
        let message = format!(
            "jumps {most} times, the farthest from {:.6} to {:.6} at row {} of those used, where no other step is larger \
             than {:.2e}: {cause}; read what lies before and after as logs of their own (`rows`)",
            worst.before, worst.after, worst.row, worst.largest_other
        );
        Some((joints, message))
    }

    /// Writes the findings that follow from the other fields.
    pub(crate) fn find(&mut self) {
        let mut findings = Vec::new();
        let mut add = |level, channel: &str, message: String| {
            findings.push(Finding { level, channel: channel.to_owned(), message });
        };
        // The clock.
        add(Level::Info, "time", format!("{} rows at {:.4} Hz; {}", self.rows, self.rate_hz, self.clock.evidence));
        if let Some(gap) = self.gaps.first() {
            let message = format!(
                "{} steps longer than three median steps, the first of {:.4} s after row {} at {:.4} s",
                self.gap_count, gap.length_s, gap.row, gap.time_s
            );
            add(Level::Warning, "time", message);
        }
        if self.segments > 1 {
            add(Level::Info, "time", format!("split at gaps into {} pieces", self.segments));
        }
        if self.bridged[0] > 0 {
            let [gaps, samples] = self.bridged;
            let message = format!(
                "{gaps} gaps, short against the motion, were bridged; the {samples} samples in them count as no rows"
            );
            add(Level::Info, "time", message);
        }
        if self.short_segments[0] > 0 {
            let [pieces, samples] = self.short_segments;
            let message = format!("{pieces} pieces too short for the filter were left out ({samples} samples)");
            add(Level::Warning, "time", message);
        }
        if self.unmapped_samples > 0 {
            let message = format!(
                "{} samples were left out: off the stroke, or the commanded motion is not followed or not known there",
                self.unmapped_samples
            );
            add(Level::Warning, "position", message);
        }
        if self.duplicate_stamps > 0 {
            let what = if self.clock.repeats_rows {
                "rows repeat the one before, stamp and positions; they are left out, and the rate is that of the others"
            } else {
                "stamps equal the one before; if they are rounded that does no harm, for the rate is that of all rows \
                 over the time they span"
            };
            add(Level::Warning, "time", format!("{} {what}", self.duplicate_stamps));
        }
        if self.backward_stamps > 0 {
            add(Level::Problem, "time", format!("{} stamps are earlier than the one before", self.backward_stamps));
        }
        if self.crowded_samples > 0 {
            let message =
                format!("{} samples stand too close to the one before and were left out", self.crowded_samples);
            add(Level::Info, "time", message);
        }
        for (quantity, every) in [("position", self.rows_to_a_position), ("torque", self.rows_to_a_torque)] {
            let Some(every) = every else { continue };
            let message = format!(
                "new values come at every {} row only ({:.4} Hz), the rows between repeat them, which makes steps of the \
                 motion and a lag: log at the robot's own rate, or keep one row in {every}",
                ordinal(every),
                self.rate_hz / every as f64
            );
            add(Level::Warning, quantity, message);
        }
        // Rows left out.
        if self.dropped.missing > 0 {
            add(Level::Warning, "rows", format!("{} rows with missing values were left out", self.dropped.missing));
        }
        if self.dropped.by_rule > 0 {
            add(Level::Info, "rows", format!("{} rows were left out as asked", self.dropped.by_rule));
        }
        if let Some(place) = &self.dropped.truncated {
            add(Level::Info, "rows", format!("the cut-off last line was left out ({place})"));
        }
        for found in &self.set_aside {
            let name = format!("{} {}", found.channel.key(), found.joint);
            let few = found.share < FEW && matches!(found.reason, Reason::Outlier | Reason::Spike);
            add(if few { Level::Info } else { Level::Warning }, &name, found.sentence());
        }
        // Each channel by itself.
        for channel in &self.channels {
            let name = format!("{} {}", channel.channel.key(), channel.joint);
            let measured = matches!(channel.channel, Quantity::Position | Quantity::Torque);
            if channel.constant() {
                let level = if measured { Level::Problem } else { Level::Warning };
                add(level, &name, format!("dead: constantly {}", channel.min));
            } else if channel.zero_share > 0.5 {
                let message =
                    format!("mostly dead: {:.1} % of the samples are exactly zero", 100.0 * channel.zero_share);
                add(if measured { Level::Problem } else { Level::Warning }, &name, message);
            }
            let of_channel = |found: &SetAside, reason: Reason| {
                found.channel == channel.channel && found.joint == channel.joint && found.reason == reason
            };
            let is_left_out = self.set_aside.iter().any(|found| of_channel(found, Reason::Saturated));
            if channel.saturated() && !is_left_out {
                let message = format!(
                    "saturated? {} samples in a row at an extreme of [{}, {}]",
                    channel.longest_run_at_extreme, channel.min, channel.max
                );
                add(Level::Warning, &name, message);
            }
            if channel.turns > 0 {
                let message = format!(
                    "jumps by a whole turn {} times: the angles wrap, and a motion cannot be made of them; unwrap them \
                     (numpy.unwrap) before they are read",
                    channel.turns
                );
                add(Level::Problem, &name, message);
            }
            if let Some(worst) = &channel.worst_lone_sample
                && !self.sets_aside(channel)
            {
                let message = format!(
                    "{} samples stand alone, the worst in row {} of those used: {:.6e} after {:.6e}; empty the field \
                     and write `missing = \"drop\"`",
                    channel.lone_samples, worst.row, worst.value, worst.before
                );
                add(if measured { Level::Problem } else { Level::Warning }, &name, message);
            }
            if let Some(step) = channel.quantisation_step
                && measured
            {
                add(Level::Info, &name, format!("quantised in steps of {step:.3e}"));
            }
        }
        if let Some((joints, message)) = self.position_jumps() {
            add(Level::Problem, &format!("position {joints}"), message);
        }
        // Logged derivatives beside those of the position.
        for (quantity, comparisons) in [("velocity", &self.velocity), ("acceleration", &self.acceleration)] {
            for comparison in comparisons {
                let name = format!("{quantity} {}", comparison.joint);
                let difference = 100.0 * comparison.relative_rms_difference;
                if comparison.correlation < -0.5 {
                    let message = "the logged signal has the opposite sign of the position's derivative";
                    add(Level::Problem, &name, message.to_owned());
                } else if let Some(times) = comparison.times().filter(|_| quantity == "velocity") {
                    let message = DerivativeComparison::velocity_in_words(times, self.rate_hz);
                    add(Level::Warning, &name, message);
                } else if difference > 20.0 && comparison.lag.is_some() {
                    let message = format!(
                        "differs from the position's derivative by {difference:.1} % RMS (correlation {:.3})",
                        comparison.correlation
                    );
                    add(Level::Warning, &name, message);
                } else if let Some(lag) = &comparison.lag
                    && lag.matters()
                    && lag.samples.abs() > 0.5
                {
                    add(Level::Info, &name, format!("comes {:.4} s after the position's derivative", lag.seconds));
                }
            }
        }
        findings.sort_by_key(|finding| core::cmp::Reverse(finding.level));
        self.findings = findings;
    }
}
