//! Time stamps that jitter around a slowly varying rate: smoothing by local lines, and their drift from an even grid.

use super::settings::ClockSettings;

/// Half-widths of the smoothing windows that are tried, rows.
const HALF_WIDTHS: [usize; 10] = [4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048];
/// A longer window is accepted if its prediction error for left-out stamps is within this factor of the minimum.
const MAX_ERROR_RATIO: f64 = 1.05;
/// Number of rows on either side of a jump of the stamps that must show that the jump is permanent.
const JUMP_ROWS: usize = 8;
/// Minimum jump of the stamps that indicates missing rows, steps.
const MIN_JUMP_STEPS: f64 = 0.6;

/// Number of rows that are needed on either side of a block to smooth its stamps.
pub(crate) const CONTEXT_ROWS: usize = HALF_WIDTHS[HALF_WIDTHS.len() - 1] + 2 * JUMP_ROWS;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Drift {
    /// Half-width of the local lines, rows.
    pub(crate) half: usize,
    /// Range of the deviations of the smoothed stamps from the even grid, steps.
    pub(crate) steps: f64,
    /// RMS of the relative variation of the rate.
    pub(crate) variation: f64,
}

/// Half-widths to try, rows: the longest window whose error for left-out stamps is nearly the minimum, and all longer
/// windows. Empty for fewer than 64 rows.
pub(crate) fn windows(place: &[f64], stamp: &[f64], begins: &[bool]) -> &'static [usize] {
    if place.len() < 64 {
        return &[];
    }
    let begins = with_jumps(place, stamp, begins);
    let errors: Vec<f64> = HALF_WIDTHS.iter().map(|half| left_out_error(place, stamp, &begins, *half)).collect();
    let least = errors.iter().fold(f64::INFINITY, |least, error| least.min(*error));
    // Exact stamps have zero error for any window, so a millionth of a step is always accepted.
    let allowed = (MAX_ERROR_RATIO * least).max(1e-6);
    &HALF_WIDTHS[errors.iter().rposition(|error| *error <= allowed).unwrap_or(HALF_WIDTHS.len())..]
}

impl Drift {
    /// Drift of the rows `place` (row numbers) with the stamps `stamp` (in steps), smoothed by local lines of
    /// half-width `half`. `begins` marks the first row of each piece. Needs at least two rows.
    pub(crate) fn of(place: &[f64], stamp: &[f64], begins: &[bool], half: usize) -> Self {
        let begins = with_jumps(place, stamp, begins);
        let smooth = smoothed_runs(place, stamp, &begins, half);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for off in off_grid(place, &smooth, &begins) {
            (low, high) = (low.min(off), high.max(off));
        }
        let span = (2 * half).min(place.len() / 4).max(1);
        let (mut square, mut count) = (0.0, 0.0);
        for i in (span..place.len()).step_by(span) {
            if begins[i - span + 1..=i].iter().any(|begins| *begins) {
                continue;
            }
            let rows = place[i] - place[i - span];
            square += ((smooth[i] - smooth[i - span]) / rows - 1.0).powi(2);
            count += 1.0;
        }
        // Jumps within a piece are missing rows. There the rate of an even grid is wrong by the whole jump.
        let jumps =
            (1..place.len()).filter(|&i| begins[i]).map(|i| stamp[i] - stamp[i - 1] - (place[i] - place[i - 1]));
        let jumps: f64 = jumps.filter(|jump| jump.abs() < JUMP_ROWS as f64).map(|jump| jump * jump).sum();
        let variation = (square / f64::max(count, 1.0) + jumps / place.len() as f64).sqrt();
        Self { half, steps: high - low, variation }
    }

    pub(crate) fn exceeds(&self, limits: &ClockSettings) -> bool {
        self.steps > limits.min_drift_steps && self.variation > limits.min_rate_variation
    }
}

/// The stamps, smoothed by local lines of half-width `half`, separately for each piece and between permanent jumps
/// (missing rows).
pub(crate) fn smoothed(place: &[f64], stamp: &[f64], begins: &[bool], half: usize) -> Vec<f64> {
    smoothed_runs(place, stamp, &with_jumps(place, stamp, begins), half)
}

/// Deviation of stamps from an even grid of one step per row, separately for each piece.
fn off_grid(place: &[f64], stamp: &[f64], begins: &[bool]) -> Vec<f64> {
    // Jumps are part of the drift. Gaps and stamps that go backwards start a new grid.
    let mut off: Vec<f64> = place.iter().zip(stamp).map(|(place, stamp)| stamp - place).collect();
    let mut shift = 0.0;
    for i in 0..off.len() {
        if i > 0 && begins[i] && (off[i] - shift - off[i - 1]).abs() >= JUMP_ROWS as f64 {
            shift = off[i] - off[i - 1];
        }
        off[i] -= shift;
    }
    off
}

