//! Augmented Durbin-Wu-Hausman test of least squares against instrumental variables. It shows whether filtering
//! removes enough noise from the regressor.

use super::instrumental::{InstrumentalEstimate, noisy_columns};
use super::projection::Projection;
use super::weighted::noise_of_joints;
use crate::error::{EstimationError, within};
use crate::factor::{InstrumentedProblem, LinearProblem, RankSettings, Unexcited, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, f_tail, joint_degrees_of_freedom};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Settings of [`hausman_test`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HausmanSettings {
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// Covariance of the test; from time segments by default. With `white`, the textbook form, residuals that are
    /// correlated in time cause far too many rejections.
    pub covariance: CovarianceMethod,
    /// Significance level: probability of rejecting least squares although it is correct. Default 0.01, because with
    /// large samples even small deviations are significant.
    pub level: f64,
}

impl Default for HausmanSettings {
    fn default() -> Self {
        Self { rank: RankSettings::default(), covariance: CovarianceMethod::default(), level: 0.01 }
    }
}

impl HausmanSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a level outside 1e-6 to 0.5 or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        within("level", self.level, 1.0e-6..=0.5, "give a probability from 1e-6 to 0.5")
    }
}

/// Verdict of the test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum HausmanVerdict {
    /// No significant noise in the regressor: filtering was sufficient, least squares is valid.
    FilteringWasEnough,
    /// Noise in the regressor (or feedback) biases least squares: use the instrumental estimate.
    RejectLeastSquares,
    /// Too few time segments for the columns, or instruments that explain the whole regressor.
    Undecided,
}

/// Verdict and statistics of the test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HausmanTest {
    /// The verdict.
    pub verdict: HausmanVerdict,
    /// F statistic; `None` if undecided.
    pub f: Option<f64>,
    /// Degrees of freedom: number of tested columns; number of time segments (rows for white residuals) minus tested
    /// columns.
    pub degrees_of_freedom: [f64; 2],
    /// p-value: probability of a larger F if least squares is correct.
    pub p_value: Option<f64>,
    /// Tested columns with `t = γ/std(γ)`; large values show where the noise is.
    pub columns: Vec<HausmanColumn>,
    /// Why the test is undecided.
    pub reason: Option<String>,
}

/// One tested column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HausmanColumn {
    /// Name of the column.
    pub name: String,
    /// γ: difference between the coefficients of the column's noise and of its motion.
    pub contrast: f64,
    /// γ divided by its standard deviation.
    pub t: f64,
}

/// Regresses `τ` on `[W | V]`, where `V = W − Z(ZᵀZ)⁻¹ZᵀW` is the part of the regressor that the instruments do not
/// explain, and tests whether the coefficients γ of V are zero:
///
/// ```text
///     τ = W θ + V γ + noise,    T² = γᵀ Cov(γ)⁻¹ γ,    F = T² (G − q)/(q (G − 1))  against F(q, G − q)
/// ```
///
/// Without significant noise in W, V has the same coefficients as W and γ = 0; noise in W (or noise fed back into the
/// motion) makes them differ. Cov comes from G time segments, so that correlated residuals alone do not cause a
/// rejection; F is Hotelling's form for a covariance estimated from G segments. Rows are weighted by the joints' noise
/// in `estimate`. Janot, Vandanjon and Gautier, Control Engineering Practice 48 (2016) 52; Hausman, Econometrica 46
/// (1978) 1251.
///
/// # Errors
/// [`EstimationError::Setting`] and the errors of the covariance. If the test is not possible, the verdict is
/// [`HausmanVerdict::Undecided`].
#[doc(alias("durbin-wu-hausman", "dwh"))]
pub fn hausman_test(
    problem: &InstrumentedProblem,
    estimate: &InstrumentalEstimate,
    settings: &HausmanSettings,
) -> Result<HausmanTest, EstimationError> {
    settings.validate()?;
    let sigma = &estimate.estimate.joint_sigma;
    crate::error::expect("joints of the estimate", problem.joints().len(), sigma.len())?;
    crate::error::expect("columns of the estimate", problem.columns().len(), estimate.estimate.values.len())?;
    let weights: Vec<f64> = sigma.iter().map(|sigma| 1.0 / sigma).collect();
    let projection = Projection::new(problem, &problem.rows.stacked(), &weights, &settings.rank)?;
    let fixed: Vec<usize> = estimate.estimate.rank.fixed.iter().map(|fixed| fixed.column).collect();
    let free: Vec<usize> = (0..problem.columns().len()).filter(|column| !fixed.contains(column)).collect();
    let noisy = noisy_columns(&projection, &free);
    if noisy.is_empty() {
        return Ok(undecided(
            "the instruments explain the regressor completely, so they contain the same noise: use other instruments"
                .into(),
            [0.0; 2],
        ));
    }
    let augmented = augmented(problem, &projection, &estimate.estimate, &free, &noisy)?;
    let stacked = augmented.stacked();
    let triangle = stacked.combined(&weights)?;
    let choice = split(&triangle, &settings.rank, &Unexcited::default());
    let tested: Vec<usize> = choice.free.iter().copied().filter(|&column| column >= free.len()).collect();
    if tested.is_empty() {
        return Ok(undecided("no noise column is independent of the regressor".into(), [0.0; 2]));
    }
    let degrees_of_freedom = match joint_degrees_of_freedom(&stacked, choice.free.len()) {
        Ok(degrees_of_freedom) => degrees_of_freedom,
        Err(error) => return Ok(undecided(error.to_string(), [tested.len() as f64, 0.0])),
    };
    let solution = solve(&triangle, &choice, &settings.rank, augmented.fallback());
    let (squares, torque) = stacked.joint_squares(&solution.values)?;
    let joint_sigma = noise_of_joints(&squares, &torque, &degrees_of_freedom);
    let degrees = triangle.rows() - choice.free.len();
    let weighted: f64 = squares.iter().zip(&weights).map(|(square, weight)| square * weight * weight).sum();
    let fit = PointEstimate {
        triangle,
        split: choice,
        solution,
        weights,
        joint_sigma,
        weighted_variance: weighted / degrees as f64,
        iterations: 1,
        converged: true,
    }
    .into_estimate(&stacked, &settings.rank, settings.covariance)?;
    let names = tested.iter().map(|&column| problem.columns()[noisy[column - free.len()]].clone()).collect();
    Ok(judged(&fit, &Tested { columns: tested, names }, degrees, settings.level))
}

