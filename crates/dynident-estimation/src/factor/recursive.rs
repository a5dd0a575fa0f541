//! A triangular factor that is updated with the few rows of one sample, for recursive estimation.
//!
//! `reflect.rs` reduces a block of hundreds of rows, with each SIMD register along the rows. A sample has one row per
//! joint only, so here each register lies along the columns. Reflector k, `v = (ν, a)` with the entries `a` of the
//! rows in column k, is applied to all columns from k on at once,
//!
//! ```text
//!     t_j = β (ν R_kj + Σ_m a_m A_mj),   R_kj −= ν t_j,   A_mj −= a_m t_j,
//! ```
//!
//! and rows whose first nonzero column comes later are skipped.

use super::reflect::{CHUNK_ROWS, Chunk, NEGLIGIBLE_SQUARE};
use super::triangular::{MAX_MAGNITUDE, TriangularFactor};
use crate::error::{EstimationError, require};
use dynident_lanes::{Kernel, Lane, Level, dispatch};

/// Rows reflected together, limited by the registers.
const GROUP_ROWS: usize = 8;

const REFLECTORS: usize = 2;

/// The upper triangular R of all rows `[W | τ]` so far; each sample adds one row per joint.
///
/// Equals a [`TriangularFactor`] up to rounding, but an update with one sample is cheap: at most 2·rows·(columns +
/// 1)² operations, fewer for rows whose first columns are zero, and no allocation.
///
/// ```
/// use dynident_estimation::RecursiveFactor;
/// // τ = 2 w on two joints; then an error of 3 where w = 0.
/// let mut factor = RecursiveFactor::new(1, &[0, 0]);
/// for [first, second] in [[1.0, 2.0], [2.0, 0.0]] {
///     for (row, w) in [first, second].into_iter().enumerate() {
///         factor.set(row, 0, w);
///         factor.set(row, 1, 2.0 * w);
///     }
///     factor.absorb()?;
/// }
/// factor.set(0, 1, 3.0);
/// factor.absorb()?;
/// let factor = factor.to_triangular();
/// assert_eq!(factor.rows(), 6);
/// assert!((factor.residual_sum_of_squares(&[2.0])? - 9.0).abs() < 1e-12);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug)]
#[doc(alias("recursive least squares", "square-root information", "srif"))]
pub struct RecursiveFactor {
    level: Level,
    columns: usize,
    samples: usize,
    /// Row k starts at the line that contains its diagonal. Entries before the diagonal are undefined.
    triangle: Vec<Chunk>,
    /// Rows of the current sample in groups that are reflected together. Lines of a group are consecutive; within a
    /// line, rows are sorted by their first column.
    lines: Vec<Line>,
    /// Sorted position of each row of a sample, and the first column of each row in sorted order.
    places: Vec<usize>,
    begins: Vec<usize>,
}

type Line = [Chunk; GROUP_ROWS];

impl RecursiveFactor {
    /// The factor without rows. Every sample has `begins.len()` rows; row m is zero in the columns before `begins[m]`.
    pub fn new(columns: usize, begins: &[usize]) -> Self {
        Self::with_level(columns, begins, Level::detect())
    }

    /// Like [`new`](Self::new), at a chosen processor level.
    pub fn with_level(columns: usize, begins: &[usize], level: Level) -> Self {
        let mut order: Vec<usize> = (0..begins.len()).collect();
        order.sort_by_key(|&row| begins[row]);
        let mut places = vec![0; begins.len()];
        for (place, &row) in order.iter().enumerate() {
            places[row] = place;
        }
        let count = line_count(columns);
        let begins: Vec<usize> = order.iter().map(|&row| begins[row]).collect();
        Self {
            level,
            columns,
            samples: 0,
            // Rounded up to whole reflector steps: the last row may be zero.
            triangle: vec![Chunk::ZERO; row_line((columns + 1).next_multiple_of(REFLECTORS), count)],
            lines: vec![[Chunk::ZERO; GROUP_ROWS]; begins.len().div_ceil(GROUP_ROWS) * count],
            places,
            begins,
        }
    }