/// Starts of pieces, including the rows after permanent jumps.
fn with_jumps(place: &[f64], stamp: &[f64], begins: &[bool]) -> Vec<bool> {
    let off: Vec<f64> = place.iter().zip(stamp).map(|(place, stamp)| stamp - place).collect();
    let n = off.len();
    let mut cut = begins.to_vec();
    for i in 1..n {
        let jump = off[i] - off[i - 1];
        // A backward jump does not indicate missing rows.
        if cut[i] || jump < MIN_JUMP_STEPS {
            continue;
        }
        let from = (i.saturating_sub(JUMP_ROWS)..i).rev().find(|k| begins[*k]).unwrap_or(i.saturating_sub(JUMP_ROWS));
        let to = (i + 1..n.min(i + JUMP_ROWS)).find(|k| begins[*k]).unwrap_or(n.min(i + JUMP_ROWS));
        let lasting = median(&off[i..to]) - median(&off[from..i]);
        cut[i] = lasting > f64::max(MIN_JUMP_STEPS, 0.7 * jump);
    }
    cut
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

/// Value of a local line at one row, and the weight of the row's own stamp in this value.
struct LocalLine {
    value: f64,
    own: f64,
}

fn local_lines(place: &[f64], stamp: &[f64], begins: &[bool], half: usize, mut see: impl FnMut(usize, LocalLine)) {
    let n = place.len();
    let mut start = 0;
    let mut sums: Vec<[f64; 4]> = Vec::new();
    while start < n {
        let end = (start + 1..n).find(|i| begins[*i]).unwrap_or(n);
        sums.clear();
        sums.push([0.0; 4]);
        let origin = place[start];
        let own_off = stamp[start] - place[start];
        for i in start..end {
            let (x, y) = (place[i] - origin, stamp[i] - place[i] - own_off);
            let [a, b, c, d] = sums[i - start];
            sums.push([a + x, b + x * x, c + y, d + x * y]);
        }
        for i in start..end {
            let (from, to) = (i.saturating_sub(half).max(start), (i + half + 1).min(end));
            let count = (to - from) as f64;
            let (low, high) = (sums[from - start], sums[to - start]);
            let [x, xx, y, xy] = core::array::from_fn(|k| high[k] - low[k]);
            let (mean_x, mean_y) = (x / count, y / count);
            let spread = xx - x * mean_x;
            let away = place[i] - origin - mean_x;
            let (slope, own) = if count > 2.0 && spread > 0.0 {
                ((xy - x * mean_y) / spread, count.recip() + away * away / spread)
            } else {
                (0.0, count.recip())
            };
            let value = if count > 2.0 { place[i] + own_off + mean_y + slope * away } else { stamp[i] };
            see(i, LocalLine { value, own });
        }
        start = end;
    }
}

fn smoothed_runs(place: &[f64], stamp: &[f64], begins: &[bool], half: usize) -> Vec<f64> {
    let mut smooth = vec![0.0; place.len()];
    local_lines(place, stamp, begins, half, |i, line| smooth[i] = line.value);
    smooth
}

/// RMS error with which the neighbours of a stamp predict it. Source: the left-out residual of a linear smoother,
/// `e / (1 - h)`; Wahba, Spline Models for Observational Data (1990), 4.2.
fn left_out_error(place: &[f64], stamp: &[f64], begins: &[bool], half: usize) -> f64 {
    let (mut square, mut count) = (0.0, 0.0_f64);
    local_lines(place, stamp, begins, half, |i, line| {
        if line.own < 0.9 {
            square += ((stamp[i] - line.value) / (1.0 - line.own)).powi(2);
            count += 1.0;
        }
    });
    (square / count.max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f64 {
        0.6 * ((i as f64 * 0.754_877_666).fract() - 0.5)
    }

    fn rows(n: usize) -> (Vec<f64>, Vec<bool>) {
        ((0..n).map(|i| i as f64).collect(), vec![false; n])
    }

    #[test]
    fn a_rate_that_wanders_is_followed_and_jitter_is_not() {
        let (place, begins) = rows(6000);
        let wander = |x: f64| 40.0 * (x / 900.0).sin();
        let stamp: Vec<f64> = place.iter().map(|x| x + wander(*x) + noise(*x as usize)).collect();
        let drift = Drift::of(&place, &stamp, &begins, windows(&place, &stamp, &begins)[0]);
        assert!(drift.exceeds(&ClockSettings::default()) && (70.0..90.0).contains(&drift.steps), "{drift:?}");
        let smooth = smoothed(&place, &stamp, &begins, drift.half);
        let worst = (200..5800).map(|i| (smooth[i] - place[i] - wander(place[i])).abs()).fold(0.0, f64::max);
        // Jitter of 0.17 steps RMS averaged over tens of rows, and the curvature of the drift over them.
        assert!(worst < 0.1, "{worst} over {}", drift.half);
    }

    #[test]
    fn jitter_about_an_even_grid_is_no_drift_and_missing_rows_are() {
        let (place, begins) = rows(6000);
        let best = |stamp: &[f64]| {
            let half = windows(&place, stamp, &begins)[0];
            Drift::of(&place, stamp, &begins, half)
        };
        let stamp: Vec<f64> = place.iter().map(|x| x + noise(*x as usize)).collect();
        assert!(!best(&stamp).exceeds(&ClockSettings::default()));
        let stamp: Vec<f64> = place.iter().map(|x| x + (x / 300.0).floor() + 0.3 * noise(*x as usize)).collect();
        let drift = best(&stamp);
        assert!(drift.exceeds(&ClockSettings::default()), "{drift:?}");
        let smooth = smoothed(&place, &stamp, &begins, drift.half);
        for i in (299..5900).step_by(300) {
            assert!((smooth[i + 1] - smooth[i] - 2.0).abs() < 0.15, "{i}: {} {}", smooth[i], smooth[i + 1]);
        }
    }
}
