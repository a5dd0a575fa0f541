//! Triangular factor of rows `[W | τ]`, sufficient for linear estimation.

use super::reflect::{CHUNK_ROWS, Chunk, TriangleOnPanel, heights, row_start};
use super::sparse_map::SparseMap;
use crate::error::{EstimationError, expect, require};
use dynident_lanes::{Level, dispatch};
use nalgebra::{DMatrix, DVector};

/// Rows absorbed at once. A block of 256 rows and 44 columns (a seven-joint arm) is 90 kB: it fits into the
/// second-level cache, and the few active columns into the first. Measured 15 % faster than 128 rows, because half as
/// many reflectors are made.
pub const BLOCK_ROWS: usize = 256;

/// The largest magnitude that can be squared and summed without overflow.
pub(crate) const MAX_MAGNITUDE: f64 = 1.0e140;

/// The upper triangular R of `[W | τ] = Q·R` (a square-root information array): `RᵀR = [W | τ]ᵀ[W | τ]`, with
/// regressor W and torque τ.
///
/// ```text
///     R = [ R_W  r ]    R_Wᵀ R_W = WᵀW,  R_Wᵀ r = Wᵀτ,
///         [  0   ρ ]    ‖τ − Wθ‖² = ‖r − R_W θ‖² + ρ²  for every θ
/// ```
///
/// Rows come in blocks and are not stored; factors of blocks, logs and robots can be [merged](Self::merge). The
/// diagonal is nonnegative, so the factor is unique (up to rounding) if the columns are independent. With fewer rows
/// than columns or dependent columns the identities above still apply and no entry is NaN; the rank decision comes
/// later, on scaled columns with an explicit tolerance (`rank.rs`), never from this diagonal.
///
/// Golub and Van Loan, Matrix Computations, 4th ed., 5.2 and 6.5; Bierman, Factorization Methods for Discrete
/// Sequential Estimation (1977), ch. IV and V.
///
/// ```
/// use dynident_estimation::TriangularFactor;
/// // τ = 2 w on three rows, then an error of 3 in a fourth row where w = 0.
/// let mut factor = TriangularFactor::new(1);
/// factor.absorb(&[1.0, 2.0, 2.0, 2.0, 4.0, 4.0], 3)?; // column w, then column τ
/// factor.absorb(&[0.0, 3.0], 1)?;
/// assert_eq!(factor.rows(), 4);
/// assert!((factor.residual_sum_of_squares(&[2.0])? - 9.0).abs() < 1e-12);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[doc(alias("qr", "square-root information", "srif"))]
pub struct TriangularFactor {
    columns: usize,
    rows: usize,
    /// Packed by rows; the size is columns + 1.
    triangle: Vec<f64>,
}

/// Memory for a block of rows; keep one per thread for [`TriangularFactor::absorb_with`].
#[derive(Clone, Debug)]
pub struct FactorWorkspace {
    level: Level,
    panel: Vec<Chunk>,
    heights: Vec<usize>,
}

impl Default for FactorWorkspace {
    fn default() -> Self {
        Self::new(Level::detect())
    }
}

impl FactorWorkspace {
    /// Creates a workspace for the given processor level; [`Default`] uses the best one.
    pub fn new(level: Level) -> Self {
        Self { level, panel: Vec::new(), heights: Vec::new() }
    }

    /// Memory for a block, with undefined content.
    fn block(&mut self, rows: usize, columns: usize) -> &mut [Chunk] {
        let length = rows.div_ceil(CHUNK_ROWS) * columns;
        if self.panel.len() < length {
            self.panel.resize(length, Chunk::ZERO);
        }
        &mut self.panel[..length]
    }
}

impl TriangularFactor {
    /// Creates a factor without rows for `columns` regressor columns and the torque.
    pub fn new(columns: usize) -> Self {
        Self { columns, rows: 0, triangle: vec![0.0; row_start(columns + 1, columns + 1)] }
    }

