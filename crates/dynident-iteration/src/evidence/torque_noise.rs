//! Noise of a logged torque, separated from torque that the model may not explain.
//!
//! Friction jumps at reversals, and a jump has a spectrum up to half the sampling rate. Noise, however, is always
//! present. So the spectral density of the torque is computed over time windows, octave by octave, beginning at the
//! highest frequency of the motion. Each octave has windows as short as possible. The lower quartile over the windows
//! is the noise; only windows without a reversal are used if there are enough. Below the highest frequency of the
//! motion, the noise is assumed to have the density of the first octave.
//!
//! Source: Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70. For the quartile of the means of several densities:
//! Wilson and Hilferty, Proc. Natl. Acad. Sci. 17 (1931) 684.

use core::f64::consts::{PI, TAU};
use core::ops::Range;

/// Length of a window in periods of an octave's lowest frequency; a window then contains four frequencies of the
/// octave.
const PERIODS_PER_WINDOW: usize = 4;
/// Number of independent densities among the four frequencies of a window with a Hann taper.
const INDEPENDENT_DENSITIES: f64 = 2.7;
/// Minimum number of windows without a reversal with which the other windows are not used.
const MIN_WINDOWS: usize = 12;
/// Ratio of the densities of two consecutive octaves above which the lower octave contains motion: first-order noise
/// falls by a factor of 4, the torque of a motion by 16 and more.
const MIN_MOTION_DENSITY_RATIO: f64 = 8.0;
/// A joint reverses in a window if in one quarter of the window it moves less than this share of its mean motion per
/// quarter.
const MIN_QUARTER_SHARE: f64 = 0.1;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TorqueNoise {
    /// Standard deviation of one sample, Nm (N).
    pub(crate) of_sample: f64,
    /// Spectral density of the noise at the lowest resolved frequencies, Nm²/Hz.
    density: f64,
}

impl TorqueNoise {
    /// Standard deviation of the noise after a low-pass filter, Nm (N).
    pub(crate) fn below(self, cutoff_hz: f64) -> f64 {
        (self.density * cutoff_hz).sqrt()
    }

    pub(crate) fn or(self, other: Self) -> Self {
        Self { of_sample: self.of_sample.max(other.of_sample), density: self.density.max(other.density) }
    }
}

/// Estimates the noise of the uniformly sampled torque `tau` of a joint with the positions `q`, whose motion has
/// frequencies up to `motion_hz`. Zero if there are too few samples or all are equal.
pub(crate) fn torque_noise(tau: &[f64], q: &[f64], rate_hz: f64, motion_hz: f64) -> TorqueNoise {
    let nyquist_hz = 0.5 * rate_hz;
    if tau.len() != q.len() || !(motion_hz > 0.0 && nyquist_hz.is_finite()) || tau.iter().any(|tau| !tau.is_finite()) {
        return TorqueNoise::default();
    }
    // Third differences prevent that the slow torque of the motion leaks through the tapers.
    let third: Vec<f64> = tau.windows(4).map(|x| x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0]).collect();
    let mut octaves: Vec<([f64; 2], f64)> = Vec::new();
    // At least one octave is evaluated, if necessary the highest.
    let mut from_hz = motion_hz.min(0.5 * nyquist_hz);
    while from_hz < 0.9 * nyquist_hz {
        let to_hz = if 2.2 * from_hz > nyquist_hz { nyquist_hz } else { 2.0 * from_hz };
        let Some(density) = octave_density(&third, q, rate_hz, [from_hz, to_hz]) else { break };
        octaves.push(([from_hz, to_hz], density));
        from_hz = to_hz;
    }
    // The spectrum of torque is wider than that of positions, because torque contains squares and products of
    // velocities.
    let motion = octaves.windows(2).take_while(|two| two[0].1 > MIN_MOTION_DENSITY_RATIO * two[1].1).count();
    octaves.drain(..motion);
    let lowest = octaves.first().map(|(_, density)| *density);
    // The noise below the highest frequency of the motion has the density of the first octave.
    let below = octaves.first().map_or(0.0, |([from_hz, _], density)| from_hz * density);
    let variance = below + octaves.iter().map(|([from_hz, to_hz], density)| (to_hz - from_hz) * density).sum::<f64>();
    let step = quantum(tau);
    let of_sample = variance.sqrt().max(step / 12.0_f64.sqrt());
    TorqueNoise { of_sample, density: lowest.unwrap_or(0.0).max(step * step / 12.0 / nyquist_hz) }
}

