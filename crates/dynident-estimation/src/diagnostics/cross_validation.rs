//! Cross-validation of models that share most of their columns, from factors alone.
//!
//! The time segments are distributed over K blocks in turn, so that every block covers all parts of the motion. For
//! each left-out block k, all other rows of all joints are reduced to one triangle whose last columns are the
//! candidates (columns v after the common columns c):
//!
//! ```text
//!     [ R_cc  R_cv  r_c ]
//!     [  0    R_vv  r_v ]
//! ```
//!
//! The coefficients of a candidate model with some of the columns v follow from `R_vv` and `r_v` alone (a few
//! unknowns), the other coefficients by substitution. The error on block k follows from the triangle of that block.
//! The rows are reduced once per block for any number of candidates (variable projection: Golub and Pereyra, SIAM J.
//! Numer. Anal. 10 (1973) 413).

use super::nonnegative::nonnegative_least_squares;
use crate::error::{EstimationError, require};
use crate::factor::{FactorWorkspace, LinearProblem, TriangularFactor};
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A column is dependent if the share of it that earlier columns do not explain is smaller than this.
const DEPENDENCE_TOLERANCE: f64 = 1.0e-8;

/// The rows of a problem, cut into blocks of time.
#[derive(Debug)]
pub struct CrossValidation<'a> {
    problem: &'a LinearProblem,
    parts: Vec<Part>,
    folds: usize,
}

/// The rows of [same-column equations](LinearProblem::same_column_groups).
#[derive(Debug)]
struct Part {
    first: usize,
    own: Vec<TriangularFactor>,
    /// Rows of all other blocks, for each block, and (last) all rows.
    others: Vec<TriangularFactor>,
}

/// One joint's candidates for all left-out blocks.
#[derive(Debug)]
pub struct JointFolds {
    common: Vec<usize>,
    variable: Vec<usize>,
    /// One per left-out block; the last one without a left-out block.
    folds: Vec<Fold>,
}

/// Data shared by all candidates for one left-out block; columns in the order common, variable.
#[derive(Debug)]
struct Fold {
    triangle: TriangularFactor,
    /// The joint's rows in the left-out block (in all blocks for the last fold).
    rows: TriangularFactor,
    /// `R_vvᵀ R_vv` and `R_vvᵀ r_v`.
    gram: DMatrix<f64>,
    right: DVector<f64>,
    /// Whether a common column is independent of earlier ones.
    independent: Vec<bool>,
}

const CANDIDATES_PER_BLOCK: usize = 8;

type CandidateValues = [f64; CANDIDATES_PER_BLOCK];

/// Prediction errors of a candidate model.
#[derive(Clone, Debug, PartialEq)]
pub struct FoldErrors {
    /// Sum of squared residuals on each block by the fit to the other blocks, (Nm)².
    pub squares: Vec<f64>,
    /// Rows of the joint in each block.
    pub rows: Vec<usize>,
    /// Coefficients of the candidate's columns by the fit to all blocks.
    pub coefficients: Vec<f64>,
}

impl FoldErrors {
    /// Root mean square over all blocks, Nm.
    pub fn rms(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.rows.iter().sum::<usize>().max(1) as f64).sqrt()
    }

    /// Mean square error minus that of `other`, and the standard error of this difference from its variation between
    /// blocks: `s/√K`, with blocks weighted by their rows.
    pub fn excess_over(&self, other: &Self) -> [f64; 2] {
        let count = self.rows.len() as f64;
        let mean_rows = self.rows.iter().sum::<usize>() as f64 / count;
        let differences: Vec<f64> = self.squares.iter().zip(&other.squares).map(|(a, b)| (a - b) / mean_rows).collect();
        let mean = differences.iter().sum::<f64>() / count;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
        [mean, (variance / count).sqrt()]
    }
}

