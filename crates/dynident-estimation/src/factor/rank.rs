//! Rank decision on scaled columns with an explicit tolerance, and the solution for the excited columns.

use super::triangular::{FactorWorkspace, TriangularFactor};
use super::unexcited::{Unexcited, answer_of_free};
use crate::error::{EstimationError, within};
use dynident_dynamics::independent_columns;
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Criteria for an excited column.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RankSettings {
    /// A column is dependent if the part that no earlier column explains is at most this share of its norm. Default
    /// 1e-8: far above rounding (about 1e-13 after scaling) and far below the share of a parameter that the motion
    /// excites.
    pub tolerance: f64,
    /// A column is treated as zero if its norm is at most this share of the largest column norm. Default 1e-12: only
    /// rounding noise is that small; the norms of columns with different units differ much less.
    pub negligible_column: f64,
}

impl Default for RankSettings {
    fn default() -> Self {
        Self { tolerance: 1.0e-8, negligible_column: 1.0e-12 }
    }
}

impl RankSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] unless both shares are at least 1e-14 (rounding) and below 1.
    pub fn validate(&self) -> Result<(), EstimationError> {
        for (setting, value) in [("rank.tolerance", self.tolerance), ("rank.negligible_column", self.negligible_column)]
        {
            within(setting, value, 1.0e-14..1.0, "use a share from 1e-14 to below 1")?;
        }
        Ok(())
    }
}

/// A column that is not estimated, because the data do not distinguish it from earlier columns.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FixedColumn {
    /// Index of the column.
    pub column: usize,
    /// Name of the column.
    pub name: String,
    /// The value at which it was fixed.
    pub value: f64,
    /// True if the column differs from a combination of other columns only by noise of the motion; false if it is
    /// exactly such a combination or zero.
    pub noise: bool,
    /// Sensitivity of the value of every column to the value of this column, `∂θ/∂value`. An estimate with a nonzero
    /// sensitivity is correct only if the fixed value is correct. Zero for columns that do not depend on it.
    #[serde(skip)]
    pub answers: Vec<f64>,
}

