//! The rows of one joint in one log as at most K factors of consecutive time segments.

use super::sparse_map::SparseMap;
use super::triangular::{FactorWorkspace, TriangularFactor, check_columns, check_panel};
use crate::error::{EstimationError, expect, require};
use core::ops::Range;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// Division of a log into segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SegmentSettings {
    /// Maximum number of segments; it bounds the memory. Default 64: enough for a covariance from segments, and in
    /// any usable log the segments are longer than the correlation time of the residuals.
    pub max_segments: usize,
    /// Initial length of a segment, in rows; doubled whenever the log exceeds `max_segments`. Default 16. A multiple
    /// of [`BLOCK_ROWS`](crate::factor::BLOCK_ROWS) is faster for long logs.
    pub first_length_rows: usize,
}

impl Default for SegmentSettings {
    fn default() -> Self {
        Self { max_segments: 64, first_length_rows: 16 }
    }
}

impl SegmentSettings {
    /// Default number of segments with an initial length that fits a log of `rows` rows: no merging, fastest.
    pub fn for_rows(rows: usize) -> Self {
        let settings = Self::default();
        let mut first_length_rows = settings.first_length_rows;
        while first_length_rows.saturating_mul(settings.max_segments) < rows {
            first_length_rows *= 2;
        }
        Self { first_length_rows, ..settings }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for fewer than two segments or a length of zero.
    pub fn validate(&self) -> Result<(), EstimationError> {
        require(self.max_segments >= 2, "max_segments", self.max_segments as f64, "use at least 2")?;
        require(self.first_length_rows > 0, "first_length_rows", 0.0, "use at least 1")
    }
}

/// Maximum number of unreduced rows of a segment. One large block is reduced faster than several small ones. The rows
/// need six times the memory of the factor.
const fn most_rows(columns: usize) -> usize {
    3 * (columns + 1)
}

/// One segment: its rows as long as there are few, then their factor.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Segment {
    /// By rows, columns + 1 numbers each.
    Rows(Vec<f64>),
    Factor(TriangularFactor),
}

/// A [`TriangularFactor`] kept as consecutive time segments of equal length (the last may be shorter).
///
/// When a log exceeds the maximum number of segments, neighbours are merged and the length doubles, so memory is
/// bounded for a log of any length. Clusters, jackknife and block bootstrap use these factors without a second pass
/// over the data. The result depends only on the rows and settings, and by rounding on how rows are split into calls.
///
/// ```
/// use dynident_estimation::{SegmentSettings, SegmentedFactor};
/// let settings = SegmentSettings { max_segments: 4, first_length_rows: 2 };
/// let mut log = SegmentedFactor::new(1, settings)?;
/// for k in 0..20 {
///     log.absorb(&[1.0, f64::from(k)], 1)?; // one row: w = 1, τ = k
/// }
/// assert_eq!(log.segment_rows(), [8, 8, 4]);
/// assert_eq!(log.total().rows(), 20);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SegmentedFactor {
    columns: usize,
    max_segments: usize,
    length_rows: usize,
    rows: usize,
    segments: Vec<Segment>,
    /// The factor of all rows, computed on first use.
    total: OnceLock<TriangularFactor>,
    workspace: FactorWorkspace,
}

impl SegmentedFactor {
    /// Creates a factor without rows for `columns` regressor columns and the torque.
    ///
    /// # Errors
    /// Same as for [`SegmentSettings::validate`].
    pub fn new(columns: usize, settings: SegmentSettings) -> Result<Self, EstimationError> {
        settings.validate()?;
        Ok(Self {
            columns,
            max_segments: settings.max_segments,
            length_rows: settings.first_length_rows,
            rows: 0,
            segments: Vec::new(),
            total: OnceLock::new(),
            workspace: FactorWorkspace::default(),
        })
    }

    /// One segment from a factor: fast, and sufficient for values without a covariance.
    pub fn of_factor(factor: TriangularFactor) -> Self {
        let (columns, rows) = (factor.columns(), factor.rows());
        let (total, workspace) = (OnceLock::from(factor.clone()), FactorWorkspace::default());
        let segments = vec![Segment::Factor(factor)];
        Self { columns, max_segments: 2, length_rows: rows.max(1), rows, segments, total, workspace }
    }

