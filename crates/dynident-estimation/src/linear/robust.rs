//! Robust least squares: iteratively reweighted rows, with low weights for outliers.

use super::weighted::{WeightedSettings, weighted_values};
use crate::error::{EstimationError, require, within};
use crate::factor::{JointRows, LinearProblem, RankSettings, SegmentedFactor, Split, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Weight of a row as a function of its residual u in units of the joint's noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum RowWeight {
    /// `w = min(1, k/|u|)`: limits the influence of large residuals to that of k. Has one minimum. Huber, Ann. Math.
    /// Stat. 35 (1964) 73.
    Huber {
        /// k; default 1.345, which costs 5 % efficiency for normal noise.
        #[serde(default = "huber_k")]
        k: f64,
    },
    /// `w = (1 − (u/c)²)²` for `|u| < c`, else zero: gross errors are excluded. Has several minima, so it starts from
    /// Huber's solution. Beaton and Tukey, Technometrics 16 (1974) 147.
    Tukey {
        /// c; default 4.685, which costs 5 % efficiency for normal noise.
        #[serde(default = "tukey_c")]
        c: f64,
    },
}

fn huber_k() -> f64 {
    1.345
}

fn tukey_c() -> f64 {
    4.685
}

impl RowWeight {
    /// Huber's weights with k = 1.345.
    pub fn huber() -> Self {
        Self::Huber { k: huber_k() }
    }

    /// Tukey's weights with c = 4.685.
    pub fn tukey() -> Self {
        Self::Tukey { c: tukey_c() }
    }

    /// w(u), 0 to 1.
    pub fn weight(&self, u: f64) -> f64 {
        match *self {
            Self::Huber { k } => {
                if u.abs() <= k {
                    1.0
                } else {
                    k / u.abs()
                }
            }
            Self::Tukey { c } => {
                if u.abs() < c {
                    (1.0 - (u / c).powi(2)).powi(2)
                } else {
                    0.0
                }
            }
        }
    }

    /// ψ'(u), the derivative of ψ(u) = u w(u).
    fn slope(&self, u: f64) -> f64 {
        match *self {
            Self::Huber { k } => f64::from(u.abs() <= k),
            Self::Tukey { c } => {
                let square = (u / c).powi(2);
                if square < 1.0 { (1.0 - square) * (1.0 - 5.0 * square) } else { 0.0 }
            }
        }
    }
}

/// Settings of [`robust_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobustSettings {
    /// Weight function; Huber's by default.
    pub weight: RowWeight,
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// Method of the reported covariance; from time segments by default.
    pub covariance: CovarianceMethod,
    /// The iteration ends at this change of the estimate in error bars (root mean square over all directions) and this
    /// relative change of every scale. Default 1e-4.
    pub tolerance: f64,
    /// Maximum number of passes over the rows. Default 50.
    pub max_passes: usize,
}

impl Default for RobustSettings {
    fn default() -> Self {
        Self {
            weight: RowWeight::huber(),
            rank: RankSettings::default(),
            covariance: CovarianceMethod::default(),
            tolerance: 1.0e-4,
            max_passes: 50,
        }
    }
}

impl RobustSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a constant outside 0.1 to 100, a tolerance outside 1e-13 to 1, fewer than two
    /// passes, or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        let (setting, value) = match self.weight {
            RowWeight::Huber { k } => ("weight.k", k),
            RowWeight::Tukey { c } => ("weight.c", c),
        };
        within(setting, value, 0.1..=100.0, "use a number of standard deviations from 0.1 to 100")?;
        within("tolerance", self.tolerance, 1.0e-13..=1.0, "use a relative change from 1e-13 to 1")?;
        require(self.max_passes >= 2, "max_passes", self.max_passes as f64, "use at least 2")
    }
}

/// Some rows of one joint in one log, in the order in which they were absorbed into the problem.
#[derive(Clone, Copy, Debug)]
pub struct RowBlock<'a> {
    /// Index of the log in [`LinearProblem::logs`].
    pub log: usize,
    /// Index of the joint in [`LinearProblem::joints`].
    pub joint: usize,
    /// Number of rows in this block.
    pub rows: usize,
    /// Column by column, torque last, as in [`TriangularFactor::absorb`](crate::TriangularFactor::absorb).
    pub panel: &'a [f64],
}

