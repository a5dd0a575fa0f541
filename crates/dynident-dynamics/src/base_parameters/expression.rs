//! Base parameters as readable sums.

use crate::independent_columns::IndependentColumns;
use crate::regressor_panels::Column;
use core::fmt::Write;

/// Coefficients below this are rounding noise of the split, not geometry (lengths are given to a micrometre at best).
pub(super) const NEGLIGIBLE: f64 = 1e-9;

/// One sum per independent column.
pub(super) fn expressions(columns: &[Column], split: &IndependentColumns) -> Vec<String> {
    let sums = split.independent.iter().enumerate().map(|(b, &column)| {
        let mut sum = columns[column].symbol();
        for (d, &dependent) in split.dependent.iter().enumerate() {
            let factor = split.regrouping[(b, d)];
            if factor.abs() < NEGLIGIBLE {
                continue;
            }
            let sign = if factor < 0.0 { '-' } else { '+' };
            let symbol = columns[dependent].symbol();
            // Writing to a string cannot fail.
            let _ = match coefficient(factor.abs()) {
                None => write!(sum, " {sign} {symbol}"),
                Some(number) => write!(sum, " {sign} {number} {symbol}"),
            };
        }
        sum
    });
    sums.collect()
}

/// Six significant digits without trailing zeros; nothing for one.
fn coefficient(value: f64) -> Option<String> {
    if (value - 1.0).abs() < NEGLIGIBLE {
        return None;
    }
    let digits = (5 - value.log10().floor() as i32).clamp(0, 15) as usize;
    let text = format!("{value:.digits$}");
    Some(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text })
}