    pub(super) fn of_segments(
        columns: usize,
        rows: usize,
        max_segments: usize,
        length_rows: usize,
        segments: Vec<Segment>,
    ) -> Self {
        let (total, workspace) = (OnceLock::new(), FactorWorkspace::default());
        Self { columns, max_segments, length_rows, rows, segments, total, workspace }
    }

    pub(super) fn segments(&self) -> &[Segment] {
        &self.segments
    }

    pub(super) fn max_segments(&self) -> usize {
        self.max_segments
    }

    pub(super) fn length_rows(&self) -> usize {
        self.length_rows
    }

    /// Number of regressor columns (without the torque).
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows absorbed so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of rows in every segment, in order of time.
    pub fn segment_rows(&self) -> Vec<usize> {
        self.segments.iter().map(|segment| segment.rows(self.columns)).collect()
    }

    /// Absorbs the next `rows` rows of the log in order of time, given column by column as in
    /// [`TriangularFactor::absorb`].
    ///
    /// # Errors
    /// Same as for [`TriangularFactor::absorb`]; on error nothing is absorbed.
    pub fn absorb(&mut self, panel: &[f64], rows: usize) -> Result<(), EstimationError> {
        check_panel(self.columns, panel, rows)?;
        self.total = OnceLock::new();
        let mut start = 0;
        while start < rows {
            let room = self.length_rows - self.segments.last().map_or(self.length_rows, |last| last.rows(self.columns));
            if room == 0 {
                if self.segments.len() == self.max_segments {
                    self.halve();
                } else {
                    self.segments.push(Segment::Rows(Vec::new()));
                }
                continue;
            }
            let end = rows.min(start + room);
            if let Some(last) = self.segments.last_mut() {
                last.absorb(self.columns, &mut self.workspace, panel, rows, start..end);
            }
            start = end;
        }
        self.rows += rows;
        Ok(())
    }

    /// Merges neighbouring segments and doubles the length.
    pub(super) fn halve(&mut self) {
        let mut merged = Vec::with_capacity(self.max_segments);
        let mut old = std::mem::take(&mut self.segments).into_iter();
        while let Some(mut first) = old.next() {
            if let Some(second) = old.next() {
                first.append(self.columns, &mut self.workspace, &second);
            }
            merged.push(first);
        }
        self.segments = merged;
        self.length_rows *= 2;
    }

    /// The same rows and segments with only the given columns, in the given order: a smaller model without a second
    /// pass over the log.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a column out of range.
    pub fn selected(&self, columns: &[usize]) -> Result<Self, EstimationError> {
        check_columns(columns, self.columns)?;
        let segment = |segment: &Segment| match segment {
            Segment::Factor(factor) => factor.selected(columns).map(Segment::Factor),
            Segment::Rows(values) => {
                let rows = values.chunks_exact(self.columns + 1);
                let places = || columns.iter().copied().chain([self.columns]);
                Ok(Segment::Rows(rows.flat_map(|row| places().map(|place| row[place])).collect()))
            }
        };
        let segments = self.segments.iter().map(segment).collect::<Result<_, _>>()?;
        let total = OnceLock::from(self.total().selected(columns)?);
        Ok(Self { columns: columns.len(), segments, total, workspace: FactorWorkspace::default(), ..*self })
    }

    /// The factor of every segment, in order of time.
    pub fn segment_factors(&self) -> Vec<TriangularFactor> {
        let mut workspace = FactorWorkspace::default();
        self.segments.iter().map(|segment| segment.factor(self.columns, &mut workspace)).collect()
    }

    /// Equivalent rows of every segment, in order of time: the rows themselves if there are at most as many as
    /// columns, else the nonzero rows of their factor.
    pub(crate) fn reduced_segments(&self) -> Vec<ReducedRows> {
        let mut workspace = FactorWorkspace::default();
        self.segments.iter().map(|segment| segment.reduced(self.columns, &mut workspace)).collect()
    }

    /// The factor of all rows, computed once. A [selection](Self::selected) or a [map](Self::mapped) derives its total
    /// from this one.
    pub fn total(&self) -> &TriangularFactor {
        self.total.get_or_init(|| {
            let mut workspace = FactorWorkspace::default();
            let mut total = Segment::Rows(Vec::new());
            for segment in &self.segments {
                total.append(self.columns, &mut workspace, segment);
            }
            total.factor(self.columns, &mut workspace)
        })
    }

