//! The parallel filter: a linear-phase low-pass for torque and all regressor columns, followed by decimation.

use crate::error::{FilterError, require};
use core::f64::consts::PI;
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Settings of a [`Decimator`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DecimationSettings {
    /// Decimation factor, 1 to 1000; 10 by default.
    pub factor: usize,
    /// Centre of the transition band (gain one half), Hz; by default 0.4 of the sample rate after decimation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutoff_hz: Option<f64>,
    /// Width of the transition band, Hz; by default 0.4 of the sample rate after decimation, so that the stop band
    /// starts at 0.6 of this rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition_hz: Option<f64>,
    /// Attenuation A in the stop band, 21 to 120 dB. The gain in the pass band (up to 0.2 of the reduced rate) differs
    /// from one by at most `4 · 10^(-A/20)`, which is 0.4 % at the default of 60. (The ripples of the two band edges
    /// add, and normalising the gain at zero frequency can double them.)
    pub stop_band_db: f64,
}

impl Default for DecimationSettings {
    fn default() -> Self {
        Self { factor: 10, cutoff_hz: None, transition_hz: None, stop_band_db: 60.0 }
    }
}

/// Maximum filter length, coefficients. Longer filters would have a narrower transition band than logs require.
const MAX_TAPS: usize = 20_001;

impl DecimationSettings {
    /// Filter coefficients at `rate_hz`: a sinc function with Kaiser's window, of odd length, symmetric, with unit gain
    /// at zero frequency.
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
        // Kaiser's formulas are accurate to about 1 dB; a margin of 2 dB guarantees the documented attenuation.
        let attenuation = self.stop_band_db + 2.0;
        let beta = if attenuation > 50.0 {
            0.1102 * (attenuation - 8.7)
        } else {
            0.5842 * (attenuation - 21.0).powf(0.4) + 0.07886 * (attenuation - 21.0)
        };
        let length = (attenuation - 7.95) / (2.285 * 2.0 * PI * transition / rate_hz) + 1.0;
        let fix = "give a wider transition: the filter would have more than 20001 coefficients";
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

/// Filters and decimates a stream of panels of columns, all with the same filter.
///
/// Only rows for which all samples of the filter are inside the signal are returned ("valid" convolution). Output row
/// `k` belongs to input row `k · factor + half_length` and has no delay. The result does not depend on how the input is
/// divided into panels.
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
    filter: Arc<Filter>,
    columns: usize,
    level: Level,
    /// Partial sums of the outputs that are not complete yet, by output and column; output `k` has the index `k` modulo
    /// their number.
    begun: Vec<Block>,
    /// Rows of the columns that are being processed.
    signal: Vec<Block>,
    /// Number of rows and of outputs of this signal so far.
    rows: usize,
    outputs: usize,
}

/// Number of partial sums per output: row `i` of the signal is added to sum `i` modulo this number. The order of
/// summation therefore depends neither on the number of processor lanes nor on how the input is divided.
const BLOCK: usize = 8;

/// Number of rows that are processed together. With eight columns, they and the coefficients fit into the first-level
/// cache.
const PIECE_ROWS: usize = 512;

/// One cache line of numbers.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Block([f64; BLOCK]);

impl Block {
    const ZERO: Self = Self([0.0; BLOCK]);
}

#[derive(Debug)]
struct Filter {
    /// The coefficients, shifted by 0, 1, .. and padded with zeros, for outputs whose first row has this position
    /// within a block.
    phases: [Vec<Block>; BLOCK],
    length: usize,
    factor: usize,
}

impl Decimator {
    /// Creates a decimator for panels of `columns` columns sampled at `rate_hz`.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn new(settings: &DecimationSettings, rate_hz: f64, columns: usize) -> Result<Self, FilterError> {
        let taps = settings.taps(rate_hz)?;
        let blocks = (taps.len() + BLOCK - 1).div_ceil(BLOCK);
        let phases = core::array::from_fn(|phase| {
            let mut shifted = vec![Block::ZERO; blocks];
            for (k, tap) in taps.iter().enumerate() {
                shifted[(phase + k) / BLOCK].0[(phase + k) % BLOCK] = *tap;
            }
            shifted
        });
        let filter = Arc::new(Filter { phases, length: taps.len(), factor: settings.factor });
        Ok(Self::of_filter(filter, columns))
    }

    /// The same filter for panels with another number of columns, at the start of a signal.
    #[must_use]
    pub fn with_columns(&self, columns: usize) -> Self {
        Self::of_filter(Arc::clone(&self.filter), columns)
    }

    fn of_filter(filter: Arc<Filter>, columns: usize) -> Self {
        let begun = vec![Block::ZERO; filter.length.div_ceil(filter.factor) * columns];
        Self { filter, columns, level: Level::detect(), begun, signal: Vec::new(), rows: 0, outputs: 0 }
    }

    /// Half-length of the filter in rows: the first output belongs to this input row.
    pub fn half_length(&self) -> usize {
        self.filter.length / 2
    }

    /// Number of coefficients.
    pub fn length(&self) -> usize {
        self.filter.length
    }

    /// Input row (since the start or the last [`finish`](Self::finish)) to which output row `index` belongs.
    pub fn input_row(&self, index: u64) -> u64 {
        index * self.filter.factor as u64 + self.half_length() as u64
    }

    /// Adds the next `rows` rows of the column-major `panel` (`panel[column * rows + row]`) and replaces the contents
    /// of `out` by the output rows that are now complete. They are column-major; the returned number of rows is the
    /// stride.
    ///
    /// # Panics
    /// If the length of `panel` is not `rows` times the number of columns.
    pub fn push(&mut self, panel: &[f64], rows: usize, out: &mut Vec<f64>) -> usize {
        assert_eq!(panel.len(), rows * self.columns, "panel of {rows} rows and {} columns", self.columns);
        let Filter { length, factor, .. } = *self.filter;
        let end = self.rows + rows;
        let complete = if end >= length { (end - length) / factor + 1 } else { 0 };
        let (before, produced) = (self.outputs, complete - self.outputs);
        out.resize(produced * self.columns, 0.0);
        for from in (0..rows).step_by(PIECE_ROWS) {
            let taken = PIECE_ROWS.min(rows - from);
            dispatch(
                self.level,
                Convolution {
                    filter: &self.filter,
                    columns: self.columns,
                    panel,
                    stride: rows,
                    piece: from..from + taken,
                    first_row: self.rows,
                    outputs: self.outputs,
                    begun: &mut self.begun,
                    signal: &mut self.signal,
                    out: Complete { values: out, stride: produced, before },
                },
            );
            self.rows += taken;
            self.outputs = if self.rows >= length { (self.rows - length) / factor + 1 } else { 0 };
        }
        produced
    }

    /// Ends the signal; the next [`push`](Self::push) starts a new one. Returns the number of output rows since the
    /// start of the signal.
    pub fn finish(&mut self) -> u64 {
        self.rows = 0;
        core::mem::take(&mut self.outputs) as u64
    }
}

