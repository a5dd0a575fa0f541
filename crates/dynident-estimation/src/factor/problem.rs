//! The linear problem of all estimators.

use super::rank::{RankSettings, split};
use super::segmented::SegmentedFactor;
use super::triangular::{FactorWorkspace, TriangularFactor, check_columns, check_weight};
use super::unexcited::{Unexcited, answer_of_free};
use crate::error::{EstimationError, expect};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The rows of one joint in one log.
#[derive(Clone, Debug)]
pub struct JointRows {
    /// Index of the log in [`LinearProblem::logs`].
    pub log: usize,
    /// Index of the joint in [`LinearProblem::joints`].
    pub joint: usize,
    /// For every column of the factor, its index in the problem.
    pub columns: Vec<usize>,
    /// The reduced rows.
    pub factor: SegmentedFactor,
}

/// Gaussian prior of the parameters θ: `S θ = S m + N(0, 1)` with mean m and information matrix SᵀS.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    mean: Vec<f64>,
    sqrt_information: DMatrix<f64>,
}

/// `τ_j = W_j θ + noise` for every joint j of every log, stored as factors.
///
/// ```
/// use dynident_estimation::{LinearProblem, SegmentSettings, SegmentedFactor, ordinary_least_squares};
/// let mut rows = SegmentedFactor::new(2, SegmentSettings { max_segments: 8, first_length_rows: 2 })?;
/// // τ = 3 x - 1 with an error of ±0.1; columns x, 1, τ one after another.
/// rows.absorb(&[0., 1., 2., 3., 4., 5., 1., 1., 1., 1., 1., 1., -0.9, 1.9, 5.1, 7.9, 10.9, 14.1], 6)?;
/// let mut problem = LinearProblem::new(vec!["slope".into(), "offset".into()], vec!["joint1".into()]);
/// problem.add("first run", 0, vec![0, 1], rows)?;
/// let estimate = ordinary_least_squares(&problem, &Default::default())?;
/// assert!((estimate.values[0] - 3.0).abs() < 0.05 && estimate.std[0] > 0.0);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LinearProblem {
    columns: Vec<String>,
    joints: Vec<String>,
    logs: Vec<String>,
    equations: Vec<JointRows>,
    fallback: Vec<f64>,
    unexcited: Unexcited,
    prior: Option<Prior>,
}

impl LinearProblem {
    /// Creates a problem without data from the names of the columns (parameters) and joints.
    pub fn new(columns: Vec<String>, joints: Vec<String>) -> Self {
        let fallback = vec![0.0; columns.len()];
        Self {
            columns,
            joints,
            logs: Vec::new(),
            equations: Vec::new(),
            fallback,
            unexcited: Unexcited::default(),
            prior: None,
        }
    }

    /// Adds the rows of joint number `joint` in the log called `log`; `columns` gives the index in the problem for
    /// every column of the factor. Add the joints of one log under the same log name.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a joint out of range or a wrong length of `columns`;
    /// [`EstimationError::Column`] for a column out of range or duplicate.
    pub fn add(
        &mut self,
        log: &str,
        joint: usize,
        columns: Vec<usize>,
        factor: SegmentedFactor,
    ) -> Result<(), EstimationError> {
        if joint >= self.joints.len() {
            let what = format!("log {log}: joint number, below the number of joints");
            return Err(EstimationError::Mismatch { what, expected: self.joints.len(), found: joint });
        }
        if columns.len() != factor.columns() {
            let what = format!("log {log}, joint {}: column numbers for the factor's columns", self.joints[joint]);
            return Err(EstimationError::Mismatch { what, expected: factor.columns(), found: columns.len() });
        }
        let mut seen = vec![false; self.columns.len()];
        for &column in &columns {
            if column >= seen.len() || std::mem::replace(&mut seen[column], true) {
                return Err(EstimationError::Column {
                    log: log.into(),
                    joint: self.joints[joint].clone(),
                    column,
                    columns: self.columns.len(),
                });
            }
        }
        let log = self.logs.iter().position(|name| name == log).unwrap_or_else(|| {
            self.logs.push(log.into());
            self.logs.len() - 1
        });
        self.equations.push(JointRows { log, joint, columns, factor });
        Ok(())
    }

    /// Sets the values of columns that the data do not excite, for example nominal values; zero by default.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a wrong number of values, [`EstimationError::Setting`] for a value that is
    /// not finite.
    pub fn with_fallback(mut self, values: Vec<f64>) -> Result<Self, EstimationError> {
        expect("fallback values", self.columns.len(), values.len())?;
        finite("fallback value", &values)?;
        self.fallback = values;
        Ok(self)
    }