/// Rank decisions, and the figures on which they are based.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankReport {
    /// Number of estimated columns.
    pub rank: usize,
    /// Number of all columns.
    pub columns: usize,
    /// Columns that these data do not excite, and the values at which they were fixed.
    pub fixed: Vec<FixedColumn>,
    /// Singular values of all columns after division by their norms (a negligible column by the largest norm),
    /// descending.
    pub singular_values: Vec<f64>,
    /// Number of singular values above `tolerance` times the largest: a cross-check of `rank`.
    pub numerical_rank: usize,
    /// Tolerance of the settings.
    pub tolerance: f64,
    /// Smallest independent share among the columns that were accepted as independent.
    pub weakest_independent: f64,
    /// Largest independent share among the columns that were rejected as dependent (0 without dependent columns).
    pub strongest_dependent: f64,
    /// Ratio of the largest to the smallest singular value of the estimated columns, unscaled; depends on units.
    pub condition_number_raw: f64,
    /// Condition number after each column was divided by its norm.
    pub condition_number_scaled: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Split {
    pub(crate) free: Vec<usize>,
    fixed: Vec<usize>,
    /// Fixed columns that differ from the others only by noise.
    noise: Vec<usize>,
    /// Fixed columns with noise only: no other column depends on them.
    silent: Vec<usize>,
    weakest_independent: f64,
    strongest_dependent: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Solution {
    /// One value per column, including fixed ones.
    pub(crate) values: Vec<f64>,
    /// `R⁻¹` of the free columns: the inverse information is `R⁻¹ R⁻ᵀ`. Upper triangular, (free, free).
    pub(crate) inverse: DMatrix<f64>,
}

/// Column norms. A negligible norm is replaced by the largest norm, so that the scaled column stays negligible.
fn scales(triangle: &TriangularFactor, settings: &RankSettings) -> Vec<f64> {
    let norms = triangle.column_norms();
    let largest = norms.iter().copied().fold(0.0, f64::max);
    let floor = settings.negligible_column * largest;
    let replacement = if largest > 0.0 { largest } else { 1.0 };
    norms.into_iter().map(|norm| if norm > floor { norm } else { replacement }).collect()
}

fn scaled_triangle(triangle: &TriangularFactor, scales: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(scales.len(), scales.len(), |row, column| triangle.entry(row, column) / scales[column])
}

/// Decides which columns of the stacked rows are excited; `unexcited` columns are always fixed.
pub(crate) fn split(triangle: &TriangularFactor, settings: &RankSettings, unexcited: &Unexcited) -> Split {
    let scales = scales(triangle, settings);
    let mut scaled = scaled_triangle(triangle, &scales);
    for &column in &unexcited.columns {
        scaled.column_mut(column).fill(0.0);
    }
    let found = independent_columns(&scaled, settings.tolerance);
    Split {
        free: found.independent,
        fixed: found.dependent,
        noise: unexcited.columns.clone(),
        silent: unexcited.silent.clone(),
        weakest_independent: found.weakest_independent,
        strongest_dependent: found.strongest_dependent,
    }
}

pub(crate) struct SolvedValues {
    /// One value per column, including fixed ones.
    pub(crate) values: Vec<f64>,
    reduced: TriangularFactor,
    scales: Vec<f64>,
}

impl SolvedValues {
    /// `R⁻ᵀ v` for one value per free column.
    pub(crate) fn whitened(&self, values: &DVector<f64>) -> DVector<f64> {
        let mut whitened = DVector::from_fn(values.len(), |row, _| values[row] / self.scales[row]);
        for row in 0..whitened.len() {
            let entries = self.reduced.row(row);
            let own = whitened[row] / entries[0];
            whitened[row] = own;
            for (below, entry) in whitened.iter_mut().skip(row + 1).zip(&entries[1..]) {
                *below -= entry * own;
            }
        }
        whitened
    }

    pub(crate) fn with_inverse(self) -> Solution {
        let mut inverse = dispatch(Level::detect(), Inverse { triangle: &self.reduced });
        for (k, scale) in self.scales.iter().enumerate() {
            inverse.row_mut(k).scale_mut(1.0 / scale);
        }
        Solution { values: self.values, inverse }
    }
}

/// Solves for the free columns with the others at `fallback`: `min ‖r − R_fixed θ_fixed − R_free θ_free‖`.
pub(crate) fn solve(triangle: &TriangularFactor, split: &Split, settings: &RankSettings, fallback: &[f64]) -> Solution {
    solved_values(triangle, split, settings, fallback).with_inverse()
}

/// Like [`solve`], without the inverse.
pub(crate) fn solved_values(
    triangle: &TriangularFactor,
    split: &Split,
    settings: &RankSettings,
    fallback: &[f64],
) -> SolvedValues {
    let size = triangle.columns();
    let free = split.free.len();
    let scales = scales(triangle, settings);
    let mut known = vec![0.0; size];
    for &column in &split.fixed {
        known[column] = fallback[column];
    }
    let torque = triangle.residual(&known);
    let scaled = |row: usize, column: usize| match split.free.get(column) {
        Some(&column) => triangle.entry(row, column) / scales[column],
        None => torque.get(row).copied().unwrap_or(0.0),
    };
    let reduced = if split.fixed.is_empty() {
        TriangularFactor::from_entries(free, 0, scaled)
    } else {
        // The triangular form is restored after columns were removed.
        let mut reduced = TriangularFactor::new(free);
        reduced.absorb_entries(&mut FactorWorkspace::default(), size, scaled);
        reduced
    };
    let mut solution = vec![0.0; free];
    for row in (0..free).rev() {
        let entries = reduced.row(row);
        let sum: f64 = entries[1..].iter().zip(&solution[row + 1..]).map(|(entry, known)| entry * known).sum();
        solution[row] = (entries[free - row] - sum) / entries[0];
    }
    let mut values = known;
    for (k, &column) in split.free.iter().enumerate() {
        values[column] = solution[k] / scales[column];
    }
    SolvedValues { values, reduced, scales: split.free.iter().map(|&column| scales[column]).collect() }
}

/// Inverse of a factor's `R_W` by back-substitution.
struct Inverse<'a> {
    triangle: &'a TriangularFactor,
}

