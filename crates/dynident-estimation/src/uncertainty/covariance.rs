//! How far an estimate may be off: covariance under white noise, and under noise that is correlated in time.
//!
//! Residuals of robot torque are strongly coloured (lag-1 correlations of 0.3 to 0.98 at usual rates): unmodelled friction and
//! elasticity last longer than a sample. The textbook `σ²(WᵀW)⁻¹` counts every sample as new information and is then too small, by a
//! factor of about √((1+ρ)/(1−ρ)) in the standard deviation. The cluster-robust covariance
//!
//! ```text
//!     V = c A⁻¹ (Σ_g s_g s_gᵀ) A⁻¹,   A = Σ w_j² W_jᵀW_j,   s_g = w_j² W_gᵀ(τ_g − W_g θ),   c = G/(G−1) · (N−1)/(N−p)
//! ```
//!
//! sums the scores over each time segment g **before** squaring: whatever the correlation (and the changes of variance) within a
//! segment, its effect is in s_g. It is right as long as segments last much longer than the correlation, so that their sums are
//! nearly independent, and there are clearly more segments than parameters that each joint's rows pay for. The first can be checked:
//! [`Estimate::segment_correlation`](crate::Estimate::segment_correlation) is near zero then.
//! Liang and Zeger, Biometrika 73 (1986) 13; Cameron and Miller, J. Human Resources 50 (2015) 317, who also give c.

use super::bootstrap;
use super::newey_west;
use crate::error::EstimationError;
use crate::factor::{Solution, Split, StackedProblem, TriangularFactor};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Which covariance an estimate reports as its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CovarianceMethod {
    /// Every time segment of every joint and log is a cluster, errors may be correlated within a segment, and each segment is judged by the fit
    /// **without it** (delete-one jackknife, CR3). A fit bends towards what it was made from, the more the fewer segments there are for each parameter; this does not
    /// take that for accuracy. Slightly cautious when segments are few.
    #[default]
    Jackknife,
    /// The same clusters with the residuals of the fit itself and the usual small-sample factor (CR1): too optimistic unless there are many more segments than
    /// parameters.
    Segments,
    /// A time segment of a log is one cluster for all joints: errors may also be correlated across joints. Needs more segments,
    /// for there are fewer clusters.
    SegmentsAcrossJoints,
    /// Neighbouring segments may be correlated as well, with Bartlett's weights up to a lag chosen from the scores (Newey and West 1994). For segments shorter than the correlation lasts; needs many of them.
    NeweyWest,
    /// Segments drawn with replacement, 300 times, from a fixed seed. As the segments' own method, with the fit's changes of information in it.
    Bootstrap,
    /// Errors independent from sample to sample. Too optimistic on real data; for simulations and comparisons.
    White,
}

/// What the errors look like, from the scores.
pub(crate) struct Covariances {
    /// By the chosen method, over all columns (zero for fixed ones).
    pub(crate) chosen: DMatrix<f64>,
    /// Under white noise.
    pub(crate) white: DMatrix<f64>,
    /// Clusters G (0 for the white method).
    pub(crate) clusters: usize,
    /// Degrees of freedom behind every column's variance (infinite for fixed columns).
    pub(crate) freedom: Vec<f64>,
    /// For every joint the mean score variance over what white noise would give.
    pub(crate) inflation: Vec<f64>,
    /// For every joint the correlation of the scores of neighbouring segments.
    pub(crate) neighbours: Vec<f64>,
}

/// What [`covariances`] needs to know about the fit.
pub(crate) struct Fit<'a> {
    pub(crate) split: &'a Split,
    pub(crate) solution: &'a Solution,
    /// w_j: what the rows of joint j were multiplied by.
    pub(crate) weights: &'a [f64],
    /// Noise of joint j, same unit as its torque.
    pub(crate) joint_sigma: &'a [f64],
    /// Variance of the weighted rows under white noise.
    pub(crate) weighted_variance: f64,
    pub(crate) rows: usize,
}

