//! The parallel filter: one linear-phase low-pass for torque and every regressor column, then every n-th row.

use crate::error::{FilterError, require};
use core::f64::consts::PI;
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use serde::{Deserialize, Serialize};

/// Settings of a [`Decimator`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DecimationSettings {
    /// Every how many rows one is kept, 1 to 1000; 10 by default.
    pub factor: usize,
    /// Middle of the transition band (gain one half); by default 0.4 of the rate after decimation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutoff_hz: Option<f64>,
    /// Width of the transition band; by default 0.4 of the rate after decimation, so that the stop band starts at 0.6
    /// of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition_hz: Option<f64>,
    /// Attenuation in the stop band, 21 to 120 dB; the gain in the pass band (up to 0.2 of the reduced rate) lies
    /// within `4 · 10^(-A/20)` of one, 0.4 % at the default of 60: each of the band's two edges ripples by one such
    /// unit, and making the gain at zero frequency one can double that.
    pub stop_band_db: f64,
}

impl Default for DecimationSettings {
    fn default() -> Self {
        Self { factor: 10, cutoff_hz: None, transition_hz: None, stop_band_db: 60.0 }
    }
}

/// Longest filter: beyond this the transition band is narrower than any log of ours can use.
const MAX_TAPS: usize = 20_001;

impl DecimationSettings {
    /// The filter's coefficients at `rate_hz`: windowed sinc with Kaiser's window, odd length, symmetric, unit gain at
    /// zero frequency.
    ///
    /// `h[k] = 2 f_c/rate · sinc(2 f_c/rate · (k - M)) · I₀(β √(1 - ((k - M)/M)²)) / I₀(β)`, length `(A - 7.95) /
    /// (2.285 Δω) + 1` with A two decibels above `stop_band_db`.
    /// Source: Kaiser, Proc. IEEE Int. Symp. Circuits and Systems (1974) 20; Gautier's parallel filter: Pressé and
    /// Gautier, ICRA 1993.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn taps(&self, rate_hz: f64) -> Result<Vec<f64>, FilterError> {
        require((1..=1000).contains(&self.factor), "factor", self.factor as f64, "give 1 to 1000")?;
        require((21.0..=120.0).contains(&self.stop_band_db), "stop_band_db", self.stop_band_db, "give 21 to 120 dB")?;
        require(rate_hz.is_finite() && rate_hz > 0.0, "rate_hz", rate_hz, "give a positive rate")?;
        if self.factor == 1 && self.cutoff_hz.is_none() {
            return Ok(vec![1.0]);
        }
        let reduced = rate_hz / self.factor as f64;
        let cutoff = self.cutoff_hz.unwrap_or(0.4 * reduced);
        require(cutoff.is_finite() && cutoff > 0.0, "cutoff_hz", cutoff, "give a positive frequency")?;
        if cutoff >= 0.5 * rate_hz {
            return Err(FilterError::AboveNyquist { cutoff_hz: cutoff, rate_hz });
        }
        let transition = self.transition_hz.unwrap_or(0.4 * reduced).min(2.0 * cutoff).min(rate_hz - 2.0 * cutoff);
        require(transition.is_finite() && transition > 0.0, "transition_hz", transition, "give a positive width")?;
        // Kaiser's formulas are good to about a decibel; aiming two higher makes the documented figures hold.
        let attenuation = self.stop_band_db + 2.0;
        let beta = if attenuation > 50.0 {
            0.1102 * (attenuation - 8.7)
        } else {
            0.5842 * (attenuation - 21.0).powf(0.4) + 0.07886 * (attenuation - 21.0)
        };
        let length = (attenuation - 7.95) / (2.285 * 2.0 * PI * transition / rate_hz) + 1.0;
        let fix = "widen it: the filter would have more than 20001 coefficients";
        require(length <= MAX_TAPS as f64, "transition_hz", transition, fix)?;
        let half = ((length.ceil() as usize) / 2).max(1);
        let middle = half as f64;
        let mut taps: Vec<f64> = (0..=2 * half)
            .map(|k| {
                let x = k as f64 - middle;
                let argument = 2.0 * PI * cutoff / rate_hz * x;
                let sinc = if x == 0.0 { 1.0 } else { argument.sin() / argument };
                sinc * bessel_i0(beta * (1.0 - (x / middle).powi(2)).max(0.0).sqrt())
            })
            .collect();
        let sum: f64 = taps.iter().sum();
        for tap in &mut taps {
            *tap /= sum;
        }
        Ok(taps)
    }
}

