//! Factors of small symmetric positive definite matrices, row-major, without allocation.

/// `A = L Lᵀ` in the lower triangle of `a` (n × n); the diagonal holds 1/L_ii. False if `A` is not positive definite (or not a number).
#[inline]
pub(super) fn cholesky(a: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        let (above, rest) = a.split_at_mut(i * n);
        let row = &mut rest[..=i];
        for j in 0..i {
            let other = &above[j * n..=j * n + j];
            let mut sum = row[j];
            for k in 0..j {
                sum -= row[k] * other[k];
            }
            row[j] = sum * other[j];
        }
        let mut square = row[i];
        for &x in &row[..i] {
            square -= x * x;
        }
        // False for NaN as well.
        if !(square > 0.0 && square < f64::INFINITY) {
            return false;
        }
        row[i] = square.sqrt().recip();
    }
    true
}

/// Solves `L Lᵀ x = b` in place, with the factor of [`cholesky`].
#[inline]
pub(super) fn solve(l: &[f64], n: usize, b: &mut [f64]) {
    for i in 0..n {
        let mut sum = b[i];
        for k in 0..i {
            sum -= l[i * n + k] * b[k];
        }
        b[i] = sum * l[i * n + i];
    }
    for i in (0..n).rev() {
        let x = b[i] * l[i * n + i];
        b[i] = x;
        for k in 0..i {
            b[k] -= l[i * n + k] * x;
        }
    }
}

/// Solves the general system `A x = b` by elimination with row pivots; `a` and `b` are used up, `b` holds x. False if a pivot is zero.
pub(super) fn eliminate(a: &mut [f64], n: usize, b: &mut [f64]) -> bool {
    for k in 0..n {
        let Some(pivot) = (k..n).max_by(|&i, &j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs())) else {
            return false;
        };
        let size = a[pivot * n + k].abs();
        if !(size > 0.0 && size < f64::INFINITY) {
            return false;
        }
        if pivot != k {
            for c in 0..n {
                a.swap(k * n + c, pivot * n + c);
            }
            b.swap(k, pivot);
        }
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            for c in k..n {
                a[i * n + c] -= factor * a[k * n + c];
            }
            b[i] -= factor * b[k];
        }
    }
    for i in (0..n).rev() {
        let mut sum = b[i];
        for c in i + 1..n {
            sum -= a[i * n + c] * b[c];
        }
        b[i] = sum / a[i * n + i];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    /// A x of the solution gives b back: 30 roundings of a matrix with condition below 1e4, so 1e-10 is ample.
    #[test]
    fn solutions_solve() {
        let mut random = Random::new(1);
        for n in 1..=8 {
            let root: Vec<f64> = (0..n * n).map(|_| random.normal()).collect();
            let entry = |i: usize, j: usize| {
                (0..n).map(|k| root[i * n + k] * root[j * n + k]).sum::<f64>() + if i == j { 0.1 } else { 0.0 }
            };
            let a: Vec<f64> = (0..n * n).map(|at| entry(at / n, at % n)).collect();
            let b: Vec<f64> = (0..n).map(|_| random.normal()).collect();
            let (mut factor, mut x) = (a.clone(), b.clone());
            assert!(cholesky(&mut factor, n));
            solve(&factor, n, &mut x);
            let (mut used, mut y) = (a.clone(), b.clone());
            assert!(eliminate(&mut used, n, &mut y));
            for solution in [x, y] {
                for i in 0..n {
                    let product: f64 = (0..n).map(|k| a[i * n + k] * solution[k]).sum();
                    assert!((product - b[i]).abs() < 1e-10);
                }
            }
        }
        assert!(!cholesky(&mut [1.0, 2.0, 2.0, 1.0], 2) && !cholesky(&mut [f64::NAN], 1));
        assert!(!eliminate(&mut [0.0], 1, &mut [1.0]));
    }
}
