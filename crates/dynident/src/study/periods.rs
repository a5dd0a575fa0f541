//! `[estimator.periods]`: the repeated motion of `method = "maximum-likelihood"`.

use serde::{Deserialize, Serialize};

/// `[estimator.periods]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PeriodSection {
    /// After how many seconds the motion repeats; by default the length of the log's `reference`.
    pub period_s: Option<f64>,
    /// Seconds at the start of every log that are left out, until the motion repeats; 0 by default.
    pub skip_s: f64,
}

impl PeriodSection {
    pub(crate) fn validate(&self) -> Result<(), String> {
        if let Some(period) = self.period_s
            && !(period > 0.0 && period.is_finite())
        {
            return Err(format!("period_s = {period}: give the seconds after which the motion repeats"));
        }
        if !(self.skip_s >= 0.0 && self.skip_s.is_finite()) {
            return Err(format!("skip_s = {}: give 0 or more seconds", self.skip_s));
        }
        Ok(())
    }
}
