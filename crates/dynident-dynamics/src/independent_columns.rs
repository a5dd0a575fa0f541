//! Which columns of a matrix are independent of the columns before them.

use nalgebra::{DMatrix, DVector};

/// What sums of some hundred products in double precision leave of an exact zero, with room.
const ROUNDING: f64 = 1e-12;

/// The split of a matrix's columns into independent ones and ones that are sums of earlier independent ones.
#[derive(Clone, Debug, PartialEq)]
pub struct IndependentColumns {
    /// Indices of the columns that no combination of earlier columns gives, ascending.
    pub independent: Vec<usize>,
    /// Indices of the other columns, ascending.
    pub dependent: Vec<usize>,
    /// `regrouping[(b, d)]`: how often independent column `b` stands in dependent column `d`, so that
    /// `A[dependent] = A[independent] · regrouping`. Shape (independent, dependent).
    pub regrouping: DMatrix<f64>,
    /// The smallest share of a column's norm that was still called independent (1 when there is no independent column).
    pub weakest_independent: f64,
    /// The largest share of a column's norm that was called dependent (0 when there is no dependent column).
    pub strongest_dependent: f64,
}

/// Splits the columns of `matrix` from left to right: a column is dependent when the part of it that is orthogonal to all
/// independent columns before it is at most `tolerance` times its own norm, or when the whole column is rounding noise beside the
/// largest column: below 1e-12 or the square of `tolerance` of it.
///
/// Householder reflections that **skip a dependent column without spending a row**: the textbook rule
/// "dependent ⇔ small diagonal entry of R" leans on rounding noise in the spent row and calls whole tails of columns
/// dependent (or not) by accident. Deterministic; the result does not depend on the rows' order beyond rounding.
pub fn independent_columns(matrix: &DMatrix<f64>, tolerance: f64) -> IndependentColumns {
    let (rows, columns) = matrix.shape();
    let mut r = matrix.clone();
    let norms: Vec<f64> = (0..columns).map(|c| matrix.column(c).norm()).collect();
    let largest = norms.iter().copied().fold(0.0, f64::max);
    let mut independent: Vec<usize> = Vec::new();
    let mut dependent = Vec::new();
    let (mut weakest_independent, mut strongest_dependent) = (1.0_f64, 0.0_f64);
    for c in 0..columns {
        let row = independent.len();
        let rest = if row < rows { r.view((row, c), (rows - row, 1)).norm() } else { 0.0 };
        // A column that is nothing but rounding beside the others would be independent of everything if measured by itself.
        let noise = norms[c] <= ROUNDING.max(tolerance * tolerance) * largest;
        let share = if noise { 0.0 } else { rest / norms[c] };
        if share <= tolerance {
            strongest_dependent = strongest_dependent.max(share);
            dependent.push(c);
            continue;
        }
        weakest_independent = weakest_independent.min(share);
        independent.push(c);
        let mut v: DVector<f64> = r.view((row, c), (rows - row, 1)).column(0).into_owned();
        v[0] += rest.copysign(v[0]);
        let beta = 2.0 / v.norm_squared();
        for k in c..columns {
            let mut target = r.view_mut((row, k), (rows - row, 1));
            let w = beta * v.dot(&target.column(0));
            target.column_mut(0).axpy(-w, &v, 1.0);
        }
    }
    // Back-substitution with the independent columns' triangle gives the regrouping.
    let rank = independent.len();
    let mut regrouping = DMatrix::zeros(rank, dependent.len());
    for (d, &column) in dependent.iter().enumerate() {
        for b in (0..rank).rev() {
            let mut sum = r[(b, column)];
            for k in b + 1..rank {
                sum -= r[(b, independent[k])] * regrouping[(k, d)];
            }
            // Earlier columns only: what is left against later ones is rounding noise.
            regrouping[(b, d)] = if independent[b] > column { 0.0 } else { sum / r[(b, independent[b])] };
        }
    }
    IndependentColumns { independent, dependent, regrouping, weakest_independent, strongest_dependent }
}

#[cfg(test)]
mod tests {
    use super::independent_columns;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    #[test]
    fn a_dependent_column_spends_no_row() {
        // Columns 2 and 4 depend on earlier ones; a textbook diagonal rule would lose column 3 or 5 here.
        let a = DMatrix::from_fn(12, 4, |i, j| ((i * 7 + j * 5 + i * i * (j + 1)) % 11) as f64 - 5.0);
        let mut m = DMatrix::zeros(12, 6);
        for (to, from) in [(0, 0), (1, 1), (3, 2), (5, 3)] {
            m.set_column(to, &a.column(from));
        }
        m.set_column(2, &(a.column(0) * 2.0 - a.column(1)));
        m.set_column(4, &(a.column(2) * 0.5));
        let split = independent_columns(&m, 1e-10);
        assert_eq!(split.independent, [0, 1, 3, 5]);
        assert_eq!(split.dependent, [2, 4]);
        assert!((split.regrouping[(0, 0)] - 2.0).abs() < 1e-12 && (split.regrouping[(1, 0)] + 1.0).abs() < 1e-12);
        assert!((split.regrouping[(2, 1)] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_column_of_rounding_noise_is_no_direction() {
        let a = DMatrix::from_fn(8, 3, |i, j| {
            if j == 1 {
                1e-13 * ((i * 5 % 7) as f64 - 3.0)
            } else {
                ((i * 7 + j * 5 + i * i * (j + 1)) % 11) as f64 - 5.0
            }
        });
        let split = independent_columns(&a, 1e-9);
        assert_eq!(split.independent, [0, 2]);
        assert!(split.strongest_dependent < 1e-12 && split.weakest_independent > 0.1);
    }

    proptest! {
        #[test]
        fn dependent_columns_are_rebuilt(values in prop::collection::vec(-3.0..3.0_f64, 60), mix in prop::collection::vec(-2..3_i32, 12)) {
            // 6 independent random columns with 3 combinations appended, each of the first four.
            let base = DMatrix::from_column_slice(10, 6, &values);
            let mixing = DMatrix::from_fn(6, 3, |i, j| if i < 4 { f64::from(mix[4 * j + i]) } else { 0.0 });
            let mut all = base.clone().resize_horizontally(9, 0.0);
            all.columns_mut(6, 3).copy_from(&(&base * &mixing));
            let split = independent_columns(&all, 1e-9);
            let pick = |indices: &[usize]| DMatrix::from_fn(10, indices.len(), |i, j| all[(i, indices[j])]);
            let rebuilt = pick(&split.independent) * &split.regrouping;
            prop_assert!((rebuilt - pick(&split.dependent)).amax() < 1e-7);
            prop_assert!(split.independent.len() <= 6);
        }
    }
}
