//! Response of a joint to its command: lag, slope, offset, correlation.

/// Maximum number of samples for the search of the lag.
const MAX_SAMPLES: usize = 20_000;
/// Longest lag that is searched, samples.
const MAX_LAG_SAMPLES: usize = 500;
/// Relative increase of the residual variance within which a shorter lag is preferred, because periodic motions have
/// several equally good lags.
const LAG_TOLERANCE: f64 = 0.05;

/// Linear function that predicts the position q from the command r some samples earlier:
/// `q(i) = slope · r(i − lag) + ..`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Response {
    /// Number of samples by which the position is later than the command; negative if it is earlier.
    pub(super) lag: isize,
    /// Change of the position per change of the command.
    pub(super) slope: f64,
    /// Median of the position minus the lagged command.
    pub(super) offset: f64,
    /// Correlation of position and lagged command, 0 if one of them is constant.
    pub(super) correlation: f64,
    /// Residual variance without a lag, divided by that with the lag.
    pub(super) lag_gain: f64,
}

impl Response {
    /// Finds the response with the largest magnitude of the correlation, for lags up to `max_lag` samples in either
    /// direction.
    pub(super) fn of(positions: &[f64], commands: &[f64], max_lag: usize) -> Self {
        let samples = positions.len().min(MAX_SAMPLES);
        let (positions, commands) = (&positions[..samples], &commands[..samples]);
        // At least half of the samples are compared at any lag.
        let most = max_lag.min(MAX_LAG_SAMPLES).min(samples / 4) as isize;
        let fits: Vec<(isize, f64, f64)> = (-most..=most)
            .map(|lag| {
                let (q, r) = lagged(positions, commands, lag, most as usize);
                let (slope, correlation) = regression(q, r);
                (lag, slope, correlation)
            })
            .collect();
        let unexplained = |correlation: f64| (1.0 - correlation * correlation).max(1e-9);
        let least = fits.iter().map(|fit| unexplained(fit.2)).fold(1.0, f64::min);
        let near = fits.iter().filter(|fit| unexplained(fit.2) <= (1.0 + LAG_TOLERANCE) * least);
        let best = near.min_by_key(|fit| (fit.0.abs(), fit.0)).copied().unwrap_or_default();
        let without = fits.iter().find(|fit| fit.0 == 0).map_or(1.0, |fit| unexplained(fit.2));
        let (q, r) = lagged(positions, commands, best.0, most as usize);
        let mut differences: Vec<f64> = q.iter().zip(r).map(|(q, r)| q - r).collect();
        Self {
            lag: best.0,
            slope: best.1,
            offset: median(&mut differences).unwrap_or(0.0),
            correlation: best.2,
            lag_gain: without / least,
        }
    }
}

/// The positions, except `margin` samples at both ends, and the commands `lag` samples earlier.
fn lagged<'a>(positions: &'a [f64], commands: &'a [f64], lag: isize, margin: usize) -> (&'a [f64], &'a [f64]) {
    let (from, to) = (margin, positions.len() - margin);
    let shifted = from.saturating_add_signed(-lag);
    (&positions[from..to], &commands[shifted..shifted + (to - from)])
}

/// Slope of the regression of `q` on `r`, and their correlation; zeros if one of them is constant.
fn regression(q: &[f64], r: &[f64]) -> (f64, f64) {
    let count = q.len().max(1) as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (mean_q, mean_r) = (mean(q), mean(r));
    let [mut qq, mut rr, mut qr] = [0.0; 3];
    for (q, r) in q.iter().zip(r) {
        let (q, r) = (q - mean_q, r - mean_r);
        qq += q * q;
        rr += r * r;
        qr += q * r;
    }
    // Constant except for rounding errors.
    let is_constant = |sum: f64, mean: f64| sum <= 1e-20 * count * (1.0 + mean * mean);
    if is_constant(qq, mean_q) || is_constant(rr, mean_r) {
        return (0.0, 0.0);
    }
    (qr / rr, (qr / (qq.sqrt() * rr.sqrt())).clamp(-1.0, 1.0))
}

pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    let half = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)
}

pub(super) fn range(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

pub(super) fn width(values: &[f64]) -> f64 {
    let [low, high] = range(values);
    (high - low).max(0.0)
}
