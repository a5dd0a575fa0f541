//! Slower execution of a reference.

use crate::error::{SimulationError, require};
use crate::reference::Reference;
use dynident_excitation::Motion;

impl Reference {
    /// Executes the motion at a share s of its speed, at the same sampling rate: `q(s t)`, `s q̇(s t)`, `s² q̈(s t)`.
    /// Between samples, positions and velocities are cubic Hermite polynomials, and accelerations are linear.
    ///
    /// # Errors
    /// A share outside (0, 1].
    pub fn slowed(&self, speed: f64) -> Result<Reference, SimulationError> {
        require(speed > 0.0 && speed <= 1.0, "speed_steps", speed, "give more than 0, at most 1")?;
        let own = self.motion();
        let last = own.samples - 1;
        let samples = (last as f64 / speed).ceil() as usize + 1;
        let step_s = 1.0 / self.rate_hz();
        let mut motion = Motion::default();
        motion.reset(own.joints, samples);
        motion.dddq.clear();
        for joint in 0..own.joints {
            let (q, dq, ddq) = (&own.q[own.of(joint)], &own.dq[own.of(joint)], &own.ddq[own.of(joint)]);
            for sample in 0..samples {
                let place = (speed * sample as f64).min(last as f64);
                let from = (place.floor() as usize).min(last.saturating_sub(1));
                let to = (from + 1).min(last);
                let x = place - from as f64;
                let (a, b) = (step_s * dq[from], step_s * dq[to]);
                let rise = q[to] - q[from];
                // q = q0 + x (a + x (c + x d))
                let (c, d) = (3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise);
                let at = joint * samples + sample;
                motion.q[at] = q[from] + x * (a + x * (c + x * d));
                motion.dq[at] = speed * (a + x * (2.0 * c + 3.0 * x * d)) / step_s;
                motion.ddq[at] = speed * speed * (ddq[from] + x * (ddq[to] - ddq[from]));
            }
        }
        Reference::new(self.rate_hz(), motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_motion_is_the_same_path() {
        let (rate_hz, samples) = (200.0, 401);
        let mut motion = Motion::default();
        motion.reset(1, samples);
        for k in 0..samples {
            let (sine, cosine) = (3.0 * k as f64 / rate_hz).sin_cos();
            (motion.q[k], motion.dq[k], motion.ddq[k]) = (sine, 3.0 * cosine, -9.0 * sine);
        }
        let slow = Reference::new(rate_hz, motion).unwrap().slowed(0.3).unwrap();
        assert!((slow.duration_s() - 2.0 / 0.3).abs() < 1.5 / rate_hz);
        for k in 0..slow.samples() - 2 {
            let (sine, cosine) = (0.9 * k as f64 / rate_hz).sin_cos();
            // Cubic pieces of 5 ms: error 3^4 h^4 / 384 of the position, half of 3^4 h^2 / 8 of a linear acceleration.
            assert!((slow.motion().q[k] - sine).abs() < 2e-10);
            assert!((slow.motion().dq[k] - 0.9 * cosine).abs() < 1e-7);
            assert!((slow.motion().ddq[k] + 0.81 * sine).abs() < 1e-4);
        }
        assert!(slow.slowed(0.0).is_err() && slow.slowed(1.5).is_err());
    }
}
