//! The findings of an [`ImportReport`] in sentences.

use super::{ChannelReport, DerivativeComparison, Finding, ImportReport, Jump, Level, ReportSettings};
use crate::cleaning::{Reason, RejectedSamples};
use crate::log::Quantity;

/// Ordinal number: `2nd`, `3rd`, `4th`, ..
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

#[derive(Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn add(&mut self, code: &str, level: Level, channel: &str, message: String) {
        self.0.push(Finding { code: code.to_owned(), level, channel: channel.to_owned(), message });
    }
}

/// Minimum number of different rounded stamps for an accurate rate. With fewer, rate and velocities have errors of 1 %
/// or more, and inertias twice as much.
const MIN_DIFFERENT_STAMPS: u64 = 100;
/// Maximum range of the position of a resting joint (rad, m): 20 steps of an encoder with 17 bits.
const MAX_RANGE_AT_REST: f64 = 1e-3;

/// Whether a joint rests at zero, so that its encoder changes by a few steps only.
fn is_at_rest_at_zero(channel: &ChannelReport) -> bool {
    channel.channel == Quantity::Position && channel.max - channel.min < MAX_RANGE_AT_REST
}

/// Name of a channel in findings, and whether every log has this channel.
struct Channel {
    name: String,
    measured: bool,
}

impl Channel {
    fn of(channel: &ChannelReport) -> Self {
        let measured = matches!(channel.channel, Quantity::Position | Quantity::Torque);
        Self { name: format!("{} {}", channel.channel.key(), channel.joint), measured }
    }
}

impl ImportReport {
    /// Derives the findings from the other fields of the report, the most severe first.
    pub(crate) fn find(&mut self, limits: &ReportSettings) {
        let mut findings = Findings::default();
        self.check_clock(&mut findings);
        self.check_pieces(&mut findings);
        self.check_stamps(&mut findings);
        self.check_repeated_values(&mut findings);
        self.check_left_out(&mut findings, limits);
        for channel in &self.channels {
            self.check_dead_or_saturated(channel, &mut findings);
            self.check_jumps(channel, &mut findings);
        }
        if let Some((joints, message)) = self.position_jumps() {
            findings.add("import-position-jumps", Level::Problem, &format!("position {joints}"), message);
        }
        for (quantity, comparisons) in [("velocity", &self.velocity), ("acceleration", &self.acceleration)] {
            for comparison in comparisons {
                self.check_difference(quantity, comparison, &mut findings, limits);
            }
        }
        findings.0.sort_by_key(|finding| core::cmp::Reverse(finding.level));
        self.findings = findings.0;
    }

    fn check_clock(&self, findings: &mut Findings) {
        findings.add(
            "import-rows",
            Level::Info,
            "time",
            format!("{} rows at {:.4} Hz; {}", self.rows, self.rate_hz, self.clock.evidence),
        );
        if let Some(gap) = self.gaps.first() {
            let message = format!(
                "{} steps longer than three median steps, the first of {:.4} s after row {} at {:.4} s",
                self.gap_count, gap.length_s, gap.row, gap.time_s
            );
            findings.add("import-gaps", Level::Warning, "time", message);
        }
    }

    fn check_pieces(&self, findings: &mut Findings) {
        if self.segments > 1 {
            findings.add("import-pieces", Level::Info, "time", format!("split at gaps into {} pieces", self.segments));
        }
        if self.bridged[0] > 0 {
            let [gaps, samples] = self.bridged;
            let message = format!("{gaps} short gaps were filled; the {samples} samples in them are not used as rows");
            findings.add("import-filled-gaps", Level::Info, "time", message);
        }
        if self.short_segments[0] > 0 {
            let [pieces, samples] = self.short_segments;
            let message = format!("{pieces} pieces too short for the filter were left out ({samples} samples)");
            findings.add("import-short-pieces", Level::Warning, "time", message);
        }
        if self.unmapped_samples > 0 {
            let message = format!(
                "{} samples were left out: off the stroke, or the commanded motion is not followed or not known there",
                self.unmapped_samples
            );
            findings.add("import-off-reference", Level::Warning, "position", message);
        }
    }

