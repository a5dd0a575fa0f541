//! Essential parameters: the base parameters that the data determine, found by backward elimination.

use crate::error::{EstimationError, require};
use crate::uncertainty::{Estimate, f_tail, student_half_width};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Criteria for dropping parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct EssentialSettings {
    /// Parameters are dropped until the largest relative standard deviation is below this multiple of the smallest.
    /// Default 30, as in published fits of the Stäubli TX40; 10 is strict.
    pub ratio: f64,
    /// Dropping also ends if the p-value of the F-test falls below this level: the residual then grows by more than
    /// noise explains. Default 0.05.
    pub significance: f64,
}

impl Default for EssentialSettings {
    fn default() -> Self {
        Self { ratio: 30.0, significance: 0.05 }
    }
}

impl EssentialSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a ratio below 1 or a significance that is not between 0 and 1.
    pub fn validate(&self) -> Result<(), EstimationError> {
        require(self.ratio >= 1.0 && self.ratio.is_finite(), "ratio", self.ratio, "use 1 or more")?;
        let fix = "use a probability above 0 and below 1";
        require(self.significance > 0.0 && self.significance < 1.0, "significance", self.significance, fix)
    }
}

/// A dropped parameter, held at zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DroppedParameter {
    /// Name of the parameter.
    pub name: String,
    /// Value before it was dropped.
    pub value: f64,
    /// Relative standard deviation before it was dropped, percent: the largest of all.
    pub relative_std_percent: f64,
    /// Ratio of this relative standard deviation to the smallest one.
    pub times_smallest: f64,
    /// F statistic of the growth of the residual, for all parameters dropped so far.
    pub f: f64,
    /// Probability of a larger F if all dropped parameters were zero.
    pub p_value: f64,
}

/// Why dropping ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EssentialEnd {
    /// All relative standard deviations are below the ratio.
    RatioReached,
    /// Dropping the next parameter would increase the residual by more than noise explains.
    ResidualGrows,
    /// One parameter is left.
    OneLeft,
}

/// Dropped parameters and the reason for stopping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EssentialReport {
    /// Number of parameters kept.
    pub kept: usize,
    /// Parameters dropped, in order.
    pub dropped: Vec<DroppedParameter>,
    /// Why dropping ended.
    pub end: EssentialEnd,
    /// The parameter that could not be dropped; `None` if the ratio was reached.
    pub refused: Option<DroppedParameter>,
}

/// Holds all but the essential parameters at zero (Pham and Gautier, "Essential parameters of robots", CDC 1991).
///
/// Repeatedly drops the parameter with the largest relative standard deviation. Stops when the largest is below
/// `ratio` times the smallest, or when the F-test rejects:
///
/// ```text
///     θ_e' = θ_e − V_ed V_dd⁻¹ θ_d,   F = θ_dᵀ V_dd⁻¹ θ_d / d  ~  F(d, N − p)
/// ```
///
/// V is the covariance under white noise, d the number of dropped parameters, N the number of rows and p that of
/// parameters. Both results equal those of a new fit with the same weights and fewer columns. With correlated
/// residuals F is too large, and fewer parameters are dropped than possible. The covariance of the remaining
/// parameters is the covariance of `estimate`, transformed by the same map; it does not include the effect of
/// selecting on the same data.
///
/// # Errors
/// [`EstimationError::Setting`].
#[doc(alias("backward elimination", "f-test"))]
pub fn essential(
    estimate: &Estimate,
    settings: &EssentialSettings,
) -> Result<(Estimate, EssentialReport), EstimationError> {
    settings.validate()?;
    let mut best = estimate.clone();
    let mut out: Vec<usize> = Vec::new();
    let mut dropped = Vec::new();
    loop {
        let ranked = |index: &usize| best.std[*index] > 0.0;
        let relative = |index: usize| best.std[index] / best.values[index].abs();
        let free: Vec<usize> = (0..best.values.len()).filter(ranked).collect();
        let worst = free.iter().copied().max_by(|a, b| relative(*a).total_cmp(&relative(*b)));
        let smallest = free.iter().map(|index| relative(*index)).fold(f64::INFINITY, f64::min);
        let (end, refused, next) = match worst {
            None => (Some(EssentialEnd::RatioReached), None, None),
            Some(worst) if relative(worst) <= settings.ratio * smallest => {
                (Some(EssentialEnd::RatioReached), None, None)
            }
            Some(_) if free.len() == 1 => (Some(EssentialEnd::OneLeft), None, None),
            Some(worst) => {
                let mut trial = out.clone();
                trial.push(worst);
                let (f, reduced) = without(estimate, &trial);
                let p_value = f_tail(f, trial.len() as f64, estimate.degrees_of_freedom as f64);
                let entry = DroppedParameter {
                    name: best.names[worst].clone(),
                    value: best.values[worst],
                    relative_std_percent: 100.0 * relative(worst).min(1.0e12),
                    times_smallest: (relative(worst) / smallest).min(1.0e12),
                    f,
                    p_value,
                };
                if p_value >= settings.significance {
                    (None, None, Some((worst, entry, reduced)))
                } else {
                    (Some(EssentialEnd::ResidualGrows), Some(entry), None)
                }
            }
        };
        if let Some((worst, entry, reduced)) = next {
            out.push(worst);
            dropped.push(entry);
            best = reduced;
        }
        if let Some(end) = end {
            let kept = free.len();
            return Ok((best, EssentialReport { kept, dropped, end, refused }));
        }
    }
}

