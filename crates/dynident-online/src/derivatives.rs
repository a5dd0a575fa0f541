//! Velocities and accelerations from a stream of positions.

use crate::error::{OnlineError, check, check_positive};

/// Local polynomials through the latest samples: position, velocity and acceleration in the middle of a window,
/// together with the torques measured there.
///
/// The window contains `2 m + 1` samples, so the result has a delay of `m` samples but no phase error. For positions
/// `q_i` at the times `i T`, i from −m to m, the least-squares cubic has at i = 0
///
/// ```text
///     q̂ = Σ (3 m² + 3 m − 1 − 5 i²) q_i · 3 / ((2m−1)(2m+1)(2m+3)),
///     q̇ = Σ c_i q_i / T  (the slope of the cubic),       q̈ = Σ d_i q_i / T²
/// ```
///
///  (Savitzky and Golay, Analytical Chemistry 36 (1964) 1627; here by discrete orthogonal polynomials up to degree 3).
#[derive(Clone, Debug)]
pub struct DelayedDerivatives {
    joints: usize,
    half: usize,
    /// Weights of position, velocity and acceleration over the window, oldest first.
    weights: [Vec<f64>; 3],
    /// Ring buffer of positions and torques: sample `s` starts at `(s % window) * 2 * joints`.
    ring: Vec<f64>,
    seen: usize,
    now: DelayedSample,
}

/// A sample in the middle of the window, with one entry per joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DelayedSample {
    /// Smoothed positions, rad (m).
    pub q: Vec<f64>,
    /// Velocities, rad/s (m/s).
    pub dq: Vec<f64>,
    /// Accelerations, rad/s² (m/s²).
    pub ddq: Vec<f64>,
    /// Measured torques at that time, Nm (N).
    pub tau: Vec<f64>,
}

impl DelayedDerivatives {
    /// Derivatives for a number of joints, sampled at `rate_hz`, over windows of `2 half + 1` samples; `half` is at
    /// least 2.
    ///
    /// # Errors
    /// [`OnlineError::Number`] for a rate that is not positive, or an invalid window.
    pub fn new(joints: usize, rate_hz: f64, half: usize) -> Result<Self, OnlineError> {
        check_positive("rate_hz", &[rate_hz])?;
        if !(2..=10_000).contains(&half) {
            let fix = "give 2 to 10000 samples on each side";
            return Err(OnlineError::Number { what: "half", value: half as f64, fix });
        }
        let zeros = || vec![0.0; joints];
        Ok(Self {
            joints,
            half,
            weights: weights(half, rate_hz),
            ring: vec![0.0; (2 * half + 1) * 2 * joints],
            seen: 0,
            now: DelayedSample { q: zeros(), dq: zeros(), ddq: zeros(), tau: zeros() },
        })
    }

    /// Delay of the result, in samples.
    pub fn delay_samples(&self) -> usize {
        self.half
    }

    /// Adds the latest positions and torques; returns the sample in the middle of the window once it is full.
    ///
    /// # Errors
    /// A vector of a different length, or a value that is not finite; the state is then unchanged.
    pub fn add(&mut self, q: &[f64], tau: &[f64]) -> Result<Option<&DelayedSample>, OnlineError> {
        check("q", q, self.joints)?;
        check("tau", tau, self.joints)?;
        let (joints, window) = (self.joints, 2 * self.half + 1);
        let at = self.seen % window * 2 * joints;
        self.ring[at..at + joints].copy_from_slice(q);
        self.ring[at + joints..at + 2 * joints].copy_from_slice(tau);
        self.seen += 1;
        if self.seen < window {
            return Ok(None);
        }
        let DelayedSample { q, dq, ddq, tau } = &mut self.now;
        for (out, weights) in [q, dq, ddq].into_iter().zip(&self.weights) {
            out.fill(0.0);
            for (back, weight) in weights.iter().enumerate() {
                let at = (self.seen + back) % window * 2 * joints;
                for (out, value) in out.iter_mut().zip(&self.ring[at..at + joints]) {
                    *out += weight * value;
                }
            }
        }
        let middle = (self.seen + self.half) % window * 2 * joints;
        tau.copy_from_slice(&self.ring[middle + joints..middle + 2 * joints]);
        Ok(Some(&self.now))
    }

    /// Removes all samples: the next sample starts a new recording.
    pub fn restart(&mut self) {
        self.seen = 0;
    }
}

/// Weights over the window, oldest sample first: value, slope and curvature of the least-squares cubic.
fn weights(half: usize, rate_hz: f64) -> [Vec<f64>; 3] {
    let places: Vec<f64> = (0..=2 * half).map(|i| i as f64 - half as f64).collect();
    let sum = |power: i32| places.iter().map(|i| i.powi(power)).sum::<f64>();
    let (s0, s2, s4, s6) = (sum(0), sum(2), sum(4), sum(6));
    // The normal equations of 1, i, i², i³ decouple into even and odd ones.
    let even = s0 * s4 - s2 * s2;
    let odd = s2 * s6 - s4 * s4;
    [
        places.iter().map(|i| (s4 - s2 * i * i) / even).collect(),
        places.iter().map(|i| rate_hz * (s6 * i - s4 * i.powi(3)) / odd).collect(),
        places.iter().map(|i| 2.0 * rate_hz * rate_hz * (s0 * i * i - s2) / even).collect(),
    ]
}