/// Modified Bessel function of the first kind and order zero, by its power series (all terms positive).
fn bessel_i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// Filters and decimates panels of columns, all alike, as they come.
///
/// Only rows whose whole filter support lies inside the signal are produced ("valid" convolution): output row `k`
/// belongs to input row `k · factor + half_length` and has no delay; nothing is invented at the ends. The result does
/// not depend on how the input is cut into panels.
///
/// ```
/// use dynident_recording::{DecimationSettings, Decimator};
/// let mut decimator = Decimator::new(&DecimationSettings::default(), 1000.0, 2)?;
/// // Two constant columns of 500 rows, one after the other.
/// let panel: Vec<f64> = [vec![3.0; 500], vec![-1.0; 500]].concat();
/// let mut out = Vec::new();
/// let rows = decimator.push(&panel, 500, &mut out);
/// assert_eq!(rows, (500 - 2 * decimator.half_length() - 1) / 10 + 1);
/// assert!(out[..rows].iter().all(|value| (value - 3.0).abs() < 1e-12));
/// # Ok::<(), dynident_recording::FilterError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Decimator {
    /// Coefficients, padded with zeros to a multiple of [`BLOCK`].
    taps: Vec<f64>,
    length: usize,
    factor: usize,
    columns: usize,
    level: Level,
    /// The last rows of each column, column-major with stride `stride`: from `begin` to `end`.
    recent: Vec<f64>,
    stride: usize,
    begin: usize,
    end: usize,
    /// Rows still to pass over, from `begin`, before the next output's support begins.
    skip: usize,
    outputs: u64,
}

/// Coefficients are summed in blocks of this many, whatever the processor's lane count.
const BLOCK: usize = 8;

/// Recent rows have room for so many lengths of the filter before they are moved.
const ROOM: usize = 4;

impl Decimator {
    /// A decimator for panels of `columns` columns sampled at `rate_hz`.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn new(settings: &DecimationSettings, rate_hz: f64, columns: usize) -> Result<Self, FilterError> {
        let mut taps = settings.taps(rate_hz)?;
        let length = taps.len();
        taps.resize(length.next_multiple_of(BLOCK), 0.0);
        Ok(Self {
            length,
            factor: settings.factor,
            columns,
            level: Level::detect(),
            recent: Vec::new(),
            stride: 0,
            begin: 0,
            end: 0,
            skip: 0,
            outputs: 0,
            taps,
        })
    }

    /// Rows on either side of an output row that enter it: the first output belongs to this input row.
    pub fn half_length(&self) -> usize {
        self.length / 2
    }

    /// Number of coefficients.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Input row (since the start or the last [`finish`](Self::finish)) to which output row `index` belongs.
    pub fn input_row(&self, index: u64) -> u64 {
        index * self.factor as u64 + self.half_length() as u64
    }

    /// Takes the next `rows` rows of the column-major `panel` (`panel[column * rows + row]`) and replaces the contents
    /// of `out` by the output rows that are now complete, column-major with the returned row count as stride.
    ///
    /// # Panics
    /// If `panel` has not `rows` times the number of columns entries.
    pub fn push(&mut self, panel: &[f64], rows: usize, out: &mut Vec<f64>) -> usize {
        assert_eq!(panel.len(), rows * self.columns, "panel of {rows} rows and {} columns", self.columns);
        self.make_room(rows);
        let available = self.end - self.begin + rows;
        let produced = if available >= self.skip + self.length {
            (available - self.skip - self.length) / self.factor + 1
        } else {
            0
        };
        out.resize(produced * self.columns, 0.0);
        for column in 0..self.columns {
            let recent = &mut self.recent[column * self.stride..(column + 1) * self.stride];
            recent[self.end..self.end + rows].copy_from_slice(&panel[column * rows..(column + 1) * rows]);
            dispatch(
                self.level,
                Convolution {
                    taps: &self.taps,
                    signal: &recent[self.begin..self.end + rows + BLOCK],
                    first: self.skip,
                    factor: self.factor,
                    out: &mut out[column * produced..(column + 1) * produced],
                },
            );
        }
        // Where the next output's support begins, in the rows from `begin` on.
        let next = self.skip + produced * self.factor;
        let kept = available.saturating_sub(next).min(self.length - 1);
        self.end += rows;
        self.begin = self.end - kept;
        self.skip = next.saturating_sub(available - kept);
        self.outputs += produced as u64;
        produced
    }

    /// Room for further rows behind the recent ones: these move to the front of their columns only when it is used up,
    /// for a long filter has many of them.
    fn make_room(&mut self, rows: usize) {
        if self.end + rows + BLOCK <= self.stride {
            return;
        }
        let kept = self.end - self.begin;
        let needed = kept + rows + BLOCK;
        if needed > self.stride {
            let stride = (ROOM * self.length + rows + BLOCK).max(needed);
            let mut wider = vec![0.0; self.columns * stride];
            for column in 0..self.columns {
                let from = &self.recent[column * self.stride..][self.begin..self.end];
                wider[column * stride..][..kept].copy_from_slice(from);
            }
            (self.recent, self.stride) = (wider, stride);
        } else {
            for recent in self.recent.chunks_exact_mut(self.stride) {
                recent.copy_within(self.begin..self.end, 0);
            }
        }
        (self.begin, self.end) = (0, kept);
    }

    /// Ends the signal: forgets its last rows, so that the next [`push`](Self::push) starts a new one. Returns the
    /// output rows produced since the start.
    pub fn finish(&mut self) -> u64 {
        (self.begin, self.end, self.skip) = (0, 0, 0);
        core::mem::take(&mut self.outputs)
    }
}

struct Convolution<'a> {
    taps: &'a [f64],
    signal: &'a [f64],
    first: usize,
    factor: usize,
    out: &'a mut [f64],
}