/// One-sided density of the noise within an octave, Nm²/Hz, from third differences; `None` if no window fits.
fn octave_density(third: &[f64], q: &[f64], rate_hz: f64, band_hz: [f64; 2]) -> Option<f64> {
    let [from_hz, to_hz] = band_hz;
    let length = (PERIODS_PER_WINDOW as f64 * rate_hz / from_hz).round() as usize;
    if length < 2 * PERIODS_PER_WINDOW || third.len() < length {
        return None;
    }
    let bins = PERIODS_PER_WINDOW
        ..((to_hz / rate_hz * length as f64).floor() as usize + 1).min(length / 2).max(PERIODS_PER_WINDOW + 1);
    let taper: Vec<f64> = (0..length).map(|k| (PI * (k as f64 + 0.5) / length as f64).sin().powi(2)).collect();
    let power: f64 = taper.iter().map(|x| x * x).sum();
    let turn: Vec<[f64; 2]> = (0..length).map(|k| (TAU * k as f64 / length as f64).sin_cos().into()).collect();
    let of_bin = |values: &[f64], bin: usize| {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (k, value) in values.iter().enumerate() {
            let [s, c] = turn[k * bin % length];
            sine += taper[k] * value * s;
            cosine += taper[k] * value * c;
        }
        let response = (2.0 * (PI * bin as f64 / length as f64).sin()).powi(6);
        2.0 * (sine * sine + cosine * cosine) / (power * rate_hz * response)
    };
    let of_window = |window: &Range<usize>| {
        let values = &third[window.clone()];
        bins.clone().map(|bin| of_bin(values, bin)).sum::<f64>() / bins.len() as f64
    };
    let windows: Vec<Range<usize>> =
        (0..=third.len() - length).step_by((length / 2).max(1)).map(|start| start..start + length).collect();
    let one_way: Vec<&Range<usize>> =
        windows.iter().filter(|window| moves_one_way(&q[window.start..window.end + 3])).collect();
    let chosen = if one_way.len() >= MIN_WINDOWS { one_way } else { windows.iter().collect() };
    let mut densities: Vec<f64> = chosen.into_iter().map(of_window).collect();
    densities.sort_by(f64::total_cmp);
    let independent = INDEPENDENT_DENSITIES * bins.len() as f64 / PERIODS_PER_WINDOW as f64;
    Some(densities[densities.len() / 4] / lower_quartile(independent))
}

/// The lower quartile of the mean of `count` independent densities, divided by its expectation.
fn lower_quartile(count: f64) -> f64 {
    (1.0 - 1.0 / (9.0 * count) - 0.6745 / (3.0 * count.sqrt())).powi(3)
}

fn moves_one_way(q: &[f64]) -> bool {
    let quarter = q.len() / 4;
    if quarter == 0 {
        return false;
    }
    let whole = q[4 * quarter - 1] - q[0];
    (0..4).all(|k| {
        let moved = q[(k + 1) * quarter - 1] - q[k * quarter];
        moved * whole.signum() > MIN_QUARTER_SHARE * 0.25 * whole.abs()
    })
}