    /// Sets columns to hold at their fallback values because they contain only noise, as found by
    /// [`unexcited_columns`](super::unexcited_columns). Every estimator holds them.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a column out of range.
    pub fn with_unexcited(mut self, mut unexcited: Unexcited) -> Result<Self, EstimationError> {
        for columns in [&mut unexcited.columns, &mut unexcited.silent] {
            check_columns(columns, self.columns.len())?;
            columns.sort_unstable();
            columns.dedup();
        }
        self.unexcited = unexcited;
        Ok(self)
    }

    /// Adds a Gaussian prior with mean `mean` (one value per column) and square-root information `sqrt_information`,
    /// shape (any, columns): rows `[S | S m]` with unit noise. A diagonal S holds 1/std of each parameter.
    ///
    /// # Errors
    /// Same as for [`with_fallback`](Self::with_fallback).
    pub fn with_prior(mut self, mean: Vec<f64>, sqrt_information: DMatrix<f64>) -> Result<Self, EstimationError> {
        expect("prior mean", self.columns.len(), mean.len())?;
        expect("columns of the prior's square-root information", self.columns.len(), sqrt_information.ncols())?;
        finite("prior mean", &mean)?;
        finite("prior square-root information", sqrt_information.as_slice())?;
        self.prior = Some(Prior { mean, sqrt_information });
        Ok(self)
    }

    /// Multiplies the rows of every joint of every log by `weight(log, joint)` (numbers of log and joint), for logs
    /// with different noise. Residuals are then in the unit of a log with weight 1.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a weight that is negative, NaN or infinite.
    pub fn with_log_weights(mut self, weight: impl Fn(usize, usize) -> f64) -> Result<Self, EstimationError> {
        for equation in &mut self.equations {
            let weight = weight(equation.log, equation.joint);
            check_weight(weight)?;
            if weight != 1.0 {
                let size = equation.factor.columns() + 1;
                equation.factor = equation.factor.mapped(&DMatrix::from_diagonal_element(size, size, weight))?;
            }
        }
        Ok(self)
    }

    /// Names of the columns.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Names of the joints.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// Names of the logs, in the order of their first rows.
    pub fn logs(&self) -> &[String] {
        &self.logs
    }

    /// The rows, one entry per joint and log.
    pub fn equations(&self) -> &[JointRows] {
        &self.equations
    }

    /// Fallback values of columns that are not estimated.
    pub fn fallback(&self) -> &[f64] {
        &self.fallback
    }

    /// Columns held at their fallback values.
    pub fn unexcited(&self) -> &Unexcited {
        &self.unexcited
    }

    /// The prior, if set.
    pub fn prior(&self) -> Option<&Prior> {
        self.prior.as_ref()
    }

    /// N_j: number of rows of every joint over all logs.
    pub fn joint_rows(&self) -> Vec<usize> {
        let mut rows = vec![0; self.joints.len()];
        for equation in &self.equations {
            rows[equation.joint] += equation.factor.rows();
        }
        rows
    }

    /// The norm of every column over all rows of all joints.
    pub fn column_norms(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.columns.len()];
        for equation in &self.equations {
            for (norm, &column) in equation.factor.total().column_norms().iter().zip(&equation.columns) {
                squares[column] += norm * norm;
            }
        }
        squares.into_iter().map(f64::sqrt).collect()
    }

    /// One factor of all rows over all columns. The rows of joint j are multiplied by `weights[j]` (1/σ_j for weighted
    /// least squares); the prior's rows, if any, have weight 1.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a wrong number of weights; [`EstimationError::Setting`] for a weight that is
    /// negative, NaN or infinite.
    pub fn combined(&self, weights: &[f64]) -> Result<TriangularFactor, EstimationError> {
        self.stacked().combined(weights)
    }

    /// Like [`combined`](Self::combined), but replaces each [unexcited](Self::with_unexcited) column by the part that
    /// the other columns explain: `W_H` by `W_F (W_FᵀW_F)⁻¹W_FᵀW_H`, and a column with noise only by zero. The factor
    /// keeps the information about identifiable combinations that include held parameters, and drops the information
    /// from noise.
    ///
    /// # Errors
    /// Same as for [`combined`](Self::combined); [`EstimationError::Overflow`] if the other columns are dependent.
    pub fn combined_without_noise(
        &self,
        weights: &[f64],
        settings: &RankSettings,
    ) -> Result<TriangularFactor, EstimationError> {
        let full = self.combined(weights)?;
        let Unexcited { columns: held, silent } = &self.unexcited;
        if held.is_empty() {
            return Ok(full);
        }
        let triangle = full.regressor_triangle();
        let free = split(&full, settings, &self.unexcited).free;
        let answer = answer_of_free(&triangle, &free, held)?;
        let explained = triangle.select_columns(&free) * -answer;
        let count = self.columns.len();
        let mut without = TriangularFactor::new(count);
        without.absorb_entries(&mut FactorWorkspace::default(), count + 1, |row, column| {
            match held.binary_search(&column) {
                Ok(place) if row < count && silent.binary_search(&column).is_err() => explained[(row, place)],
                Ok(_) => 0.0,
                Err(_) => full.entry(row, column),
            }
        });
        without.count(full.rows());
        Ok(without)
    }

    /// The total factors of all equations, for repeated weighting.
    pub(crate) fn stacked(&self) -> StackedProblem<'_> {
        let totals: Vec<&TriangularFactor> = self.equations.par_iter().map(|e| e.factor.total()).collect();
        let stack = |group: Vec<usize>| {
            let mut total = totals[group[0]].clone();
            let mut workspace = FactorWorkspace::default();
            group[1..].iter().for_each(|&equation| total.absorb_factor(&mut workspace, totals[equation]));
            (group[0], total)
        };
        let stacks = self.same_column_groups().into_par_iter().map(stack).collect();
        StackedProblem { problem: self, totals, stacks }
    }

    /// Groups of equations of one joint with the same columns, which always have the same weight.
    pub(crate) fn same_column_groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (number, equation) in self.equations.iter().enumerate() {
            let same = |group: &&mut Vec<usize>| {
                let first = &self.equations[group[0]];
                first.joint == equation.joint && first.columns == equation.columns
            };
            match groups.iter_mut().find(same) {
                Some(group) => group.push(number),
                None => groups.push(vec![number]),
            }
        }
        groups
    }
}

