//! Which parameters of one robot wander: friction that grows, a belt that slackens.
//!
//! ```text
//!     y_k = a + b t_k + e_k,   e_k ~ N(0, c v_k),   c = max(1, χ²/(n − 2))
//! ```
//!
//! Estimates of several weeks that scatter about their line by more than their bars (another load, another temperature)
//! make the slope's bar wider by √c; b over its bar is Student's with n − 2 degrees of freedom.

use super::member::{Member, checked};
use crate::error::{EstimationError, expect, require};
use crate::uncertainty::{f_tail, student_half_width};
use serde::Serialize;

/// Estimates that a line with a bar can be laid through.
const FEWEST: usize = 3;

/// One parameter over time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ParameterDrift {
    /// Change of the parameter for each unit of time, b.
    pub slope: f64,
    /// Its standard deviation.
    pub slope_std: f64,
    /// Half of its 95 % interval.
    pub half_width_95: f64,
    /// Times the variance of their bars that estimates scatter about the line, c.
    pub scatter: f64,
    /// How likely a parameter that stays where it is looks as if it wandered as much.
    pub tail: f64,
    /// Whether it wanders: `tail` below the false-alarm rate over all parameters.
    pub drifts: bool,
}

/// One robot over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// One for each parameter; none where too few estimates have it, or all at one time.
    pub parameters: Vec<Option<ParameterDrift>>,
}

/// Lays a line through the estimates of one robot at the `times` given (days, say). `false_alarm` is the chance that
/// any parameter of a robot that does not change is said to wander (Bonferroni's inequality over parameters).
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
/// [`EstimationError::Mismatch`] for fewer than three estimates, estimates of other parameters or another number of
/// times; [`EstimationError::Setting`] for numbers without a meaning.
pub fn drift(members: &[Member], times: &[f64], false_alarm: f64) -> Result<Drift, EstimationError> {
    let parameters = checked(members, FEWEST, false_alarm)?;
    expect("times of the estimates", members.len(), times.len())?;
    for &time in times {
        require(time.is_finite(), "time of an estimate", time, "give a finite number")?;
    }
    let of_parameter = |parameter: usize| {
        let known =
            members.iter().zip(times).filter_map(|(one, time)| one.known(parameter).map(|known| (*time, known)));
        line(&known.collect::<Vec<_>>(), false_alarm / parameters as f64)
    };
    Ok(Drift { parameters: (0..parameters).map(of_parameter).collect() })
}

/// The line through `(time, (value, variance))`.
fn line(points: &[(f64, (f64, f64))], false_alarm: f64) -> Option<ParameterDrift> {
    if points.len() < FEWEST {
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
    // All at one time, by rounding.
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