/// Columns of `[W | V]` whose coefficients are tested.
struct Tested {
    columns: Vec<usize>,
    /// Names of the corresponding columns of W.
    names: Vec<String>,
}

/// Evaluates the test on a fit of `[W | V]` with `degrees` degrees of freedom.
fn judged(fit: &Estimate, tested: &Tested, degrees: usize, level: f64) -> HausmanTest {
    let Tested { columns: tested, names } = tested;
    let q = tested.len();
    let pieces = if fit.clusters > 0 { fit.clusters } else { degrees + q };
    let degrees_of_freedom = [q as f64, pieces.saturating_sub(q) as f64];
    let columns: Vec<HausmanColumn> = tested
        .iter()
        .zip(names)
        .filter(|&(&column, _)| fit.std[column] > 0.0)
        .map(|(&column, name)| HausmanColumn {
            name: name.clone(),
            contrast: fit.values[column],
            t: fit.values[column] / fit.std[column],
        })
        .collect();
    if pieces <= q {
        let reason =
            format!("too few time segments ({pieces}) for {q} tested columns: use shorter segments or longer logs");
        return HausmanTest { columns, ..undecided(reason, degrees_of_freedom) };
    }
    // Scaled by the standard deviations, to be independent of units.
    let std: Vec<f64> = tested.iter().map(|&column| fit.std[column]).collect();
    let correlation = DMatrix::from_fn(q, q, |i, j| fit.covariance[(tested[i], tested[j])] / (std[i] * std[j]));
    let t = DVector::from_fn(q, |i, _| fit.values[tested[i]] / std[i]);
    let square = correlation.cholesky().map(|factor| t.dot(&factor.solve(&t))).filter(|square| square.is_finite());
    let Some(square) = square else {
        let reason = "the covariance of the tested columns is singular: use shorter segments or longer logs".into();
        return HausmanTest { columns, ..undecided(reason, degrees_of_freedom) };
    };
    let scale = if fit.clusters > 0 { degrees_of_freedom[1] / (pieces as f64 - 1.0) } else { 1.0 };
    let f = square * scale / q as f64;
    let p_value = f_tail(f, degrees_of_freedom[0], degrees_of_freedom[1]);
    let verdict = if p_value < level { HausmanVerdict::RejectLeastSquares } else { HausmanVerdict::FilteringWasEnough };
    HausmanTest { verdict, f: Some(f), degrees_of_freedom, p_value: Some(p_value), columns, reason: None }
}

/// Regression of τ on the `free` columns of W and the `noisy` ones of V; the other columns of W keep their values.
fn augmented(
    problem: &InstrumentedProblem,
    projection: &Projection,
    estimate: &Estimate,
    free: &[usize],
    noisy: &[usize],
) -> Result<LinearProblem, EstimationError> {
    let names = problem.columns();
    let all: Vec<String> = free
        .iter()
        .map(|&column| names[column].clone())
        .chain(noisy.iter().map(|&column| format!("noise of {}", names[column])))
        .collect();
    let zeros = vec![0.0; all.len()];
    let fixed = estimate.rank.fixed.iter().map(|fixed| fixed.column);
    let held: Vec<(usize, f64)> = fixed.map(|column| (column, estimate.values[column])).collect();
    problem.combined(all, zeros, |local| augmented_rows(projection, local, free, noisy, &held))
}

/// Coefficients of an equation's `[Z | W | τ]` in `[W_free | V_noisy | τ − W_fixed θ_fixed]`.
fn augmented_rows(
    projection: &Projection,
    local: &[usize],
    free: &[usize],
    noisy: &[usize],
    held: &[(usize, f64)],
) -> DMatrix<f64> {
    let (_, left) = projection.parts(local);
    let (size, count) = (left.nrows(), free.len() + noisy.len());
    let mut rows = DMatrix::zeros(size, count + 1);
    for (place, &column) in local.iter().enumerate() {
        if let Some(k) = free.iter().position(|&free| free == column) {
            rows[(local.len() + place, k)] = 1.0;
        }
        if let Some((_, value)) = held.iter().find(|(fixed, _)| *fixed == column) {
            rows[(local.len() + place, count)] = -value;
        }
    }
    for (k, &column) in noisy.iter().enumerate() {
        rows.set_column(free.len() + k, &left.column(column));
    }
    rows[(size - 1, count)] = 1.0;
    rows
}

fn undecided(reason: String, degrees_of_freedom: [f64; 2]) -> HausmanTest {
    HausmanTest {
        verdict: HausmanVerdict::Undecided,
        f: None,
        degrees_of_freedom,
        p_value: None,
        columns: Vec::new(),
        reason: Some(reason),
    }
}
