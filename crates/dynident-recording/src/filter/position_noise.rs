//! Position noise in the pass band of the low-pass, estimated from the spectrum just above the cut-off.

use super::cutoff::{MAX_CUTOFF_SAMPLES, welch};

/// Maximum number of samples in a segment of a spectrum. With it, there are enough bins between the cut-off and four
/// times the cut-off for a quartile.
const MAX_PIECE_SAMPLES: usize = 1 << 12;

/// Standard deviation of the white position noise in one sample, for every joint. The density of the noise is the lower
/// quartile of the spectrum of the uniformly sampled positions `q` between the cut-off and four times the cut-off.
/// Noise of this density is also present below the cut-off, where the motion hides it. Zero for a joint whose position
/// never changes, and for too few samples.
///
/// If the cut-off was selected for the motion, the motion has decayed above it: what remains there corresponds to noise
/// of far less than a hundredth of the acceleration below the cut-off. Therefore motion is not mistaken for noise. The
/// estimate is also valid for positions that were filtered before they were logged, whose spectrum is empty near half
/// the sample rate.
///
/// Source: Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70, on second differences.
pub fn position_noise<S: AsRef<[f64]>>(q: &[S], rate_hz: f64, cutoff_hz: f64) -> Vec<f64> {
    NoiseSpectra::of(q, rate_hz).beyond(cutoff_hz)
}

/// Spectra for the noise estimate, for any cut-off; `None` for a joint without a valid spectrum.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseSpectra {
    joints: Vec<Option<Vec<f64>>>,
    rate_hz: f64,
}

impl NoiseSpectra {
    pub(crate) fn of<S: AsRef<[f64]>>(q: &[S], rate_hz: f64) -> Self {
        Self { joints: q.iter().map(|q| spectrum(q.as_ref())).collect(), rate_hz }
    }

    pub(crate) fn beyond(&self, cutoff_hz: f64) -> Vec<f64> {
        let of_joint = |spectrum: &Vec<f64>| noise_beyond(spectrum, self.rate_hz, cutoff_hz);
        self.joints.iter().map(|spectrum| spectrum.as_ref().and_then(of_joint).unwrap_or(0.0)).collect()
    }
}

fn spectrum(q: &[f64]) -> Option<Vec<f64>> {
    let q = &q[..q.len().min(MAX_CUTOFF_SAMPLES)];
    let first = q.first()?;
    if q.len() < 64 || q.iter().all(|x| x == first) || q.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let second: Vec<f64> = q.windows(3).map(|x| (x[2] - x[1]) - (x[1] - x[0])).collect();
    welch(&second, MAX_PIECE_SAMPLES.min(1 << (second.len() / 2).checked_ilog2()?))
}

fn noise_beyond(spectrum: &[f64], rate_hz: f64, cutoff_hz: f64) -> Option<f64> {
    let bins = spectrum.len();
    let length = 2 * (bins - 1);
    let bin = |hertz: f64| (hertz / rate_hz * length as f64) as usize;
    // At least eight bins are used, if necessary the highest ones.
    let from = bin(cutoff_hz).clamp(1, bins.saturating_sub(8).max(1));
    let to = bin(4.0 * cutoff_hz).clamp(from + 8, bins.max(from + 8)).min(bins);
    let response = |k: usize| (2.0 * (core::f64::consts::PI * k as f64 / length as f64).sin()).powi(4);
    let mut density: Vec<f64> = (from..to).map(|k| spectrum[k] / response(k)).collect();
    density.sort_by(f64::total_cmp);
    density.get(density.len() / 4).map(|density| density.sqrt()).filter(|noise| noise.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::sums_of_uniforms;
    use core::f64::consts::TAU;

    #[test]
    fn noise_is_found_below_a_motion_and_at_rest() {
        let (rate, n, sigma) = (500.0, 10_000, 2.0e-5);
        let moving: Vec<f64> = sums_of_uniforms(1, n)
            .iter()
            .enumerate()
            .map(|(i, noise)| (TAU * 0.8 * i as f64 / rate).sin() + sigma * noise)
            .collect();
        let resting: Vec<f64> = sums_of_uniforms(2, n).iter().map(|noise| 0.3 + sigma * noise).collect();
        let found = position_noise(&[moving, resting, vec![0.3; n]], rate, 5.0);
        // Bins of 4 pieces each: their lower quartile is a third below the mean, so the root is about 18 % low.
        for noise in &found[..2] {
            assert!((0.65..1.0).contains(&(noise / sigma)), "{found:?}");
        }
        assert_eq!(found[2], 0.0);
    }

    #[test]
    fn positions_filtered_before_they_were_logged_keep_their_noise() {
        // A moving mean of eleven samples: gain 0.92 at 10 Hz, nearly zero at half the rate.
        let raw = sums_of_uniforms(3, 20_010);
        let q: Vec<f64> = raw.windows(11).map(|x| x.iter().sum::<f64>() / 11.0).collect();
        let found = position_noise(&[q], 500.0, 8.0)[0];
        assert!((0.5..1.0).contains(&found), "{found}");
    }

    #[test]
    fn short_and_invalid_series_have_no_noise() {
        assert_eq!(position_noise(&[vec![], vec![1.0; 10], vec![f64::NAN; 100]], 100.0, 10.0), [0.0; 3]);
        assert!(position_noise(&[sums_of_uniforms(4, 64)], 100.0, 1000.0)[0] > 0.0);
        assert!(position_noise(&[sums_of_uniforms(4, 64)], 100.0, 0.0)[0] > 0.0);
    }
}
