//! Averages the periods of a repeated motion and estimates the noise from their differences.

use crate::error::FormatError;

/// Mean period of several channels and covariance of their noise.
#[derive(Clone, Debug, PartialEq)]
pub struct AveragedPeriods {
    /// Mean over the periods, `period_samples` values for each channel.
    pub mean: Vec<Vec<f64>>,
    /// Noise covariance of a single sample between channels at one instant, row by row; that of the mean is smaller by
    /// the factor P.
    pub sample_covariance: Vec<Vec<f64>>,
    /// Number P of averaged periods.
    pub periods: usize,
}

impl AveragedPeriods {
    /// Covariance of the mean: [`sample_covariance`](Self::sample_covariance) over P.
    pub fn mean_covariance(&self) -> Vec<Vec<f64>> {
        let share = 1.0 / self.periods as f64;
        self.sample_covariance.iter().map(|row| row.iter().map(|value| value * share).collect()).collect()
    }
}

/// ```text
///     x̄_k = Σ_p x_pk / P,   Σ = Σ_k Σ_p (x_pk − x̄_k)(x_pk − x̄_k)ᵀ / (N (P − 1))
/// ```
///
/// for N samples per period and P whole periods; samples after the last whole period are not used. Noise correlated
/// over a period and drift between periods are included in the noise. Source: Olsen, Swevers and Verdonck, Int. J.
/// Robotics Research 21 (2002) 895.
///
/// # Errors
/// [`FormatError`] with key `period_samples` if it is zero or channels are shorter than two periods, `channels` if they
/// differ in length or contain a value that is not finite.
///
/// ```
/// // Two periods of three samples, 0.2 apart everywhere.
/// let found = dynident_recording::averaged_periods(&[&[0.9, 1.9, 2.9, 1.1, 2.1, 3.1]], 3)?;
/// assert!((found.mean[0][2] - 3.0).abs() < 1e-12);
/// assert!((found.sample_covariance[0][0] - 0.02).abs() < 1e-12); // 2 · 0.1² over one degree of freedom
/// # Ok::<(), dynident_recording::FormatError>(())
/// ```
pub fn averaged_periods(channels: &[&[f64]], period_samples: usize) -> Result<AveragedPeriods, FormatError> {
    let length = channels.first().map_or(0, |channel| channel.len());
    if channels.iter().any(|channel| channel.len() != length) {
        return Err(FormatError::new("channels", "the channels differ in length", "give samples of the same instants"));
    }
    if channels.iter().any(|channel| channel.iter().any(|value| !value.is_finite())) {
        return Err(FormatError::new("channels", "a sample is not finite", "fill or cut gaps before averaging"));
    }
    let periods = length.checked_div(period_samples).unwrap_or(0);
    if periods < 2 {
        let problem = format!("{length} samples contain {periods} whole period(s) of {period_samples} samples");
        return Err(FormatError::new("period_samples", problem, "record at least two periods, or give a shorter one"));
    }
    let mean: Vec<Vec<f64>> = channels
        .iter()
        .map(|channel| {
            let at = |k: usize| (0..periods).map(|p| channel[p * period_samples + k]).sum::<f64>() / periods as f64;
            (0..period_samples).map(at).collect()
        })
        .collect();
    let degrees_of_freedom = (period_samples * (periods - 1)) as f64;
    let entry = |a: usize, b: usize| {
        let deviation = |channel: usize, at: usize| channels[channel][at] - mean[channel][at % period_samples];
        (0..periods * period_samples).map(|at| deviation(a, at) * deviation(b, at)).sum::<f64>() / degrees_of_freedom
    };
    let sample_covariance = (0..channels.len()).map(|a| (0..channels.len()).map(|b| entry(a, b)).collect()).collect();
    Ok(AveragedPeriods { mean, sample_covariance, periods })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Approximately normal noise: a sum of uniform xorshift numbers.
    fn noise(state: &mut u64) -> f64 {
        let mut sum = 0.0;
        for _ in 0..12 {
            *state ^= *state << 13;
            *state ^= *state >> 7;
            *state ^= *state << 17;
            sum += (*state >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum - 6.0
    }

    #[test]
    fn noise_of_known_covariance_is_estimated() {
        // Channel b has half of channel a's noise and independent noise: covariances 0.04, 0.02, 0.01 + 0.0225.
        let (periods, samples) = (20, 200);
        let mut state = 0x1234_5678_9ABC_DEF1;
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for k in 0..periods * samples + 17 {
            let phase = core::f64::consts::TAU * (k % samples) as f64 / samples as f64;
            let shared = 0.2 * noise(&mut state);
            a.push(phase.sin() + shared);
            b.push(3.0 * phase.cos() + 0.5 * shared + 0.15 * noise(&mut state));
        }
        let found = averaged_periods(&[&a, &b], samples).unwrap();
        assert_eq!(found.periods, periods);
        // A variance from 3800 squares has a relative standard deviation of √(2/3800) = 2.3 %; four are allowed.
        for (value, truth) in [
            (found.sample_covariance[0][0], 0.04),
            (found.sample_covariance[0][1], 0.02),
            (found.sample_covariance[1][1], 0.0325),
        ] {
            assert!((value / truth - 1.0).abs() < 0.1, "{value} for {truth}");
        }
        // The mean square error of the mean is the variance over P; for 200 squares, 10 % standard deviation; four are
        // allowed.
        let square: f64 = (0..samples)
            .map(|k| (found.mean[0][k] - (core::f64::consts::TAU * k as f64 / samples as f64).sin()).powi(2))
            .sum();
        assert!((square / samples as f64 / (0.04 / periods as f64) - 1.0).abs() < 0.4);
        assert!((found.mean_covariance()[0][0] - found.sample_covariance[0][0] / 20.0).abs() < 1e-15);
    }

    #[test]
    fn invalid_channels_and_periods_are_rejected() {
        let channel = [1.0, 2.0, 3.0];
        assert_eq!(averaged_periods(&[&channel], 2).unwrap_err().key, "period_samples");
        assert_eq!(averaged_periods(&[&channel], 0).unwrap_err().key, "period_samples");
        assert_eq!(averaged_periods(&[], 2).unwrap_err().key, "period_samples");
        assert_eq!(averaged_periods(&[&channel, &channel[..2]], 1).unwrap_err().key, "channels");
        assert_eq!(averaged_periods(&[&[1.0, f64::NAN]], 1).unwrap_err().key, "channels");
    }
}
