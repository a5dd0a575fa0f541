//! Base parameters as readable sums.

use crate::independent_columns::IndependentColumns;
use crate::regressor_panels::Column;
use core::fmt::Write;

/// Coefficients below this are rounding noise of the split, not geometry (lengths have at best micrometre precision).
pub(super) const NEGLIGIBLE: f64 = 1e-9;

#[derive(Clone, Copy)]
pub(super) enum Digits {
    /// Six, without trailing zeros, for names.
    Six,
    /// Enough to read back the same `f64`.
    All,
}

pub(super) fn expressions(columns: &[Column], split: &IndependentColumns, digits: Digits) -> Vec<String> {
    let mut sums: Vec<String> = split.independent.iter().map(|&column| columns[column].symbol()).collect();
    for (&dependent, factors) in split.dependent.iter().zip(split.regrouping.column_iter()) {
        let symbol = columns[dependent].symbol();
        for (sum, factor) in sums.iter_mut().zip(factors.iter()).filter(|(_, factor)| factor.abs() >= NEGLIGIBLE) {
            let sign = if *factor < 0.0 { '-' } else { '+' };
            // Writing to a string cannot fail.
            let _ = match coefficient(factor.abs(), digits) {
                None => write!(sum, " {sign} {symbol}"),
                Some(number) => write!(sum, " {sign} {number} {symbol}"),
            };
        }
    }
    sums
}

/// `None` for one.
fn coefficient(value: f64, digits: Digits) -> Option<String> {
    if (value - 1.0).abs() < NEGLIGIBLE {
        return None;
    }
    let decimals = match digits {
        Digits::Six => (5 - value.log10().floor() as i32).clamp(0, 15) as usize,
        Digits::All => return Some(value.to_string()),
    };
    let text = format!("{value:.decimals$}");
    Some(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text })
}
