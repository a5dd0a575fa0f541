//! One estimate of a fleet.

use crate::error::{EstimationError, expect, require};

/// An estimate of one robot, or of one robot in one week.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Name for reports.
    pub name: String,
    /// Values, in the same order for all members.
    pub values: Vec<f64>,
    /// Standard deviations; zero for values that were not estimated, which are not compared.
    pub std: Vec<f64>,
}

impl Member {
    /// Value and variance of a parameter; `None` if it was not estimated.
    pub(super) fn known(&self, parameter: usize) -> Option<(f64, f64)> {
        let variance = self.std[parameter].powi(2);
        (variance > 0.0).then(|| (self.values[parameter], variance))
    }
}

/// Checks the members and returns their number of parameters.
pub(super) fn checked(members: &[Member], fewest: usize, false_alarm: f64) -> Result<usize, EstimationError> {
    require(
        false_alarm > 0.0 && false_alarm < 1.0,
        "false_alarm",
        false_alarm,
        "use a probability above 0 and below 1, for example 0.01",
    )?;
    if members.len() < fewest {
        let what = "estimates to compare, at least".to_owned();
        return Err(EstimationError::Mismatch { what, expected: fewest, found: members.len() });
    }
    let count = members[0].values.len();
    for member in members {
        expect("parameters of an estimate", count, member.values.len())?;
        expect("standard deviations of an estimate", count, member.std.len())?;
        for (&value, &std) in member.values.iter().zip(&member.std) {
            require(value.is_finite(), "value of an estimate", value, "remove this estimate")?;
            let has_meaning = std.is_finite() && std >= 0.0;
            require(has_meaning, "standard deviation of an estimate", std, "remove this estimate")?;
        }
    }
    Ok(count)
}
