//! The rules by which rows are omitted, with the indices of their columns.

use super::channels::ColumnRef;
use super::format::LogFormat;
use super::row_rules::RowRule;

#[derive(Clone, Debug, Default)]
pub(super) struct FoundRules {
    rows: Vec<[u64; 2]>,
    time_s: Vec<[f64; 2]>,
    keep: Vec<(usize, RowRule)>,
    drop: Vec<(usize, RowRule)>,
}

impl FoundRules {
    /// Resolves the rules of `format`; `want` requests a column and returns the index of its values.
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

    pub(super) fn drops(&self, row: u64, time_s: f64, values: &[f64]) -> bool {
        self.rows.iter().any(|[first, end]| (*first..*end).contains(&row))
            || self.time_s.iter().any(|[from, to]| (*from..*to).contains(&time_s))
            || self.drop.iter().any(|(slot, rule)| rule.holds(values[*slot]))
            || !self.keep.iter().all(|(slot, rule)| rule.holds(values[*slot]))
    }
}
