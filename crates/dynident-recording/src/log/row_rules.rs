//! Rules that exclude rows: by number, by time, by the value of a column.

use super::channels::{ColumnRef, OneOrMany};
use crate::error::FormatError;
use serde::{Deserialize, Serialize};

/// A condition on a column of the main file, for example a status: equal to one of several values, above a value, or
/// below a value. If several conditions are given, all must be true.
///
/// ```
/// let rule: dynident_recording::log::RowRule = toml::from_str("column = \"state\"\nequals = [2, 3]").unwrap();
/// assert!(rule.holds(3.0) && !rule.holds(1.0));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RowRule {
    /// Name or 0-based index of a numeric column in the main file.
    pub column: ColumnRef,
    /// Value or list of values; the column must equal one of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equals: Option<OneOrMany<f64>>,
    /// Exclusive lower limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
    /// Exclusive upper limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
}

impl RowRule {
    /// Whether the value satisfies the rule; false for a missing value.
    pub fn holds(&self, value: f64) -> bool {
        let equal = match &self.equals {
            None => true,
            Some(OneOrMany::One(one)) => value == *one,
            Some(OneOrMany::Many(many)) => many.contains(&value),
        };
        equal && self.above.is_none_or(|above| value > above) && self.below.is_none_or(|below| value < below)
    }

    pub(super) fn validate(&self, key: &str) -> Result<(), FormatError> {
        let fix = "write { column = \"state\", equals = 1 }, or above, or below";
        if self.equals.is_none() && self.above.is_none() && self.below.is_none() {
            return Err(FormatError::new(key, "a rule has no value", fix));
        }
        let equals = match &self.equals {
            None => &[][..],
            Some(OneOrMany::One(one)) => core::slice::from_ref(one),
            Some(OneOrMany::Many(many)) => many,
        };
        let finite = equals.iter().chain(&self.above).chain(&self.below).all(|value| value.is_finite());
        if finite { Ok(()) } else { Err(FormatError::new(key, "a value is not finite", fix)) }
    }
}

pub(super) fn checked_ranges(drop_rows: &[[u64; 2]], drop_time_s: &[[f64; 2]]) -> Result<(), FormatError> {
    for [first, end] in drop_rows {
        if first >= end {
            let fix = "write [[first, end), ..] with first < end";
            return Err(FormatError::new("drop_rows", format!("[{first}, {end}] is empty"), fix));
        }
    }
    for [from, to] in drop_time_s {
        if !(from.is_finite() && from < to) {
            let fix = "write [[from, to], ..] in seconds with from < to";
            return Err(FormatError::new("drop_time_s", format!("[{from}, {to}] is empty"), fix));
        }
    }
    Ok(())
}