pub(crate) fn covariances(
    stacked: &StackedProblem<'_>,
    fit: &Fit<'_>,
    method: CovarianceMethod,
) -> Result<Covariances, EstimationError> {
    let problem = stacked.problem;
    let columns = problem.columns().len();
    let inverse = &fit.solution.inverse;
    let free = inverse.ncols();
    let mut place = vec![None; columns];
    for (k, &column) in fit.split.free.iter().enumerate() {
        place[column] = Some(k);
    }
    // Scores and information in the coordinates of R⁻ᵀ, where the total information is the unit matrix.
    let joints = problem.joints().len();
    let (mut found, mut expected, mut spilled) = (vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]);
    let mut clusters: Vec<Vec<f64>> = Vec::new();
    // For every cluster what share of each estimate's variance comes from it under white noise.
    let mut shares: Vec<Vec<f64>> = Vec::new();
    // Whitened scores (and informations) of every joint and log, for the methods that look at their order or draw from them.
    let mut series: Vec<Vec<DVector<f64>>> = Vec::new();
    let mut blocks: Vec<bootstrap::Blocks> = Vec::new();
    let mut log_clusters: Vec<Option<(usize, Vec<usize>)>> = vec![None; problem.logs().len()];
    for (equation, total) in problem.equations().iter().zip(&stacked.totals) {
        let (joint, weight) = (equation.joint, fit.weights[equation.joint]);
        let mut local_inverse = DMatrix::zeros(total.columns(), free);
        for (local, &column) in equation.columns.iter().enumerate() {
            if let Some(k) = place[column] {
                local_inverse.set_row(local, &inverse.row(k));
            }
        }
        let whitened = total.regressor_triangle() * &local_inverse * weight;
        expected[joint] += whitened.norm_squared() * (weight * fit.joint_sigma[joint]).powi(2);
        if method != CovarianceMethod::White {
            shares.extend(equation.factor.segment_factors().iter().map(|segment| {
                let part = segment.regressor_triangle() * &local_inverse * weight * inverse.transpose();
                part.column_iter().map(|column| column.norm_squared()).collect::<Vec<f64>>()
            }));
        }
        let segment_rows = equation.factor.segment_rows();
        let shared = log_clusters[equation.log].as_ref().filter(|_| method == CovarianceMethod::SegmentsAcrossJoints);
        let start = if let Some((start, rows)) = shared {
            if *rows != segment_rows {
                return Err(EstimationError::SegmentsDiffer {
                    log: problem.logs()[equation.log].clone(),
                    joint: problem.joints()[joint].clone(),
                });
            }
            *start
        } else {
            let start = clusters.len();
            clusters.resize(start + segment_rows.len(), vec![0.0; free]);
            log_clusters[equation.log] = Some((start, segment_rows));
            start
        };
        let local = equation.local(&fit.solution.values);
        let mut previous: Option<DVector<f64>> = None;
        let mut own = Vec::new();
        for (g, segment) in equation.factor.scores(&local)?.iter().enumerate() {
            let score = local_inverse.tr_mul(&segment.score) * (weight * weight);
            found[joint] += score.norm_squared();
            spilled[joint] += previous.as_ref().map_or(0.0, |previous| previous.dot(&score));
            if method != CovarianceMethod::Jackknife {
                for (sum, value) in clusters[start + g].iter_mut().zip(score.iter()) {
                    *sum += value;
                }
            }
            if method == CovarianceMethod::NeweyWest || method == CovarianceMethod::Bootstrap {
                own.push(score.clone());
            }
            previous = Some(score);
        }
        if method == CovarianceMethod::Bootstrap {
            let informations = equation.factor.segment_factors().into_iter().map(|segment| {
                let whitened = segment.regressor_triangle() * &local_inverse * weight;
                whitened.tr_mul(&whitened)
            });
            blocks.push(informations.zip(own).collect());
        } else if method == CovarianceMethod::NeweyWest {
            series.push(own);
        }
        if method == CovarianceMethod::Jackknife {
            for (g, segment) in equation.factor.segment_factors().iter().enumerate() {
                let change = change_without(segment, &local, &local_inverse, weight);
                clusters[start + g].copy_from_slice(change.as_slice());
            }
        }
    }
    let spread = |inner: &DMatrix<f64>| {
        let small = inverse * inner * inverse.transpose();
        let mut all = DMatrix::zeros(columns, columns);
        for (i, &row) in fit.split.free.iter().enumerate() {
            for (j, &column) in fit.split.free.iter().enumerate() {
                all[(row, column)] = 0.5 * (small[(i, j)] + small[(j, i)]);
            }
        }
        all
    };
    let white = spread(&(DMatrix::identity(free, free) * fit.weighted_variance));
    let neighbours = spilled.iter().zip(&found).map(|(s, f)| if *f > 0.0 { s / f } else { 0.0 }).collect();
    let inflation = found.iter().zip(&expected).map(|(f, e)| if *e > 0.0 { f / e } else { 1.0 }).collect();
    if method == CovarianceMethod::White {
        let freedom = vec![(fit.rows - free) as f64; columns];
        return Ok(Covariances { chosen: white.clone(), white, clusters: 0, freedom, inflation, neighbours });
    }
    let count = clusters.len();
    if count < 2 {
        return Err(EstimationError::TooFewSegments { clusters: count });
    }
    let scores = DMatrix::from_fn(count, free, |g, k| clusters[g][k]);
    let (g, n, p) = (count as f64, fit.rows as f64, free as f64);
    let factor = match method {
        CovarianceMethod::Jackknife => (g - 1.0) / g,
        _ => g / (g - 1.0) * (n - 1.0) / (n - p),
    };
    // The prior's rows have unit noise by definition.
    let fixed = problem.prior().map_or_else(
        || DMatrix::zeros(free, free),
        |prior| {
            let rows = prior.sqrt_information().select_columns(&fit.split.free) * inverse;
            rows.tr_mul(&rows)
        },
    );
    let bandwidths: Vec<usize> = series.iter().map(|series| newey_west::bandwidth(series)).collect();
    let inner = match method {
        CovarianceMethod::NeweyWest => {
            let sum = series.iter().zip(&bandwidths).fold(DMatrix::zeros(free, free), |sum, (series, bandwidth)| {
                sum + newey_west::long_run(series, free, *bandwidth)
            });
            sum * (n / (n - p)) + fixed
        }
        CovarianceMethod::Bootstrap => bootstrap::spread(&blocks, &fixed)? + fixed,
        _ => scores.tr_mul(&scores) * factor + fixed,
    };
    // Bartlett's kernel of bandwidth L makes 3/(2 (L + 1)) independent squares of one score (Priestley, Spectral Analysis and Time Series, 6.2); never more than one.
    let longest = bandwidths.iter().copied().max().unwrap_or(0) as f64;
    let independent = (1.5 / (longest + 1.0)).min(1.0);
    let freedom =
        |place: &Option<usize>| place.map_or(f64::INFINITY, |k| (independent * satterthwaite(&shares, k)).max(1.0));
    let freedom = place.iter().map(freedom).collect();
    Ok(Covariances { chosen: spread(&inner), white, clusters: count, freedom, inflation, neighbours })
}

