//! Weighted least squares with a noise level for each joint and instant, estimated from nearby residuals.

use super::robust::{RowBlock, RowVisitor, scale_floors, with_factors};
use super::weighted::{WeightedSettings, weighted_least_squares};
use crate::error::{EstimationError, require, within};
use crate::factor::{LinearProblem, RankSettings, SegmentedFactor};
use crate::uncertainty::{CovarianceMethod, Estimate, EstimateStatus};
use serde::{Deserialize, Serialize};

/// Settings of [`noise_weighted_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseLevelSettings {
    /// Window length in rows of one joint and log, centred on a row, for the local noise level. Default 51: the level
    /// has an uncertainty of about 10 % and follows changes that last longer than about fifty rows (slow and fast
    /// motion, slow reversals, brake release).
    pub window_rows: usize,
    /// Share of the joint's mean square residual in the square of every local level, 0 to 1. Default 1e-3: every
    /// level is at least about 1/30 of the joint's RMS residual. With 1 the result is weighted least squares.
    pub pooled_share: f64,
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// Method of the reported covariance; from time segments by default.
    pub covariance: CovarianceMethod,
    /// The iteration ends when no value changes by more than this share of its error bar. Default 1e-2.
    pub tolerance: f64,
    /// Maximum number of passes over the rows. Default 30.
    pub max_passes: usize,
}

impl Default for NoiseLevelSettings {
    fn default() -> Self {
        Self {
            window_rows: 51,
            pooled_share: 1.0e-3,
            rank: RankSettings::default(),
            covariance: CovarianceMethod::default(),
            tolerance: 1.0e-2,
            max_passes: 30,
        }
    }
}

impl NoiseLevelSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a window of fewer than five rows, a share outside 1e-6 to 1, a tolerance
    /// outside 1e-9 to 1, fewer than two passes, or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        let fix = "use at least 5 rows to estimate the noise";
        require(self.window_rows >= 5, "window_rows", self.window_rows as f64, fix)?;
        within("pooled_share", self.pooled_share, 1.0e-6..=1.0, "use a share from 1e-6 to 1")?;
        within("tolerance", self.tolerance, 1.0e-9..=1.0, "use a change in error bars from 1e-9 to 1")?;
        require(self.max_passes >= 2, "max_passes", self.max_passes as f64, "use at least 2")
    }
}

/// Result of [`noise_weighted_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseWeightedEstimate {
    /// Values with covariance. `joint_sigma` is the noise of rows whose level is the mean level of their joint.
    pub estimate: Estimate,
    /// Smallest and largest noise level of each joint's rows, relative to the RMS of its residuals. If both are near
    /// one, weighted least squares is sufficient.
    pub level_range: Vec<[f64; 2]>,
}

