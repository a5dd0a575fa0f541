//! Factorisation of small symmetric positive definite matrices, row-major, without allocation.

use dynident_lanes::Scalar;

/// Factors `A = L D Lᵀ` in the lower triangle of `a` (n × n); the diagonal then contains 1/D_ii, the upper triangle is
/// not used. Returns false if `A` is not positive definite or not finite.
#[inline]
pub(super) fn factor(a: &mut [f64], n: usize) -> bool {
    factor_over(a, n, is_pivot)
}

/// Like [`factor`], for other scalars. Calls `is_pivot` for every pivot and returns false if any call returned false.
#[inline(always)]
pub(super) fn factor_over<T: Scalar>(a: &mut [T], n: usize, is_pivot: impl FnMut(T) -> bool) -> bool {
    // Arms have six or seven joints. With a constant size the compiler unrolls the loops.
    match n {
        2 => factor_of::<T, 2>(a, is_pivot),
        6 => factor_of::<T, 6>(a, is_pivot),
        7 => factor_of::<T, 7>(a, is_pivot),
        _ => factor_of_any_size(a, n, is_pivot),
    }
}

fn is_pivot(pivot: f64) -> bool {
    // False for NaN as well.
    pivot > 0.0 && pivot < f64::INFINITY
}

#[inline(always)]
fn factor_of<T: Scalar, const N: usize>(a: &mut [T], mut is_pivot: impl FnMut(T) -> bool) -> bool {
    let (rows, _) = a.as_chunks_mut::<N>();
    let Ok(m) = <&mut [[T; N]; N]>::try_from(rows) else { return false };
    let mut fine = true;
    for j in 0..N {
        let pivot = m[j][j];
        fine &= is_pivot(pivot);
        let inverse = pivot.recip();
        for i in j + 1..N {
            let ratio = m[i][j] * inverse;
            for k in j + 1..=i {
                m[i][k] -= ratio * m[k][j];
            }
        }
        for row in m.iter_mut().skip(j + 1) {
            row[j] = row[j] * inverse;
        }
        m[j][j] = inverse;
    }
    fine
}

#[inline(always)]
fn factor_of_any_size<T: Scalar>(a: &mut [T], n: usize, mut is_pivot: impl FnMut(T) -> bool) -> bool {
    let mut fine = true;
    for j in 0..n {
        let pivot = a[j * n + j];
        fine &= is_pivot(pivot);
        let inverse = pivot.recip();
        for i in j + 1..n {
            let ratio = a[i * n + j] * inverse;
            for k in j + 1..=i {
                a[i * n + k] -= ratio * a[k * n + j];
            }
        }
        for i in j + 1..n {
            a[i * n + j] = a[i * n + j] * inverse;
        }
        a[j * n + j] = inverse;
    }
    fine
}

/// Does [`factor`] and [`solve`] together, with identical results; the right-hand side is processed during the
/// divisions of a column.
#[inline]
pub(super) fn factor_and_solve(a: &mut [f64], n: usize, b: &mut [f64]) -> bool {
    match n {
        2 => factor_and_solve_of::<2>(a, b),
        6 => factor_and_solve_of::<6>(a, b),
        7 => factor_and_solve_of::<7>(a, b),
        _ => {
            let fine = factor(a, n);
            if fine {
                solve(a, n, b);
            }
            fine
        }
    }
}

#[inline(always)]
fn factor_and_solve_of<const N: usize>(a: &mut [f64], b: &mut [f64]) -> bool {
    let (rows, _) = a.as_chunks_mut::<N>();
    let (Ok(m), Ok(b)) = (<&mut [[f64; N]; N]>::try_from(rows), <&mut [f64; N]>::try_from(b)) else { return false };
    for j in 0..N {
        let pivot = m[j][j];
        if !is_pivot(pivot) {
            return false;
        }
        let inverse = pivot.recip();
        let x = b[j];
        for i in j + 1..N {
            let ratio = m[i][j] * inverse;
            for k in j + 1..=i {
                m[i][k] -= ratio * m[k][j];
            }
            b[i] -= ratio * x;
        }
        for row in m.iter_mut().skip(j + 1) {
            row[j] *= inverse;
        }
        m[j][j] = inverse;
        b[j] = x * inverse;
    }
    for i in (0..N).rev() {
        let x = b[i];
        for k in 0..i {
            b[k] -= m[i][k] * x;
        }
    }
    true
}

