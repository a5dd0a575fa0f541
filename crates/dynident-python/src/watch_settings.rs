//! Settings of ``Model.online``.

use dynident::online::WatchSettings;
use serde::{Deserialize, Serialize};

/// The settings of ``Model.online``; missing ones have their defaults.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct OnlineSettings {
    pub(crate) rate_hz: f64,
    pub(crate) forgetting_s: Option<f64>,
    pub(crate) correlation_s: Option<f64>,
    pub(crate) collision_s: Option<f64>,
    pub(crate) payload_s: Option<f64>,
    pub(crate) contact_alarms_per_hour: Option<f64>,
    pub(crate) drift_alarms_per_hour: Option<f64>,
    pub(crate) half_window: Option<usize>,
}

impl OnlineSettings {
    /// The arguments of ``online`` in their order.
    #[allow(clippy::type_complexity, reason = "the signature of Python")]
    pub(crate) fn arguments(
        &self,
    ) -> (f64, Option<f64>, Option<f64>, Option<f64>, Option<f64>, Option<f64>, Option<f64>, Option<usize>) {
        (
            self.rate_hz,
            self.forgetting_s,
            self.correlation_s,
            self.collision_s,
            self.payload_s,
            self.contact_alarms_per_hour,
            self.drift_alarms_per_hour,
            self.half_window,
        )
    }

    pub(crate) fn of_watch(&self) -> WatchSettings {
        let mut settings = WatchSettings::new(self.rate_hz);
        settings.half_life_s = self.forgetting_s;
        let set = |value: &mut f64, given: Option<f64>| *value = given.unwrap_or(*value);
        set(&mut settings.correlation_s, self.correlation_s);
        set(&mut settings.contact.collision_s, self.collision_s);
        set(&mut settings.contact.payload_s, self.payload_s);
        set(&mut settings.contact.false_alarms_per_hour, self.contact_alarms_per_hour);
        set(&mut settings.drift_alarms_per_hour, self.drift_alarms_per_hour);
        settings.half_window = self.half_window.unwrap_or(settings.half_window);
        settings
    }
}
