//! Covariance of an estimate under white noise and under noise that is correlated in time.
//!
//! Residuals of robot torque are strongly correlated in time (lag-1 correlations ρ of 0.3 to 0.98 at usual rates),
//! because unmodelled friction and elasticity last longer than a sample. The textbook covariance `σ²(WᵀW)⁻¹` treats
//! every sample as independent; its standard deviation is too small by a factor of about √((1+ρ)/(1−ρ)). The
//! cluster-robust covariance over time segments g includes these correlations:
//!
//! ```text
//!     V = c A⁻¹ (Σ_g s_g s_gᵀ) A⁻¹,   A = Σ w_j² W_jᵀW_j,   s_g = w_j² W_gᵀ(τ_g − W_g θ),   c = G/(G−1) · (N−1)/(N−p)
//! ```
//!
//! sums the scores over each time segment g **before** squaring, so s_g includes any correlation and any change of
//! variance within a segment. It is valid if segments are much longer than the correlation, so that their sums are
//! nearly independent, and if there are clearly more segments than parameters per joint. To check the first condition:
//! [`Estimate::segment_correlation`](crate::Estimate::segment_correlation) is then near zero. Liang and Zeger,
//! Biometrika 73 (1986) 13; Cameron and Miller, J. Human Resources 50 (2015) 317, who also give c.

use super::bootstrap::{Blocks, replicated};
use super::newey_west::{bandwidth, long_run};
use super::scores::{Fit, JointScores, Scores};
use crate::error::EstimationError;
use crate::factor::{LinearProblem, StackedProblem};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The method for the covariance that an estimate reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CovarianceMethod {
    /// Delete-one jackknife (CR3): every time segment of every joint and log is a cluster, and its residuals are those
    /// of the fit **without** it, so overfitting does not shrink the error bars. Valid for errors correlated within a
    /// segment. Slightly conservative with few segments.
    #[default]
    Jackknife,
    /// The same clusters with the residuals of the full fit and the usual small-sample factor (CR1). Too optimistic
    /// unless there are many more segments than parameters.
    Segments,
    /// A time segment of a log is one cluster for all joints, so errors may also be correlated across joints. Needs
    /// more segments, because there are fewer clusters.
    SegmentsAcrossJoints,
    /// Neighbouring segments may also be correlated: Bartlett weights up to a lag that is selected from the scores
    /// (Newey and West 1994). For segments that are shorter than the correlation time; needs many segments.
    NeweyWest,
    /// Segments drawn with replacement, 300 times, from a fixed seed. Like [`Segments`](Self::Segments), but includes
    /// the variation of the information matrix.
    Bootstrap,
    /// Errors independent from sample to sample. Too optimistic on real data; for simulations and comparisons.
    White,
}

pub(crate) struct Covariances {
    /// Covariance by the chosen method, over all columns (zero for fixed columns).
    pub(crate) chosen: DMatrix<f64>,
    pub(crate) white: DMatrix<f64>,
    /// Number of clusters G (0 for the white method).
    pub(crate) clusters: usize,
    /// Degrees of freedom of the variance of every column (infinite for fixed columns).
    pub(crate) degrees_of_freedom: Vec<f64>,
    /// For every joint, the mean variance of the scores relative to white noise.
    pub(crate) inflation: Vec<f64>,
    /// For every joint the correlation of the scores of neighbouring segments.
    pub(crate) neighbours: Vec<f64>,
}

/// Second moment of the scores in whitened coordinates, without the prior.
struct Moment {
    matrix: DMatrix<f64>,
    clusters: usize,
    independent: f64,
}

pub(crate) fn covariances(
    stacked: &StackedProblem<'_>,
    fit: &Fit<'_>,
    method: CovarianceMethod,
) -> Result<Covariances, EstimationError> {
    let problem = stacked.problem;
    let scores = Scores::new(stacked, fit)?;
    let (inflation, neighbours) = scores.inflation_and_neighbours(fit);
    let free = scores.free;
    let white = scores.spread(&(DMatrix::identity(free, free) * fit.weighted_variance));
    // The prior's rows have unit noise by definition.
    let prior = problem.prior().map_or_else(
        || DMatrix::zeros(free, free),
        |prior| {
            let rows = prior.sqrt_information().select_columns(&fit.split.free) * &fit.solution.inverse;
            rows.tr_mul(&rows)
        },
    );
    let moment = match method {
        CovarianceMethod::White => {
            let degrees_of_freedom = vec![(fit.rows - free) as f64; problem.columns().len()];
            return Ok(Covariances {
                chosen: white.clone(),
                white,
                clusters: 0,
                degrees_of_freedom,
                inflation,
                neighbours,
            });
        }
        CovarianceMethod::Jackknife => jackknife(&scores)?,
        CovarianceMethod::Segments => segments(&scores, fit.rows)?,
        CovarianceMethod::SegmentsAcrossJoints => segments_across_joints(&scores, problem, fit.rows)?,
        CovarianceMethod::NeweyWest => newey_west(&scores, fit.rows)?,
        CovarianceMethod::Bootstrap => bootstrap(&scores, &prior)?,
    };
    Ok(Covariances {
        chosen: scores.spread(&(moment.matrix + prior)),
        white,
        clusters: moment.clusters,
        degrees_of_freedom: scores.degrees_of_freedom(moment.independent),
        inflation,
        neighbours,
    })
}

