//! Settings of the search for events.

mod channels;
mod fits;
mod intervals;

pub use channels::{FilledHoleSettings, OverflowSettings, TrendSettings};
pub use fits::{BinSettings, RobustFitSettings, UsualResidualSettings};
pub use intervals::{DrivesOffSettings, IntervalSettings, KindSettings, StopSettings};

use crate::kind::EventKind;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Name of a setting, its value, and its smallest and largest permitted value.
type Rule = (&'static str, f64, f64, f64);

/// Treatment of events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EventChoice {
    /// Excludes clear events that normal operation cannot cause ([`EventKind::is_unmistakable`]) from the fit; reports
    /// all events.
    #[default]
    Auto,
    /// Excludes clear events of every kind from the fit; reports all events.
    SetAside,
    /// Reports all events and excludes no rows.
    Warn,
    /// No search for events.
    Off,
}

/// Thresholds of the search. All are ratios without unit unless stated otherwise. They were chosen on simulated logs
/// (`cargo run --release -p dynident-identification --example events`, seed sets 0 to 4; other seed sets gave the
/// detection rates in the documentation of the search).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct EventSettings {
    /// Treatment of events; in a study, the key `estimator.events`.
    #[serde(skip)]
    pub choice: EventChoice,
    /// Minimum mean square of unexplained torque in an interval, relative to the usual residual of the joint in the
    /// same state of motion, for a clear event. 25.0 by default.
    pub clear_ratio: f64,
    /// Minimum mean square of unexplained torque in an interval, relative to the usual residual of the joint, for a
    /// warning. 15.0 by default.
    pub warn_ratio: f64,
    /// Minimum mean square of unexplained torque, relative to the worst interval of the same length in the rest of the
    /// log, for a clear event. The comparison with the worst of all other intervals accounts for the number of tested
    /// intervals. 4.0 by default.
    pub clear_prominence: f64,
    /// Minimum mean square of unexplained torque, relative to the worst interval of the same length in the rest of the
    /// log, for a warning. 3.0 by default.
    pub warn_prominence: f64,
    /// Minimum unexplained torque relative to the torque of the joint (both root mean square), for a clear event. 0.2
    /// by default. Smaller residuals can result from friction in very slow motion or errors of a torque sensor; they
    /// change a fit little.
    pub clear_effect: f64,
    /// Minimum unexplained torque relative to the torque of the joint (both root mean square), for a warning. 0.05 by
    /// default.
    pub min_effect: f64,
    /// Maximum share of a log that is excluded automatically; rests with the drives off are not included in this share.
    /// If the share is larger, it is not clear which part of the log is normal. 0.45 by default.
    pub max_share: f64,
    /// Minimum duration of a log that is searched, s. 4.0 by default.
    pub min_duration_s: f64,
    /// Averages over time, and the model of each joint.
    pub bins: BinSettings,
    /// The first fit, which excludes the least consistent blocks.
    pub robust_fit: RobustFitSettings,
    /// The usual residual of a joint in each state of motion.
    pub usual_residual: UsualResidualSettings,
    /// Limits of the intervals that are tested.
    pub intervals: IntervalSettings,
    /// Rests without torque.
    pub drives_off: DrivesOffSettings,
    /// A joint at its mechanical stop.
    pub stop: StopSettings,
    /// Kind of an interval with unexplained torque.
    pub kind: KindSettings,
    /// Holes that were filled by straight lines.
    pub filled_hole: FilledHoleSettings,
    /// Overflow of the number format of a torque.
    pub overflow: OverflowSettings,
    /// Slow changes of a torque.
    pub trend: TrendSettings,
}

impl Default for EventSettings {
    fn default() -> Self {
        Self {
            choice: EventChoice::default(),
            clear_ratio: 25.0,
            warn_ratio: 15.0,
            clear_prominence: 4.0,
            warn_prominence: 3.0,
            clear_effect: 0.2,
            min_effect: 0.05,
            max_share: 0.45,
            min_duration_s: 4.0,
            bins: BinSettings::default(),
            robust_fit: RobustFitSettings::default(),
            usual_residual: UsualResidualSettings::default(),
            intervals: IntervalSettings::default(),
            drives_off: DrivesOffSettings::default(),
            stop: StopSettings::default(),
            kind: KindSettings::default(),
            filled_hole: FilledHoleSettings::default(),
            overflow: OverflowSettings::default(),
            trend: TrendSettings::default(),
        }
    }
}

