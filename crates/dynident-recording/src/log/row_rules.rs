//! Rows that are left out by rule: by number, by time, by what a column says.

use super::format::{ColumnRef, LogFormat, OneOrMany};
use crate::error::FormatError;
use serde::{Deserialize, Serialize};

/// What a column of the main file says in some rows, such as a status: equal to one of some values, above one, below
/// one; all that is given has to hold.
///
/// ```
/// let rule: dynident_recording::log::RowRule = toml::from_str("column = \"state\"\nequals = [2, 3]").unwrap();
/// assert!(rule.holds(3.0) && !rule.holds(1.0));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RowRule {
    /// Name or 0-based index, in the main file; a column of numbers.
    pub column: ColumnRef,
    /// The value is this one, or one of these.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equals: Option<OneOrMany<f64>>,
    /// The value is above this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
    /// The value is below this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
}

impl RowRule {
    /// Whether the column's value is one that the rule is about; never for a missing one.
    pub fn holds(&self, value: f64) -> bool {
        let equal = match &self.equals {
            None => true,
            Some(OneOrMany::One(one)) => value == *one,
            Some(OneOrMany::Many(many)) => many.contains(&value),
        };
        equal && self.above.is_none_or(|above| value > above) && self.below.is_none_or(|below| value < below)
    }

    fn validate(&self, key: &str) -> Result<(), FormatError> {
        let fix = "write { column = \"state\", equals = 1 }, or above, or below";
        if self.equals.is_none() && self.above.is_none() && self.below.is_none() {
            return Err(FormatError::new(key, "a rule names a column and no value", fix));
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

/// Rules of a log whose columns are found: each with the place of its value in a row.
#[derive(Clone, Debug, Default)]
pub(super) struct FoundRules {
    rows: Vec<[u64; 2]>,
    time_s: Vec<[f64; 2]>,
    keep: Vec<(usize, RowRule)>,
    drop: Vec<(usize, RowRule)>,
}

impl FoundRules {
    /// The rules of `format`; `want` gives the place of a column.
    pub(super) fn new<E>(
        format: &LogFormat,
        mut want: impl FnMut(&str, &ColumnRef) -> Result<usize, E>,
    ) -> Result<Self, E> {
        let mut found = |key: &str, rules: &[RowRule]| -> Result<Vec<(usize, RowRule)>, E> {
            let one = |rule: &RowRule| Ok((want(&format!("{key}.column"), &rule.column)?, rule.clone()));
            rules.iter().map(one).collect()
        };
        Ok(Self {
            rows: format.drop_rows.clone(),
            time_s: format.drop_time_s.clone(),
            keep: found("keep_where", &format.keep_where)?,
            drop: found("drop_where", &format.drop_where)?,
        })
    }

    /// Whether the data row with this number, time and values is left out.
    pub(super) fn drops(&self, row: u64, time_s: f64, values: &[f64]) -> bool {
        self.rows.iter().any(|[first, end]| (*first..*end).contains(&row))
            || self.time_s.iter().any(|[from, to]| (*from..*to).contains(&time_s))
            || self.drop.iter().any(|(slot, rule)| rule.holds(values[*slot]))
            || !self.keep.iter().all(|(slot, rule)| rule.holds(values[*slot]))
    }
}

/// Checks the rules of a format.
pub(super) fn validate(format: &LogFormat) -> Result<(), FormatError> {
    for [first, end] in &format.drop_rows {
        if first >= end {
            let fix = "write [[first, end), ..] with first < end";
            return Err(FormatError::new("drop_rows", format!("[{first}, {end}] is empty"), fix));
        }
    }
    for [from, to] in &format.drop_time_s {
        if !(from.is_finite() && from < to) {
            let fix = "write [[from, to], ..] in seconds with from < to";
            return Err(FormatError::new("drop_time_s", format!("[{from}, {to}] is empty"), fix));
        }
    }
    let rules = format.keep_where.iter().map(|rule| ("keep_where", rule));
    let rules = rules.chain(format.drop_where.iter().map(|rule| ("drop_where", rule)));
    for (key, rule) in rules {
        rule.validate(key)?;
    }
    Ok(())
}