/// Solves `L D Lᵀ x = b` in place, with the result of [`factor`].
#[inline(always)]
pub(super) fn solve<T: Scalar>(l: &[T], n: usize, b: &mut [T]) {
    match n {
        2 => solve_of::<T, 2>(l, b),
        6 => solve_of::<T, 6>(l, b),
        7 => solve_of::<T, 7>(l, b),
        _ => {
            for i in 0..n {
                let x = b[i];
                for k in i + 1..n {
                    b[k] -= l[k * n + i] * x;
                }
            }
            for i in (0..n).rev() {
                // The standard library starts its sums with this value.
                let mut sum = T::splat(-0.0);
                for k in i + 1..n {
                    sum += l[k * n + i] * b[k];
                }
                b[i] = l[i * n + i] * b[i] - sum;
            }
        }
    }
}

#[inline(always)]
fn solve_of<T: Scalar, const N: usize>(l: &[T], b: &mut [T]) {
    let (rows, _) = l.as_chunks::<N>();
    let (Ok(l), Ok(b)) = (<&[[T; N]; N]>::try_from(rows), <&mut [T; N]>::try_from(b)) else { return };
    for i in 0..N {
        let x = b[i];
        for k in i + 1..N {
            b[k] -= l[k][i] * x;
        }
    }
    for i in 0..N {
        b[i] = b[i] * l[i][i];
    }
    for i in (0..N).rev() {
        let x = b[i];
        for k in 0..i {
            b[k] -= l[i][k] * x;
        }
    }
}

/// Does [`solve`] for several right-hand sides, stored one after another in `b`, with identical results. A single
/// solution is a chain of dependent steps; several together use the processor better.
#[inline]
pub(super) fn solve_all(l: &[f64], n: usize, b: &mut [f64]) {
    match n {
        2 => solve_all_of::<2>(l, b),
        6 => solve_all_of::<6>(l, b),
        7 => solve_all_of::<7>(l, b),
        _ => b.chunks_exact_mut(n).for_each(|b| solve(l, n, b)),
    }
}

#[inline(always)]
fn solve_all_of<const N: usize>(l: &[f64], b: &mut [f64]) {
    let (rows, _) = l.as_chunks::<N>();
    let Ok(l) = <&[[f64; N]; N]>::try_from(rows) else { return };
    let (sides, _) = b.as_chunks_mut::<N>();
    for sides in sides.chunks_mut(N) {
        let mut x = [[0.0; N]; N];
        for (at, side) in sides.iter().enumerate() {
            for i in 0..N {
                x[i][at] = side[i];
            }
        }
        for i in 0..N {
            let known = x[i];
            for k in i + 1..N {
                for at in 0..N {
                    x[k][at] -= l[k][i] * known[at];
                }
            }
        }
        for i in 0..N {
            for at in 0..N {
                x[i][at] *= l[i][i];
            }
        }
        for i in (0..N).rev() {
            let known = x[i];
            for k in 0..i {
                for at in 0..N {
                    x[k][at] -= l[i][k] * known[at];
                }
            }
        }
        for (at, side) in sides.iter_mut().enumerate() {
            for i in 0..N {
                side[i] = x[i][at];
            }
        }
    }
}

/// Solves the general system `A x = b` by elimination with row pivots. `a` is overwritten, `b` then contains x. Returns
/// false if a pivot is zero.
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

    /// A x equals b: 30 roundings with a condition number below 1e4, so that 1e-10 is sufficient.
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
            let (mut lower_too, mut same) = (a.clone(), b.clone());
            assert!(factor_and_solve(&mut lower_too, n, &mut same));
            assert!(x == same && lower == lower_too);
            for sides in [1, n, n + 1] {
                let mut together: Vec<f64> = (0..sides * n).map(|_| random.normal()).collect();
                let mut alone = together.clone();
                solve_all(&lower, n, &mut together);
                alone.chunks_exact_mut(n).for_each(|side| solve(&lower, n, side));
                assert_eq!(together, alone);
            }
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