/// Destination of complete outputs, column by column, from output `before` on.
struct Complete<'a> {
    values: &'a mut [f64],
    stride: usize,
    before: usize,
}

/// Adds rows to all outputs that contain them. Each row is read only once, while it is in the cache.
struct Convolution<'a> {
    filter: &'a Filter,
    columns: usize,
    panel: &'a [f64],
    /// Number of rows of the panel, their range that is being processed, and the number of the first of them in the
    /// signal.
    stride: usize,
    piece: core::ops::Range<usize>,
    first_row: usize,
    /// Number of outputs that were complete before this panel.
    outputs: usize,
    begun: &'a mut [Block],
    signal: &'a mut Vec<Block>,
    out: Complete<'a>,
}

impl Kernel for Convolution<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(mut self) {
        let mut column = 0;
        while column < self.columns {
            // Coefficients that were loaded once are used for all columns of a group, and the sums of several columns
            // hide the latency.
            column += match self.columns - column {
                8.. => self.group::<T, 8>(column),
                4.. => self.group::<T, 4>(column),
                2.. => self.group::<T, 2>(column),
                _ => self.group::<T, 1>(column),
            };
        }
    }
}

impl Convolution<'_> {
    /// Processes the columns `column .. column + N`, and returns their number.
    #[inline(always)]
    fn group<T: Lane, const N: usize>(&mut self, column: usize) -> usize {
        let Filter { length, factor, .. } = *self.filter;
        let (begin, end) = (self.first_row, self.first_row + self.piece.len());
        let first_block = begin / BLOCK;
        // In the first and the last block, rows outside of this range are zero.
        let blocks = end.div_ceil(BLOCK) - first_block;
        self.signal.resize(blocks * N, Block::ZERO);
        for n in 0..N {
            let rows = &self.panel[(column + n) * self.stride..][self.piece.clone()];
            self.signal[n] = Block::ZERO;
            self.signal[(blocks - 1) * N + n] = Block::ZERO;
            let (head, rest) = rows.split_at((BLOCK - begin % BLOCK).min(rows.len()));
            self.signal[n].0[begin % BLOCK..][..head.len()].copy_from_slice(head);
            let (whole, last) = rest.as_chunks::<BLOCK>();
            for (to, from) in self.signal.iter_mut().skip(N + n).step_by(N).zip(whole) {
                to.0 = *from;
            }
            if !last.is_empty() {
                self.signal[(blocks - 1) * N + n].0[..last.len()].copy_from_slice(last);
            }
        }
        let places = self.begun.len() / self.columns;
        for output in self.outputs..end.div_ceil(factor) {
            let support = output * factor;
            let (phase, base) = (support % BLOCK, support / BLOCK);
            let taps = &self.filter.phases[phase][..];
            let from = base.max(first_block);
            let to = (base + taps.len()).min(first_block + blocks);
            let taps = &taps[from - base..to.max(from) - base];
            let signal = &self.signal[(from - first_block) * N..];
            let sums = &mut self.begun[(output % places) * self.columns + column..][..N];
            if support >= begin {
                sums.fill(Block::ZERO);
            }
            for part in 0..BLOCK / T::LANES {
                let at = part * T::LANES;
                let mut sum = [T::ZERO; N];
                for n in 0..N {
                    sum[n] = T::load(&sums[n].0[at..]);
                }
                for (tap, rows) in taps.iter().zip(signal.chunks_exact(N)) {
                    let tap = T::load(&tap.0[at..]);
                    for n in 0..N {
                        sum[n] = T::load(&rows[n].0[at..]).mul_add(tap, sum[n]);
                    }
                }
                for n in 0..N {
                    sum[n].store(&mut sums[n].0[at..]);
                }
            }
            if support + length <= end {
                for (n, sum) in sums.iter().enumerate() {
                    let Complete { values, stride, before } = &mut self.out;
                    values[(column + n) * *stride + output - *before] = sum.0.iter().sum();
                }
            }
        }
        N
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(i: usize) -> f64 {
        (i as f64 * 0.037).sin() + 0.3 * (i as f64 * 0.9).cos()
    }

    #[test]
    fn output_rows_are_the_plain_convolution_for_any_partition() {
        let settings = DecimationSettings { factor: 7, ..DecimationSettings::default() };
        let taps = settings.taps(1000.0).unwrap();
        let n = 1203;
        let plain: Vec<f64> = (0..n)
            .map(|k| k * 7)
            .take_while(|from| from + taps.len() <= n)
            .map(|from| taps.iter().enumerate().map(|(j, tap)| tap * wave(from + j)).sum())
            .collect();
        let mut bits: Option<Vec<u64>> = None;
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
            // Bit-identical for all partitions.
            let own: Vec<u64> = first.iter().map(|value| value.to_bits()).collect();
            assert_eq!(*bits.get_or_insert_with(|| own.clone()), own, "cut {cut}");
        }
    }

    #[test]
    fn columns_and_signals_are_independent_for_any_factor() {
        // Factors around the block length of eight, one longer than the filter and one without decimation; 15 columns
        // form groups of every width.
        for (factor, settings) in [1, 4, 8, 9, 40].into_iter().flat_map(|factor| {
            let narrow = DecimationSettings { factor, cutoff_hz: Some(100.0), ..DecimationSettings::default() };
            let wide = DecimationSettings { transition_hz: Some(200.0), ..narrow.clone() };
            [(factor, narrow), (factor, wide)]
        }) {
            let (taps, columns, rows) = (settings.taps(1000.0).unwrap(), 15, 700);
            let value = |column: usize, row: usize| (column + 1) as f64 * wave(row + 17 * column);
            let mut decimator = Decimator::new(&settings, 1000.0, 1).unwrap().with_columns(columns);
            let mut out = Vec::new();
            // An interrupted signal does not change the next one.
            decimator.push(&vec![1e6; 13 * columns], 13, &mut out);
            decimator.finish();
            let mut found = vec![Vec::new(); columns];
            for range in [0..333, 333..rows] {
                let panel: Vec<f64> = (0..columns).flat_map(|c| range.clone().map(move |row| value(c, row))).collect();
                let produced = decimator.push(&panel, range.len(), &mut out);
                for (found, column) in found.iter_mut().zip(out.chunks(produced.max(1))) {
                    found.extend_from_slice(&column[..produced]);
                }
            }
            for (column, found) in found.iter().enumerate() {
                let plain: Vec<f64> = (0..rows)
                    .step_by(factor)
                    .take_while(|from| from + taps.len() <= rows)
                    .map(|from| taps.iter().enumerate().map(|(j, tap)| tap * value(column, from + j)).sum())
                    .collect();
                assert_eq!(found.len(), plain.len());
                for (found, plain) in found.iter().zip(&plain) {
                    // Sums of at most some hundred products of order 15.
                    assert!((found - plain).abs() < 1e-11, "factor {factor}, column {column}");
                }
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
