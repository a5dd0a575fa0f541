//! A known motion: samples of a file or a log.

use super::error::{FamilyError, require};
use super::polynomials::quintic_hermite;
use crate::family::Family;
use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;

const NAME: &str = "given";

/// A motion defined by samples, as a family without free parameters. Between two samples it is the quintic polynomial
/// with q, q̇ and q̈ of both samples. So q, q̇ and q̈ are exact at the samples and continuous everywhere; the jerk is
/// that of the polynomial.
///
/// ```
/// use dynident_excitation::{Family, Motion, families::SampledMotion};
/// // A parabola from three samples: q = t².
/// let samples = Motion {
///     samples: 3, joints: 1, q: vec![0.0, 0.25, 4.0], dq: vec![0.0, 1.0, 4.0], ddq: vec![2.0; 3], dddq: Vec::new(),
/// };
/// let given = SampledMotion::new(vec![0.0, 0.5, 2.0], samples)?;
/// let mut motion = Motion::default();
/// given.motion(&[], &[1.0], &mut motion);
/// assert!((motion.q[0] - 1.0).abs() < 1e-14 && (motion.dq[0] - 2.0).abs() < 1e-14);
/// # Ok::<(), dynident_excitation::families::FamilyError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SampledMotion {
    times_s: Vec<f64>,
    samples: Motion,
}

impl SampledMotion {
    /// Creates the motion with q, q̇ and q̈ of `samples` at `times_s`, which are shifted to start at 0; the jerk is not
    /// used.
    ///
    /// # Errors
    /// Fewer than two samples, times that do not increase, arrays of other lengths than joints × samples, a value that
    /// is not finite.
    pub fn new(mut times_s: Vec<f64>, samples: Motion) -> Result<Self, FamilyError> {
        let length = |what, expected, found| {
            if expected == found { Ok(()) } else { Err(FamilyError::Length { family: NAME, what, expected, found }) }
        };
        require(times_s.len() >= 2, NAME, "samples", times_s.len() as f64, "give two or more")?;
        require(samples.joints >= 1, NAME, "joints", samples.joints as f64, "give one or more")?;
        length("samples", times_s.len(), samples.samples)?;
        let arrays = [("positions", &samples.q), ("speeds", &samples.dq), ("accelerations", &samples.ddq)];
        for (what, values) in arrays {
            length(what, samples.joints * samples.samples, values.len())?;
            for &value in values {
                require(value.is_finite(), NAME, what, value, "give finite numbers")?;
            }
        }
        for pair in times_s.windows(2) {
            // The comparison is false for NaN as well.
            require(pair[1] > pair[0], NAME, "time", pair[1], "give times that increase")?;
        }
        let first = times_s[0];
        for time in &mut times_s {
            *time -= first;
        }
        let last = times_s[times_s.len() - 1];
        require(last.is_finite(), NAME, "time", last, "give finite times")?;
        Ok(Self { times_s, samples })
    }

    /// Times of the samples, s, from 0.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// The samples.
    pub fn samples(&self) -> &Motion {
        &self.samples
    }
}

impl Family for SampledMotion {
    fn name(&self) -> &'static str {
        NAME
    }

    fn joints(&self) -> usize {
        self.samples.joints
    }

    fn duration_s(&self) -> f64 {
        self.times_s[self.times_s.len() - 1]
    }

    fn parameters(&self) -> usize {
        0
    }

    fn random(&self, _ranges: &[[f64; 2]], _speeds: &[f64], _random: &mut Random) -> Vec<f64> {
        Vec::new()
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert!(parameters.is_empty(), "parameters of {NAME}");
        let Motion { joints, samples, q, dq, ddq, .. } = &self.samples;
        out.reset(*joints, times_s.len());
        for (to, &time) in times_s.iter().enumerate() {
            let from = self.times_s.partition_point(|at| *at <= time).clamp(1, samples - 1) - 1;
            let span_s = self.times_s[from + 1] - self.times_s[from];
            let functions = quintic_hermite(time - self.times_s[from], span_s);
            for joint in 0..*joints {
                let at = joint * samples + from;
                let weights = [q[at], dq[at], ddq[at], q[at + 1], dq[at + 1], ddq[at + 1]];
                let value = |order: usize| functions.iter().zip(weights).map(|(f, weight)| f[order] * weight).sum();
                let at = joint * times_s.len() + to;
                (out.q[at], out.dq[at], out.ddq[at], out.dddq[at]) = (value(0), value(1), value(2), value(3));
            }
        }
    }

    fn apply_adjoint(&self, _: &[f64], _: &[f64], _: &MotionAdjoint, gradient: &mut [f64]) {
        assert!(gradient.is_empty(), "gradient of {NAME}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{Fourier, FourierSettings, check};

    /// Interpolates samples of a series: exact at samples, with an error between them below the remainder h⁶ max|q⁽⁶⁾|
    /// / (720 · 64) of quintic Hermite interpolation.
    #[test]
    fn a_sampled_series_comes_back() {
        let duration = 8.0;
        let series = Fourier::new(2, duration, &FourierSettings::default()).unwrap();
        let parameters = check::start(&series, 4);
        let own: Vec<f64> = (0..=160).map(|k| f64::from(k) * 0.05 - 0.02 * f64::from(k % 2)).collect();
        let mut samples = Motion::default();
        series.motion(&parameters, &own, &mut samples);
        let given = SampledMotion::new(own.iter().map(|time| time + 3.0).collect(), samples.clone()).unwrap();
        let mut back = Motion::default();
        given.motion(&[], given.times_s(), &mut back);
        for (found, expected) in [(&back.q, &samples.q), (&back.dq, &samples.dq), (&back.ddq, &samples.ddq)] {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        }
        let between: Vec<f64> = (0..799).map(|k| 0.005 + f64::from(k) * 0.01).collect();
        let (mut found, mut expected) = (Motion::default(), Motion::default());
        given.motion(&[], &between, &mut found);
        series.motion(&parameters, &between, &mut expected);
        // Fastest harmonic 5 · 2π/8 = 3.93 rad/s, velocities below 4 rad/s: q⁽⁶⁾ below 4 · 3.93⁵ = 3.8e3; h at most
        // 0.07.
        let worst = found.q.iter().zip(&expected.q).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(worst < 0.07_f64.powi(6) * 3.8e3 / (720.0 * 64.0), "{worst}");
    }

    #[test]
    fn rejects_invalid_samples() {
        let motion = |values: usize| Motion {
            samples: 2,
            joints: 1,
            q: vec![0.0; values],
            dq: vec![0.0; values],
            ddq: vec![0.0; values],
            dddq: Vec::new(),
        };
        assert!(SampledMotion::new(vec![0.0, 1.0], motion(2)).is_ok());
        assert!(SampledMotion::new(vec![0.0, 1.0], motion(3)).is_err());
        for times in [vec![0.0], vec![0.0, 0.0], vec![1.0, 0.0], vec![0.0, f64::NAN], vec![0.0, f64::INFINITY]] {
            assert!(SampledMotion::new(times, motion(2)).is_err());
        }
        let mut broken = motion(2);
        broken.ddq[1] = f64::NAN;
        assert!(SampledMotion::new(vec![0.0, 1.0], broken).is_err());
    }
}
