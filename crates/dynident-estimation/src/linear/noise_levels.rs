//! Reweighting by the noise itself: every row counts by the noise around it, for each joint and instant.

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
    /// Rows of one joint and log, centred on a row, whose residuals say how large the noise is there. Default 51: the
    /// level is then known to about 10 %, and follows what lasts longer than some fifty rows (slow and fast motion,
    /// reversals of a slow motion, a brake that is let go).
    pub window_rows: usize,
    /// Share of the joint's mean square residual in every level's square, 0 to 1. Default 1e-3: no row is taken for
    /// more than thirty times as quiet as the mean. One gives weighted least squares.
    pub pooled_share: f64,
    /// When a column counts as excited.
    pub rank: RankSettings,
    /// The covariance to report; from time segments by default.
    pub covariance: CovarianceMethod,
    /// Largest change of a value, in its error bars, at which the iteration ends. Default 1e-2.
    pub tolerance: f64,
    /// Most passes over the rows. Default 30.
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
        let fix = "give at least 5: fewer rows are no measure of noise";
        require(self.window_rows >= 5, "window_rows", self.window_rows as f64, fix)?;
        within("pooled_share", self.pooled_share, 1.0e-6..=1.0, "give a share from 1e-6 to 1")?;
        within("tolerance", self.tolerance, 1.0e-9..=1.0, "give a change in error bars from 1e-9 to 1")?;
        require(self.max_passes >= 2, "max_passes", self.max_passes as f64, "give at least 2")
    }
}

/// What [`noise_weighted_least_squares`] found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseWeightedEstimate {
    /// Values with covariance. `joint_sigma` is the noise of rows at their joint's mean level.
    pub estimate: Estimate,
    /// For every joint the smallest and the largest noise level of its rows, over the root mean square of all its
    /// residuals. Both near one: weighted least squares would have done.
    pub level_range: Vec<[f64; 2]>,
}

/// `θ = argmin Σ_j Σ_k (τ_jk − w_jk θ)² / σ_jk²`, `σ_jk² = s σ_j² + (1 − s) · mean of r² over the window around row k`,
/// iterated: rows of joint j at instant k count by the reciprocal of the noise level there, which the residuals of the
/// solution before determine.
///
/// Feng's reading of iteratively reweighted least squares, where weights are the reciprocal noise: torque noise of a
/// drive is larger at velocity, friction is modelled worse at reversals, and one σ for the whole joint lets the worst
/// part decide. Unlike Huber's and Tukey's weights a row is not judged by its own residual but by its neighbourhood's,
/// so that normal noise loses nothing but what the level's own uncertainty costs. After Han et al., "An iterative
/// approach for accurate dynamic model identification", IEEE Trans. Ind. Electron. (2020); for estimated weights in
/// general Carroll and Ruppert, Transformation and Weighting in Regression (1988), 2.3 and 3.
///
/// `pass` hands every row that `problem` was made of to its visitor, as often as it is called; residuals are kept, one
/// number for each row, regressors are not. The covariance is that of [`weighted_least_squares`] on the reweighted
/// rows, weights taken for given.
///
/// # Errors
/// As [`weighted_least_squares`]; [`EstimationError::Mismatch`] when a pass gives other rows than the problem holds;
/// and whatever `pass` itself returns. Reaching `max_passes` is a status, not an error.
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
    // At least two passes are made, and the last one returns.
    Err(EstimationError::Empty.into())
}

/// Noise levels over the joint's own, by equation and row.
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

/// Mean square over a centred window of `width` numbers, cut at the ends. Sums are made afresh, not by subtraction, so
/// that a large residual leaves no rounding behind.
fn window_means(residuals: &[f64], width: usize) -> Vec<f64> {
    let half = width / 2;
    let mean = |row: usize| {
        let window = &residuals[row.saturating_sub(half)..(row + half + 1).min(residuals.len())];
        window.iter().map(|r| r * r).sum::<f64>() / window.len() as f64
    };
    (0..residuals.len()).map(mean).collect()
}

/// One pass: residuals of θ by equation, and the factors of the rows over their levels.
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
        let what = format!("log {log}, joint {joint}: rows of another pass over the same log");
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