impl RowBlock<'_> {
    /// Index of the block's equation in the problem; also checks the size of the panel.
    pub(super) fn equation(&self, equations: &[JointRows]) -> Result<usize, EstimationError> {
        let Some(at) = equations.iter().position(|e| e.log == self.log && e.joint == self.joint) else {
            let what = "log and joint of a block, part of the problem".to_owned();
            return Err(EstimationError::Mismatch { what, expected: equations.len(), found: self.log });
        };
        let expected = (equations[at].columns.len() + 1) * self.rows;
        if self.panel.len() != expected {
            return Err(EstimationError::Shape { what: "a block of rows", expected, found: self.panel.len() });
        }
        Ok(at)
    }

    /// `τ − w θ` of one row, with θ of the equation's columns.
    pub(super) fn residual(&self, row: usize, theta: &[f64]) -> f64 {
        let at_column = |column: usize| self.panel[column * self.rows + row];
        let predicted: f64 = theta.iter().enumerate().map(|(column, value)| value * at_column(column)).sum();
        at_column(theta.len()) - predicted
    }
}

/// Receives the blocks of rows of a pass.
pub type RowVisitor<'a> = dyn FnMut(&RowBlock<'_>) -> Result<(), EstimationError> + 'a;

/// Result of [`robust_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobustEstimate {
    /// Values with covariance; `joint_sigma` is the scale s_j from the median absolute residual.
    pub estimate: Estimate,
    /// Share of rows with a weight below one half, for every joint.
    pub outlier_share: Vec<f64>,
    /// Mean weight of the rows, for every joint.
    pub mean_weight: Vec<f64>,
}

struct PassSums {
    factors: Vec<SegmentedFactor>,
    residuals: Vec<Vec<f64>>,
    tally: Vec<Tally>,
}

#[derive(Clone, Copy, Default)]
struct Tally {
    rows: usize,
    weight: f64,
    slope: f64,
    /// Sum of ψ².
    square: f64,
    outliers: usize,
}

/// Median magnitude of normal noise relative to its standard deviation: Φ⁻¹(3/4).
const NORMAL_MEDIAN_ABS_DEVIATION: f64 = 0.674_489_750_196_081_7;

/// The noise scales are updated in the first 1/SCALE_UPDATE_PART of the passes only. With few rows per parameter,
/// scales and weights would otherwise oscillate; with a fixed scale the reweighting converges, as in MM-estimates
/// (Yohai, Ann. Stat. 15 (1987) 642).
const SCALE_UPDATE_PART: usize = 4;

/// Lower limit of the scale relative to the RMS torque, for data that most rows fit exactly (simulation).
const MIN_SCALE_SHARE: f64 = 1.0e-9;