const COLUMNS_PER_BLOCK: usize = 8;

impl Kernel for Inverse<'_> {
    type Output = DMatrix<f64>;

    /// The loops over columns vectorise; the sums of each column keep their order.
    #[inline(always)]
    fn run<T: Lane>(self) -> Self::Output {
        let size = self.triangle.columns();
        let mut inverse = DMatrix::zeros(size, size);
        let mut x = vec![[0.0; COLUMNS_PER_BLOCK]; size];
        for first in (0..size).step_by(COLUMNS_PER_BLOCK) {
            let end = size.min(first + COLUMNS_PER_BLOCK);
            x[..end].fill([0.0; COLUMNS_PER_BLOCK]);
            for row in (0..end).rev() {
                let entries = self.triangle.row(row);
                let mut sum = [0.0; COLUMNS_PER_BLOCK];
                for (entry, below) in entries[1..].iter().zip(&x[row + 1..end]) {
                    for k in 0..COLUMNS_PER_BLOCK {
                        sum[k] += entry * below[k];
                    }
                }
                for column in row.max(first)..end {
                    let k = column - first;
                    x[row][k] = if row == column { 1.0 / entries[0] } else { -sum[k] / entries[0] };
                    inverse[(row, column)] = x[row][k];
                }
            }
        }
        inverse
    }
}

pub(crate) fn report(
    triangle: &TriangularFactor,
    split: &Split,
    settings: &RankSettings,
    names: &[String],
    fallback: &[f64],
) -> RankReport {
    let scales = scales(triangle, settings);
    let scaled = scaled_triangle(triangle, &scales);
    let mut singular_values: Vec<f64> = scaled.singular_values().iter().copied().collect();
    singular_values.sort_by(|a, b| b.total_cmp(a));
    let largest = singular_values.first().copied().unwrap_or(0.0);
    let condition_number_scaled = match singular_values.last() {
        Some(least) if split.fixed.is_empty() => largest / least,
        _ => condition(&scaled.select_columns(&split.free)),
    };
    let answers = answer_of_free(&triangle.regressor_triangle(), &split.free, &split.fixed).ok();
    let answers_to = |place: usize| {
        let mut all = vec![0.0; names.len()];
        if split.silent.contains(&split.fixed[place]) {
            return all;
        }
        for (row, &column) in split.free.iter().enumerate() {
            all[column] = answers.as_ref().map_or(0.0, |answers| answers[(row, place)]);
        }
        all
    };
    RankReport {
        rank: split.free.len(),
        columns: names.len(),
        fixed: split
            .fixed
            .iter()
            .enumerate()
            .map(|(place, &column)| FixedColumn {
                column,
                name: names[column].clone(),
                value: fallback[column],
                noise: split.noise.contains(&column),
                answers: answers_to(place),
            })
            .collect(),
        numerical_rank: singular_values.iter().filter(|&&value| value > settings.tolerance * largest).count(),
        singular_values,
        tolerance: settings.tolerance,
        weakest_independent: split.weakest_independent,
        strongest_dependent: split.strongest_dependent,
        condition_number_raw: condition(&triangle.regressor_triangle().select_columns(&split.free)),
        condition_number_scaled,
    }
}

/// Largest over smallest singular value; 1 without columns.
fn condition(matrix: &DMatrix<f64>) -> f64 {
    if matrix.ncols() == 0 {
        return 1.0;
    }
    let values = matrix.singular_values();
    values.max() / values.min()
}
