//! Factors of small symmetric positive definite matrices, one in each lane: step by step what [`super::factor`] does
//! with one, so that a lane has the bits of a robot by itself.

use dynident_lanes::Lane;

/// Solves `A x = b` in every lane by `A = L D Lᵀ`; the lower triangle of `a` (row-major, n × n) is used up, `b` holds
/// x. False if some lane's `A` is not positive definite: `bad` is then set there, and x has no meaning.
#[inline(always)]
pub(super) fn factor_and_solve<T: Lane>(a: &mut [T], n: usize, b: &mut [T], bad: &mut [bool; 8]) -> bool {
    match n {
        2 => of_size::<T, 2>(a, b, bad),
        6 => of_size::<T, 6>(a, b, bad),
        7 => of_size::<T, 7>(a, b, bad),
        _ => of_any_size(a, n, b, bad),
    }
}

#[inline(always)]
fn of_size<T: Lane, const N: usize>(a: &mut [T], b: &mut [T], bad: &mut [bool; 8]) -> bool {
    let (rows, _) = a.as_chunks_mut::<N>();
    let (Ok(m), Ok(b)) = (<&mut [[T; N]; N]>::try_from(rows), <&mut [T; N]>::try_from(b)) else { return false };
    let mut fine = true;
    for j in 0..N {
        let pivot = m[j][j];
        fine &= is_pivot(pivot, bad);
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
    for i in 0..N {
        let x = b[i];
        for k in i + 1..N {
            b[k] -= m[k][i] * x;
        }
    }
    for i in 0..N {
        b[i] = b[i] * m[i][i];
    }
    for i in (0..N).rev() {
        let x = b[i];
        for k in 0..i {
            b[k] -= m[i][k] * x;
        }
    }
    fine
}

#[inline(always)]
fn of_any_size<T: Lane>(a: &mut [T], n: usize, b: &mut [T], bad: &mut [bool; 8]) -> bool {
    let mut fine = true;
    for j in 0..n {
        let pivot = a[j * n + j];
        fine &= is_pivot(pivot, bad);
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
    for i in 0..n {
        let x = b[i];
        for k in i + 1..n {
            b[k] -= a[k * n + i] * x;
        }
    }
    for i in (0..n).rev() {
        // The sum of numbers begins at minus zero.
        let mut sum = T::splat(-0.0);
        for k in i + 1..n {
            sum += a[k * n + i] * b[k];
        }
        b[i] = a[i * n + i] * b[i] - sum;
    }
    fine
}

/// Whether a pivot is positive and finite in every lane.
#[inline(always)]
fn is_pivot<T: Lane>(pivot: T, bad: &mut [bool; 8]) -> bool {
    // The least positive number.
    let fine = T::splat(f64::from_bits(1)).all_at_most(pivot) && pivot.all_at_most(T::splat(f64::MAX));
    if !fine {
        let mut lanes = [1.0; 8];
        pivot.store(&mut lanes);
        mark(&lanes, bad);
    }
    fine
}

#[cold]
fn mark(pivots: &[f64; 8], bad: &mut [bool; 8]) {
    for (pivot, bad) in pivots.iter().zip(bad) {
        *bad |= !(*pivot > 0.0 && *pivot < f64::INFINITY);
    }
}