/// Solves `Σ_i W_iᵀ w(u_i) (τ_i − W_i θ)/s_j² = 0` for θ, with the scaled residuals `u_i = (τ_i − W_i θ)/s_j` and the
/// scale `s_j = median |τ_i − W_i θ| / 0.6745` over the rows of joint j.
///
/// Starts from [`weighted_values`] of `problem`'s factors. Every pass over the rows gives residuals, scales and the
/// factors of the reweighted rows for the next θ. A pass uses the scale of the previous θ, which converges to the
/// same limit and saves a second pass. After a quarter of the passes the scales are fixed. Residuals are stored, one
/// number per row, for their median; regressors are not. `pass` must give all rows of `problem` to its visitor at
/// each call.
///
/// The covariance is that of the reweighted rows times `(Σw/Σψ')²`, because the weight of an outlier changes with the
/// fit (Huber, Robust Statistics (1981), 7.6). Rows are weighted one by one, but a filter spreads an outlier over
/// several rows. Filter as little as possible.
///
/// # Errors
/// As [`weighted_values`]; [`EstimationError::Mismatch`] if the rows of a pass differ from those of the problem; and
/// the errors of `pass`. Reaching `max_passes` is a status, not an error.
///
/// ```
/// use dynident_estimation::*;
/// // τ = 2 x, but every tenth row is far off.
/// let x: Vec<f64> = (0..200).map(|k| f64::from(k % 13)).collect();
/// let tau = (0..200).map(|k| 2.0 * x[k] + if k % 10 == 0 { 50.0 } else { 0.1 * (k as f64).sin() });
/// let panel: Vec<f64> = x.iter().copied().chain(tau).collect();
/// let mut rows = SegmentedFactor::new(1, SegmentSettings { max_segments: 8, first_length_rows: 25 })?;
/// rows.absorb(&panel, 200)?;
/// let mut problem = LinearProblem::new(vec!["gain".into()], vec!["joint1".into()]);
/// problem.add("run", 0, vec![0], rows)?;
/// let settings = RobustSettings { weight: RowWeight::tukey(), ..Default::default() };
/// let found = robust_least_squares(&problem, &settings, |visit| {
///     visit(&RowBlock { log: 0, joint: 0, rows: 200, panel: &panel })
/// })?;
/// assert!((found.estimate.values[0] - 2.0).abs() < 0.01);
/// assert!((found.outlier_share[0] - 0.1).abs() < 0.02);
/// # Ok::<(), EstimationError>(())
/// ```
#[doc(alias("irls", "huber", "tukey", "m-estimator"))]
pub fn robust_least_squares<E: From<EstimationError>>(
    problem: &LinearProblem,
    settings: &RobustSettings,
    mut pass: impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<RobustEstimate, E> {
    settings.validate()?;
    let start = WeightedSettings { rank: settings.rank, tolerance: 1.0e-3, ..WeightedSettings::default() };
    let mut theta = weighted_values(problem, &start)?.values;
    let floors = scale_floors(problem);
    let mut scales = vec![f64::INFINITY; floors.len()];
    // Tukey's weights have several solutions; Huber's unique solution is the start.
    let mut weight = RowWeight::huber();
    let mut choice: Option<Split> = None;
    let mut passes = 0;
    loop {
        let gathered = gather(problem, &theta, &scales, &weight, &mut pass)?;
        passes += 1;
        let new_scales: Vec<f64> = if passes > settings.max_passes / SCALE_UPDATE_PART {
            scales.clone()
        } else {
            gathered.residuals.into_iter().zip(&floors).map(|(r, floor)| median_scale(r).max(*floor)).collect()
        };
        if scales.iter().any(|scale| scale.is_infinite()) {
            scales = new_scales;
            continue;
        }
        let reweighted = with_factors(problem, gathered.factors)?;
        let stacked = reweighted.stacked();
        let weights: Vec<f64> = scales.iter().map(|scale| 1.0 / scale).collect();
        let triangle = stacked.combined(&weights)?;
        let choice = choice.get_or_insert_with(|| split(&triangle, &settings.rank, problem.unexcited()));
        joint_degrees_of_freedom(&stacked, choice.free.len())?;
        let solution = solve(&triangle, choice, &settings.rank, problem.fallback());
        let scale_change = new_scales.iter().zip(&scales).map(|(new, old)| (new / old - 1.0).abs()).fold(0.0, f64::max);
        // The rows have unit noise, so this norm is the step length in error bars over all directions.
        let step: Vec<f64> = solution.values.iter().zip(&theta).map(|(new, old)| new - old).collect();
        let change = (triangle.regressor_triangle() * nalgebra::DVector::from_vec(step)).norm()
            / (choice.free.len().max(1) as f64).sqrt();
        let largest = scale_change.max(change);
        let preliminary = weight != settings.weight;
        // A tenth of an error bar is sufficient for the start.
        let settled = largest <= if preliminary { settings.tolerance.max(0.1) } else { settings.tolerance };
        let last = passes >= settings.max_passes;
        if (settled && !preliminary) || last {
            let fitted = PointEstimate {
                weighted_variance: variance_factor(&gathered.tally),
                triangle,
                split: choice.clone(),
                solution,
                weights,
                joint_sigma: scales,
                iterations: passes,
                converged: settled && !preliminary,
            };
            let estimate = fitted.into_estimate(&stacked, &settings.rank, settings.covariance)?;
            return Ok(finished(estimate, &gathered.tally, settings.covariance));
        }
        if preliminary && (settled || 2 * passes >= settings.max_passes) {
            weight = settings.weight;
        }
        theta = solution.values;
        scales = new_scales;
    }
}

/// One pass over the rows: residuals of θ, and factors of the rows multiplied by √w.
fn gather<E: From<EstimationError>>(
    problem: &LinearProblem,
    theta: &[f64],
    scales: &[f64],
    weight: &RowWeight,
    pass: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<PassSums, E> {
    let equations = problem.equations();
    let mut factors: Vec<SegmentedFactor> = equations.iter().map(|equation| equation.factor.emptied()).collect();
    let locals: Vec<Vec<f64>> = equations.iter().map(|equation| equation.local(theta)).collect();
    let joints = problem.joints().len();
    let (mut residuals, mut tally) = (vec![Vec::new(); joints], vec![Tally::default(); joints]);
    let mut scaled = Vec::new();
    let mut visit = |block: &RowBlock<'_>| -> Result<(), EstimationError> {
        let at = block.equation(equations)?;
        scaled.clear();
        scaled.extend_from_slice(block.panel);
        let scale = scales[block.joint];
        let tally = &mut tally[block.joint];
        for row in 0..block.rows {
            let residual = block.residual(row, &locals[at]);
            residuals[block.joint].push(residual);
            let u = residual / scale;
            let w = weight.weight(u);
            tally.rows += 1;
            tally.weight += w;
            tally.slope += weight.slope(u);
            tally.square += (w * u).powi(2);
            tally.outliers += usize::from(w < 0.5);
            let root = w.sqrt();
            if root < 1.0 {
                scaled.iter_mut().skip(row).step_by(block.rows).for_each(|value| *value *= root);
            }
        }
        factors[at].absorb(&scaled, block.rows)
    };
    pass(&mut visit)?;
    for (equation, factor) in equations.iter().zip(&factors) {
        if factor.rows() != equation.factor.rows() {
            let (log, joint) = (&problem.logs()[equation.log], &problem.joints()[equation.joint]);
            let what = format!("log {log}, joint {joint}: rows of another pass over the log");
            return Err(
                EstimationError::Mismatch { what, expected: equation.factor.rows(), found: factor.rows() }.into()
            );
        }
    }
    Ok(PassSums { factors, residuals, tally })
}

/// The same problem with other factors; keeps the prior.
pub(crate) fn with_factors(
    problem: &LinearProblem,
    factors: Vec<SegmentedFactor>,
) -> Result<LinearProblem, EstimationError> {
    let mut new = LinearProblem::new(problem.columns().to_vec(), problem.joints().to_vec())
        .with_fallback(problem.fallback().to_vec())?
        .with_unexcited(problem.unexcited().clone())?;
    if let Some(prior) = problem.prior() {
        new = new.with_prior(prior.mean().to_vec(), prior.sqrt_information().clone())?;
    }
    for (equation, factor) in problem.equations().iter().zip(factors) {
        new.add(&problem.logs()[equation.log], equation.joint, equation.columns.clone(), factor)?;
    }
    Ok(new)
}

/// `median |r| / 0.6745`; zero without rows.
fn median_scale(mut residuals: Vec<f64>) -> f64 {
    let count = residuals.len();
    if count == 0 {
        return 0.0;
    }
    for residual in &mut residuals {
        *residual = residual.abs();
    }
    let (below, middle, _) = residuals.select_nth_unstable_by(count / 2, f64::total_cmp);
    let median = if count % 2 == 1 { *middle } else { 0.5 * (*middle + below.iter().copied().fold(0.0, f64::max)) };
    median / NORMAL_MEDIAN_ABS_DEVIATION
}

pub(crate) fn scale_floors(problem: &LinearProblem) -> Vec<f64> {
    let mut squares = vec![0.0; problem.joints().len()];
    for equation in problem.equations() {
        squares[equation.joint] += equation.factor.total().torque_norm().powi(2);
    }
    let rows = problem.joint_rows();
    let mut rms: Vec<f64> = squares.iter().zip(rows).map(|(s, rows)| (s / rows.max(1) as f64).sqrt()).collect();
    let largest = rms.iter().copied().fold(0.0, f64::max);
    for value in &mut rms {
        if *value <= 0.0 {
            *value = if largest > 0.0 { largest } else { 1.0 };
        }
        *value *= MIN_SCALE_SHARE;
    }
    rms
}

/// Variance of the reweighted rows under white noise for which `A⁻¹` is the covariance before the correction in
/// [`finished`]: `E ψ² / E w`.
fn variance_factor(tally: &[Tally]) -> f64 {
    let (square, weight) = tally.iter().fold((0.0, 0.0), |(s, w), t| (s + t.square, w + t.weight));
    if weight > 0.0 { square / weight } else { 1.0 }
}

fn finished(mut estimate: Estimate, tally: &[Tally], method: CovarianceMethod) -> RobustEstimate {
    let (weight, slope) = tally.iter().fold((0.0, 0.0), |(w, s), t| (w + t.weight, s + t.slope));
    // The sum of the slopes is below a tenth of that of the weights only if most rows are outliers; the covariance is
    // meaningless then.
    let correction = (weight / slope.max(0.1 * weight)).powi(2);
    if correction.is_finite() {
        let scale = |matrix: &mut DMatrix<f64>| *matrix *= correction;
        scale(&mut estimate.covariance);
        scale(&mut estimate.covariance_white);
        let root = correction.sqrt();
        estimate.std.iter_mut().chain(&mut estimate.half_width_95).for_each(|width| *width *= root);
        estimate.relative_std_percent.iter_mut().flatten().for_each(|percent| *percent *= root);
    }
    estimate.covariance_method = method;
    let share = |part: f64, rows: usize| if rows > 0 { part / rows as f64 } else { 0.0 };
    RobustEstimate {
        estimate,
        outlier_share: tally.iter().map(|t| share(t.outliers as f64, t.rows)).collect(),
        mean_weight: tally.iter().map(|t| share(t.weight, t.rows)).collect(),
    }
}
