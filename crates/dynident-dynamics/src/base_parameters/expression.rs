//! Base parameters as readable sums.

use crate::independent_columns::IndependentColumns;
use crate::regressor_panels::Column;
use core::fmt::Write;

/// Coefficients below this are rounding noise of the split, not geometry (lengths have at best micrometre precision).
pub(super) const NEGLIGIBLE: f64 = 1e-9;

/// Direction cosines, and lengths relative to the robot's length, below which a coefficient is omitted in names.
/// Rounded angles of robot descriptions (`1.5708` for π/2, an error of 4e-6) cause such coefficients.
const NAME_SHARE: f64 = 1e-5;

/// Same threshold for products of two lengths: 1.4 mm squared on a robot of one metre.
const NAME_SHARE_OF_SQUARES: f64 = 2e-6;

/// Coefficients that are omitted.
#[derive(Clone, Copy)]
pub(super) enum Omitted {
    /// Only rounding noise is omitted.
    Noise,
    /// Coefficients caused by rounded angles are omitted, too, for a robot of this length, m.
    RoundedAngles(f64),
}

impl Omitted {
    /// Smallest coefficient of column `added` that is shown in a sum whose first parameter is column `first`.
    fn least(self, first: &Column, added: &Column) -> f64 {
        let (Self::RoundedAngles(length), Some(to), Some(from)) = (self, power(first), power(added)) else {
            return NEGLIGIBLE;
        };
        let share = if to - from == 2 { NAME_SHARE_OF_SQUARES } else { NAME_SHARE };
        NEGLIGIBLE.max(share * length.powi(to - from))
    }
}

/// Power of the length in the unit of a parameter of a body: 0 of a mass, 2 of an inertia.
fn power(column: &Column) -> Option<i32> {
    match column {
        Column::Body { parameter: 0, .. } => Some(0),
        Column::Body { parameter: 1..=3, .. } => Some(1),
        Column::Body { .. } => Some(2),
        Column::Term(_) => None,
    }
}

#[derive(Clone, Copy)]
pub(super) enum Digits {
    /// Six significant digits without trailing zeros, for names.
    Six,
    /// As many digits as are needed to read back the same `f64`.
    All,
}

pub(super) fn expressions(
    columns: &[Column],
    split: &IndependentColumns,
    digits: Digits,
    omitted: Omitted,
) -> Vec<String> {
    let mut sums: Vec<String> = split.independent.iter().map(|&column| columns[column].symbol()).collect();
    for (&dependent, factors) in split.dependent.iter().zip(split.regrouping.column_iter()) {
        let symbol = columns[dependent].symbol();
        for ((sum, factor), &first) in sums.iter_mut().zip(factors.iter()).zip(&split.independent) {
            if factor.abs() < omitted.least(&columns[first], &columns[dependent]) {
                continue;
            }
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

/// Text of a coefficient; `None` for one.
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