    /// The factor of given rows: `panel` column by column (all rows of column 0 first; torque last).
    ///
    /// # Errors
    /// Same as for [`absorb`](Self::absorb).
    pub fn from_rows(columns: usize, panel: &[f64], rows: usize) -> Result<Self, EstimationError> {
        let mut factor = Self::new(columns);
        factor.absorb(panel, rows)?;
        Ok(factor)
    }

    pub(super) fn of_triangle(columns: usize, rows: usize, triangle: Vec<f64>) -> Self {
        Self { columns, rows, triangle }
    }

    pub(super) fn triangle(&self) -> &[f64] {
        &self.triangle
    }

    pub(crate) fn from_entries(columns: usize, rows: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let triangle = (0..=columns).flat_map(|row| (row..=columns).map(move |column| (row, column)));
        Self { columns, rows, triangle: triangle.map(|(row, column)| entry(row, column)).collect() }
    }

    /// Number of regressor columns (without the torque).
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// N, the number of rows absorbed so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Entry (`row`, `column`) of R; column [`columns()`](Self::columns) is the torque. Zero below the diagonal.
    ///
    /// # Panics
    /// If either number is above [`columns()`](Self::columns).
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        let size = self.columns + 1;
        assert!(row < size && column < size, "entry ({row}, {column}) of a factor of size {size}");
        if column < row { 0.0 } else { self.triangle[row_start(size, row) + column - row] }
    }

    /// Entries of row `row` of R from its diagonal to the torque.
    pub(crate) fn row(&self, row: usize) -> &[f64] {
        let size = self.columns + 1;
        &self.triangle[row_start(size, row)..row_start(size, row + 1)]
    }

    /// Absorbs `rows` rows of `[W | τ]` given column by column: `panel[c * rows + i]` is column c of row i, torque
    /// last.
    ///
    /// Takes about 2·rows·(columns + 1)² operations, in blocks of [`BLOCK_ROWS`]. The order of rows and their division
    /// into calls change the result by rounding only.
    ///
    /// # Errors
    /// [`EstimationError::Shape`] for a panel of the wrong length; [`EstimationError::Unusable`] for a NaN, an
    /// infinity or a magnitude above 1e140. The factor is then unchanged.
    pub fn absorb(&mut self, panel: &[f64], rows: usize) -> Result<(), EstimationError> {
        self.absorb_with(&mut FactorWorkspace::default(), panel, rows)
    }

    /// Like [`absorb`](Self::absorb), without allocation once the workspace is large enough.
    ///
    /// # Errors
    /// Same as for [`absorb`](Self::absorb).
    pub fn absorb_with(
        &mut self,
        workspace: &mut FactorWorkspace,
        panel: &[f64],
        rows: usize,
    ) -> Result<(), EstimationError> {
        check_panel(self.columns, panel, rows)?;
        self.absorb_range(workspace, panel, rows, 0..rows);
        Ok(())
    }

    /// Absorbs a range of rows of a panel that has passed [`check_panel`].
    pub(crate) fn absorb_range(
        &mut self,
        workspace: &mut FactorWorkspace,
        panel: &[f64],
        stride: usize,
        range: core::ops::Range<usize>,
    ) {
        let mut start = range.start;
        while start < range.end {
            let end = (start + BLOCK_ROWS).min(range.end);
            let block = workspace.block(end - start, self.columns + 1);
            for (column, out) in
                panel.chunks_exact(stride).zip(block.chunks_exact_mut((end - start).div_ceil(CHUNK_ROWS)))
            {
                let (whole, rest) = column[start..end].as_chunks::<CHUNK_ROWS>();
                for (values, chunk) in whole.iter().zip(&mut *out) {
                    chunk.0 = *values;
                }
                if let Some(chunk) = out.get_mut(whole.len()) {
                    chunk.0 = [0.0; CHUNK_ROWS];
                    chunk.0[..rest.len()].copy_from_slice(rest);
                }
            }
            self.reflect(workspace, end - start);
            start = end;
        }
        self.rows += range.len();
    }

    /// Absorbs one block given by its entries at (row, column). The caller updates the number of rows.
    pub(crate) fn absorb_entries(
        &mut self,
        workspace: &mut FactorWorkspace,
        rows: usize,
        entry: impl Fn(usize, usize) -> f64,
    ) {
        let chunks = rows.div_ceil(CHUNK_ROWS);
        let block = workspace.block(rows, self.columns + 1);
        block.fill(Chunk::ZERO);
        for column in 0..=self.columns {
            for row in 0..rows {
                block[column * chunks + row / CHUNK_ROWS].0[row % CHUNK_ROWS] = entry(row, column);
            }
        }
        self.reflect(workspace, rows);
    }

    /// Absorbs the first `rows` rows of `other` times `weight`: column `column` here is column `place(column)` of
    /// `other`, zero for `None`. The caller updates the number of rows.
    pub(crate) fn absorb_columns(
        &mut self,
        workspace: &mut FactorWorkspace,
        other: &Self,
        rows: usize,
        weight: f64,
        place: impl Fn(usize) -> Option<usize>,
    ) {
        let (chunks, size) = (rows.div_ceil(CHUNK_ROWS), other.columns + 1);
        let block = workspace.block(rows, self.columns + 1);
        block.fill(Chunk::ZERO);
        for (column, out) in block.chunks_exact_mut(chunks.max(1)).enumerate() {
            let Some(local) = place(column) else { continue };
            // Offset to the next row of a packed triangle.
            let mut at = local;
            for row in 0..rows.min(local + 1) {
                out[row / CHUNK_ROWS].0[row % CHUNK_ROWS] = weight * other.triangle[at];
                at += size - row - 1;
            }
        }
        self.reflect(workspace, rows);
    }

    pub(crate) fn count(&mut self, rows: usize) {
        self.rows += rows;
    }

    fn reflect(&mut self, workspace: &mut FactorWorkspace, rows: usize) {
        let (size, chunks) = (self.columns + 1, rows.div_ceil(CHUNK_ROWS));
        if chunks == 0 {
            return;
        }
        let FactorWorkspace { level, panel, heights: own } = workspace;
        let panel = &mut panel[..size * chunks];
        heights(panel, chunks, own);
        dispatch(*level, TriangleOnPanel { triangle: &mut self.triangle, size, panel, chunks, heights: own });
    }

    /// Adds the rows of `other`.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] if the numbers of columns differ.
    pub fn merge(&mut self, other: &Self) -> Result<(), EstimationError> {
        expect("columns of merged factors", self.columns, other.columns)?;
        self.absorb_factor(&mut FactorWorkspace::default(), other);
        Ok(())
    }

    /// [`merge`](Self::merge) without the check of columns, and without allocation once the workspace is large enough.
    pub(crate) fn absorb_factor(&mut self, workspace: &mut FactorWorkspace, other: &Self) {
        if self.rows == 0 {
            self.clone_from(other);
        } else if other.rows > 0 {
            self.absorb_columns(workspace, other, other.filled_rows(), 1.0, Some);
            self.rows += other.rows;
        }
    }

    /// Absorbs rows given one after another, `columns + 1` numbers each.
    pub(crate) fn absorb_row_by_row(&mut self, workspace: &mut FactorWorkspace, values: &[f64]) {
        let size = self.columns + 1;
        let rows = values.len() / size;
        let chunks = rows.div_ceil(CHUNK_ROWS);
        let block = workspace.block(rows, size);
        for (c, rows) in values.chunks(CHUNK_ROWS * size).enumerate() {
            for column in 0..size {
                let chunk = &mut block[column * chunks + c];
                *chunk = Chunk::ZERO;
                for (place, value) in chunk.0.iter_mut().zip(rows[column..].iter().step_by(size)) {
                    *place = *value;
                }
            }
        }
        self.reflect(workspace, rows);
        self.rows += rows;
    }

    /// The factor of the same rows multiplied by `weight`: `weight · R`.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a weight that is negative, NaN or infinite.
    pub fn scaled(&self, weight: f64) -> Result<Self, EstimationError> {
        check_weight(weight)?;
        let mut scaled = self.clone();
        for value in &mut scaled.triangle {
            *value *= weight;
        }
        Ok(scaled)
    }

    /// The factor of the same rows with the first `columns` columns. Its torque is the weighted sum of the remaining
    /// columns: several torques of one motion need only one pass over its rows.
    ///
    /// ```
    /// use dynident_estimation::TriangularFactor;
    /// // One column w = 1, 2, 2 and two torques, of which the second is taken twice.
    /// let both = TriangularFactor::from_rows(2, &[1.0, 2.0, 2.0, 0.0, 3.0, 1.0, 2.0, 4.0, 7.0], 3)?;
    /// let second = both.with_torque(1, &[0.0, 2.0])?;
    /// assert!((second.residual_sum_of_squares(&[4.0])? - 36.0).abs() < 1e-12);
    /// # Ok::<(), dynident_estimation::EstimationError>(())
    /// ```
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] unless there is one weight per remaining column, and at least one;
    /// [`EstimationError::Setting`] for a weight that is not finite.
    pub fn with_torque(&self, columns: usize, weights: &[f64]) -> Result<Self, EstimationError> {
        let given = columns.saturating_add(weights.len());
        expect("kept columns plus weights of the remaining ones", self.columns + 1, given)?;
        expect("kept columns, at most", self.columns.min(columns), columns)?;
        for &weight in weights {
            require(weight.is_finite(), "weight of a torque", weight, "use a finite number")?;
        }
        let torque = |row: usize| {
            let behind = self.row(row).iter().rev().zip(weights.iter().rev());
            behind.map(|(entry, weight)| entry * weight).sum::<f64>()
        };
        // The rows below the kept columns contribute to the torque only.
        let below = (columns..=self.columns).map(|row| torque(row).powi(2)).sum::<f64>().sqrt();
        let mut triangle = Vec::with_capacity(row_start(columns + 1, columns + 1));
        for row in 0..columns {
            triangle.extend_from_slice(&self.row(row)[..columns - row]);
            triangle.push(torque(row));
        }
        triangle.push(below);
        Ok(Self { columns, rows: self.rows, triangle })
    }

    /// `‖τ − Wθ‖²` over all rows absorbed.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a wrong number of parameters.
    pub fn residual_sum_of_squares(&self, theta: &[f64]) -> Result<f64, EstimationError> {
        expect("parameters of a factor", self.columns, theta.len())?;
        let rho = self.entry(self.columns, self.columns);
        Ok(self.residual(theta).norm_squared() + rho * rho)
    }

    /// `r − R_W θ`.
    pub(crate) fn residual(&self, theta: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.columns, |row, _| {
            let start = row_start(self.columns + 1, row);
            let entries = &self.triangle[start..start + self.columns - row];
            let predicted: f64 = entries.iter().zip(&theta[row..]).map(|(a, b)| a * b).sum();
            self.triangle[start + self.columns - row] - predicted
        })
    }

    /// `Wᵀ(τ − Wθ)`, from R alone.
    pub(crate) fn score(&self, theta: &[f64]) -> DVector<f64> {
        let residual = self.residual(theta);
        let mut score = DVector::zeros(self.columns);
        for row in 0..self.columns {
            for column in row..self.columns {
                score[column] += self.entry(row, column) * residual[row];
            }
        }
        score
    }

    /// The factor of the same rows with only the given columns, in the given order.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a column out of range.
    pub fn selected(&self, columns: &[usize]) -> Result<Self, EstimationError> {
        check_columns(columns, self.columns)?;
        let mut selected = Self::new(columns.len());
        let place = |column: usize| Some(columns.get(column).copied().unwrap_or(self.columns));
        selected.absorb_columns(&mut FactorWorkspace::default(), self, self.filled_rows(), 1.0, place);
        selected.rows = self.rows;
        Ok(selected)
    }

    pub(super) fn mapped(&self, workspace: &mut FactorWorkspace, map: &SparseMap) -> Self {
        let (rows, size) = (self.filled_rows(), self.columns + 1);
        let mut mapped = Self::new(map.columns());
        let chunks = rows.div_ceil(CHUNK_ROWS);
        let block = workspace.block(rows, mapped.columns + 1);
        block.fill(Chunk::ZERO);
        for (out, entries) in block.chunks_exact_mut(chunks.max(1)).zip(map.of_columns()) {
            for &(from, weight) in entries {
                // Offset to the next row of a packed triangle.
                let mut at = from;
                for row in 0..rows.min(from + 1) {
                    out[row / CHUNK_ROWS].0[row % CHUNK_ROWS] += weight * self.triangle[at];
                    at += size - row - 1;
                }
            }
        }
        mapped.reflect(workspace, rows);
        mapped.rows = self.rows;
        mapped
    }

    /// The norm of every column of W over all rows.
    pub fn column_norms(&self) -> Vec<f64> {
        (0..self.columns).map(|c| (0..=c).map(|r| self.entry(r, c).powi(2)).sum::<f64>().sqrt()).collect()
    }

    /// `‖τ‖` over all rows.
    pub fn torque_norm(&self) -> f64 {
        (0..=self.columns).map(|r| self.entry(r, self.columns).powi(2)).sum::<f64>().sqrt()
    }

    /// `R_W`, (columns, columns).
    pub fn regressor_triangle(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.columns, self.columns, |r, c| self.entry(r, c))
    }

    /// `r = Qᵀτ` in the rows of `R_W`.
    pub fn rotated_torque(&self) -> DVector<f64> {
        DVector::from_fn(self.columns, |r, _| self.entry(r, self.columns))
    }

    /// Number of leading rows that are not zero; less than the size if few rows were absorbed.
    pub(super) fn filled_rows(&self) -> usize {
        let size = self.columns + 1;
        (0..size)
            .rev()
            .find(|&r| self.triangle[row_start(size, r)..row_start(size, r + 1)].iter().any(|&x| x != 0.0))
            .map_or(0, |r| r + 1)
    }
}

