//! The estimate: values, covariance, noise and rank decisions.

use super::covariance::{CovarianceMethod, covariances};
use super::distributions::student_half_width;
use super::scores::Fit;
use crate::error::EstimationError;
use crate::factor::{RankReport, RankSettings, Solution, Split, StackedProblem, TriangularFactor, report};
use nalgebra::{DMatrix, DVector};
use serde::{Serialize, Serializer, ser::SerializeSeq};

/// Status of an estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimateStatus {
    /// All columns were estimated.
    Complete,
    /// The data do not excite some columns; these were fixed (see [`RankReport::fixed`]) and the others estimated.
    NotAllExcited,
    /// The iteration limit was reached before the weights converged.
    IterationLimit,
}

impl EstimateStatus {
    pub(crate) fn of(converged: bool, rank: &RankReport) -> Self {
        if !converged {
            Self::IterationLimit
        } else if rank.fixed.is_empty() {
            Self::Complete
        } else {
            Self::NotAllExcited
        }
    }
}

impl Estimate {
    /// Adds an independent, normally distributed error with covariance F: `Σ + F`, also in `std` and the intervals,
    /// `h' = √(h² + (1.96 σ_F)²)`. `further` has the size of the covariance or covers the first columns only; columns
    /// with zero variance in F (held columns) do not change.
    #[must_use]
    pub fn with_further_error(&self, further: &DMatrix<f64>) -> Self {
        let mut wider = self.clone();
        let count = further.nrows().min(self.std.len());
        let normal = student_half_width(0.95, f64::INFINITY);
        for row in 0..count {
            for column in 0..count {
                wider.covariance[(row, column)] += further[(row, column)];
            }
            let added = further[(row, row)].max(0.0).sqrt();
            if added == 0.0 {
                continue;
            }
            let before = self.std[row];
            wider.std[row] = before.hypot(added);
            wider.half_width_95[row] = self.half_width_95[row].hypot(normal * added);
            if before > 0.0 {
                let grown = wider.std[row] / before;
                wider.relative_std_percent[row] = self.relative_std_percent[row].map(|percent| percent * grown);
            }
        }
        wider
    }

    /// Covariance for tests of several parameters together.
    ///
    /// ```text
    /// Σ' = (1 − w) Σ + w k V,   w = p / (p + ν),   k = median of Σ_ii / V_ii
    /// ```
    ///
    /// Σ is [`covariance`](Self::covariance), V is [`covariance_white`](Self::covariance_white), p the number of
    /// estimated columns, and ν the median of their [`std_degrees_of_freedom`](Self::std_degrees_of_freedom). Every
    /// variance of Σ is valid, but with few segments its smallest eigenvalues are far too small, and `eᵀΣ⁻¹e` of the
    /// true errors e is many times its expectation (decision 0066). Σ' is the mean of an inverse Wishart posterior
    /// whose prior has the form of V and p degrees of freedom. It equals Σ if Σ is not from segments.
    /// Source: Haff, Annals of Statistics 8 (1980) 586.
    pub fn joint_covariance(&self) -> DMatrix<f64> {
        let (own, white) = (self.covariance.diagonal(), self.covariance_white.diagonal());
        let estimated: Vec<usize> = (0..own.len()).filter(|&k| own[k] > 0.0 && white[k] > 0.0).collect();
        if self.clusters == 0 || estimated.is_empty() {
            return self.covariance.clone();
        }
        let median = |value: &dyn Fn(usize) -> f64| {
            let mut values: Vec<f64> = estimated.iter().map(|&k| value(k)).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let count = estimated.len() as f64;
        let share = count / (count + median(&|k| self.std_degrees_of_freedom[k]));
        &self.covariance * (1.0 - share) + &self.covariance_white * (share * median(&|k| own[k] / white[k]))
    }
}

/// Covariance of all columns (zero for the fixed ones) and its standard deviations from that of the `free` columns.
pub(crate) fn covariance_of_all(
    names: &[String],
    values: &DVector<f64>,
    free: &[usize],
    covariance_of_free: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, Vec<f64>), EstimationError> {
    let mut covariance = DMatrix::zeros(names.len(), names.len());
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate() {
            covariance[(i, j)] = covariance_of_free[(a, b)];
        }
    }
    let std: Vec<f64> = covariance.diagonal().iter().map(|variance: &f64| variance.sqrt()).collect();
    match (0..names.len()).find(|&k| !(values[k].is_finite() && std[k].is_finite())) {
        Some(k) => Err(EstimationError::Overflow { name: names[k].clone() }),
        None => Ok((covariance, std)),
    }
}

