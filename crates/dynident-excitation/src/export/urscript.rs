//! URScript: a program of `servoj` calls.

use super::{ExportError, Sampled};
use core::fmt::Write;

/// Settings of the URScript program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UrScriptSettings {
    /// Rate of the calls, Hz: 125 for CB-series robots, 500 for e-Series robots. Default 125. The motion must be
    /// sampled at this rate.
    pub rate_hz: f64,
    /// `lookahead_time` of servoj, s, 0.03 to 0.2. Default 0.03, the weakest smoothing.
    pub lookahead_time_s: f64,
    /// `gain` of servoj, 100 to 2000. Default 300.
    pub gain: f64,
    /// Velocity of the slow move to the first point, rad/s. Default 0.3.
    pub approach_speed: f64,
}

impl Default for UrScriptSettings {
    fn default() -> Self {
        Self { rate_hz: 125.0, lookahead_time_s: 0.03, gain: 300.0, approach_speed: 0.3 }
    }
}

impl UrScriptSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn validate(&self) -> Result<(), ExportError> {
        for (setting, value, [least, most], needed) in [
            ("rate_hz", self.rate_hz, [1.0, 500.0], "1 to 500 (125 for CB-series, 500 for e-series)"),
            ("lookahead_time_s", self.lookahead_time_s, [0.03, 0.2], "0.03 to 0.2"),
            ("gain", self.gain, [100.0, 2000.0], "100 to 2000"),
            ("approach_speed", self.approach_speed, [1e-3, 3.0], "0.001 to 3"),
        ] {
            if !(least..=most).contains(&value) {
                return Err(ExportError::Setting { setting, value, needed });
            }
        }
        Ok(())
    }
}

/// Writes a URScript program: a slow `movej` to the first point, one `servoj` per sample, then a stop. The program
/// contains only positions; the controller computes velocities and accelerations.
///
/// # Source
/// Universal Robots, The URScript Programming Language, `movej` and `servoj`.
///
/// # Errors
/// Settings out of range; a number of joints other than six; errors of the other formats.
pub fn urscript(sampled: &Sampled<'_>, settings: &UrScriptSettings) -> Result<String, ExportError> {
    sampled.check()?;
    settings.validate()?;
    if sampled.joints.len() != 6 {
        return Err(ExportError::SixJoints { joints: sampled.joints.len() });
    }
    let point = |sample: usize| -> String {
        // Eight decimals: a resolution of 1e-8 rad, far below that of an encoder.
        let row: Vec<String> = (0..6).map(|joint| format!("{:.8}", sampled.at(joint, sample)[0])).collect();
        row.join(", ")
    };
    let UrScriptSettings { rate_hz, lookahead_time_s, gain, approach_speed } = settings;
    let mut text = String::from("def excitation():\n");
    if !sampled.times_s.is_empty() {
        let _ = writeln!(text, "  movej([{}], a=0.5, v={approach_speed})\n  sleep(1.0)", point(0));
    }
    for sample in 0..sampled.times_s.len() {
        let period = 1.0 / rate_hz;
        let _ =
            writeln!(text, "  servoj([{}], t={period}, lookahead_time={lookahead_time_s}, gain={gain})", point(sample));
    }
    text.push_str("  stopj(2.0)\nend\n");
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::tests::sampled;

    #[test]
    fn one_call_a_sample_for_six_joints_only() {
        let (joints, times, motion) = sampled(6, 251);
        let settings = UrScriptSettings::default();
        let text = urscript(&Sampled { joints: &joints, times_s: &times, motion: &motion }, &settings).unwrap();
        assert_eq!(text.matches("  servoj([").count(), 251);
        assert!(text.starts_with("def excitation():\n  movej([") && text.ends_with("  stopj(2.0)\nend\n"));
        let call = format!("servoj([{:.8}, ", motion.q[17]);
        assert!(text.contains(&call) && text.contains("t=0.008, lookahead_time=0.03, gain=300)"), "{call}");
        let (joints, times, motion) = sampled(7, 5);
        let error = urscript(&Sampled { joints: &joints, times_s: &times, motion: &motion }, &settings).unwrap_err();
        assert_eq!(error, ExportError::SixJoints { joints: 7 });
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let settings = UrScriptSettings { gain: f64::NAN, ..UrScriptSettings::default() };
        assert!(settings.validate().unwrap_err().to_string().starts_with("gain = NaN: give 100 to 2000"));
    }
}
