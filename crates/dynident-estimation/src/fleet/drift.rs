//! Drift of the parameters of one robot over time, for example growing friction or a slackening belt.
//!
//! ```text
//!     y_k = a + b t_k + e_k,   e_k ~ N(0, c v_k),   c = max(1, χ²/(n − 2))
//! ```
//!
//! If the estimates scatter about the line by more than their error bars (other load or temperature), the slope's
//! error bar grows by √c. The slope over its error bar has a Student distribution with n − 2 degrees of freedom.

use super::member::{Member, checked};
use crate::error::{EstimationError, expect, require};
use crate::uncertainty::{f_tail, student_half_width};
use serde::Serialize;

/// Minimum number of estimates for a line with an error bar.
const MIN_ESTIMATES: usize = 3;

/// Drift of one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ParameterDrift {
    /// b: change of the parameter per unit of time.
    pub slope: f64,
    /// Standard deviation of the slope.
    pub slope_std: f64,
    /// Half-width of the 95 % interval of the slope.
    pub half_width_95: f64,
    /// c: variance of the estimates about the line relative to their error bars.
    pub scatter: f64,
    /// p-value: probability of at least this slope if the parameter is constant.
    pub tail: f64,
    /// Whether the parameter drifts: `tail` is below the false-alarm rate, corrected for the number of parameters.
    pub drifts: bool,
}

/// Drift of one robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// One entry per parameter; `None` if too few estimates contain it, or if all estimates have the same time.
    pub parameters: Vec<Option<ParameterDrift>>,
}

/// Fits a line to the estimates of one robot at the given `times` (for example in days). `false_alarm` is the
/// probability that any parameter of an unchanged robot is reported as drifting (Bonferroni's inequality over
/// parameters).
///
/// ```
/// use dynident_estimation::fleet::{Member, drift};
/// let weeks: Vec<f64> = (0..10).map(f64::from).collect();
/// let of = |week: &f64| Member { name: format!("week {week}"), values: vec![5.0 + 0.2 * week, 1.0], std: vec![0.1; 2] };
/// let found = drift(&weeks.iter().map(of).collect::<Vec<_>>(), &weeks, 0.01)?;
/// let wandering = found.parameters[0].unwrap();
/// assert!(wandering.drifts && (wandering.slope - 0.2).abs() < 1e-12);
/// assert!(!found.parameters[1].unwrap().drifts);
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
///
/// # Errors
/// [`EstimationError::Mismatch`] for fewer than three estimates, different parameters or a wrong number of times;
/// [`EstimationError::Setting`] for values that are not finite or an invalid false-alarm rate.
pub fn drift(members: &[Member], times: &[f64], false_alarm: f64) -> Result<Drift, EstimationError> {
    let parameters = checked(members, MIN_ESTIMATES, false_alarm)?;
    expect("times of the estimates", members.len(), times.len())?;
    for &time in times {
        require(time.is_finite(), "time of an estimate", time, "use a finite number")?;
    }
    let of_parameter = |parameter: usize| {
        let known =
            members.iter().zip(times).filter_map(|(one, time)| one.known(parameter).map(|known| (*time, known)));
        line(&known.collect::<Vec<_>>(), false_alarm / parameters as f64)
    };
    Ok(Drift { parameters: (0..parameters).map(of_parameter).collect() })
}

/// Fits a line to points `(time, (value, variance))`.
fn line(points: &[(f64, (f64, f64))], false_alarm: f64) -> Option<ParameterDrift> {
    if points.len() < MIN_ESTIMATES {
        return None;
    }
    let unit = points.iter().map(|(_, (_, variance))| *variance).fold(f64::INFINITY, f64::min);
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        points.iter().map(|(time, (value, variance))| unit / variance * of(*time, *value)).sum()
    };
    let weights = sum(&|_, _| 1.0);
    let (time, value) = (sum(&|time, _| time) / weights, sum(&|_, value| value) / weights);
    let spread = sum(&|t, _| (t - time).powi(2));
    let longest = points.iter().map(|(t, _)| (t - time).abs()).fold(0.0, f64::max);
    // All times are equal up to rounding.
    if spread <= weights * (f64::EPSILON * (longest + time.abs())).powi(2) {
        return None;
    }
    let slope = sum(&|t, y| (t - time) * (y - value)) / spread;
    let freedoms = (points.len() - 2) as f64;
    let squares = sum(&|t, y| (y - value - slope * (t - time)).powi(2)) / unit;
    let scatter = (squares / freedoms).max(1.0);
    let slope_std = (scatter * unit / spread).sqrt();
    let tail = f_tail((slope / slope_std).powi(2), 1.0, freedoms);
    let half_width_95 = slope_std * student_half_width(0.95, freedoms);
    Some(ParameterDrift { slope, slope_std, half_width_95, scatter, tail, drifts: tail < false_alarm })
}
