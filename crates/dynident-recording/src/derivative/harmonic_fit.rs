//! Least-squares fit of a straight line and harmonics.

use crate::error::{FilterError, require};
use core::f64::consts::TAU;

const BLOCK_ROWS: usize = 512;
/// Minimum ratio of a pivot to the norm of its column. Below it the column is treated as linearly dependent; only six
/// digits of the fit would remain.
const MIN_PIVOT_RATIO: f64 = 1e-10;

/// `x(t) = c + d s + Σ_k a_k sin(2π k f t) + b_k cos(2π k f t)`, k = 1 .. K, with the time s scaled to ±1 over the
/// samples.
///
/// The straight line represents the aperiodic part of the motion. Without it, different values at the two ends would
/// change all harmonics.
#[derive(Clone, Debug)]
pub(crate) struct HarmonicFit {
    base_hz: f64,
    rate_hz: f64,
    /// Centre and half of the length of the sampled interval, in samples.
    middle: f64,
    half: f64,
    harmonics: usize,
    trend: bool,
    coefficients: Vec<f64>,
}

impl HarmonicFit {
    /// Fits uniformly sampled values by Householder reduction of blocks of rows.
    ///
    /// # Errors
    /// If the samples do not distinguish the harmonics, or the highest one is not below half the rate.
    pub(crate) fn new(
        method: &'static str,
        base_hz: f64,
        harmonics: usize,
        trend: bool,
        rate_hz: f64,
        signal: &[f64],
    ) -> Result<Self, FilterError> {
        let highest = base_hz * harmonics as f64;
        if highest.partial_cmp(&(0.5 * rate_hz)) != Some(core::cmp::Ordering::Less) {
            return Err(FilterError::AboveNyquist { cutoff_hz: highest, rate_hz });
        }
        let half = 0.5 * (signal.len() as f64 - 1.0).max(1.0);
        let mut fit = Self { base_hz, rate_hz, middle: half, half, harmonics, trend, coefficients: Vec::new() };
        let columns = fit.columns();
        // Values are relative to the first sample, so that rounding errors scale with the motion.
        let origin = signal.first().copied().unwrap_or(0.0);
        let mut triangle = Triangle::new(columns + 1);
        let mut row = vec![0.0; columns + 1];
        for (i, x) in signal.iter().enumerate() {
            fit.row(i, &mut row[..columns]);
            row[columns] = x - origin;
            triangle.push(&row);
        }
        fit.coefficients = triangle.solution().ok_or(FilterError::Undetermined {
            method,
            samples: signal.len(),
            fix: "the piece is too short for harmonics of this base frequency: raise base_hz, lower harmonics, or disable the trend",
        })?;
        fit.coefficients[0] += origin;
        Ok(fit)
    }

    fn columns(&self) -> usize {
        1 + usize::from(self.trend) + 2 * self.harmonics
    }

    fn row(&self, sample: usize, row: &mut [f64]) {
        row[0] = 1.0;
        if self.trend {
            row[1] = (sample as f64 - self.middle) / self.half;
        }
        let first = 1 + usize::from(self.trend);
        for (k, pair) in row[first..].chunks_exact_mut(2).enumerate() {
            let (sin, cos) = self.phase(k + 1, sample).sin_cos();
            (pair[0], pair[1]) = (sin, cos);
        }
    }

    fn phase(&self, harmonic: usize, sample: usize) -> f64 {
        // Whole turns are removed before the multiplication by 2π, so that the argument stays small in a long log.
        TAU * (harmonic as f64 * self.base_hz * sample as f64 / self.rate_hz).fract()
    }

    /// Value, first and second derivative of the series at a sample.
    pub(crate) fn at(&self, sample: usize) -> [f64; 3] {
        let first = 1 + usize::from(self.trend);
        let mut value = [self.coefficients[0], 0.0, 0.0];
        if self.trend {
            let slope = self.coefficients[1] / self.half;
            value[0] += slope * (sample as f64 - self.middle);
            value[1] += slope * self.rate_hz;
        }
        for (k, pair) in self.coefficients[first..].chunks_exact(2).enumerate() {
            let omega = TAU * self.base_hz * (k + 1) as f64;
            let (sin, cos) = self.phase(k + 1, sample).sin_cos();
            let (x, dx) = (pair[0] * sin + pair[1] * cos, pair[0] * cos - pair[1] * sin);
            value[0] += x;
            value[1] += omega * dx;
            value[2] -= omega * omega * x;
        }
        value
    }
}

/// Checks the settings of the Fourier fits.
///
/// # Errors
/// A base frequency that is not positive, or harmonics that are not 1 to 200.
pub(crate) fn check_series(base_hz: f64, harmonics: usize) -> Result<(), FilterError> {
    let fix = "give the trajectory's base frequency, positive, in Hz";
    require(base_hz.is_finite() && base_hz > 0.0, "base_hz", base_hz, fix)?;
    require((1..=200).contains(&harmonics), "harmonics", harmonics as f64, "give 1 to 200")
}

/// Triangular factor of a tall matrix whose rows are added one after another; the last column is the right-hand side.
/// Source: Golub and Van Loan, Matrix Computations, 5.1 and 5.2.
struct Triangle {
    width: usize,
    rows: Vec<Vec<f64>>,
    squares: Vec<f64>,
}

impl Triangle {
    fn new(width: usize) -> Self {
        Self { width, rows: Vec::new(), squares: vec![0.0; width] }
    }

    fn push(&mut self, row: &[f64]) {
        self.rows.push(row.to_vec());
        self.squares.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x);
        if self.rows.len() >= self.width + BLOCK_ROWS {
            self.reduce();
        }
    }

    fn reduce(&mut self) {
        let (rows, width) = (&mut self.rows, self.width);
        for k in 0..width.min(rows.len()) {
            let norm = rows[k..].iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
            if norm == 0.0 {
                continue;
            }
            let pivot = if rows[k][k] > 0.0 { -norm } else { norm };
            let head = rows[k][k] - pivot;
            // Reflector (1, v): v = rows[k+1..][k] / head, factor -head/pivot.
            let factor = -head / pivot;
            let mut sums = rows[k].clone();
            for row in &rows[k + 1..] {
                let v = row[k] / head;
                if v != 0.0 {
                    sums[k + 1..].iter_mut().zip(&row[k + 1..]).for_each(|(sum, x)| *sum += v * x);
                }
            }
            rows[k][k] = pivot;
            for j in k + 1..width {
                rows[k][j] -= factor * sums[j];
            }
            for row in &mut rows[k + 1..] {
                let v = factor * row[k] / head;
                row[k] = 0.0;
                if v != 0.0 {
                    row[k + 1..].iter_mut().zip(&sums[k + 1..]).for_each(|(x, sum)| *x -= v * sum);
                }
            }
        }
        rows.truncate(width);
    }

    /// The least-squares solution; `None` if a column depends linearly on the previous ones.
    fn solution(mut self) -> Option<Vec<f64>> {
        self.reduce();
        let columns = self.width - 1;
        if self.rows.len() < columns {
            return None;
        }
        let mut solution = vec![0.0; columns];
        for k in (0..columns).rev() {
            let row = &self.rows[k];
            let pivot = row[k];
            if pivot.abs().partial_cmp(&(MIN_PIVOT_RATIO * self.squares[k].sqrt()))
                != Some(core::cmp::Ordering::Greater)
            {
                return None;
            }
            let rest: f64 = (k + 1..columns).map(|j| row[j] * solution[j]).sum();
            solution[k] = (row[columns] - rest) / pivot;
        }
        Some(solution)
    }
}
