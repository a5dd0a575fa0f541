//! Cross-validation between models that share most of their columns, from factors alone: which of many columns should
//! one joint have?
//!
//! The log's time segments are dealt out to K blocks in turn, so that every block holds a part of all that was moved:
//! what a fit says of a block is then not made of what the other blocks never showed. With block k left out, all other
//! rows of all joints are reduced to one triangle whose last columns are the candidates':
//!
//! ```text
//!     [ R_cc  R_cv  r_c ]   c: columns that every candidate model has, v: candidate columns
//!     [  0    R_vv  r_v ]
//! ```
//!
//! A candidate model takes some of v: its coefficients follow from `R_vv` and `r_v` alone (a problem of a few
//! unknowns), the others by substitution, and the error on block k from that block's own triangle. So the rows are
//! reduced once per block, whatever the number of candidates (variable projection: Golub and Pereyra, SIAM J. Numer.
//! Anal. 10 (1973) 413).

use super::nonnegative::nonnegative_least_squares;
use crate::error::{EstimationError, require};
use crate::factor::{FactorWorkspace, LinearProblem, TriangularFactor};
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A column of which earlier ones leave a smaller share than this has no value of its own.
const DEPENDENT: f64 = 1.0e-8;

/// The rows of a problem, cut into blocks of time.
#[derive(Debug)]
pub struct CrossValidation<'a> {
    problem: &'a LinearProblem,
    parts: Vec<Part>,
    folds: usize,
}

/// The rows of equations that are [alike](LinearProblem::alike).
#[derive(Debug)]
struct Part {
    /// The first of these equations.
    first: usize,
    /// What each block holds.
    own: Vec<TriangularFactor>,
    /// What all others hold, and (last) what all hold.
    others: Vec<TriangularFactor>,
}

/// One joint's candidates with one block left out at a time.
#[derive(Debug)]
pub struct JointFolds {
    common: Vec<usize>,
    variable: Vec<usize>,
    /// Per block and, last, with no block left out.
    folds: Vec<Fold>,
}

/// What all candidates share when one block is left out; columns in the order common, variable.
#[derive(Debug)]
struct Fold {
    /// All rows that are fitted to.
    triangle: TriangularFactor,
    /// The joint's rows of the block (of all blocks).
    rows: TriangularFactor,
    /// `R_vvᵀ R_vv` and `R_vvᵀ r_v`.
    gram: DMatrix<f64>,
    right: DVector<f64>,
    /// Whether a common column is separated from earlier ones.
    independent: Vec<bool>,
}

/// Candidates that are computed side by side.
const SIDE_BY_SIDE: usize = 8;

/// A number for each candidate at work.
type Side = [f64; SIDE_BY_SIDE];

/// What a candidate model leaves of the joint's torque.
#[derive(Clone, Debug, PartialEq)]
pub struct FoldErrors {
    /// Sum of squared residuals on each block by the fit to the others, (Nm)².
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

    /// Mean square error minus that of `other`, and the standard error of this difference as it varies from block to
    /// block: `s/√K`, with blocks weighted by their rows.
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
    /// Deals the problem's segments out to `folds` blocks in turn, over all logs in their order.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for fewer than two blocks; [`EstimationError::TooFewSegments`] when there are fewer
    /// segments than blocks; [`EstimationError::Empty`].
    pub fn new(problem: &'a LinearProblem, folds: usize) -> Result<Self, EstimationError> {
        require(folds >= 2, "folds", folds as f64, "give at least 2 blocks")?;
        if problem.equations().is_empty() {
            return Err(EstimationError::Empty);
        }
        let mut segments = vec![0; problem.joints().len()];
        let mut before = Vec::with_capacity(problem.equations().len());
        for equation in problem.equations() {
            before.push(segments[equation.joint]);
            segments[equation.joint] += equation.factor.segment_rows().len();
        }
        // Logs whose rows see the same columns are one stack of rows from here on.
        let part = |alike: Vec<usize>| {
            let columns = problem.equations()[alike[0]].factor.columns();
            let mut own = vec![TriangularFactor::new(columns); folds];
            let mut workspace = FactorWorkspace::default();
            for &equation in &alike {
                for (number, segment) in problem.equations()[equation].factor.segment_factors().iter().enumerate() {
                    own[(before[equation] + number) % folds].absorb_factor(&mut workspace, segment);
                }
            }
            let others = all_but_one(&own, columns);
            Part { first: alike[0], own, others }
        };
        let parts = problem.alike().into_par_iter().map(part).collect();
        let fewest = segments.into_iter().filter(|&count| count > 0).min().unwrap_or(0);
        if fewest < folds {
            return Err(EstimationError::TooFewSegments { clusters: fewest });
        }
        Ok(Self { problem, parts, folds })
    }

    /// Prepares the choice of joint `joint` among the columns `variable`, which no other joint sees. All joints see
    /// those of the columns `common` that are theirs; rows of joint j count with `weights[j]`.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for numbers out of range or another number of weights;
    /// [`EstimationError::Setting`] for an impossible weight; [`EstimationError::TooFewRows`] when a block leaves fewer
    /// rows of the joint, or all blocks but one of all joints, than could distinguish the columns.
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
            return Err(mismatch("a joint number below the number of joints", joints.len(), joint));
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
                // Later rows have nothing but torque, and what the triangle cannot explain does not count.
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

/// What all blocks but one hold, for each block, and (last) what all hold: from both ends towards the middle.
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
    /// The columns to choose from, as given.
    pub fn variable(&self) -> &[usize] {
        &self.variable
    }

