//! Settings of the search for events.

use crate::kind::EventKind;
use serde::{Deserialize, Serialize};
use thiserror::Error;

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
/// (`cargo run --release -p dynident-identification --example events`).
#[derive(Clone, Debug, PartialEq)]
pub struct EventSettings {
    /// Treatment of events.
    pub choice: EventChoice,
    /// Minimum mean square of unexplained torque in an interval, relative to the usual residual of the joint in the
    /// same state of motion, for a clear event.
    pub clear_ratio: f64,
    /// Minimum mean square of unexplained torque in an interval, relative to the usual residual of the joint, for a
    /// warning.
    pub warn_ratio: f64,
    /// Minimum mean square of unexplained torque, relative to the worst interval of the same length in the rest of the
    /// log, for a clear event. The comparison with the worst of all other intervals accounts for the number of tested
    /// intervals.
    pub clear_prominence: f64,
    /// Minimum mean square of unexplained torque, relative to the worst interval of the same length in the rest of the
    /// log, for a warning.
    pub warn_prominence: f64,
    /// Minimum unexplained torque relative to the torque of the joint (both root mean square), for a clear event.
    /// Smaller residuals can result from friction in very slow motion or errors of a torque sensor; they change a fit
    /// little.
    pub clear_effect: f64,
    /// Minimum unexplained torque relative to the torque of the joint (both root mean square), for a warning.
    pub min_effect: f64,
    /// Maximum share of a log that is excluded automatically; rests with the drives off are not included in this share.
    /// If the share is larger, it is not clear which part of the log is normal.
    pub max_share: f64,
    /// Minimum duration of a log that is searched, s.
    pub min_duration_s: f64,
    /// Minimum share of a joint's squared residual that a slow change must explain, for a warning.
    pub min_trend_share: f64,
    /// Minimum size of a slow change relative to the torque of the joint (both root mean square), for a warning.
    pub min_trend_effect: f64,
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
            min_trend_share: 0.5,
            min_trend_effect: 0.03,
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
#[error("events: {name} is {value}: use a number from {low} to {high}")]
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
        let rules = [
            ("clear_ratio", self.clear_ratio, 1.0, 1e6),
            ("warn_ratio", self.warn_ratio, 1.0, 1e6),
            ("clear_prominence", self.clear_prominence, 1.0, 1e6),
            ("warn_prominence", self.warn_prominence, 1.0, 1e6),
            ("clear_effect", self.clear_effect, 0.0, 10.0),
            ("min_effect", self.min_effect, 0.0, 10.0),
            ("max_share", self.max_share, 0.0, 0.5),
            ("min_duration_s", self.min_duration_s, 1.0, 1e6),
            ("min_trend_share", self.min_trend_share, 0.0, 1.0),
            ("min_trend_effect", self.min_trend_effect, 0.0, 10.0),
        ];
        for (name, value, low, high) in rules {
            if !(low..=high).contains(&value) {
                return Err(EventSettingsError { name, value, low, high });
            }
        }
        Ok(())
    }
}