    /// The rows `[W | τ] C` in the same segments. C has shape (columns + 1, new columns + 1); its last column gives
    /// the torque. Use this, without a second pass over the log, for a payload with combined columns, to subtract a
    /// known part of the torque, or to change the unit of a joint.
    ///
    /// ```
    /// use dynident_estimation::{SegmentSettings, SegmentedFactor};
    /// use nalgebra::DMatrix;
    /// let mut log = SegmentedFactor::new(1, SegmentSettings::default())?;
    /// log.absorb(&[1.0, 2.0, 5.0, 9.0], 2)?; // w = 1, 2 and τ = 5, 9
    /// // One column 2 w; torque τ - w = 4, 7.
    /// let other = log.mapped(&DMatrix::from_row_slice(2, 2, &[2.0, -1.0, 0.0, 1.0]))?;
    /// assert!((other.total().residual_sum_of_squares(&[1.5])? - 2.0).abs() < 1e-12);
    /// # Ok::<(), dynident_estimation::EstimationError>(())
    /// ```
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] unless C has one row per column plus the torque and at least one column;
    /// [`EstimationError::Setting`] for an entry that is not finite.
    pub fn mapped(&self, map: &DMatrix<f64>) -> Result<Self, EstimationError> {
        expect("rows of a map of columns", self.columns + 1, map.nrows())?;
        if map.ncols() == 0 {
            return Err(EstimationError::Mismatch {
                what: "columns of a map of columns".into(),
                expected: 1,
                found: 0,
            });
        }
        if let Some(&value) = map.iter().find(|value| !value.is_finite()) {
            return Err(EstimationError::Setting { setting: "map of columns", value, fix: "use finite numbers" });
        }
        let (columns, map) = (map.ncols() - 1, SparseMap::new(map));
        let mut workspace = FactorWorkspace::default();
        let segments = self.segments.iter().map(|segment| segment.mapped(&mut workspace, &map)).collect();
        let total = OnceLock::from(self.total().mapped(&mut workspace, &map));
        Ok(Self { columns, segments, total, workspace, ..*self })
    }

    /// The same rows as one segment: sufficient for values without a covariance, and fast for repeated solutions.
    #[must_use]
    pub fn as_one_segment(&self) -> Self {
        Self { max_segments: self.max_segments, ..Self::of_factor(self.total().clone()) }
    }

    /// The same columns and settings without rows, for another pass over the same log.
    pub(crate) fn emptied(&self) -> Self {
        let (total, workspace) = (OnceLock::new(), FactorWorkspace::default());
        Self { rows: 0, segments: Vec::new(), total, workspace, ..*self }
    }

    /// The factor of the rows `[W | τ] C` for every matrix C of `blocks`, shape (columns + 1, new columns + 1), all
    /// blocks stacked. Segments stay the same in time; their numbers of rows are multiplied by the number of blocks.
    pub(crate) fn transformed(&self, blocks: &[DMatrix<f64>]) -> Self {
        let size = self.columns + 1;
        let columns = blocks.first().map_or(0, |block| block.ncols().saturating_sub(1));
        let mut workspace = FactorWorkspace::default();
        let segments = self.segments.iter().map(|segment| {
            let old = segment.factor(self.columns, &mut workspace);
            let triangle = DMatrix::from_fn(size, size, |row, column| old.entry(row, column));
            let mut new = TriangularFactor::new(columns);
            for block in blocks {
                let rows = &triangle * block;
                new.absorb_entries(&mut workspace, size, |row, column| rows[(row, column)]);
            }
            new.count(old.rows() * blocks.len());
            Segment::Factor(new)
        });
        let segments = segments.collect();
        Self {
            columns,
            max_segments: self.max_segments,
            length_rows: self.length_rows * blocks.len().max(1),
            rows: self.rows * blocks.len(),
            segments,
            total: OnceLock::new(),
            workspace: FactorWorkspace::default(),
        }
    }

    /// `Wᵀ(τ − Wθ)` of every segment, in order of time, for covariances with correlated errors.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a wrong number of parameters.
    pub fn scores(&self, theta: &[f64]) -> Result<Vec<DVector<f64>>, EstimationError> {
        if theta.len() != self.columns {
            let what = "parameters of a factor".into();
            return Err(EstimationError::Mismatch { what, expected: self.columns, found: theta.len() });
        }
        let score = |segment: &Segment| match segment {
            Segment::Factor(factor) => factor.score(theta),
            Segment::Rows(values) => {
                let mut score = DVector::zeros(self.columns);
                for row in values.chunks_exact(self.columns + 1) {
                    let predicted: f64 = row.iter().zip(theta).map(|(w, t)| w * t).sum();
                    let residual = row[self.columns] - predicted;
                    for (sum, w) in score.iter_mut().zip(row) {
                        *sum += w * residual;
                    }
                }
                score
            }
        };
        Ok(self.segments.iter().map(score).collect())
    }
}