    /// Variance inflation of a combination `a` of candidate columns, given as (place in [`variable`](Self::variable),
    /// factor): the factor by which the common columns and the combinations `others` increase the variance of its
    /// coefficient. It is `1 / (1 - R²)`, where R² is the share of `‖W a‖²` that a combination of those columns
    /// explains over all rows: 1 where they explain nothing, infinite where they explain all of it.
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
        // The Gram matrix is that of the parts which the common columns do not explain.
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
            if square > DEPENDENT * fold.square_of(self.common.len(), other) {
                basis.push(rest / square.sqrt());
            }
        }
        let rest = without(own, &basis);
        let left = rest.dot(&(&fold.gram * &rest)).max(0.0);
        if whole > 0.0 && left > 0.0 { whole / left } else { f64::INFINITY }
    }

    /// The error of the model that has the candidate columns `chosen` (places in [`variable`](Self::variable)) beside
    /// the common ones; those with `nonnegative` set are constrained to coefficients of zero or more.
    ///
    /// # Panics
    /// If the slices' lengths differ or a place is out of range.
    pub fn errors(&self, chosen: &[usize], nonnegative: &[bool]) -> FoldErrors {
        self.side_by_side(Level::detect(), &[(chosen, nonnegative)]).swap_remove(0)
    }

    /// [`errors`](Self::errors) of many models, each given as (chosen, nonnegative), in their order.
    ///
    /// # Panics
    /// As [`errors`](Self::errors).
    pub fn errors_of_all(&self, models: &[(&[usize], &[bool])]) -> Vec<FoldErrors> {
        let level = Level::detect();
        models.chunks(SIDE_BY_SIDE).flat_map(|some| self.side_by_side(level, some)).collect()
    }

    fn side_by_side(&self, level: Level, models: &[(&[usize], &[bool])]) -> Vec<FoldErrors> {
        let last = self.folds.len() - 1;
        let mut places: Vec<usize> = models.iter().flat_map(|(chosen, _)| *chosen).copied().collect();
        places.sort_unstable();
        places.dedup();
        let none =
            FoldErrors { squares: Vec::with_capacity(last), rows: Vec::with_capacity(last), coefficients: vec![] };
        let mut errors = vec![none; models.len()];
        let mut theta = vec![[0.0; SIDE_BY_SIDE]; self.common.len() + self.variable.len()];
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
        let independent = (0..start).map(|row| triangle.entry(row, row) > DEPENDENT * norms[row]).collect();
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

/// What the candidates at work leave of the block's torque, a column each.
struct Residuals<'a> {
    fold: &'a Fold,
    /// Places of the columns that any of them has; all others are zero in `theta`.
    places: &'a [usize],
    /// Coefficients of the candidates' columns; those of the common ones come from here.
    theta: &'a mut [Side],
}

impl Kernel for Residuals<'_> {
    type Output = DMatrix<f64>;

    /// The loops over candidates become vector instructions; each candidate's own sums keep their order.
    #[inline(always)]
    fn run<T: Lane>(self) -> Self::Output {
        let Self { fold, places, theta } = self;
        let (start, end) = (fold.independent.len(), theta.len());
        // All parameters: a common column that the rows do not separate from earlier ones is zero.
        for row in (0..start).rev() {
            let entries = fold.triangle.row(row);
            let mut value = [0.0; SIDE_BY_SIDE];
            if fold.independent[row] {
                let sum = products(entries, row, row + 1..start, places, theta);
                for k in 0..SIDE_BY_SIDE {
                    value[k] = (entries[end - row] - sum[k]) / entries[0];
                }
            }
            theta[row] = value;
        }
        let mut residuals = DMatrix::zeros(end, SIDE_BY_SIDE);
        for row in 0..end {
            let entries = fold.rows.row(row);
            let sum = products(entries, row, row.min(start)..start, places, theta);
            for k in 0..SIDE_BY_SIDE {
                residuals[(row, k)] = entries[end - row] - sum[k];
            }
        }
        residuals
    }
}

/// The sums of products of a triangle's row, whose entries begin at column `row`, with the parameters of the common
/// columns `range` and of those at `places`.
#[inline(always)]
fn products(entries: &[f64], row: usize, range: core::ops::Range<usize>, places: &[usize], theta: &[Side]) -> Side {
    let mut sum = [0.0; SIDE_BY_SIDE];
    let common = range.end;
    for (entry, theta) in entries[range.start - row.min(range.start)..].iter().zip(&theta[range]) {
        for k in 0..SIDE_BY_SIDE {
            sum[k] += entry * theta[k];
        }
    }
    for place in places {
        let column = common + place;
        if column >= row {
            for k in 0..SIDE_BY_SIDE {
                sum[k] += entries[column - row] * theta[column][k];
            }
        }
    }
    sum
}
