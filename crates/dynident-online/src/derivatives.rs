//! Velocities and accelerations from a stream of positions.

use crate::error::{OnlineError, check, check_positive};
use nalgebra::{Matrix4, Vector4};
use serde::{Deserialize, Serialize};

/// Local polynomials through the latest samples: position, velocity and acceleration in the middle of a window,
/// together with the torques that were measured at that time.
///
/// The window contains `2 m + 1` samples, so the result is delayed by `m` samples but has no phase error. For positions
/// `q_i` at the times `i T` with sampling period T and i from −m to m, the least-squares cubic polynomial has at i = 0
///
/// ```text
///     q̂ = Σ (3 m² + 3 m − 1 − 5 i²) q_i · 3 / ((2m−1)(2m+1)(2m+3)),
///     q̇ = Σ c_i q_i / T  (the slope of the cubic),       q̈ = Σ d_i q_i / T²
/// ```
///
///  (Savitzky and Golay, Analytical Chemistry 36 (1964) 1627; here by discrete orthogonal polynomials up to degree 3).
///
/// With time stamps ([`add_at`](Self::add_at)), the cubic is fitted at the times of the stamps, so that lost samples
/// cause no error. A window that is longer than [`MAX_WINDOW_RATIO`](Self::MAX_WINDOW_RATIO) of its usual length gives
/// no result.
#[derive(Clone, Debug)]
pub struct DelayedDerivatives {
    joints: usize,
    half: usize,
    rate_hz: f64,
    /// Weights of the samples in the window for position, velocity and acceleration, oldest sample first.
    weights: [Vec<f64>; 3],
    /// Ring buffer of positions and torques: sample `s` starts at `(s % window) * 2 * joints`.
    ring: Vec<f64>,
    /// Time of each sample in the ring buffer, in sampling periods.
    times: Vec<f64>,
    seen: usize,
    now: DelayedSample,
    /// Weights for samples that are not evenly spaced.
    uneven: [Vec<f64>; 3],
}

/// State of [`DelayedDerivatives`], for storage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DerivativesState {
    ring: Vec<f64>,
    times: Vec<f64>,
    seen: usize,
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
    /// Torques measured at that time, Nm (N).
    pub tau: Vec<f64>,
}

impl DelayedDerivatives {
    /// Longest duration of a window that gives a result, divided by the duration without lost samples. The error of the
    /// cubic grows with the fourth power of the duration.
    pub const MAX_WINDOW_RATIO: f64 = 1.5;
    /// Largest deviation of the time between two samples from a whole number of periods that is treated as jitter of
    /// the stamps, in periods.
    const JITTER_PERIODS: f64 = 0.25;