    /// Number of regressor columns (without the torque).
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of samples absorbed so far.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Sets an entry of row `row` of the current sample; column [`columns()`](Self::columns) is the torque. Unset
    /// entries are zero; entries before the first column of the row are ignored.
    ///
    /// # Panics
    /// If the row or column is out of range.
    #[inline]
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        assert!(column <= self.columns, "column {column} of {}", self.columns);
        let place = self.places[row];
        let line = place / GROUP_ROWS * line_count(self.columns) + column / CHUNK_ROWS;
        self.lines[line][place % GROUP_ROWS].0[column % CHUNK_ROWS] = value;
    }

    /// Absorbs the current sample into the triangle, without allocation.
    ///
    /// # Errors
    /// [`EstimationError::Unusable`] for a NaN, an infinity or a magnitude above 1e140; the whole sample is dropped.
    pub fn absorb(&mut self) -> Result<(), EstimationError> {
        let count = line_count(self.columns);
        if let Some(bad) = dispatch(self.level, FindUnusable(&self.lines)) {
            let (group, line) = (bad / GROUP_ROWS / count, bad / GROUP_ROWS % count);
            let place = group * GROUP_ROWS + bad % GROUP_ROWS;
            let row = self.places.iter().position(|&at| at == place).unwrap_or(0);
            let chunk = self.lines[bad / GROUP_ROWS][bad % GROUP_ROWS].0;
            let within = chunk.iter().position(|value| value.is_nan() || value.abs() > MAX_MAGNITUDE).unwrap_or(0);
            self.lines.fill([Chunk::ZERO; GROUP_ROWS]);
            let column = line * CHUNK_ROWS + within;
            return Err(EstimationError::Unusable { row, column, value: chunk[within], limit: MAX_MAGNITUDE });
        }
        for (lines, begins) in self.lines.chunks_mut(count).zip(self.begins.chunks(GROUP_ROWS)) {
            dispatch(
                self.level,
                TriangleOnRows { triangle: &mut self.triangle, size: self.columns + 1, lines, begins },
            );
        }
        self.samples += 1;
        Ok(())
    }

    /// Entry (`row`, `column`) of R; column [`columns()`](Self::columns) is the torque. Zero below the diagonal.
    ///
    /// # Panics
    /// If either number is above [`columns()`](Self::columns).
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        assert!(row <= self.columns && column <= self.columns, "entry ({row}, {column}) of {} columns", self.columns);
        if column < row { 0.0 } else { self.at(row, column) }
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        let line = row_line(row, line_count(self.columns)) + column / CHUNK_ROWS - row / CHUNK_ROWS;
        self.triangle[line].0[column % CHUNK_ROWS]
    }

    /// Multiplies all rows so far by `weight`: `weight · R`, in place.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a weight that is negative, NaN or infinite.
    pub fn scale(&mut self, weight: f64) -> Result<(), EstimationError> {
        require(weight.is_finite() && weight >= 0.0, "weight", weight, "use a finite, nonnegative weight")?;
        for value in self.triangle.iter_mut().flat_map(|chunk| &mut chunk.0) {
            *value *= weight;
        }
        Ok(())
    }

    /// Writes the solution θ of `R_W θ = r` to `out`, with the triangle R_W of the regressor columns and the
    /// transformed torques r. Returns false if a diagonal entry of R_W is below 1e-12 of the largest, i.e. the rows do
    /// not determine θ; `out` is then incomplete. Does not allocate.
    ///
    /// # Panics
    /// If `out` does not have one entry per column.
    pub fn solve(&self, out: &mut [f64]) -> bool {
        assert_eq!(out.len(), self.columns, "one entry for each column");
        let count = line_count(self.columns);
        let largest = (0..self.columns).map(|k| self.at(k, k)).fold(0.0, f64::max);
        for row in (0..self.columns).rev() {
            let start = row_line(row, count);
            let (mut known, first) = (0.0, row / CHUNK_ROWS);
            for (line, chunk) in self.triangle[start..row_line(row + 1, count)].iter().enumerate() {
                let columns = (first + line) * CHUNK_ROWS..((first + line + 1) * CHUNK_ROWS).min(self.columns);
                for (column, entry) in columns.zip(&chunk.0) {
                    known += if column > row { entry * out[column] } else { 0.0 };
                }
            }
            let pivot = self.at(row, row);
            if pivot.is_nan() || pivot <= 1e-12 * largest {
                return false;
            }
            out[row] = (self.at(row, self.columns) - known) / pivot;
        }
        true
    }

    /// Converts to a [`TriangularFactor`]. Allocates.
    pub fn to_triangular(&self) -> TriangularFactor {
        TriangularFactor::from_entries(self.columns, self.samples * self.begins.len(), |row, column| {
            self.entry(row, column)
        })
    }

    /// The entries of R (including the torque column) row by row from the diagonal, for storage.
    pub fn entries(&self) -> Vec<f64> {
        (0..=self.columns)
            .flat_map(|row| (row..=self.columns).map(move |column| (row, column)))
            .map(|(row, column)| self.at(row, column))
            .collect()
    }

    /// Continues from stored [`entries`](Self::entries) of `samples` samples; the result is bit-identical.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] if the number of entries differs.
    pub fn restore(&mut self, entries: &[f64], samples: usize) -> Result<(), EstimationError> {
        let size = self.columns + 1;
        crate::error::expect("stored entries", size * (size + 1) / 2, entries.len())?;
        let mut entries = entries.iter();
        for row in 0..size {
            let start = row_line(row, line_count(self.columns)) - row / CHUNK_ROWS;
            for (column, entry) in (row..size).zip(entries.by_ref()) {
                self.triangle[start + column / CHUNK_ROWS].0[column % CHUNK_ROWS] = *entry;
            }
        }
        self.samples = samples;
        Ok(())
    }

    /// Replaces the content by the factor of rows before the first sample.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] if the numbers of columns differ.
    pub fn start_from(&mut self, factor: &TriangularFactor) -> Result<(), EstimationError> {
        crate::error::expect("columns of the start", self.columns, factor.columns())?;
        self.samples = 0;
        for row in 0..=self.columns {
            let start = row_line(row, line_count(self.columns)) - row / CHUNK_ROWS;
            for column in row..=self.columns {
                self.triangle[start + column / CHUNK_ROWS].0[column % CHUNK_ROWS] = factor.entry(row, column);
            }
        }
        Ok(())
    }
}