pub(crate) fn check_weight(weight: f64) -> Result<(), EstimationError> {
    require(weight.is_finite() && weight >= 0.0, "weight", weight, "use a finite, nonnegative weight")
}

pub(crate) fn check_columns(columns: &[usize], size: usize) -> Result<(), EstimationError> {
    match columns.iter().find(|&&column| column >= size) {
        Some(&found) => Err(EstimationError::Mismatch {
            what: "selected column, below the number of columns".into(),
            expected: size,
            found,
        }),
        None => Ok(()),
    }
}

/// Checks the length and values of a panel with `columns` + 1 columns of `rows` rows.
pub(crate) fn check_panel(columns: usize, panel: &[f64], rows: usize) -> Result<(), EstimationError> {
    let expected = rows.saturating_mul(columns + 1);
    if panel.len() != expected {
        return Err(EstimationError::Shape { what: "a panel of rows", expected, found: panel.len() });
    }
    // The comparison is false for NaN; without an early exit the loop vectorises.
    let usable = panel.iter().fold(true, |usable, value| usable & (value.abs() <= MAX_MAGNITUDE));
    if usable {
        return Ok(());
    }
    let place = panel.iter().position(|value| value.is_nan() || value.abs() > MAX_MAGNITUDE).unwrap_or(0);
    Err(EstimationError::Unusable {
        row: place % rows,
        column: place / rows,
        value: panel[place],
        limit: MAX_MAGNITUDE,
    })
}