    /// Computes derivatives for a number of joints, sampled at `rate_hz`, over windows of `2 half + 1` samples; `half`
    /// is at least 2.
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
            rate_hz,
            weights: weights(half, rate_hz),
            ring: vec![0.0; (2 * half + 1) * 2 * joints],
            times: vec![0.0; 2 * half + 1],
            uneven: core::array::from_fn(|_| vec![0.0; 2 * half + 1]),
            seen: 0,
            now: DelayedSample { q: zeros(), dq: zeros(), ddq: zeros(), tau: zeros() },
        })
    }

    /// Delay of the result, in samples.
    pub fn delay_samples(&self) -> usize {
        self.half
    }

    /// Adds the latest positions and torques; returns the sample in the middle of the window once it is full. The time
    /// since the previous sample is assumed to be one period.
    ///
    /// # Errors
    /// A vector of a different length, or a value that is not finite; the state is then unchanged.
    pub fn add(&mut self, q: &[f64], tau: &[f64]) -> Result<Option<&DelayedSample>, OnlineError> {
        self.add_after(1.0, q, tau)
    }

    /// As [`add`](Self::add), for a sample that was measured `step_s` seconds after the previous one. The time is
    /// rounded to a whole number of periods if it is close to one. Returns `None` while the window contains a longer
    /// pause.
    ///
    /// # Errors
    /// As [`add`](Self::add), and a step that is not positive.
    pub fn add_at(&mut self, step_s: f64, q: &[f64], tau: &[f64]) -> Result<Option<&DelayedSample>, OnlineError> {
        check_positive("step of the time stamps", &[step_s])?;
        let periods = step_s * self.rate_hz;
        let whole = periods.round().max(1.0);
        self.add_after(if (periods - whole).abs() <= Self::JITTER_PERIODS { whole } else { periods }, q, tau)
    }

    fn add_after(&mut self, periods: f64, q: &[f64], tau: &[f64]) -> Result<Option<&DelayedSample>, OnlineError> {
        check("q", q, self.joints)?;
        check("tau", tau, self.joints)?;
        let (joints, window) = (self.joints, 2 * self.half + 1);
        let at = self.seen % window * 2 * joints;
        self.ring[at..at + joints].copy_from_slice(q);
        self.ring[at + joints..at + 2 * joints].copy_from_slice(tau);
        let before = if self.seen == 0 { 0.0 } else { self.times[(self.seen - 1) % window] };
        self.times[self.seen % window] = if self.seen == 0 { 0.0 } else { before + periods };
        self.seen += 1;
        if self.seen < window {
            return Ok(None);
        }
        let time = |back: usize| self.times[(self.seen + back) % window];
        let (length, usual) = (time(window - 1) - time(0), (window - 1) as f64);
        if length > Self::MAX_WINDOW_RATIO * usual {
            return Ok(None);
        }
        // A window of uneven steps can have the same total length.
        let is_even = (1..window).all(|back| time(back) - time(back - 1) == 1.0);
        if !is_even {
            let middle = time(self.half);
            for (back, place) in self.uneven[0].iter_mut().enumerate() {
                *place = (self.times[(self.seen + back) % window] - middle) / self.half as f64;
            }
            // Samples that do not determine a cubic, such as several at almost one time, give no result.
            if !uneven_weights(&mut self.uneven, self.half, self.rate_hz) {
                return Ok(None);
            }
        }
        let weights = if is_even { &self.weights } else { &self.uneven };
        let DelayedSample { q, dq, ddq, tau } = &mut self.now;
        for (out, weights) in [q, dq, ddq].into_iter().zip(weights) {
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

    /// The state, for storage.
    pub fn state(&self) -> DerivativesState {
        DerivativesState { ring: self.ring.clone(), times: self.times.clone(), seen: self.seen }
    }

    /// Continues from a stored state of the same joints and window.
    ///
    /// # Errors
    /// A state of other joints or of another window.
    pub fn restore(&mut self, state: DerivativesState) -> Result<(), OnlineError> {
        check("stored samples", &state.ring, self.ring.len())?;
        check("stored times", &state.times, self.times.len())?;
        let DerivativesState { ring, times, seen } = state;
        (self.ring, self.times, self.seen) = (ring, times, seen);
        Ok(())
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

/// Computes weights of the least-squares cubic for value, slope and curvature at time zero, and stores them in
/// `weights`. On entry, `weights[0]` contains the times of the samples, divided by `half`. Returns false if the times
/// do not determine a cubic.
fn uneven_weights(weights: &mut [Vec<f64>; 3], half: usize, rate_hz: f64) -> bool {
    let mut sums = [0.0; 7];
    for place in &weights[0] {
        let mut power = 1.0;
        for sum in &mut sums {
            *sum += power;
            power *= place;
        }
    }
    let normal = Matrix4::from_fn(|row, column| sums[row + column]);
    let Some(inverse) = normal.cholesky().map(|lower| lower.inverse()) else { return false };
    if inverse.diagonal().iter().any(|entry| !(0.0..1e6).contains(entry)) {
        return false;
    }
    let [values, slopes, curvatures] = weights;
    let per_s = rate_hz / half as f64;
    for ((value, slope), curvature) in values.iter_mut().zip(slopes).zip(curvatures) {
        let place = *value;
        let powers = Vector4::new(1.0, place, place * place, place * place * place);
        *value = inverse.row(0).transpose().dot(&powers);
        *slope = per_s * inverse.row(1).transpose().dot(&powers);
        *curvature = 2.0 * per_s * per_s * inverse.row(2).transpose().dot(&powers);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Position, velocity and acceleration of each joint, which moves on a cubic polynomial.
    fn cubic(t: f64) -> ([f64; 2], [f64; 2], [f64; 2]) {
        let of = |c: [f64; 4]| {
            let q = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
            (q, c[1] + t * (2.0 * c[2] + t * 3.0 * c[3]), 2.0 * c[2] + 6.0 * c[3] * t)
        };
        let (a, b) = (of([0.3, -1.0, 2.0, 0.5]), of([-1.0, 0.2, -0.4, 3.0]));
        ([a.0, b.0], [a.1, b.1], [a.2, b.2])
    }

    #[test]
    fn lost_samples_do_not_change_the_derivatives_of_a_cubic() {
        let (rate_hz, half) = (125.0, 10);
        let mut window = DelayedDerivatives::new(2, rate_hz, half).unwrap();
        let mut stamps: Vec<f64> = (0..200).map(|k| f64::from(k) / rate_hz).collect();
        // One lost sample, three lost samples, a late one and its early successor, and a pause of 0.4 s.
        stamps.remove(40);
        stamps.drain(80..83);
        stamps[120] += 0.5 / rate_hz;
        stamps.iter_mut().skip(150).for_each(|stamp| *stamp += 0.4);
        let (mut last, mut results, mut silent) = (-1.0 / rate_hz, 0, 0);
        for (place, &stamp) in stamps.iter().enumerate() {
            let (q, _, _) = cubic(stamp);
            let found = window.add_at(stamp - last, &q, &[0.0, place as f64]).unwrap();
            last = stamp;
            let Some(found) = found else {
                silent += usize::from(place >= 2 * half);
                continue;
            };
            results += 1;
            let middle = stamps[place - half];
            assert_eq!(found.tau[1], (place - half) as f64);
            let (q, dq, ddq) = cubic(middle);
            for joint in 0..2 {
                // Tolerance for the rounding of the weights, which are divided by the square of the period.
                assert!((found.q[joint] - q[joint]).abs() < 1e-11, "{place}");
                assert!((found.dq[joint] - dq[joint]).abs() < 1e-9, "{place}");
                assert!((found.ddq[joint] - ddq[joint]).abs() < 1e-7, "{place}: {:?} {ddq:?}", found.ddq);
            }
        }
        // The pause is in the window of 20 samples.
        assert_eq!((results, silent), (stamps.len() - 20 - 20, 20));
    }

    #[test]
    fn jitter_of_the_stamps_is_ignored() {
        let (mut even, mut jittered) =
            (DelayedDerivatives::new(1, 500.0, 5).unwrap(), DelayedDerivatives::new(1, 500.0, 5).unwrap());
        for sample in 0..40 {
            let q = [(0.05 * f64::from(sample)).sin()];
            let step_s = (1.0 + 0.2 * f64::from(sample % 3 - 1)) / 500.0;
            let expected = even.add(&q, &[1.0]).unwrap().cloned();
            assert_eq!(jittered.add_at(step_s, &q, &[1.0]).unwrap().cloned(), expected);
        }
        for step_s in [0.0, -0.1, f64::NAN] {
            assert!(even.add_at(step_s, &[0.0], &[0.0]).is_err());
        }
    }
}
