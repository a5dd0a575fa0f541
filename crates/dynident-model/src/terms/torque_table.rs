//! A torque measured at several positions, with smooth interpolation: the characteristic of a spring.
//!
//! The curve is piecewise cubic with slopes by Fritsch and Butland: weighted harmonic mean of the adjacent slopes,
//! zero at a peak. It is monotone where the points are monotone and has no overshoot between two equal points. Its
//! first derivative is continuous. Beyond the ends the torque is constant, so that a design or a simulation can go
//! beyond the range. A log beyond the range is rejected ([`TorqueTerm::undefined`](super::TorqueTerm::undefined)).
//! Source: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, with three-point slopes at the ends as in
//! SciPy's `PchipInterpolator`.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Maximum number of points. Each piece between two points becomes several lines of an exported program.
const MAX_POINTS: usize = 200;
/// Largest magnitude of a position or torque.
const MAX_VALUE: f64 = 1e9;

/// Torque as a function of position, interpolated between points.
///
/// ```
/// use dynident_model::terms::TorqueTable;
/// let table = TorqueTable::new(vec![[-1.0, 0.0], [0.0, 2.0], [1.0, 4.0]])?;
/// assert_eq!([table.value(0.5), table.slope(0.5)], [3.0, 2.0]);
/// assert_eq!([table.value(7.0), table.slope(7.0)], [4.0, 0.0]);
/// # Ok::<(), dynident_model::terms::TorqueTableError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(with = "Vec<[f64; 2]>"))]
#[serde(try_from = "Vec<[f64; 2]>", into = "Vec<[f64; 2]>")]
pub struct TorqueTable {
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
}

/// Error of a torque table.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum TorqueTableError {
    /// `table` or `table_file` of a `[[torque]]` has too few or too many points. Add points, or thin out a long table.
    #[error("{found} points: give 2 to {MAX_POINTS}")]
    Points { found: usize },
    /// A position or torque of the table is NaN, infinite or too large. Correct it, and check its unit.
    #[error("point {number}: {value}: give numbers of at most {MAX_VALUE:e} in size")]
    Number { number: usize, value: f64 },
    /// The positions of the table must increase. Sort the points, and delete a position that appears twice.
    #[error("point {number}: position {position} after {before}: sort the points by position, each once")]
    Order { number: usize, position: f64, before: f64 },
}

/// One cubic polynomial: `torque + b t + c t² + d t³` with `t` from zero to `width`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TablePiece {
    /// Start position, rad or m.
    pub from: f64,
    /// Length, rad or m.
    pub width: f64,
    /// Torque at the start.
    pub torque: f64,
    /// Coefficients `b`, `c`, `d`.
    pub factors: [f64; 3],
}

impl TorqueTable {
    /// Creates the curve through points of position (rad, m) and torque.
    ///
    /// # Errors
    /// Fewer than 2 or more than 200 points, numbers that are not finite or above 1e9, positions that do not ascend.
    pub fn new(points: Vec<[f64; 2]>) -> Result<Self, TorqueTableError> {
        if !(2..=MAX_POINTS).contains(&points.len()) {
            return Err(TorqueTableError::Points { found: points.len() });
        }
        for (place, point) in points.iter().enumerate() {
            if let Some(&value) = point.iter().find(|value| value.is_nan() || value.abs() > MAX_VALUE) {
                return Err(TorqueTableError::Number { number: place + 1, value });
            }
            let before = place.checked_sub(1).map_or(f64::NEG_INFINITY, |before| points[before][0]);
            // The width of each piece is a divisor.
            if point[0] - before < 1e-9 {
                return Err(TorqueTableError::Order { number: place + 1, position: point[0], before });
            }
        }
        let slopes = slopes(&points);
        Ok(Self { points, slopes })
    }

    /// The points.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// First and last position, rad or m.
    pub fn range(&self) -> [f64; 2] {
        [self.points[0][0], self.points[self.points.len() - 1][0]]
    }

    /// Cubic pieces between neighbouring points.
    pub fn pieces(&self) -> impl Iterator<Item = TablePiece> + '_ {
        (0..self.points.len() - 1).map(|place| self.piece(place))
    }

    fn piece(&self, place: usize) -> TablePiece {
        let ([from, torque], [to, next]) = (self.points[place], self.points[place + 1]);
        let (width, begin, end) = (to - from, self.slopes[place], self.slopes[place + 1]);
        let mean = (next - torque) / width;
        let factors = [begin, (3.0 * mean - 2.0 * begin - end) / width, (begin + end - 2.0 * mean) / (width * width)];
        TablePiece { from, width, torque, factors }
    }

    /// Torque at position `q`.
    pub fn value(&self, q: f64) -> f64 {
        let [first, last] = self.range();
        if q >= last {
            return self.points[self.points.len() - 1][1];
        }
        let piece = self.piece(self.place(q));
        let (t, [b, c, d]) = (q.max(first) - piece.from, piece.factors);
        piece.torque + t * (b + t * (c + t * d))
    }

    /// Derivative with respect to position; zero beyond the ends.
    pub fn slope(&self, q: f64) -> f64 {
        let [first, last] = self.range();
        if !(first..=last).contains(&q) {
            return 0.0;
        }
        let piece = self.piece(self.place(q));
        let (t, [b, c, d]) = (q - piece.from, piece.factors);
        b + t * (2.0 * c + t * 3.0 * d)
    }

    /// Index of the piece that contains a position.
    fn place(&self, q: f64) -> usize {
        self.points.partition_point(|point| point[0] <= q).clamp(1, self.points.len() - 1) - 1
    }
}

fn slopes(points: &[[f64; 2]]) -> Vec<f64> {
    let count = points.len();
    let width: Vec<f64> = points.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let mean: Vec<f64> = points.windows(2).zip(&width).map(|(pair, width)| (pair[1][1] - pair[0][1]) / width).collect();
    if count == 2 {
        return vec![mean[0]; 2];
    }
    // Slope of the parabola through three points, if it has the sign of the first secant.
    let at_end = |h: [f64; 2], m: [f64; 2]| {
        let slope = ((2.0 * h[0] + h[1]) * m[0] - h[0] * m[1]) / (h[0] + h[1]);
        if slope * m[0] <= 0.0 {
            0.0
        } else if m[0] * m[1] <= 0.0 && slope.abs() > 3.0 * m[0].abs() {
            3.0 * m[0]
        } else {
            slope
        }
    };
    let inside = |k: usize| {
        let (before, after) = (mean[k - 1], mean[k]);
        if before * after <= 0.0 {
            return 0.0;
        }
        let (w1, w2) = (2.0 * width[k] + width[k - 1], width[k] + 2.0 * width[k - 1]);
        (w1 + w2) / (w1 / before + w2 / after)
    };
    let last = count - 2;
    let mut slopes = vec![at_end([width[0], width[1]], [mean[0], mean[1]])];
    slopes.extend((1..count - 1).map(inside));
    slopes.push(at_end([width[last], width[last - 1]], [mean[last], mean[last - 1]]));
    slopes
}

impl TryFrom<Vec<[f64; 2]>> for TorqueTable {
    type Error = TorqueTableError;

    fn try_from(points: Vec<[f64; 2]>) -> Result<Self, TorqueTableError> {
        Self::new(points)
    }
}

impl From<TorqueTable> for Vec<[f64; 2]> {
    fn from(table: TorqueTable) -> Self {
        table.points
    }
}