pub(crate) struct StackedProblem<'a> {
    pub(crate) problem: &'a LinearProblem,
    pub(crate) totals: Vec<&'a TriangularFactor>,
    /// For each group of [same-column equations](LinearProblem::same_column_groups) the number of its first equation
    /// and the factor of all its rows; with many logs this saves most of the work.
    stacks: Vec<(usize, TriangularFactor)>,
}

impl StackedProblem<'_> {
    pub(crate) fn combined(&self, weights: &[f64]) -> Result<TriangularFactor, EstimationError> {
        let problem = self.problem;
        expect("weights of joints", problem.joints.len(), weights.len())?;
        let columns = problem.columns.len();
        let mut workspace = FactorWorkspace::default();
        let mut combined = TriangularFactor::new(columns);
        for (first, total) in &self.stacks {
            let equation = &problem.equations[*first];
            let weight = weights[equation.joint];
            check_weight(weight)?;
            let mut place = vec![None; columns + 1];
            for (local, &column) in equation.columns.iter().enumerate() {
                place[column] = Some(local);
            }
            place[columns] = Some(total.columns());
            combined.absorb_columns(&mut workspace, total, total.columns() + 1, weight, |column| place[column]);
            combined.count(total.rows());
        }
        if let Some(prior) = &problem.prior {
            let s = &prior.sqrt_information;
            let rotated = s * DVector::from_column_slice(&prior.mean);
            combined.absorb_entries(&mut workspace, s.nrows(), |row, column| {
                if column == columns { rotated[row] } else { s[(row, column)] }
            });
        }
        Ok(combined)
    }

    /// Residual sum of squares and `‖τ‖²` of every joint over all logs, without weights or prior.
    pub(crate) fn joint_squares(&self, theta: &[f64]) -> Result<(Vec<f64>, Vec<f64>), EstimationError> {
        let joints = self.problem.joints.len();
        let (mut residual, mut torque) = (vec![0.0; joints], vec![0.0; joints]);
        for (equation, total) in self.problem.equations.iter().zip(&self.totals) {
            residual[equation.joint] += total.residual_sum_of_squares(&equation.local(theta))?;
            torque[equation.joint] += total.torque_norm().powi(2);
        }
        Ok((residual, torque))
    }

    /// `W_jᵀ(τ_j − W_j θ)` of every joint over all logs and columns, without weights or prior.
    pub(crate) fn joint_scores(&self, theta: &[f64]) -> Vec<DVector<f64>> {
        let mut scores = vec![DVector::zeros(self.problem.columns.len()); self.problem.joints.len()];
        for (first, total) in &self.stacks {
            let equation = &self.problem.equations[*first];
            let score = total.score(&equation.local(theta));
            for (&column, own) in equation.columns.iter().zip(score.iter()) {
                scores[equation.joint][column] += own;
            }
        }
        scores
    }
}

impl JointRows {
    /// The parameters of the columns of these rows.
    pub(crate) fn local(&self, theta: &[f64]) -> Vec<f64> {
        self.columns.iter().map(|&column| theta[column]).collect()
    }
}

impl Prior {
    /// The mean, one value per column.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// S, the square root of the information matrix, shape (any, columns).
    pub fn sqrt_information(&self) -> &DMatrix<f64> {
        &self.sqrt_information
    }
}

fn finite(setting: &'static str, values: &[f64]) -> Result<(), EstimationError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(EstimationError::Setting { setting, value, fix: "use finite numbers" }),
        None => Ok(()),
    }
}