impl EventChoice {
    /// Whether a clear event of this kind is excluded from the fit.
    pub fn sets_aside(self, kind: EventKind) -> bool {
        match self {
            Self::Auto => kind.is_unmistakable(),
            Self::SetAside => !kind.is_trend(),
            Self::Warn | Self::Off => false,
        }
    }
}

/// A setting of the search for events is outside its range. Write a number within the range that the message names, or
/// delete the key.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("thresholds.events.{name} = {value}: use a number from {low} to {high}")]
pub struct EventSettingsError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value of the setting.
    pub value: f64,
    /// Smallest permitted value.
    pub low: f64,
    /// Largest permitted value.
    pub high: f64,
}

impl EventSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A value is out of range or not finite.
    pub fn validate(&self) -> Result<(), EventSettingsError> {
        let own = [
            ("clear_ratio", self.clear_ratio, 1.0, 1e6),
            ("warn_ratio", self.warn_ratio, 1.0, 1e6),
            ("clear_prominence", self.clear_prominence, 1.0, 1e6),
            ("warn_prominence", self.warn_prominence, 1.0, 1e6),
            ("clear_effect", self.clear_effect, 0.0, 10.0),
            ("min_effect", self.min_effect, 0.0, 10.0),
            ("max_share", self.max_share, 0.0, 0.5),
            ("min_duration_s", self.min_duration_s, 1.0, 1e6),
        ];
        let rules = own
            .into_iter()
            .chain(self.bins.rules())
            .chain(self.robust_fit.rules())
            .chain(self.usual_residual.rules())
            .chain(self.intervals.rules())
            .chain(self.drives_off.rules())
            .chain(self.stop.rules())
            .chain(self.kind.rules())
            .chain(self.filled_hole.rules())
            .chain(self.overflow.rules())
            .chain(self.trend.rules());
        for (name, value, low, high) in rules {
            if !(low..=high).contains(&value) {
                return Err(EventSettingsError { name, value, low, high });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_each_section_is_checked() {
        let good = EventSettings::default();
        assert_eq!(good.validate(), Ok(()));
        let nan = f64::NAN;
        let wrong = [
            EventSettings { warn_ratio: nan, ..good },
            EventSettings { bins: BinSettings { bin_s: 0.0, ..good.bins }, ..good },
            EventSettings { robust_fit: RobustFitSettings { kept_share: 1.1, ..good.robust_fit }, ..good },
            EventSettings {
                usual_residual: UsualResidualSettings { time_error_s: nan, ..good.usual_residual },
                ..good
            },
            EventSettings { intervals: IntervalSettings { min_bins: 0, ..good.intervals }, ..good },
            EventSettings { drives_off: DrivesOffSettings { min_rest_share: -0.1, ..good.drives_off }, ..good },
            EventSettings { stop: StopSettings { max_distance: 0.6, ..good.stop }, ..good },
            EventSettings { kind: KindSettings { end_s: nan, ..good.kind }, ..good },
            EventSettings { filled_hole: FilledHoleSettings { min_samples: 0, ..good.filled_hole }, ..good },
            EventSettings { overflow: OverflowSettings { max_jump_ratio: 0.9, ..good.overflow }, ..good },
            EventSettings { trend: TrendSettings { parts: 1, ..good.trend }, ..good },
        ];
        let names = wrong.map(|settings| settings.validate().unwrap_err().name);
        let expected = [
            "warn_ratio",
            "bins.bin_s",
            "robust_fit.kept_share",
            "usual_residual.time_error_s",
            "intervals.min_bins",
            "drives_off.min_rest_share",
            "stop.max_distance",
            "kind.end_s",
            "filled_hole.min_samples",
            "overflow.max_jump_ratio",
            "trend.parts",
        ];
        assert_eq!(names, expected);
    }
}
