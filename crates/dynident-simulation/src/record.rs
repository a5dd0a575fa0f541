//! Record of a run as in a log.

use crate::error::{SimulationError, require};
use crate::run::Run;
use crate::sensors::SensorSettings;
use dynident_model::Model;
use dynident_model::sample::Random;

/// Separate the random numbers of positions, torques and sampling instants.
const RANDOM_STREAMS: [u64; 3] = [0x5eed_0002, 0x5eed_0003, 0x5eed_0004];

/// Recorded samples of a run, joint-major: joint `j`, sample `s` at `j * samples + s`.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Sampling rate by the record's clock, Hz.
    pub rate_hz: f64,
    /// Number of samples of each joint.
    pub samples: usize,
    /// Times by the record's clock, s.
    pub times_s: Vec<f64>,
    /// Positions, rad (m).
    pub q: Vec<f64>,
    /// Torques of the drives, Nm (N).
    pub tau: Vec<f64>,
}

impl Record {
    /// Index range of one joint in either array.
    pub fn of(&self, joint: usize) -> core::ops::Range<usize> {
        joint * self.samples..(joint + 1) * self.samples
    }

    /// The record as a CSV table `t_s, q1.., tau1..` with full precision, for log readers.
    pub fn csv(&self) -> String {
        use core::fmt::Write;
        let mut text = String::from("t_s");
        for prefix in ["q", "tau"] {
            for joint in 1..=self.joints.len() {
                let _ = write!(text, ",{prefix}{joint}");
            }
        }
        text.push('\n');
        for sample in 0..self.samples {
            let _ = write!(text, "{}", self.times_s[sample]);
            for values in [&self.q, &self.tau] {
                for joint in 0..self.joints.len() {
                    let _ = write!(text, ",{}", values[joint * self.samples + sample]);
                }
            }
            text.push('\n');
        }
        text
    }
}

impl SensorSettings {
    /// Records a run of a robot with these sensors.
    ///
    /// Positions between the controller's samples are cubic Hermite polynomials of position and velocity (error below
    /// `h⁴/384` times the fourth derivative); torques are constant between samples. If the record has the same
    /// sampling instants as the controller (same rate, no jitter, drift or delay), its positions are those that the
    /// controller measured, with the same noise.
    ///
    /// # Errors
    /// Errors of [`validate`](Self::validate); noise or steps so large that the record would not be finite.
    pub fn record(&self, model: &Model, run: &Run) -> Result<Record, SimulationError> {
        let joints = run.joints.len();
        self.validate(joints)?;
        let rate_hz = self.record_rate_hz.unwrap_or(run.rate_hz);
        let stretch = 1.0 + 1e-6 * self.clock_drift_ppm;
        let end_s = run.samples.saturating_sub(1) as f64 / run.rate_hz;
        let samples = if run.samples == 0 { 0 } else { (end_s * rate_hz / stretch + 1e-9).floor() as usize + 1 };
        let [mut position, mut torque, mut instant] = RANDOM_STREAMS.map(|stream| Random::new(self.seed ^ stream));
        let times_s: Vec<f64> = (0..samples).map(|sample| sample as f64 / rate_hz).collect();
        let true_times: Vec<f64> = times_s
            .iter()
            .map(|time| {
                let jitter = if self.jitter_std_s > 0.0 { self.jitter_std_s * instant.normal() } else { 0.0 };
                (time * stretch + jitter).clamp(0.0, end_s)
            })
            .collect();
        let same_instants = rate_hz == run.rate_hz && stretch == 1.0 && self.jitter_std_s == 0.0;
        let (mut q, mut tau) = (Vec::with_capacity(joints * samples), Vec::with_capacity(joints * samples));
        for joint in 0..joints {
            let own = run.of(joint);
            let is_rotary = model.joints()[joint].is_rotary();
            let (delay_q, delay_tau) = (self.position_delay_s.of(joint), self.torque_delay_s.of(joint));
            if same_instants && delay_q == 0.0 && self.feedback_delay_samples == 0 {
                q.extend_from_slice(&run.measured_q[own.clone()]);
            } else {
                q.extend(true_times.iter().map(|time| {
                    let at = interpolate(&run.q[own.clone()], &run.dq[own.clone()], run.rate_hz, time - delay_q);
                    self.position(joint, at, is_rotary, &mut position)
                }));
            }
            let (std, correlation) = (self.torque_std.of(joint), self.torque_correlation);
            let fresh = std * (1.0 - correlation * correlation).sqrt();
            let mut error = if std > 0.0 { std * torque.normal() } else { 0.0 };
            let torques = &run.tau[own];
            for time in &true_times {
                // The tolerance prevents that rounding selects the previous sample.
                let at = ((time - delay_tau).max(0.0) * run.rate_hz + 1e-6).floor() as usize;
                let value = torques[at.min(run.samples - 1)] + error;
                tau.push(match &self.torque_step {
                    Some(step) => (value / step.of(joint)).round() * step.of(joint),
                    None => value,
                });
                if std > 0.0 {
                    error = correlation * error + fresh * torque.normal();
                }
            }
        }
        // Noise and quantisation can exceed the range of finite numbers, although the values of a run are finite.
        if let Some(&value) = q.iter().chain(&tau).find(|value| !value.is_finite()) {
            let fix = "give position_std, torque_std, encoder_steps and torque_step sizes that a sensor can have";
            require(false, "a recorded position or torque", value, fix)?;
        }
        Ok(Record { joints: run.joints.clone(), rate_hz, samples, times_s, q, tau })
    }
}

fn interpolate(q: &[f64], dq: &[f64], rate_hz: f64, time_s: f64) -> f64 {
    let place = (time_s * rate_hz).max(0.0);
    let from = (place.floor() as usize).min(q.len().saturating_sub(2));
    let Some(&next) = q.get(from + 1) else { return q[0] };
    let s = (place - from as f64).min(1.0);
    if time_s <= 0.0 {
        return q[0];
    }
    let (slope, slope_next) = (dq[from] / rate_hz, dq[from + 1] / rate_hz);
    let rise = next - q[from];
    q[from] + s * (slope + s * (3.0 * rise - 2.0 * slope - slope_next + s * (slope + slope_next - 2.0 * rise)))
}