/// Result of a linear estimator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Names of the columns.
    pub names: Vec<String>,
    /// One value per column; the fallback value for a fixed column.
    pub values: Vec<f64>,
    /// Covariance of the values by the chosen method; zero rows and columns for fixed columns.
    #[serde(serialize_with = "rows_of")]
    pub covariance: DMatrix<f64>,
    /// Covariance for errors that are independent from sample to sample.
    #[serde(serialize_with = "rows_of")]
    pub covariance_white: DMatrix<f64>,
    /// Method of `covariance`.
    pub covariance_method: CovarianceMethod,
    /// Number of clusters of `covariance` (0 for white noise).
    pub clusters: usize,
    /// Square roots of the diagonal of `covariance`.
    pub std: Vec<f64>,
    /// `std` from the residuals alone, without the additional error of
    /// [`with_further_error`](Self::with_further_error).
    pub noise_std: Vec<f64>,
    /// Degrees of freedom of the variance of each value (Satterthwaite; N − p for white errors). With few degrees of
    /// freedom the half-width of the interval is larger than 1.96 std.
    pub std_degrees_of_freedom: Vec<f64>,
    /// Half-width of the 95 % interval: `t₀.₉₇₅(std_degrees_of_freedom) · std`; zero for fixed columns.
    pub half_width_95: Vec<f64>,
    /// `100 std / |value|`; `None` for a fixed column or a value of zero.
    pub relative_std_percent: Vec<Option<f64>>,
    /// Status of the estimator.
    pub status: EstimateStatus,
    /// Number of solutions: 1 for ordinary least squares.
    pub iterations: usize,
    /// Standard deviation of each joint's residual, `√(RSS_j / (N_j − p/n))`, in N m (N for a prismatic joint).
    pub joint_sigma: Vec<f64>,
    /// For every joint, the squared scores of the time segments relative to their expectation for white noise. The
    /// ratio is about (1+ρ)/(1−ρ) for residuals with lag-1 correlation ρ, slowly changing columns and long segments.
    pub score_inflation: Vec<f64>,
    /// Effective lag-1 correlation of every joint, between −1 and 1: the ρ for which `score_inflation` is
    /// (1+ρ)/(1−ρ). This correlation determines the error bars. It is lower than the correlation of the residuals
    /// themselves if columns alternate fast.
    pub effective_lag1: Vec<f64>,
    /// For every joint, the correlation between the scores of neighbouring segments, Σ s_gᵀA⁻¹s_{g+1} / Σ s_gᵀA⁻¹s_g.
    /// If it exceeds about 0.2, the segments are too short and the error bars too small: use fewer, longer segments.
    pub segment_correlation: Vec<f64>,
    /// Rank decisions.
    pub rank: RankReport,
    /// N − p: number of all rows minus number of estimated columns.
    pub degrees_of_freedom: usize,
    /// Condition number of the (weighted) rows of the estimated columns, unscaled; depends on units.
    pub condition_number_raw: f64,
    /// Condition number after each column was divided by its norm.
    pub condition_number_scaled: f64,
}

/// Estimate without its covariance.
pub(crate) struct PointEstimate {
    pub(crate) triangle: TriangularFactor,
    pub(crate) split: Split,
    pub(crate) solution: Solution,
    pub(crate) weights: Vec<f64>,
    pub(crate) joint_sigma: Vec<f64>,
    /// Variance of the weighted rows under white noise.
    pub(crate) weighted_variance: f64,
    pub(crate) iterations: usize,
    pub(crate) converged: bool,
}