/// A few rows `[W | τ]` that are equivalent to those of a segment.
pub(crate) struct ReducedRows {
    /// W, shape (rows, columns).
    pub(crate) regressor: DMatrix<f64>,
    pub(crate) torque: DVector<f64>,
}

impl Segment {
    pub(super) fn rows(&self, columns: usize) -> usize {
        match self {
            Self::Rows(values) => values.len() / (columns + 1),
            Self::Factor(factor) => factor.rows(),
        }
    }

    fn absorb(
        &mut self,
        columns: usize,
        workspace: &mut FactorWorkspace,
        panel: &[f64],
        stride: usize,
        range: Range<usize>,
    ) {
        if self.rows(columns) + range.len() > most_rows(columns) {
            self.condense(columns, workspace);
        }
        match self {
            Self::Factor(factor) => factor.absorb_range(workspace, panel, stride, range),
            Self::Rows(values) => {
                let (size, start) = (columns + 1, values.len());
                values.resize(start + range.len() * size, 0.0);
                for (c, column) in panel.chunks_exact(stride).enumerate() {
                    for (value, place) in column[range.clone()].iter().zip(values[start + c..].iter_mut().step_by(size))
                    {
                        *place = *value;
                    }
                }
            }
        }
    }

    fn append(&mut self, columns: usize, workspace: &mut FactorWorkspace, next: &Self) {
        if let (Self::Rows(values), Self::Rows(more)) = (&mut *self, next) {
            values.extend_from_slice(more);
            if self.rows(columns) > most_rows(columns) {
                self.condense(columns, workspace);
            }
            return;
        }
        self.condense(columns, workspace);
        if let Self::Factor(factor) = self {
            match next {
                Self::Rows(more) => factor.absorb_row_by_row(workspace, more),
                Self::Factor(other) => factor.absorb_factor(workspace, other),
            }
        }
    }

    fn condense(&mut self, columns: usize, workspace: &mut FactorWorkspace) {
        if let Self::Rows(_) = self {
            *self = Self::Factor(self.factor(columns, workspace));
        }
    }

    fn mapped(&self, workspace: &mut FactorWorkspace, map: &SparseMap) -> Self {
        match self {
            Self::Factor(factor) => Self::Factor(factor.mapped(workspace, map)),
            Self::Rows(values) => {
                let rows: Vec<f64> = values.chunks_exact(map.size()).flat_map(|row| map.of_row(row)).collect();
                let mut mapped = Self::Rows(rows);
                if mapped.rows(map.columns()) > most_rows(map.columns()) {
                    mapped.condense(map.columns(), workspace);
                }
                mapped
            }
        }
    }

    fn reduced(&self, columns: usize, workspace: &mut FactorWorkspace) -> ReducedRows {
        match self {
            Self::Rows(values) if self.rows(columns) <= columns => {
                let (rows, size) = (self.rows(columns), columns + 1);
                let regressor = DMatrix::from_fn(rows, columns, |row, column| values[row * size + column]);
                ReducedRows { regressor, torque: DVector::from_fn(rows, |row, _| values[row * size + columns]) }
            }
            Self::Rows(_) => Self::Factor(self.factor(columns, workspace)).reduced(columns, workspace),
            Self::Factor(factor) => {
                // The last row has no regressor.
                let rows = factor.filled_rows().min(columns);
                let regressor = DMatrix::from_fn(rows, columns, |row, column| factor.entry(row, column));
                ReducedRows { regressor, torque: DVector::from_fn(rows, |row, _| factor.entry(row, columns)) }
            }
        }
    }

    fn factor(&self, columns: usize, workspace: &mut FactorWorkspace) -> TriangularFactor {
        match self {
            Self::Factor(factor) => factor.clone(),
            Self::Rows(values) => {
                let mut factor = TriangularFactor::new(columns);
                factor.absorb_row_by_row(workspace, values);
                factor
            }
        }
    }
}