/// `(Σ_g h_g)² / Σ_g h_g²`: the degrees of freedom of a sum of independent squares with expectations h_g.
///
/// Satterthwaite, Biometrics Bulletin 2 (1946) 110; for clusters Bell and McCaffrey, Survey Methodology 28 (2002) 169, here without the correlation that the fit puts between clusters, and less the
/// one degree that the jackknife's factor (G − 1)/G stands for.
fn satterthwaite(shares: &[Vec<f64>], k: usize) -> f64 {
    let (sum, square) = shares.iter().fold((0.0, 0.0), |(sum, square), h| (sum + h[k], square + h[k] * h[k]));
    if square > 0.0 { (sum * sum / square - 1.0).max(1.0) } else { 1.0 }
}

/// By how much leaving out one segment changes the estimate, in whitened coordinates.
fn change_without(
    segment: &TriangularFactor,
    theta: &[f64],
    local_inverse: &DMatrix<f64>,
    weight: f64,
) -> DVector<f64> {
    // Where a segment alone fixes a direction its own residual there is zero, and so is the quotient; this keeps it from being 0/0.
    const ALONE: f64 = 1.0e-6;
    let triangle = segment.regressor_triangle();
    let rest = (segment.rotated_torque() - &triangle * DVector::from_column_slice(theta)) * weight;
    let whitened = triangle * local_inverse * weight;
    let left = DMatrix::identity(rest.len(), rest.len()) * (1.0 + ALONE) - &whitened * whitened.transpose();
    // Positive definite but for rounding: the segment is a part of the total, which is one here.
    let judged = left.cholesky().map_or_else(|| rest.clone(), |factor| factor.solve(&rest));
    whitened.tr_mul(&judged)
}

/// The correlation matrix of a covariance matrix. A row and column of zero variance (a fixed column) become those of the unit matrix.
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
