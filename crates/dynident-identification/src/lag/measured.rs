//! Lag of the torque behind the motion (time by which the torque is late), with its error bar.

use dynident_recording::{Finding, Level};
use serde::{Deserialize, Serialize};

/// Lags and error bars below a picosecond are rounding errors.
const MIN_STD_S: f64 = 1.0e-12;

/// Time by which the torque of one joint is later than its motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TorqueLag {
    /// Lag, s; negative if the torque is early.
    pub lag_s: f64,
    /// Standard deviation of the lag, s.
    pub std_s: f64,
    /// Half-width of the 95 % interval of the lag, s. For a common lag of all joints, it includes the complete spread
    /// between the joints.
    pub half_width_95_s: f64,
    /// Whether the uncompensated part of the lag is significant: zero is outside its interval, and it changes the
    /// torque by more than the residual.
    pub matters: bool,
    /// Part of the lag that was compensated before the fit, s.
    #[serde(default)]
    pub taken_off_s: f64,
}

impl TorqueLag {
    /// Adds a lag that was compensated before this remaining lag was measured.
    pub(crate) fn after(self, taken_off_s: f64) -> Self {
        Self { lag_s: taken_off_s + self.lag_s, taken_off_s, ..self }
    }
}

/// Common lag of several logs: the mean with inverse variances as weights. If logs differ by more than their error
/// bars, the error bar grows accordingly (Birge, Phys. Rev. 40 (1932) 207).
pub fn pooled_delay(lags: &[TorqueLag]) -> Option<TorqueLag> {
    let weight = |lag: &TorqueLag| lag.std_s.max(MIN_STD_S).powi(-2);
    let total: f64 = lags.iter().map(weight).sum();
    let first = lags.first()?;
    let mean = lags.iter().map(|lag| weight(lag) * lag.lag_s).sum::<f64>() / total;
    let scatter: f64 = lags.iter().map(|lag| weight(lag) * (lag.lag_s - mean).powi(2)).sum();
    let inflation = if lags.len() > 1 { (scatter / (lags.len() - 1) as f64).sqrt().max(1.0) } else { 1.0 };
    let half: f64 = lags.iter().map(|lag| (weight(lag) * lag.half_width_95_s).powi(2)).sum();
    let half_width_95_s = if lags.len() > 1 { inflation * half.sqrt() / total } else { first.half_width_95_s };
    let std_s = if lags.len() > 1 { inflation / total.sqrt() } else { first.std_s };
    let taken_off_s = first.taken_off_s;
    let matters = lags.iter().any(|lag| lag.matters) && (mean - taken_off_s).abs() > half_width_95_s;
    Some(TorqueLag { lag_s: mean, std_s, half_width_95_s, matters, taken_off_s })
}

/// Findings about significant lags.
pub fn delay_findings(lags: &[Option<TorqueLag>], joints: &[String]) -> Vec<Finding> {
    let of_joint = |(joint, lag): (&String, &Option<TorqueLag>)| {
        lag.filter(|lag| lag.matters || lag.taken_off_s != 0.0).map(|lag| {
            let side = if lag.lag_s > 0.0 { "after" } else { "before" };
            let taken_off = match lag.taken_off_s {
                0.0 => String::new(),
                taken_off_s => format!("; {:.1} ms were compensated", 1e3 * taken_off_s.abs()),
            };
            let message = format!(
                "comes {:.1} +- {:.1} ms {side} the motion (95 %), estimated together with the model{taken_off}",
                1e3 * lag.lag_s.abs(),
                1e3 * lag.half_width_95_s
            );
            Finding {
                code: "fit-torque-lag".to_owned(),
                level: Level::Info,
                channel: format!("torque {joint}"),
                message,
            }
        })
    };
    joints.iter().zip(lags).filter_map(of_joint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreeing_logs_narrow_the_lag_interval_and_scattered_logs_widen_it() {
        let lag = |lag_s| TorqueLag { lag_s, std_s: 1e-3, half_width_95_s: 2e-3, matters: true, taken_off_s: 0.0 };
        assert_eq!(pooled_delay(&[]), None);
        assert_eq!(pooled_delay(&[lag(5e-3)]), Some(lag(5e-3)));
        let agreeing = pooled_delay(&[lag(5e-3), lag(5e-3)]).unwrap_or(lag(0.0));
        // Two equal measurements: the standard deviation of their mean is that of a single measurement divided by √2.
        assert!((agreeing.std_s - 1e-3 / 2_f64.sqrt()).abs() < 1e-12 && (agreeing.lag_s - 5e-3).abs() < 1e-12);
        let apart = pooled_delay(&[lag(0.0), lag(10e-3)]).unwrap_or(lag(0.0));
        // The standard deviation of the mean is half the difference of the two measurements.
        assert!((apart.std_s - 5e-3).abs() < 1e-12 && !apart.matters);
    }
}