/// Solves `θ = argmin Σ_j Σ_k (τ_jk − w_jk θ)² / σ_jk²` for joint j and row k with `σ_jk² = s σ_j² + (1 − s) · mean
/// of r² over the window around row k`, where s is the pooled share. r are the residuals of the previous solution;
/// the solution is iterated.
///
/// Torque noise of a drive is larger at high velocity, and friction models are worse at reversals. With one σ per
/// joint the worst part would dominate. Unlike Huber's and Tukey's weights, the weight of a row depends on the
/// residuals of neighbouring rows and not on its own residual alone. For normal noise the efficiency loss is
/// therefore only that of the estimated level. After Han et al., "An iterative approach for accurate dynamic model
/// identification", IEEE Trans. Ind. Electron. (2020); for estimated weights Carroll and Ruppert, Transformation and
/// Weighting in Regression (1988), 2.3 and 3.
///
/// `pass` must give all rows of `problem` to its visitor at each call. Residuals are stored, one number per row;
/// regressors are not. The covariance is that of [`weighted_least_squares`] on the reweighted rows and treats the
/// weights as known.
///
/// # Errors
/// Same as for [`weighted_least_squares`]; [`EstimationError::Mismatch`] if the rows of a pass differ from those of the
/// problem; and the errors of `pass`. Reaching `max_passes` is a status, not an error.
///
/// ```
/// use dynident_estimation::*;
/// // τ = 2 x, noise 0.01 in the first half and 1 in the second.
/// let x: Vec<f64> = (0..400).map(|k| f64::from(k % 13)).collect();
/// let tau = (0..400).map(|k| 2.0 * x[k] + if k < 200 { 0.01 } else { 1.0 } * (k as f64 * 1.7).sin());
/// let panel: Vec<f64> = x.iter().copied().chain(tau).collect();
/// let mut rows = SegmentedFactor::new(1, SegmentSettings { max_segments: 8, first_length_rows: 50 })?;
/// rows.absorb(&panel, 400)?;
/// let mut problem = LinearProblem::new(vec!["gain".into()], vec!["joint1".into()]);
/// problem.add("run", 0, vec![0], rows)?;
/// let found = noise_weighted_least_squares(&problem, &NoiseLevelSettings::default(), |visit| {
///     visit(&RowBlock { log: 0, joint: 0, rows: 400, panel: &panel })
/// })?;
/// assert!((found.estimate.values[0] - 2.0).abs() < 1e-3 && found.level_range[0][0] < 0.2);
/// # Ok::<(), EstimationError>(())
/// ```
#[doc(alias("heteroscedastic", "irls"))]
pub fn noise_weighted_least_squares<E: From<EstimationError>>(
    problem: &LinearProblem,
    settings: &NoiseLevelSettings,
    mut pass: impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<NoiseWeightedEstimate, E> {
    settings.validate()?;
    let weighted =
        WeightedSettings { rank: settings.rank, covariance: settings.covariance, ..WeightedSettings::default() };
    let mut estimate = weighted_least_squares(problem, &weighted)?;
    let floors = scale_floors(problem);
    let mut levels: Option<Levels> = None;
    for passes in 1..=settings.max_passes {
        let (residuals, factors) = gathered(problem, &estimate.values, levels.as_ref(), &mut pass)?;
        let next = Levels::new(problem, &residuals, &floors, settings);
        if levels.is_some() {
            let reweighted = with_factors(problem, factors)?;
            let mut found = weighted_least_squares(&reweighted, &weighted)?;
            let change = found.values.iter().zip(&estimate.values).zip(&found.std).filter(|(_, std)| **std > 0.0);
            let largest = change.map(|((new, old), std)| ((new - old) / std).abs()).fold(0.0, f64::max);
            found.iterations = passes;
            let settled = largest <= settings.tolerance;
            if settled || passes == settings.max_passes {
                if !settled {
                    found.status = EstimateStatus::IterationLimit;
                }
                return Ok(NoiseWeightedEstimate { estimate: found, level_range: next.ranges });
            }
            estimate = found;
        }
        levels = Some(next);
    }
    // Unreachable: at least two passes are made, and the last one returns.
    Err(EstimationError::Empty.into())
}

/// Noise levels of the rows relative to the level of their joint, by equation and row.
struct Levels {
    relative: Vec<Vec<f64>>,
    ranges: Vec<[f64; 2]>,
}

impl Levels {
    fn new(problem: &LinearProblem, residuals: &[Vec<f64>], floors: &[f64], settings: &NoiseLevelSettings) -> Self {
        let joints = problem.joints().len();
        let (mut squares, mut rows) = (vec![0.0; joints], vec![0_usize; joints]);
        for (equation, residuals) in problem.equations().iter().zip(residuals) {
            squares[equation.joint] += residuals.iter().map(|r| r * r).sum::<f64>();
            rows[equation.joint] += residuals.len();
        }
        let mean_square: Vec<f64> = (0..joints)
            .map(|joint| (squares[joint] / rows[joint].max(1) as f64).max(floors[joint] * floors[joint]))
            .collect();
        let mut ranges = vec![[f64::INFINITY, 0.0_f64]; joints];
        let relative = problem
            .equations()
            .iter()
            .zip(residuals)
            .map(|(equation, residuals)| {
                let of_joint = mean_square[equation.joint];
                let range = &mut ranges[equation.joint];
                let local = window_means(residuals, settings.window_rows);
                let level = |local: f64| {
                    let square = settings.pooled_share + (1.0 - settings.pooled_share) * local / of_joint;
                    square.sqrt()
                };
                let levels: Vec<f64> = local.into_iter().map(level).collect();
                for &level in &levels {
                    *range = [range[0].min(level), range[1].max(level)];
                }
                levels
            })
            .collect();
        Self { relative, ranges }
    }
}

/// Mean square over a centred window of `width` numbers, truncated at the ends. Every sum is computed anew, because
/// running sums would keep the rounding of large residuals.
fn window_means(residuals: &[f64], width: usize) -> Vec<f64> {
    let half = width / 2;
    let mean = |row: usize| {
        let window = &residuals[row.saturating_sub(half)..(row + half + 1).min(residuals.len())];
        window.iter().map(|r| r * r).sum::<f64>() / window.len() as f64
    };
    (0..residuals.len()).map(mean).collect()
}

/// One pass over the rows: residuals of θ by equation, and factors of the rows divided by their levels.
fn gathered<E: From<EstimationError>>(
    problem: &LinearProblem,
    theta: &[f64],
    levels: Option<&Levels>,
    pass: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<(Vec<Vec<f64>>, Vec<SegmentedFactor>), E> {
    let equations = problem.equations();
    let mut factors: Vec<SegmentedFactor> = equations.iter().map(|equation| equation.factor.emptied()).collect();
    let locals: Vec<Vec<f64>> = equations.iter().map(|equation| equation.local(theta)).collect();
    let mut residuals: Vec<Vec<f64>> = equations.iter().map(|e| Vec::with_capacity(e.factor.rows())).collect();
    let mut scaled = Vec::new();
    let mismatch = |at: usize, found: usize| {
        let equation = &equations[at];
        let (log, joint) = (&problem.logs()[equation.log], &problem.joints()[equation.joint]);
        let what = format!("log {log}, joint {joint}: rows of another pass over the log");
        EstimationError::Mismatch { what, expected: equation.factor.rows(), found }
    };
    let mut visit = |block: &RowBlock<'_>| -> Result<(), EstimationError> {
        let at = block.equation(equations)?;
        let first = residuals[at].len();
        if first + block.rows > equations[at].factor.rows() {
            return Err(mismatch(at, first + block.rows));
        }
        scaled.clear();
        scaled.extend_from_slice(block.panel);
        for row in 0..block.rows {
            residuals[at].push(block.residual(row, &locals[at]));
            if let Some(levels) = levels {
                let weight = 1.0 / levels.relative[at][first + row];
                scaled.iter_mut().skip(row).step_by(block.rows).for_each(|value| *value *= weight);
            }
        }
        if levels.is_some() { factors[at].absorb(&scaled, block.rows) } else { Ok(()) }
    };
    pass(&mut visit)?;
    if let Some(at) = (0..equations.len()).find(|&at| residuals[at].len() != equations[at].factor.rows()) {
        return Err(mismatch(at, residuals[at].len()).into());
    }
    Ok((residuals, factors))
}
