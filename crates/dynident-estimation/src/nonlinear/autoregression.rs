//! Autoregressive models of residuals, and the whitening filter.

use nalgebra::{DMatrix, DVector};

/// Coefficients `a` of the model `e_t = a_1 e_{t−1} + … + a_k e_{t−k} + white noise` with order k of at most `most`;
/// empty for white noise.
///
/// Levinson-Durbin recursion on the sample autocovariances `Σ e_t e_{t−l} / N`, which always gives a stable model; k
/// minimises Schwarz's criterion (BIC) `N ln v_k + k ln N` with the innovation variance v_k of order k. Brockwell and
/// Davis, Time Series: Theory and Methods, 2nd ed., 5.2 and 9.3.
pub(crate) fn autoregression(e: &[f64], most: usize) -> Vec<f64> {
    let count = e.len();
    let covariance = |lag: usize| -> f64 { e[lag..].iter().zip(e).map(|(late, early)| late * early).sum() };
    let covariances: Vec<f64> = (0..=most.min(count / 4)).map(covariance).collect();
    from_covariances(&covariances, count).0
}

/// Like [`autoregression`], but from the autocovariances of `count` samples, starting with lag 0; also returns the
/// innovation variance.
pub(crate) fn from_covariances(covariances: &[f64], count: usize) -> (Vec<f64>, f64) {
    let mut left = covariances.first().copied().unwrap_or_default();
    if left <= 0.0 || !left.is_finite() {
        return (Vec::new(), 0.0);
    }
    let penalty = (count as f64).ln() / count as f64;
    let all = left;
    let (mut a, mut best) = (Vec::new(), (0.0, Vec::new(), left));
    for order in 1..covariances.len() {
        let ahead: f64 = a.iter().enumerate().map(|(i, a)| a * covariances[order - 1 - i]).sum();
        let reflection = (covariances[order] - ahead) / left;
        if reflection.is_nan() || reflection.abs() >= 1.0 {
            break;
        }
        let turned: Vec<f64> = a.iter().zip(a.iter().rev()).map(|(a, b)| a - reflection * b).collect();
        a = turned;
        a.push(reflection);
        left *= 1.0 - reflection * reflection;
        if left <= f64::EPSILON * all {
            break;
        }
        let criterion = (left / all).ln() + order as f64 * penalty;
        if criterion < best.0 {
            best = (criterion, a.clone(), left);
        }
    }
    (best.1, best.2)
}

/// Shortens the memory of an autoregression by `a_k cᵏ`, so that every mode decays at least by the factor `most` per
/// sample. Also returns the innovation variance for these autocovariances.
pub(crate) fn shortened(a: Vec<f64>, variance: f64, covariances: &[f64], most: f64) -> (Vec<f64>, f64) {
    let order = a.len();
    let companion =
        DMatrix::from_fn(
            order,
            order,
            |row, column| {
                if row == 0 { a[column] } else { f64::from(u8::from(row == column + 1)) }
            },
        );
    let longest =
        if order == 0 { 0.0 } else { companion.complex_eigenvalues().iter().map(|x| x.norm()).fold(0.0, f64::max) };
    if longest <= most {
        return (a, variance);
    }
    let share = most / longest;
    let a: Vec<f64> = a.iter().enumerate().map(|(k, a)| a * share.powi(k as i32 + 1)).collect();
    let filter: Vec<f64> = core::iter::once(1.0).chain(a.iter().map(|a| -a)).collect();
    let products = filter
        .iter()
        .enumerate()
        .flat_map(|(i, x)| filter.iter().enumerate().map(move |(j, y)| x * y * covariances[i.abs_diff(j)]));
    let left = products.sum::<f64>().max(variance);
    (a, left)
}

/// `y_t − a_1 y_{t−1} − … − a_k y_{t−k}` for `t ≥ k`; the first k values are lost.
pub(crate) fn whitened(y: &[f64], a: &[f64]) -> DVector<f64> {
    let order = a.len();
    DVector::from_iterator(
        y.len().saturating_sub(order),
        (order..y.len()).map(|t| a.iter().enumerate().fold(y[t], |sum, (lag, a)| sum - a * y[t - 1 - lag])),
    )
}

/// Applies [`whitened`] to every column.
pub(crate) fn whitened_columns(columns: &DMatrix<f64>, a: &[f64]) -> DMatrix<f64> {
    if a.is_empty() {
        return columns.clone();
    }
    let rows = columns.nrows();
    let mut out = DMatrix::zeros(rows.saturating_sub(a.len()), columns.ncols());
    if rows > 0 {
        for (column, y) in columns.as_slice().chunks_exact(rows).enumerate() {
            out.set_column(column, &whitened(y, a));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    /// e_t = 1.2 e_{t−1} − 0.5 e_{t−2} + w_t: coefficients of 4000 samples have errors of about √((1 − a_2²)/N) =
    /// 0.014; tolerance 4 σ. The filtered residual is w.
    #[test]
    fn autoregression_is_estimated_and_removed() {
        let mut random = Random::new(5);
        let w: Vec<f64> = (0..4000).map(|_| random.normal()).collect();
        let mut e = vec![0.0; w.len()];
        for t in 2..e.len() {
            e[t] = 1.2 * e[t - 1] - 0.5 * e[t - 2] + w[t];
        }
        let a = autoregression(&e, 6);
        assert_eq!(a.len(), 2, "{a:?}");
        assert!((a[0] - 1.2).abs() < 0.056 && (a[1] + 0.5).abs() < 0.056, "{a:?}");
        let left = whitened(&e, &[1.2, -0.5]);
        for (left, w) in left.iter().zip(&w[2..]) {
            assert!((left - w).abs() < 1e-12);
        }
    }

    /// One mode of 0.9 shortened to 0.5: the filter is 1 − 0.5 z⁻¹, with innovation variance 1 − 2 · 0.5 · 0.9 + 0.25.
    #[test]
    fn long_modes_are_shortened() {
        let (a, left) = shortened(vec![0.9], 0.19, &[1.0, 0.9], 0.5);
        assert!((a[0] - 0.5).abs() < 1e-12 && (left - 0.35).abs() < 1e-12);
        assert_eq!(shortened(vec![0.4], 0.84, &[1.0, 0.4], 0.5), (vec![0.4], 0.84));
    }

    #[test]
    fn white_and_empty_residuals_have_no_colour() {
        let mut random = Random::new(6);
        let white: Vec<f64> = (0..4000).map(|_| random.normal()).collect();
        assert!(autoregression(&white, 4).is_empty());
        assert!(autoregression(&[0.0; 50], 4).is_empty() && autoregression(&[], 4).is_empty());
    }
}