/// Quantisation step of a torque: the smallest nonzero difference of neighbouring samples; nearly zero without
/// quantisation.
fn quantum(tau: &[f64]) -> f64 {
    let steps = tau.windows(2).map(|two| (two[1] - two[0]).abs()).filter(|step| *step > 0.0);
    let least = steps.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    /// A torque and its joint's positions over 20 s: gravity, inertia and friction of a joint that reverses up to twice
    /// a second.
    struct Torque {
        rate_hz: f64,
        /// Coulomb friction, Nm, and the velocity at which it is fully developed, rad/s.
        coulomb: [f64; 2],
        noise: f64,
    }

    impl Torque {
        fn samples(&self) -> (Vec<f64>, Vec<f64>) {
            let mut random = Random::new(3);
            let samples = (20.0 * self.rate_hz) as usize;
            let pair = |k: usize| {
                let t = k as f64 / self.rate_hz;
                let term = |a: f64, hertz: f64| {
                    let w = TAU * hertz;
                    [a * (w * t).sin(), a * w * (w * t).cos(), -a * w * w * (w * t).sin()]
                };
                let terms = [term(0.5, 0.1), term(0.3, 0.3), term(-0.2, 0.6), term(0.1, 0.9)];
                let [q, dq, ddq]: [f64; 3] = core::array::from_fn(|k| terms.iter().map(|own| own[k]).sum());
                let [size, width] = self.coulomb;
                (q, 30.0 * q.cos() + 2.0 * ddq + dq + size * (dq / width).tanh())
            };
            (0..samples)
                .map(pair)
                .map(|(q, tau)| (q + 1e-5 * random.normal(), tau + self.noise * random.normal()))
                .unzip()
        }
    }

    const RATES_HZ: [f64; 4] = [100.0, 250.0, 500.0, 1000.0];

    fn found((q, tau): &(Vec<f64>, Vec<f64>), rate_hz: f64) -> TorqueNoise {
        torque_noise(tau, q, rate_hz, 6.0)
    }

    /// White noise is known by construction; friction that is forty times as large and steps within a sample, or over
    /// 0.05 rad/s, adds at most half of it.
    #[test]
    fn steps_of_friction_are_not_noise() {
        for rate_hz in RATES_HZ {
            for coulomb in [[0.0, 1.0], [8.0, 1e-6], [8.0, 0.05], [2.0, 1e-6], [2.0, 0.1]] {
                let noise = 0.2;
                let of = Torque { rate_hz, coulomb, noise }.samples();
                let (sample, row) = (found(&of, rate_hz).of_sample / noise, found(&of, rate_hz).below(6.0));
                let row = row / (noise * (6.0 / (0.5 * rate_hz)).sqrt());
                let most = if coulomb[0] == 0.0 { 1.2 } else { 1.5 };
                assert!((0.8..most).contains(&sample), "{rate_hz} Hz, {coulomb:?}: {sample}");
                assert!((0.65..most.max(1.35)).contains(&row), "{rate_hz} Hz, {coulomb:?}: of a row {row}");
            }
        }
    }

    /// Noise that is correlated over ten samples, as of a filtered current, is 4.4 times white noise of its size in a
    /// slow row: the variance of the mean of a first-order process. The encoder noise in a controller's torque is
    /// nearly zero there.
    #[test]
    fn coloured_noise_is_known_in_a_filtered_row() {
        let (rate_hz, correlation) = (500.0, 0.9_f64);
        let (q, smooth) = Torque { rate_hz, coulomb: [2.0, 1e-6], noise: 0.0 }.samples();
        let mut random = Random::new(4);
        let mut held = 0.0;
        let mut next = || {
            held = correlation * held + (1.0 - correlation * correlation).sqrt() * random.normal();
            held
        };
        let noise: Vec<f64> = (0..smooth.len()).map(|_| 0.3 * next()).collect();
        // Expected value: the noise through a moving mean, which is a low-pass of that width.
        let mean_of = |values: &[f64]| {
            let means: Vec<f64> = values.windows(42).map(|x| x.iter().sum::<f64>() / 42.0).collect();
            (means.iter().map(|x| x * x).sum::<f64>() / means.len() as f64).sqrt()
        };
        let tau: Vec<f64> = smooth.iter().zip(&noise).map(|(tau, noise)| tau + noise).collect();
        let own = torque_noise(&tau, &q, rate_hz, 6.0);
        // A moving mean over 42 samples has the noise of a low-pass at 500 Hz / 84.
        let row = own.below(rate_hz / 84.0) / mean_of(&noise);
        assert!((0.6..1.2).contains(&row), "{row}");
        assert!((0.7..1.5).contains(&(own.of_sample / 0.3)), "{own:?}");

        let white: Vec<f64> = (0..=smooth.len()).map(|_| 0.3 * random.normal()).collect();
        let fed_back: Vec<f64> = white.windows(2).map(|two| two[1] - two[0]).collect();
        let tau: Vec<f64> = smooth.iter().zip(&fed_back).map(|(tau, noise)| tau + noise).collect();
        let own = torque_noise(&tau, &q, rate_hz, 6.0);
        let sample = own.of_sample / (0.3 * 2.0_f64.sqrt());
        assert!((0.8..1.2).contains(&sample), "{sample}");
        assert!(own.below(6.0) < 0.3 * own.of_sample * (6.0 / 250.0_f64).sqrt() * 2.0, "{own:?}");
    }

    /// Rounded to 0.1 Nm: the variance is a twelfth of the squared step.
    #[test]
    fn rounding_is_noise() {
        for rate_hz in RATES_HZ {
            let (q, tau) = Torque { rate_hz, coulomb: [2.0, 1e-6], noise: 0.0 }.samples();
            let rounded: Vec<f64> = tau.iter().map(|tau| (tau / 0.1).round() * 0.1).collect();
            let share = torque_noise(&rounded, &q, rate_hz, 6.0).of_sample / (0.1 / 12.0_f64.sqrt());
            assert!((0.8..1.5).contains(&share), "{rate_hz} Hz: {share}");
        }
    }

    #[test]
    fn short_and_broken_torques_have_none() {
        let none = TorqueNoise::default();
        assert_eq!(torque_noise(&[], &[], 500.0, 6.0), none);
        assert_eq!(torque_noise(&[1.0; 500], &[0.0; 500], 500.0, 6.0), none);
        assert_eq!(torque_noise(&[f64::NAN; 500], &[0.0; 500], 500.0, 6.0), none);
        assert_eq!(torque_noise(&[1.0, 2.0], &[0.0; 2], 500.0, f64::NAN), none);
        assert!(torque_noise(&[1.0, 2.0, 1.5, 0.0], &[0.0; 4], 500.0, 6.0).of_sample.is_finite());
    }
}