/// Delete-one jackknife: `(G − 1)/G Σ_g Δ_g Δ_gᵀ` with the change Δ_g when segment g is left out.
fn jackknife(scores: &Scores<'_>) -> Result<Moment, EstimationError> {
    let changes = scores.joints.par_iter().map(JointScores::changes_without).collect::<Vec<_>>().concat();
    let g = at_least_two(changes.len())? as f64;
    Ok(second_moment(&changes, scores.free, (g - 1.0) / g))
}

/// CR1: `c Σ_g s_g s_gᵀ` over the segments of all joints and logs.
fn segments(scores: &Scores<'_>, rows: usize) -> Result<Moment, EstimationError> {
    let all: Vec<DVector<f64>> = scores.joints.iter().flat_map(|joint| joint.scores.iter().cloned()).collect();
    let factor = small_sample(at_least_two(all.len())?, rows, scores.free);
    Ok(second_moment(&all, scores.free, factor))
}

/// Like [`segments`], with the scores summed over the joints of a log.
fn segments_across_joints(
    scores: &Scores<'_>,
    problem: &LinearProblem,
    rows: usize,
) -> Result<Moment, EstimationError> {
    let mut sums: Vec<DVector<f64>> = Vec::new();
    let mut logs: Vec<Option<(usize, Vec<usize>)>> = vec![None; problem.logs().len()];
    for joint in &scores.joints {
        let segment_rows = joint.rows.factor.segment_rows();
        let (start, first_rows) = logs[joint.rows.log].get_or_insert_with(|| {
            let start = sums.len();
            sums.resize(start + segment_rows.len(), DVector::zeros(scores.free));
            (start, segment_rows.clone())
        });
        if *first_rows != segment_rows {
            return Err(EstimationError::SegmentsDiffer {
                log: problem.logs()[joint.rows.log].clone(),
                joint: problem.joints()[joint.rows.joint].clone(),
            });
        }
        for (sum, score) in sums[*start..].iter_mut().zip(&joint.scores) {
            *sum += score;
        }
    }
    let factor = small_sample(at_least_two(sums.len())?, rows, scores.free);
    Ok(second_moment(&sums, scores.free, factor))
}

fn newey_west(scores: &Scores<'_>, rows: usize) -> Result<Moment, EstimationError> {
    let clusters = at_least_two(scores.clusters())?;
    let (n, p) = (rows as f64, scores.free as f64);
    let bandwidths: Vec<usize> = scores.joints.iter().map(|joint| bandwidth(&joint.scores)).collect();
    let sum = scores
        .joints
        .iter()
        .zip(&bandwidths)
        .fold(DMatrix::zeros(scores.free, scores.free), |sum, (joint, bandwidth)| {
            sum + long_run(&joint.scores, scores.free, *bandwidth)
        });
    // Bartlett's kernel of bandwidth L gives 3/(2 (L + 1)) independent squares per score (Priestley, Spectral
    // Analysis and Time Series, 6.2), at most one.
    let longest = bandwidths.iter().copied().max().unwrap_or(0) as f64;
    Ok(Moment { matrix: sum * (n / (n - p)), clusters, independent: (1.5 / (longest + 1.0)).min(1.0) })
}

fn bootstrap(scores: &Scores<'_>, prior: &DMatrix<f64>) -> Result<Moment, EstimationError> {
    let clusters = at_least_two(scores.clusters())?;
    let blocks: Vec<Blocks> =
        scores.joints.iter().map(|joint| joint.informations().zip(joint.scores.iter().cloned()).collect()).collect();
    Ok(Moment { matrix: replicated(&blocks, prior)?, clusters, independent: 1.0 })
}

fn at_least_two(clusters: usize) -> Result<usize, EstimationError> {
    if clusters < 2 { Err(EstimationError::TooFewSegments { clusters }) } else { Ok(clusters) }
}

/// Small-sample factor c = G/(G−1) · (N−1)/(N−p).
fn small_sample(clusters: usize, rows: usize, free: usize) -> f64 {
    let (g, n, p) = (clusters as f64, rows as f64, free as f64);
    g / (g - 1.0) * (n - 1.0) / (n - p)
}

fn second_moment(clusters: &[DVector<f64>], free: usize, factor: f64) -> Moment {
    let rows = DMatrix::from_fn(clusters.len(), free, |g, k| clusters[g][k]);
    Moment { matrix: rows.tr_mul(&rows) * factor, clusters: clusters.len(), independent: 1.0 }
}

/// Correlation matrix of a covariance matrix. Rows and columns of zero variance (fixed columns) are those of the unit
/// matrix.
///
/// ```
/// use dynident_estimation::correlation;
/// use nalgebra::DMatrix;
/// let c = correlation(&DMatrix::from_row_slice(2, 2, &[4.0, 3.0, 3.0, 9.0]));
/// assert_eq!(c[(0, 1)], 0.5);
/// ```
pub fn correlation(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let std: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect();
    DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| {
        if i == j {
            1.0
        } else if std[i] > 0.0 && std[j] > 0.0 {
            covariance[(i, j)] / (std[i] * std[j])
        } else {
            0.0
        }
    })
}