/// F statistic for holding `columns` at zero, and the estimate of the remaining parameters.
fn without(estimate: &Estimate, columns: &[usize]) -> (f64, Estimate) {
    let all = estimate.values.len();
    let white = &estimate.covariance_white;
    let block = white.select_rows(columns).select_columns(columns);
    let theta = DVector::from_iterator(columns.len(), columns.iter().map(|column| estimate.values[*column]));
    // A block of a covariance is positive definite. If rounding destroyed this property, no parameter may be dropped.
    let Some(factor) = block.cholesky() else { return (f64::INFINITY, estimate.clone()) };
    let f = theta.dot(&factor.solve(&theta)) / columns.len() as f64;
    // θ' = C θ with C = 1 − V_·d V_dd⁻¹ E_dᵀ.
    let gain = factor.solve(&white.select_rows(columns)).transpose();
    let mut map = DMatrix::identity(all, all);
    for (place, &column) in columns.iter().enumerate() {
        let changed = map.column(column) - gain.column(place);
        map.set_column(column, &changed);
    }
    for &column in columns {
        map.row_mut(column).fill(0.0);
    }
    let mut reduced = estimate.clone();
    reduced.values = (&map * DVector::from_column_slice(&estimate.values)).as_slice().to_vec();
    reduced.covariance = &map * &estimate.covariance * map.transpose();
    reduced.covariance_white = &map * white * map.transpose();
    reduced.std = reduced.covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect();
    // The ratio of the noise part to the whole error bar stays the same for every parameter.
    let share = |(noise, std): (&f64, &f64)| if *std > 0.0 { noise / std } else { 0.0 };
    let shares = estimate.noise_std.iter().zip(&estimate.std).map(share);
    reduced.noise_std = reduced.std.iter().zip(shares).map(|(std, share)| std * share).collect();
    let half = |(std, degrees_of_freedom): (&f64, &f64)| student_half_width(0.95, *degrees_of_freedom) * std;
    reduced.half_width_95 = reduced.std.iter().zip(&reduced.std_degrees_of_freedom).map(half).collect();
    let relative = |(std, value): (&f64, &f64)| (*std > 0.0 && *value != 0.0).then(|| 100.0 * std / value.abs());
    reduced.relative_std_percent = reduced.std.iter().zip(&reduced.values).map(relative).collect();
    (f, reduced)
}

/// Two parameters and the correlation of their estimates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CorrelatedPair {
    /// The two names.
    pub parameters: [String; 2],
    /// Their correlation, −1 to 1: near ±1 the data determine only a combination of the two.
    pub correlation: f64,
}

/// The `most` strongest correlations among an estimate's parameters, strongest first.
pub fn strongest_correlations(estimate: &Estimate, most: usize) -> Vec<CorrelatedPair> {
    let correlation = crate::uncertainty::correlation(&estimate.covariance);
    let count = estimate.names.len();
    let mut pairs: Vec<(usize, usize)> = (0..count).flat_map(|i| (0..i).map(move |j| (j, i))).collect();
    pairs.sort_by(|a, b| correlation[*b].abs().total_cmp(&correlation[*a].abs()));
    let named = |(i, j): &(usize, usize)| CorrelatedPair {
        parameters: [estimate.names[*i].clone(), estimate.names[*j].clone()],
        correlation: correlation[(*i, *j)],
    };
    pairs.iter().take(most).filter(|pair| correlation[**pair] != 0.0).map(named).collect()
}