impl<'a> CrossValidation<'a> {
    /// Distributes the problem's segments over `folds` blocks in turn, over all logs in their order.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for fewer than two blocks; [`EstimationError::TooFewSegments`] for fewer segments
    /// than blocks; [`EstimationError::Empty`].
    pub fn new(problem: &'a LinearProblem, folds: usize) -> Result<Self, EstimationError> {
        require(folds >= 2, "folds", folds as f64, "use at least 2 blocks")?;
        if problem.equations().is_empty() {
            return Err(EstimationError::Empty);
        }
        let mut segments = vec![0; problem.joints().len()];
        let mut before = Vec::with_capacity(problem.equations().len());
        for equation in problem.equations() {
            before.push(segments[equation.joint]);
            segments[equation.joint] += equation.factor.segment_rows().len();
        }
        // Logs with the same columns are combined.
        let part = |group: Vec<usize>| {
            let columns = problem.equations()[group[0]].factor.columns();
            let mut own = vec![TriangularFactor::new(columns); folds];
            let mut workspace = FactorWorkspace::default();
            for &equation in &group {
                for (number, segment) in problem.equations()[equation].factor.segment_factors().iter().enumerate() {
                    own[(before[equation] + number) % folds].absorb_factor(&mut workspace, segment);
                }
            }
            let others = all_but_one(&own, columns);
            Part { first: group[0], own, others }
        };
        let parts = problem.same_column_groups().into_par_iter().map(part).collect();
        let fewest = segments.into_iter().filter(|&count| count > 0).min().unwrap_or(0);
        if fewest < folds {
            return Err(EstimationError::TooFewSegments { clusters: fewest });
        }
        Ok(Self { problem, parts, folds })
    }

    /// Prepares the selection for joint `joint` among the columns `variable`, which must not occur in other joints.
    /// The columns `common` are always included; rows of joint j have the weight `weights[j]`.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for numbers out of range or a wrong number of weights;
    /// [`EstimationError::Setting`] for an invalid weight; [`EstimationError::TooFewRows`] if the rows without a block
    /// cannot distinguish the columns.
    pub fn joint(
        &self,
        joint: usize,
        common: &[usize],
        variable: &[usize],
        weights: &[f64],
    ) -> Result<JointFolds, EstimationError> {
        let joints = self.problem.joints();
        let mismatch = |what: &str, expected, found| EstimationError::Mismatch { what: what.into(), expected, found };
        if weights.len() != joints.len() {
            return Err(mismatch("weights of joints", joints.len(), weights.len()));
        }
        if joint >= joints.len() {
            return Err(mismatch("joint number, below the number of joints", joints.len(), joint));
        }
        let size = self.problem.columns().len();
        crate::factor::check_columns(common, size)?;
        crate::factor::check_columns(variable, size)?;
        let order: Vec<usize> = common.iter().chain(variable).copied().collect();
        let mut folds = Vec::with_capacity(self.folds + 1);
        for fold in 0..=self.folds {
            let mut triangle = TriangularFactor::new(order.len());
            let mut rows = TriangularFactor::new(order.len());
            let mut workspace = FactorWorkspace::default();
            for Part { first, own, others } in &self.parts {
                let equation = &self.problem.equations()[*first];
                let mut place = vec![None; size];
                for (local, &column) in equation.columns.iter().enumerate() {
                    place[column] = Some(local);
                }
                let mut absorb = |to: &mut TriangularFactor, from: &TriangularFactor, weight: f64, rows: usize| {
                    let local = |column: usize| order.get(column).map_or(Some(from.columns()), |&global| place[global]);
                    to.absorb_columns(&mut workspace, from, rows, weight, local);
                    to.count(from.rows());
                };
                let weight = weights[equation.joint];
                crate::factor::check_weight(weight)?;
                // Later rows contain torque only and do not affect the fit.
                let seen = order.iter().filter_map(|&global| place[global]).max().map_or(0, |local| local + 1);
                absorb(&mut triangle, &others[fold], weight, seen);
                if equation.joint == joint {
                    let from = if fold < self.folds { &own[fold] } else { &others[fold] };
                    absorb(&mut rows, from, 1.0, from.columns() + 1);
                }
            }
            let enough = rows.rows() > 0 && triangle.rows() > order.len();
            if !enough {
                return Err(EstimationError::TooFewRows {
                    what: format!("cross-validation of joint {}", joints[joint]),
                    rows: triangle.rows(),
                    parameters: order.len() as f64,
                });
            }
            folds.push(Fold::new(triangle, rows, common.len()));
        }
        Ok(JointFolds { common: common.to_vec(), variable: variable.to_vec(), folds })
    }
}