const fn line_count(columns: usize) -> usize {
    (columns + 1).div_ceil(CHUNK_ROWS)
}

/// First line of row `row`: eight rows have all `count` lines, the next eight one less.
const fn row_line(row: usize, count: usize) -> usize {
    let (whole, rest) = (row / CHUNK_ROWS, row % CHUNK_ROWS);
    CHUNK_ROWS * whole * count - CHUNK_ROWS / 2 * whole * whole.saturating_sub(1) + rest * (count - whole)
}

/// Index over all lines of the first chunk with a value that cannot be squared.
struct FindUnusable<'a>(&'a [Line]);

impl Kernel for FindUnusable<'_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn run<T: Lane>(self) -> Option<usize> {
        // The comparison is false for NaN; without an early exit the loop vectorises.
        let mut usable = true;
        for value in self.0.as_flattened().iter().flat_map(|chunk| &chunk.0) {
            usable &= value.abs() <= MAX_MAGNITUDE;
        }
        if usable {
            return None;
        }
        let bad = |value: &f64| value.is_nan() || value.abs() > MAX_MAGNITUDE;
        self.0.as_flattened().iter().position(|chunk| chunk.0.iter().any(bad))
    }
}

/// Reflects at most eight rows into the triangle and clears them for the next sample.
struct TriangleOnRows<'a> {
    triangle: &'a mut [Chunk],
    size: usize,
    lines: &'a mut [Line],
    begins: &'a [usize],
}

impl Kernel for TriangleOnRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { mut triangle, size, lines, begins } = self;
        let mut active = 0;
        for first in (0..size).step_by(REFLECTORS) {
            while active < begins.len() && begins[active] < first + REFLECTORS {
                active += 1;
            }
            let rest = &mut lines[first / CHUNK_ROWS..];
            let (above, later) = triangle.split_at_mut(rest.len() * REFLECTORS);
            triangle = later;
            let within = first % CHUNK_ROWS;
            match active {
                0 => {}
                1 => reflect::<T, 1>(above, rest, within),
                2 => reflect::<T, 2>(above, rest, within),
                3 => reflect::<T, 3>(above, rest, within),
                4 => reflect::<T, 4>(above, rest, within),
                5 => reflect::<T, 5>(above, rest, within),
                6 => reflect::<T, 6>(above, rest, within),
                7 => reflect::<T, 7>(above, rest, within),
                _ => reflect::<T, 8>(above, rest, within),
            }
        }
        lines.fill([Chunk::ZERO; GROUP_ROWS]);
    }
}

