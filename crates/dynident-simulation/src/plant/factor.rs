//! Factors of small symmetric positive definite matrices, row-major, without allocation.

/// `A = L D Lᵀ` in the lower triangle of `a` (n × n); the diagonal holds 1/D_ii, the upper triangle is not used. False
/// if `A` is not positive definite (or not a number).
#[inline]
pub(super) fn factor(a: &mut [f64], n: usize) -> bool {
    // Sizes known to the compiler: arms have six or seven joints, and loops that end there are unrolled.
    match n {
        2 => factor_of::<2>(a),
        6 => factor_of::<6>(a),
        7 => factor_of::<7>(a),
        _ => {
            for j in 0..n {
                let pivot = a[j * n + j];
                if !is_pivot(pivot) {
                    return false;
                }
                let inverse = pivot.recip();
                for i in j + 1..n {
                    let ratio = a[i * n + j] * inverse;
                    for k in j + 1..=i {
                        a[i * n + k] -= ratio * a[k * n + j];
                    }
                }
                scale_column(a, n, j, inverse);
            }
            true
        }
    }
}

fn is_pivot(pivot: f64) -> bool {
    // False for NaN as well.
    pivot > 0.0 && pivot < f64::INFINITY
}

fn scale_column(a: &mut [f64], n: usize, j: usize, inverse: f64) {
    for i in j + 1..n {
        a[i * n + j] *= inverse;
    }
    a[j * n + j] = inverse;
}

#[inline(always)]
fn factor_of<const N: usize>(a: &mut [f64]) -> bool {
    let (rows, _) = a.as_chunks_mut::<N>();
    let Ok(m) = <&mut [[f64; N]; N]>::try_from(rows) else { return false };
    for j in 0..N {
        let pivot = m[j][j];
        if !is_pivot(pivot) {
            return false;
        }
        let inverse = pivot.recip();
        for i in j + 1..N {
            let ratio = m[i][j] * inverse;
            for k in j + 1..=i {
                m[i][k] -= ratio * m[k][j];
            }
        }
        for row in m.iter_mut().skip(j + 1) {
            row[j] *= inverse;
        }
        m[j][j] = inverse;
    }
    true
}

/// Solves `L D Lᵀ x = b` in place, with the result of [`factor`].
#[inline]
pub(super) fn solve(l: &[f64], n: usize, b: &mut [f64]) {
    match n {
        2 => solve_of::<2>(l, b),
        6 => solve_of::<6>(l, b),
        7 => solve_of::<7>(l, b),
        _ => {
            for i in 0..n {
                let x = b[i];
                for k in i + 1..n {
                    b[k] -= l[k * n + i] * x;
                }
            }
            for i in (0..n).rev() {
                let x = b[i];
                b[i] = l[i * n + i] * x - (i + 1..n).map(|k| l[k * n + i] * b[k]).sum::<f64>();
            }
        }
    }
}

#[inline(always)]
fn solve_of<const N: usize>(l: &[f64], b: &mut [f64]) {
    let (rows, _) = l.as_chunks::<N>();
    let (Ok(l), Ok(b)) = (<&[[f64; N]; N]>::try_from(rows), <&mut [f64; N]>::try_from(b)) else { return };
    for i in 0..N {
        let x = b[i];
        for k in i + 1..N {
            b[k] -= l[k][i] * x;
        }
    }
    for i in 0..N {
        b[i] *= l[i][i];
    }
    for i in (0..N).rev() {
        let x = b[i];
        for k in 0..i {
            b[k] -= l[i][k] * x;
        }
    }
}

/// Solves the general system `A x = b` by elimination with row pivots; `a` and `b` are used up, `b` holds x. False if a
/// pivot is zero.
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
        for n in 1..=9 {
            let root: Vec<f64> = (0..n * n).map(|_| random.normal()).collect();
            let entry = |i: usize, j: usize| {
                (0..n).map(|k| root[i * n + k] * root[j * n + k]).sum::<f64>() + if i == j { 0.1 } else { 0.0 }
            };
            let a: Vec<f64> = (0..n * n).map(|at| entry(at / n, at % n)).collect();
            let b: Vec<f64> = (0..n).map(|_| random.normal()).collect();
            let (mut lower, mut x) = (a.clone(), b.clone());
            assert!(factor(&mut lower, n));
            solve(&lower, n, &mut x);
            let (mut used, mut y) = (a.clone(), b.clone());
            assert!(eliminate(&mut used, n, &mut y));
            for solution in [x, y] {
                for i in 0..n {
                    let product: f64 = (0..n).map(|k| a[i * n + k] * solution[k]).sum();
                    assert!((product - b[i]).abs() < 1e-10);
                }
            }
        }
        assert!(!factor(&mut [1.0, 2.0, 2.0, 1.0], 2) && !factor(&mut [f64::NAN], 1));
        assert!(!eliminate(&mut [0.0], 1, &mut [1.0]));
    }
}