/// For each block the rows of all other blocks, and (last) all rows, from prefix and suffix sums.
fn all_but_one(own: &[TriangularFactor], columns: usize) -> Vec<TriangularFactor> {
    let mut workspace = FactorWorkspace::default();
    let mut after = vec![TriangularFactor::new(columns)];
    for factor in own.iter().rev() {
        let mut next = after[after.len() - 1].clone();
        next.absorb_factor(&mut workspace, factor);
        after.push(next);
    }
    after.reverse();
    let mut before = TriangularFactor::new(columns);
    let mut others = Vec::with_capacity(own.len() + 1);
    for (fold, factor) in own.iter().enumerate() {
        let mut rest = before.clone();
        rest.absorb_factor(&mut workspace, &after[fold + 1]);
        others.push(rest);
        before.absorb_factor(&mut workspace, factor);
    }
    others.push(before);
    others
}

impl JointFolds {
    /// Variance inflation factor of a combination `a` of candidate columns, given as (place among
    /// the candidate columns, factor): `1 / (1 - R²)`, where R² is the share of `‖W a‖²` that the common
    /// columns and the combinations `others` explain over all rows. It is 1 if they explain nothing and infinite if
    /// they explain everything.
    ///
    /// Source: Belsley, Kuh and Welsch, *Regression Diagnostics*, 1980, section 3.1; not centred.
    ///
    /// # Panics
    /// If a place is out of range.
    pub fn variance_inflation(&self, combination: &[(usize, f64)], others: &[&[(usize, f64)]]) -> f64 {
        let Some(fold) = self.folds.last() else { return f64::INFINITY };
        let count = self.variable.len();
        let dense = |sparse: &[(usize, f64)]| {
            let mut dense = DVector::zeros(count);
            for &(place, factor) in sparse {
                dense[place] += factor;
            }
            dense
        };
        let own = dense(combination);
        let whole = fold.square_of(self.common.len(), combination);
        // The Gram matrix is that of the parts that the common columns do not explain.
        let mut basis: Vec<DVector<f64>> = Vec::with_capacity(others.len());
        let without = |mut vector: DVector<f64>, basis: &[DVector<f64>]| {
            for one in basis {
                let share = one.dot(&(&fold.gram * &vector));
                vector -= share * one;
            }
            vector
        };
        for other in others {
            let rest = without(dense(other), &basis);
            let square = rest.dot(&(&fold.gram * &rest));
            if square > DEPENDENCE_TOLERANCE * fold.square_of(self.common.len(), other) {
                basis.push(rest / square.sqrt());
            }
        }
        let rest = without(own, &basis);
        let left = rest.dot(&(&fold.gram * &rest)).max(0.0);
        if whole > 0.0 && left > 0.0 { whole / left } else { f64::INFINITY }
    }

    /// Errors of the model with the candidate columns `chosen` (places in `variable`) and the common
    /// ones; coefficients with `nonnegative` set are constrained to zero or more.
    ///
    /// # Panics
    /// If the slices' lengths differ or a place is out of range.
    pub fn errors(&self, chosen: &[usize], nonnegative: &[bool]) -> FoldErrors {
        self.block_errors(Level::detect(), &[(chosen, nonnegative)]).swap_remove(0)
    }

    /// [`errors`](Self::errors) of several models, each given as (chosen, nonnegative).
    ///
    /// # Panics
    /// As [`errors`](Self::errors).
    pub fn errors_of_all(&self, models: &[(&[usize], &[bool])]) -> Vec<FoldErrors> {
        let level = Level::detect();
        models.chunks(CANDIDATES_PER_BLOCK).flat_map(|some| self.block_errors(level, some)).collect()
    }

    fn block_errors(&self, level: Level, models: &[(&[usize], &[bool])]) -> Vec<FoldErrors> {
        let last = self.folds.len() - 1;
        let mut places: Vec<usize> = models.iter().flat_map(|(chosen, _)| *chosen).copied().collect();
        places.sort_unstable();
        places.dedup();
        let none =
            FoldErrors { squares: Vec::with_capacity(last), rows: Vec::with_capacity(last), coefficients: vec![] };
        let mut errors = vec![none; models.len()];
        let mut theta = vec![[0.0; CANDIDATES_PER_BLOCK]; self.common.len() + self.variable.len()];
        for (number, fold) in self.folds.iter().enumerate() {
            for (k, (chosen, nonnegative)) in models.iter().enumerate() {
                let coefficients = fold.coefficients(chosen, nonnegative);
                if number == last {
                    errors[k].coefficients = coefficients.iter().copied().collect();
                    continue;
                }
                for (&place, &value) in chosen.iter().zip(&coefficients) {
                    theta[self.common.len() + place][k] = value;
                }
            }
            if number < last {
                let residuals = dispatch(level, Residuals { fold, places: &places, theta: &mut theta });
                let rho = fold.rows.row(fold.rows.columns())[0];
                for (error, residual) in errors.iter_mut().zip(residuals.column_iter()) {
                    error.squares.push(residual.norm_squared() + rho * rho);
                    error.rows.push(fold.rows.rows());
                }
            }
        }
        errors
    }
}