/// Applies two reflectors to two rows of the triangle and `M` rows: made from their own columns as scalars, then
/// applied to eight columns at a time, which stay in registers for both. Columns before the pivot in the first line
/// contain rounding of earlier reflectors. They are reflected too, which keeps them bounded, and never read.
#[inline(always)]
fn reflect<T: Lane, const M: usize>(triangle: &mut [Chunk], lines: &mut [Line], within: usize) {
    let count = lines.len();
    let (upper, lower) = triangle.split_at_mut(count);
    let (Some(first), Some(second), Some(line)) = (upper.first(), lower.first(), lines.first()) else { return };
    let (i, j) = (within % CHUNK_ROWS, (within + 1) % CHUNK_ROWS);
    let (mut a, mut b) = ([0.0; M], [0.0; M]);
    for m in 0..M {
        (a[m], b[m]) = (line[m].0[i], line[m].0[j]);
    }
    let (own, beside) = (Reflector::new(first.0[i], &a), first.0[j]);
    let amount = (own.nu * beside + product(&a, &b)) * own.beta;
    let beside = beside - own.nu * amount;
    for m in 0..M {
        b[m] -= a[m] * amount;
    }
    let other = Reflector::new(second.0[j], &b);
    let (a, b): ([T; M], [T; M]) = (wide(&a), wide(&b));
    let own_wide = [T::splat(own.nu), T::splat(own.beta)];
    let other_wide = [T::splat(other.nu), T::splat(other.beta)];
    for ((line, upper), lower) in lines.iter_mut().zip(upper.iter_mut()).zip(lower.iter_mut()) {
        for part in 0..CHUNK_ROWS / T::LANES {
            let at = part * T::LANES;
            let mut x = [T::ZERO; M];
            for m in 0..M {
                x[m] = T::load(&line[m].0[at..]);
            }
            apply(own_wide, &a, &mut upper.0[at..], &mut x);
            apply(other_wide, &b, &mut lower.0[at..], &mut x);
            for m in 0..M {
                x[m].store(&mut line[m].0[at..]);
            }
        }
    }
    upper[0].0[i] = own.norm;
    upper[0].0[j] = beside;
    lower[0].0[j] = other.norm;
}

/// `I - β v vᵀ` with `v = (ν, a)`, which maps `(old, a)` to `(norm, 0)`.
struct Reflector {
    nu: f64,
    beta: f64,
    norm: f64,
}

impl Reflector {
    #[inline(always)]
    fn new<const M: usize>(old: f64, a: &[f64; M]) -> Self {
        let square = product(a, a);
        if square < NEGLIGIBLE_SQUARE {
            return Self { nu: 0.0, beta: 0.0, norm: old };
        }
        // Runs in parallel with the root, which takes as long.
        let inverse = 1.0 / square;
        let norm = (old * old + square).sqrt();
        let sum = old + norm;
        // old - norm without cancellation, and β of at most 2/square: see `reflect.rs`.
        Self { nu: -square / sum, beta: sum / norm * inverse, norm }
    }
}

/// Applies a reflector to a row of the triangle and the rows in `x`.
#[inline(always)]
fn apply<T: Lane, const M: usize>(reflector: [T; 2], a: &[T; M], above: &mut [f64], x: &mut [T; M]) {
    let [nu, beta] = reflector;
    let r = T::load(above);
    // Two independent sums avoid a dependency chain.
    let mut sums = [r * nu, T::ZERO];
    for m in 0..M {
        sums[m % 2] = x[m].mul_add(a[m], sums[m % 2]);
    }
    let amount = (sums[0] + sums[1]) * beta;
    nu.neg_mul_add(amount, r).store(above);
    for m in 0..M {
        x[m] = a[m].neg_mul_add(amount, x[m]);
    }
}

#[inline(always)]
fn wide<T: Lane, const M: usize>(values: &[f64; M]) -> [T; M] {
    let mut wide = [T::ZERO; M];
    for m in 0..M {
        wide[m] = T::splat(values[m]);
    }
    wide
}

/// `aᵀ b` in four independent sums.
#[inline(always)]
fn product<const M: usize>(a: &[f64; M], b: &[f64; M]) -> f64 {
    let mut sums = [0.0; 4];
    for m in 0..M {
        sums[m % 4] += a[m] * b[m];
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}