impl Kernel for Convolution<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let taps = self.taps;
        // Four outputs at a time: each load of coefficients serves four, and four sums hide the latency.
        let mut chunks = self.out.chunks_exact_mut(4);
        let mut from = self.first;
        for out in &mut chunks {
            let row = |i: usize| self.signal[from + i * self.factor..][..taps.len()].chunks_exact(T::LANES);
            let mut sums = [T::ZERO; 4];
            for ((((tap, a), b), c), d) in taps.chunks_exact(T::LANES).zip(row(0)).zip(row(1)).zip(row(2)).zip(row(3)) {
                let tap = T::load(tap);
                sums[0] = T::load(a).mul_add(tap, sums[0]);
                sums[1] = T::load(b).mul_add(tap, sums[1]);
                sums[2] = T::load(c).mul_add(tap, sums[2]);
                sums[3] = T::load(d).mul_add(tap, sums[3]);
            }
            for i in 0..4 {
                out[i] = sums[i].sum();
            }
            from += 4 * self.factor;
        }
        for out in chunks.into_remainder() {
            let row = self.signal[from..][..taps.len()].chunks_exact(T::LANES);
            let mut sum = T::ZERO;
            for (tap, value) in taps.chunks_exact(T::LANES).zip(row) {
                sum = T::load(value).mul_add(T::load(tap), sum);
            }
            *out = sum.sum();
            from += self.factor;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(i: usize) -> f64 {
        (i as f64 * 0.037).sin() + 0.3 * (i as f64 * 0.9).cos()
    }

    #[test]
    fn output_rows_are_the_plain_convolution_however_the_input_is_cut() {
        let settings = DecimationSettings { factor: 7, ..DecimationSettings::default() };
        let taps = settings.taps(1000.0).unwrap();
        let n = 1203;
        let plain: Vec<f64> = (0..n)
            .map(|k| k * 7)
            .take_while(|from| from + taps.len() <= n)
            .map(|from| taps.iter().enumerate().map(|(j, tap)| tap * wave(from + j)).sum())
            .collect();
        for cut in [1_usize, 3, 64, 100, 1203] {
            let mut decimator = Decimator::new(&settings, 1000.0, 2).unwrap();
            let (mut first, mut second, mut out) = (Vec::new(), Vec::new(), Vec::new());
            let mut from = 0;
            while from < n {
                let rows = cut.min(n - from);
                let column: Vec<f64> = (from..from + rows).map(wave).collect();
                let panel: Vec<f64> = column.iter().copied().chain(column.iter().map(|x| 2.0 * x)).collect();
                let produced = decimator.push(&panel, rows, &mut out);
                first.extend_from_slice(&out[..produced]);
                second.extend_from_slice(&out[produced..]);
                from += rows;
            }
            assert_eq!(decimator.finish(), plain.len() as u64);
            assert_eq!((first.len(), second.len()), (plain.len(), plain.len()), "cut {cut}");
            for ((a, b), plain) in first.iter().zip(&second).zip(&plain) {
                // Sums of about 70 products of order one: rounding below 1e-14.
                assert!((a - plain).abs() < 1e-13 && (b - 2.0 * plain).abs() < 2e-13, "cut {cut}");
            }
        }
    }

    #[test]
    fn pass_band_ripple_and_stop_band_are_as_documented() {
        let rate = 1000.0;
        for (factor, db) in [(2, 60.0), (10, 60.0), (10, 90.0), (25, 40.0)] {
            let settings = DecimationSettings { factor, stop_band_db: db, ..DecimationSettings::default() };
            let taps = settings.taps(rate).unwrap();
            let reduced = rate / factor as f64;
            let gain = |f: f64| {
                let middle = (taps.len() / 2) as f64;
                taps.iter()
                    .enumerate()
                    .map(|(k, tap)| tap * (2.0 * PI * f / rate * (k as f64 - middle)).cos())
                    .sum::<f64>()
            };
            // The documented figures themselves.
            let ripple = 10_f64.powf(-db / 20.0);
            for i in 0..=100 {
                let share = f64::from(i) / 100.0;
                let pass = gain(0.2 * reduced * share);
                assert!((pass - 1.0).abs() < 4.0 * ripple, "factor {factor}, {db} dB: pass band {pass}");
                let stop = gain(0.6 * reduced + share * (0.5 * rate - 0.6 * reduced).max(0.0));
                assert!(stop.abs() < ripple, "factor {factor}, {db} dB: stop band {stop}");
            }
            assert!((gain(0.0) - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn bad_settings_are_refused() {
        for settings in [
            DecimationSettings { factor: 0, ..DecimationSettings::default() },
            DecimationSettings { cutoff_hz: Some(600.0), ..DecimationSettings::default() },
            DecimationSettings { cutoff_hz: Some(f64::NAN), ..DecimationSettings::default() },
            DecimationSettings { transition_hz: Some(1e-9), ..DecimationSettings::default() },
            DecimationSettings { stop_band_db: 500.0, ..DecimationSettings::default() },
        ] {
            assert!(settings.taps(1000.0).is_err(), "{settings:?}");
        }
    }
}