impl Fold {
    fn new(triangle: TriangularFactor, rows: TriangularFactor, common: usize) -> Self {
        let (start, end) = (common, triangle.columns());
        let columns = DMatrix::from_fn(end - start, end - start, |row, k| triangle.entry(start + row, start + k));
        let torque = DVector::from_fn(end - start, |row, _| triangle.entry(start + row, end));
        let norms = triangle.column_norms();
        let independent = (0..start).map(|row| triangle.entry(row, row) > DEPENDENCE_TOLERANCE * norms[row]).collect();
        Self { gram: columns.tr_mul(&columns), right: columns.tr_mul(&torque), independent, triangle, rows }
    }

    /// `‖W a‖²` over all rows.
    fn square_of(&self, start: usize, combination: &[(usize, f64)]) -> f64 {
        let of_row = |row: usize| -> f64 {
            combination.iter().map(|&(place, factor)| factor * self.triangle.entry(row, start + place)).sum()
        };
        (0..self.triangle.columns()).map(|row| of_row(row).powi(2)).sum()
    }

    fn coefficients(&self, chosen: &[usize], nonnegative: &[bool]) -> DVector<f64> {
        assert_eq!(chosen.len(), nonnegative.len());
        let count = chosen.len();
        let gram = DMatrix::from_fn(count, count, |i, j| self.gram[(chosen[i], chosen[j])]);
        nonnegative_least_squares(&gram, &DVector::from_fn(count, |i, _| self.right[chosen[i]]), nonnegative)
    }
}

struct Residuals<'a> {
    fold: &'a Fold,
    /// Places of the columns of any candidate; all others are zero in `theta`.
    places: &'a [usize],
    /// Coefficients of the candidates' columns; the kernel adds those of the common columns.
    theta: &'a mut [CandidateValues],
}

impl Kernel for Residuals<'_> {
    type Output = DMatrix<f64>;

    /// The loops over candidates vectorise; the sums of each candidate keep their order.
    #[inline(always)]
    fn run<T: Lane>(self) -> Self::Output {
        let Self { fold, places, theta } = self;
        let (start, end) = (fold.independent.len(), theta.len());
        // A dependent common column is zero.
        for row in (0..start).rev() {
            let entries = fold.triangle.row(row);
            let mut value = [0.0; CANDIDATES_PER_BLOCK];
            if fold.independent[row] {
                let sum = products(entries, row, row + 1..start, places, theta);
                for k in 0..CANDIDATES_PER_BLOCK {
                    value[k] = (entries[end - row] - sum[k]) / entries[0];
                }
            }
            theta[row] = value;
        }
        let mut residuals = DMatrix::zeros(end, CANDIDATES_PER_BLOCK);
        for row in 0..end {
            let entries = fold.rows.row(row);
            let sum = products(entries, row, row.min(start)..start, places, theta);
            for k in 0..CANDIDATES_PER_BLOCK {
                residuals[(row, k)] = entries[end - row] - sum[k];
            }
        }
        residuals
    }
}

/// Products of a triangle's row, whose entries begin at column `row`, with the parameters of the common columns
/// `range` and of those at `places`.
#[inline(always)]
fn products(
    entries: &[f64],
    row: usize,
    range: core::ops::Range<usize>,
    places: &[usize],
    theta: &[CandidateValues],
) -> CandidateValues {
    let mut sum = [0.0; CANDIDATES_PER_BLOCK];
    let common = range.end;
    for (entry, theta) in entries[range.start - row.min(range.start)..].iter().zip(&theta[range]) {
        for k in 0..CANDIDATES_PER_BLOCK {
            sum[k] += entry * theta[k];
        }
    }
    for place in places {
        let column = common + place;
        if column >= row {
            for k in 0..CANDIDATES_PER_BLOCK {
                sum[k] += entries[column - row] * theta[column][k];
            }
        }
    }
    sum
}