    fn check_stamps(&self, findings: &mut Findings) {
        if self.duplicate_stamps > 0 {
            let different = self.rows.saturating_sub(self.duplicate_stamps).max(1);
            let (level, what) = if self.clock.repeats_rows {
                let what = "rows repeat the one before, stamp and positions; they are left out, and the rate is that of the others";
                (Level::Warning, what.to_owned())
            } else if 2 * self.duplicate_stamps > self.rows && different < MIN_DIFFERENT_STAMPS {
                let what = format!(
                    "stamps equal the one before: {different} different stamps give the rate only to 1 part in {different}: select the \
                     time column with the fractions of a second, or state `rate_hz` instead of the time column"
                );
                (Level::Problem, what)
            } else {
                let what = "stamps equal the one before; rounded stamps are harmless, because the rate is the number of all rows \
                            over the time span";
                (Level::Warning, what.to_owned())
            };
            findings.add("import-duplicate-stamps", level, "time", format!("{} {what}", self.duplicate_stamps));
        }
        if self.backward_stamps > 0 {
            findings.add(
                "import-backward-stamps",
                Level::Problem,
                "time",
                format!(
                    "{} stamps are earlier than the one before: sort the rows by time, or select one part with `rows`",
                    self.backward_stamps
                ),
            );
        }
        if self.crowded_samples > 0 {
            let message = format!("{} samples are too close to the one before and were left out", self.crowded_samples);
            findings.add("import-crowded-samples", Level::Info, "time", message);
        }
    }

    fn check_repeated_values(&self, findings: &mut Findings) {
        for (quantity, every) in [("position", self.rows_to_a_position), ("torque", self.rows_to_a_torque)] {
            let Some(every) = every else { continue };
            let message = format!(
                "values change only at every {} row ({:.4} Hz); the repeated rows cause steps in the motion and a lag: \
                 log at the robot's sample rate, or keep one row in {every} by the key `keep_every = {every}` of [format]",
                ordinal(every),
                self.rate_hz / every as f64
            );
            findings.add("import-repeated-values", Level::Warning, quantity, message);
        }
    }

    fn check_left_out(&self, findings: &mut Findings, limits: &ReportSettings) {
        if self.dropped.missing > 0 {
            findings.add(
                "import-missing-values",
                Level::Warning,
                "rows",
                format!("{} rows with missing values were left out", self.dropped.missing),
            );
        }
        if self.dropped.by_rule > 0 {
            findings.add(
                "import-rows-by-rule",
                Level::Info,
                "rows",
                format!("{} rows were left out by the rules", self.dropped.by_rule),
            );
        }
        if let Some(place) = &self.dropped.truncated {
            findings.add(
                "import-truncated-line",
                Level::Info,
                "rows",
                format!("the truncated last line was left out ({place})"),
            );
        }
        for found in &self.set_aside {
            let name = format!("{} {}", found.channel.key(), found.joint);
            let few = found.share < limits.max_info_share && matches!(found.reason, Reason::Outlier | Reason::Spike);
            findings.add(found.reason.code(), if few { Level::Info } else { Level::Warning }, &name, found.sentence());
        }
    }

    fn check_dead_or_saturated(&self, channel: &ChannelReport, findings: &mut Findings) {
        let Channel { name, measured } = Channel::of(channel);
        if channel.constant() {
            let level = if measured { Level::Problem } else { Level::Warning };
            findings.add("import-dead", level, &name, format!("dead: constantly {}", channel.min));
        } else if channel.zero_share > 0.5 && !is_at_rest_at_zero(channel) {
            let message = format!("mostly dead: {:.1} % of the samples are exactly zero", 100.0 * channel.zero_share);
            findings.add("import-mostly-dead", if measured { Level::Problem } else { Level::Warning }, &name, message);
        }
        let of_channel = |found: &RejectedSamples, reason: Reason| {
            found.channel == channel.channel && found.joint == channel.joint && found.reason == reason
        };
        let is_left_out = self.set_aside.iter().any(|found| of_channel(found, Reason::Saturated));
        if channel.saturated() && !is_left_out {
            let message = format!(
                "saturated? {} samples in a row at an extreme of [{}, {}]",
                channel.longest_run_at_extreme, channel.min, channel.max
            );
            findings.add("import-saturated", Level::Warning, &name, message);
        }
    }

