//! A segmented factor as plain numbers, for files and for transfer between computers.

use super::segmented::{Segment, SegmentedFactor};
use super::triangular::{MAX_MAGNITUDE, TriangularFactor};
use super::{SegmentSettings, row_start};
use crate::error::{EstimationError, expect, require};
use serde::{Deserialize, Serialize};

/// Layout of the numbers of a [`SegmentedFactor`]: see [`SegmentedFactor::numbers`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactorShape {
    /// Number of regressor columns (without the torque).
    pub columns: usize,
    /// Maximum number of segments.
    pub max_segments: usize,
    /// Number of rows of a full segment.
    pub segment_length_rows: usize,
    /// The segments, in order of time.
    pub segments: Vec<SegmentShape>,
}

/// Layout of the numbers of one segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentShape {
    /// Number of rows `[W | τ]` in the segment.
    pub rows: usize,
    /// True for a triangle packed by rows; false for the unreduced rows, one after another.
    pub is_triangle: bool,
}

impl FactorShape {
    /// Number of stored values of all segments; `None` on overflow.
    pub fn count(&self) -> Option<usize> {
        let size = self.columns.checked_add(1)?;
        self.segments.iter().try_fold(0_usize, |sum, segment| sum.checked_add(segment.count(size)?))
    }
}

impl SegmentShape {
    /// Number of stored values of this segment with `size` columns including the torque.
    fn count(self, size: usize) -> Option<usize> {
        if self.is_triangle {
            size.checked_mul(size.checked_add(1)?).map(|twice| twice / 2)
        } else {
            self.rows.checked_mul(size)
        }
    }
}

impl SegmentedFactor {
    /// Layout of [`numbers`](Self::numbers).
    pub fn shape(&self) -> FactorShape {
        let columns = self.columns();
        let segment = |segment: &Segment| SegmentShape {
            rows: segment.rows(columns),
            is_triangle: matches!(segment, Segment::Factor(_)),
        };
        FactorShape {
            columns,
            max_segments: self.max_segments(),
            segment_length_rows: self.length_rows(),
            segments: self.segments().iter().map(segment).collect(),
        }
    }

    /// Complete content: for every segment in order of time the packed triangle of `[W | τ]`, or its rows if they are
    /// not yet reduced.
    ///
    /// ```
    /// use dynident_estimation::{SegmentSettings, SegmentedFactor};
    /// let mut log = SegmentedFactor::new(1, SegmentSettings { max_segments: 2, first_length_rows: 2 })?;
    /// log.absorb(&[1.0, 2.0, 3.0, 2.0, 4.0, 6.5], 3)?; // column w, then column τ
    /// let again = SegmentedFactor::from_numbers(&log.shape(), &log.numbers())?;
    /// assert_eq!(again.numbers(), log.numbers());
    /// # Ok::<(), dynident_estimation::EstimationError>(())
    /// ```
    pub fn numbers(&self) -> Vec<f64> {
        let of = |segment: &Segment| match segment {
            Segment::Rows(values) => values.clone(),
            Segment::Factor(factor) => factor.triangle().to_vec(),
        };
        self.segments().iter().flat_map(of).collect()
    }

    /// Restores the factor from its [`shape`](Self::shape) and [`numbers`](Self::numbers), bit-identically.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a wrong count of numbers or segments; [`EstimationError::Unusable`] for an
    /// invalid value; [`EstimationError::Setting`] as [`SegmentSettings::validate`].
    pub fn from_numbers(shape: &FactorShape, numbers: &[f64]) -> Result<Self, EstimationError> {
        let FactorShape { columns, max_segments, segment_length_rows, ref segments } = *shape;
        SegmentSettings { max_segments, first_length_rows: segment_length_rows }.validate()?;
        expect("number of values of a stored factor", shape.count().unwrap_or(usize::MAX), numbers.len())?;
        let size = columns + 1;
        if let Some(place) = numbers.iter().position(|value| value.is_nan() || value.abs() > MAX_MAGNITUDE) {
            return Err(EstimationError::Unusable {
                row: place / size,
                column: place % size,
                value: numbers[place],
                limit: MAX_MAGNITUDE,
            });
        }
        if segments.len() > max_segments {
            let what = "segments of a stored factor, at most".to_owned();
            return Err(EstimationError::Mismatch { what, expected: max_segments, found: segments.len() });
        }
        let mut rest = numbers;
        let mut restored = Vec::with_capacity(segments.len());
        for segment in segments {
            // The total count was checked above.
            let (own, later) = rest.split_at(segment.count(size).unwrap_or(rest.len()).min(rest.len()));
            rest = later;
            restored.push(if segment.is_triangle {
                Segment::Factor(triangular(columns, segment.rows, own)?)
            } else {
                Segment::Rows(own.to_vec())
            });
        }
        let rows = segments.iter().fold(0_usize, |sum, segment| sum.saturating_add(segment.rows));
        Ok(Self::of_segments(columns, rows, max_segments, segment_length_rows, restored))
    }

    /// The same rows in at most `most` segments: neighbours are merged pairwise. Values change by rounding only;
    /// error bars have fewer segments.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] if `most` is zero.
    pub fn with_at_most(&self, most: usize) -> Result<Self, EstimationError> {
        require(most > 0, "segments", most as f64, "use at least 1")?;
        let mut fewer = self.clone();
        while fewer.segments().len() > most {
            fewer.halve();
        }
        Ok(fewer)
    }
}

/// Creates a factor of `rows` rows from its packed triangle.
fn triangular(columns: usize, rows: usize, packed: &[f64]) -> Result<TriangularFactor, EstimationError> {
    let size = columns + 1;
    for row in 0..size {
        let diagonal = packed[row_start(size, row)];
        // The diagonal of a factor is never negative, so a negative entry means a corrupt file.
        require(diagonal >= 0.0, "diagonal of a stored factor", diagonal, "the file is corrupt: use an intact one")?;
    }
    Ok(TriangularFactor::of_triangle(columns, rows, packed.to_vec()))
}