impl PointEstimate {
    pub(crate) fn into_estimate(
        self,
        stacked: &StackedProblem<'_>,
        rank: &RankSettings,
        method: CovarianceMethod,
    ) -> Result<Estimate, EstimationError> {
        let problem = stacked.problem;
        let fit = Fit {
            split: &self.split,
            solution: &self.solution,
            weights: &self.weights,
            joint_sigma: &self.joint_sigma,
            weighted_variance: self.weighted_variance,
            rows: self.triangle.rows(),
        };
        let covariances = covariances(stacked, &fit, method)?;
        let std: Vec<f64> = covariances.chosen.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect();
        for (index, name) in problem.columns().iter().enumerate() {
            let finite = self.solution.values[index].is_finite()
                && covariances
                    .chosen
                    .row(index)
                    .iter()
                    .chain(covariances.white.row(index).iter())
                    .all(|c| c.is_finite());
            if !finite {
                return Err(EstimationError::Overflow { name: name.clone() });
            }
        }
        let relative = |(std, value): (&f64, &f64)| (*std > 0.0 && *value != 0.0).then(|| 100.0 * std / value.abs());
        let rank = report(&self.triangle, &self.split, rank, problem.columns(), problem.fallback());
        Ok(Estimate {
            names: problem.columns().to_vec(),
            half_width_95: std
                .iter()
                .zip(&covariances.degrees_of_freedom)
                .map(|(s, f)| student_half_width(0.95, *f) * s)
                .collect(),
            std_degrees_of_freedom: covariances.degrees_of_freedom,
            relative_std_percent: std.iter().zip(&self.solution.values).map(relative).collect(),
            noise_std: std.clone(),
            std,
            covariance: covariances.chosen,
            covariance_white: covariances.white,
            covariance_method: method,
            clusters: covariances.clusters,
            status: EstimateStatus::of(self.converged, &rank),
            iterations: self.iterations,
            joint_sigma: self.joint_sigma,
            effective_lag1: covariances.inflation.iter().map(|v| (v - 1.0) / (v + 1.0)).collect(),
            score_inflation: covariances.inflation,
            segment_correlation: covariances.neighbours,
            degrees_of_freedom: self.triangle.rows() - self.split.free.len(),
            condition_number_raw: rank.condition_number_raw,
            condition_number_scaled: rank.condition_number_scaled,
            rank,
            values: self.solution.values,
        })
    }
}

/// Checks that all rows together, and the rows of each joint, leave degrees of freedom for the noise; returns `N_j −
/// p/n` for every joint.
pub(crate) fn joint_degrees_of_freedom(stacked: &StackedProblem<'_>, free: usize) -> Result<Vec<f64>, EstimationError> {
    let problem = stacked.problem;
    let rows = problem.joint_rows();
    let all: usize = rows.iter().sum();
    if all == 0 || problem.joints().is_empty() {
        return Err(EstimationError::Empty);
    }
    if all <= free {
        return Err(EstimationError::TooFewRows { what: "all joints".into(), rows: all, parameters: free as f64 });
    }
    let share = free as f64 / rows.len() as f64;
    rows.iter()
        .zip(problem.joints())
        .map(|(&rows, joint)| {
            let degrees_of_freedom = rows as f64 - share;
            if degrees_of_freedom > 0.0 {
                Ok(degrees_of_freedom)
            } else {
                Err(EstimationError::TooFewRows { what: format!("joint {joint}"), rows, parameters: share })
            }
        })
        .collect()
}

fn rows_of<S: Serializer>(matrix: &DMatrix<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    let mut rows = serializer.serialize_seq(Some(matrix.nrows()))?;
    for row in matrix.row_iter() {
        rows.serialize_element(&row.iter().copied().collect::<Vec<f64>>())?;
    }
    rows.end()
}