    fn check_jumps(&self, channel: &ChannelReport, findings: &mut Findings) {
        let Channel { name, measured } = Channel::of(channel);
        if channel.turns > 0 {
            let message = format!(
                "jumps by a whole turn {} times: the angles wrap, so the motion cannot be determined; unwrap them \
                 (numpy.unwrap) before reading",
                channel.turns
            );
            findings.add("import-whole-turns", Level::Problem, &name, message);
        }
        if let Some(worst) = &channel.worst_lone_sample
            && !self.sets_aside(channel)
        {
            let message = format!(
                "{} samples are isolated, the worst in row {} of those used: {:.6e} after {:.6e}; empty the field and \
                 set `missing = \"drop\"`",
                channel.lone_samples, worst.row, worst.value, worst.before
            );
            findings.add(
                "import-isolated-samples",
                if measured { Level::Problem } else { Level::Warning },
                &name,
                message,
            );
        }
        if let Some(step) = channel.quantisation_step
            && measured
        {
            findings.add("import-quantised", Level::Info, &name, format!("quantised in steps of {step:.3e}"));
        }
    }

    /// Joints whose positions jump, and advice.
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
                "jumps from one end of its range to the other, {:.6} to {:.6} at row {} of those used: it wraps around \
                 with a period of about {period:.4}, like a counter that overflows; unwrap it (numpy.unwrap with that \
                 `period`) before reading",
                jump.before, jump.after, jump.row
            );
            return Some((joint.clone(), message));
        }
        let joints = all.iter().map(|(joint, ..)| &joint[..]).collect::<Vec<_>>().join(", ");
        let cause = if all.iter().filter(|(.., jump)| jump.row == worst.row).count() > 1 {
            "rows are missing there without a gap in the stamps, or the log is composed of pieces"
        } else {
            "the encoder stood still or lost counts, or rows are missing there"
        };
        let message = format!(
            "jumps {most} times, the farthest from {:.6} to {:.6} at row {} of those used, where no other step is \
             larger than {:.2e}: {cause}; read the parts before and after as separate logs (`rows`)",
            worst.before, worst.after, worst.row, worst.largest_other
        );
        Some((joints, message))
    }

    fn check_difference(
        &self,
        quantity: &str,
        comparison: &DerivativeComparison,
        findings: &mut Findings,
        limits: &ReportSettings,
    ) {
        let name = format!("{quantity} {}", comparison.joint);
        let difference = 100.0 * comparison.relative_rms_difference;
        if comparison.correlation < limits.opposite_correlation {
            let message = "the logged signal has the opposite sign of the position's derivative";
            findings.add("import-derivative-opposite", Level::Problem, &name, message.to_owned());
        } else if let Some(times) = comparison.times(limits).filter(|_| quantity == "velocity") {
            let message = DerivativeComparison::describe_velocity(times, self.rate_hz, limits);
            findings.add("import-derivative-scale", Level::Warning, &name, message);
        } else if difference > limits.min_difference_percent && comparison.lag.is_some() {
            let message = format!(
                "differs from the position's derivative by {difference:.1} % RMS (correlation {:.3})",
                comparison.correlation
            );
            findings.add("import-derivative-difference", Level::Warning, &name, message);
        } else if let Some(lag) = &comparison.lag
            && lag.matters()
            && lag.samples.abs() > 0.5
        {
            findings.add(
                "import-derivative-lag",
                Level::Info,
                &name,
                format!("is {:.4} s behind the position's derivative", lag.seconds),
            );
        }
    }
}
