//! Least squares with some unknowns that cannot be negative, for a handful of unknowns.

use nalgebra::{DMatrix, DVector};

/// `argmin ‖A x − b‖²` with `x_k ≥ 0` where `nonnegative[k]`, from `gram = AᵀA` and `right = Aᵀb`.
///
/// The active-set method of Lawson and Hanson, *Solving Least Squares Problems* (1974), ch. 23, with the free unknowns
/// never active. A column that others explain up to 1e-10 of its norm is left out (zero). Always ends: after `4 n + 10`
/// changes of the set the last feasible point is returned. `gram` is n × n, `right` and `nonnegative` have n entries,
/// in whatever units A and b have.
///
/// # Panics
/// Where sizes differ.
pub fn nonnegative_least_squares(gram: &DMatrix<f64>, right: &DVector<f64>, nonnegative: &[bool]) -> DVector<f64> {
    let n = right.len();
    // Unit diagonal, so that one tolerance fits all.
    let scale = DVector::from_fn(n, |k, _| if gram[(k, k)] > 0.0 { gram[(k, k)].sqrt() } else { 0.0 });
    let usable = |k: usize| scale[k] > 0.0;
    let gram =
        DMatrix::from_fn(n, n, |i, j| if usable(i) && usable(j) { gram[(i, j)] / (scale[i] * scale[j]) } else { 0.0 });
    let right = DVector::from_fn(n, |k, _| if usable(k) { right[k] / scale[k] } else { 0.0 });
    let mut passive: Vec<usize> = Vec::new();
    for k in 0..n {
        if usable(k) && !nonnegative[k] {
            passive.push(k);
            if solved(&gram, &right, &passive).is_none() {
                passive.pop();
            }
        }
    }
    let mut x = DVector::zeros(n);
    put(&mut x, &passive, &solved(&gram, &right, &passive).unwrap_or_default());
    let size = right.amax().max(f64::MIN_POSITIVE);
    let mut refused = vec![false; n];
    for _ in 0..4 * n + 10 {
        let gradient = &right - &gram * &x;
        let enters = (0..n)
            .filter(|k| nonnegative[*k] && usable(*k) && !refused[*k] && !passive.contains(k))
            .filter(|k| gradient[*k] > 1.0e-12 * size)
            .max_by(|a, b| gradient[*a].total_cmp(&gradient[*b]).then(b.cmp(a)));
        let Some(enters) = enters else { break };
        passive.push(enters);
        // Back from the unconstrained point until all are feasible again.
        loop {
            let Some(target) = solved(&gram, &right, &passive) else {
                // Dependent on those that are in already.
                refused[enters] = true;
                passive.retain(|&k| k != enters);
                break;
            };
            let negative = |at: usize| nonnegative[passive[at]] && target[at] <= 0.0;
            let step = (0..passive.len())
                .filter(|&at| negative(at))
                .map(|at| {
                    let from = x[passive[at]];
                    if from - target[at] > 0.0 { from / (from - target[at]) } else { 0.0 }
                })
                .fold(1.0_f64, f64::min);
            let blocked = (0..passive.len()).any(negative);
            for (at, &k) in passive.iter().enumerate() {
                x[k] += step * (target[at] - x[k]);
            }
            if !blocked {
                break;
            }
            let leaving: Vec<usize> = (0..passive.len())
                .filter(|&at| negative(at) && x[passive[at]] <= 1.0e-14 * (1.0 + target[at].abs()))
                .map(|at| passive[at])
                .collect();
            for &k in &leaving {
                x[k] = 0.0;
                refused[k] |= k == enters;
            }
            passive.retain(|k| !leaving.contains(k));
            if leaving.is_empty() {
                break;
            }
        }
    }
    DVector::from_fn(n, |k, _| if usable(k) { x[k] / scale[k] } else { 0.0 })
}

fn put(x: &mut DVector<f64>, places: &[usize], values: &[f64]) {
    for (&place, &value) in places.iter().zip(values) {
        x[place] = value;
    }
}

/// The unconstrained solution on some unknowns; none when their columns are dependent.
fn solved(gram: &DMatrix<f64>, right: &DVector<f64>, places: &[usize]) -> Option<Vec<f64>> {
    if places.is_empty() {
        return Some(Vec::new());
    }
    let part = DMatrix::from_fn(places.len(), places.len(), |i, j| gram[(places[i], places[j])]);
    let factor = part.cholesky()?;
    // Squares of the shares that earlier columns leave.
    if factor.l_dirty().diagonal().iter().any(|pivot| pivot * pivot < 1.0e-12) {
        return None;
    }
    let solution = factor.solve(&DVector::from_fn(places.len(), |i, _| right[places[i]]));
    Some(solution.iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The conditions of Karush, Kuhn and Tucker are necessary and sufficient here: an oracle that knows nothing of
    /// active sets.
    #[test]
    fn random_problems_meet_the_optimality_conditions() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        for case in 0..300 {
            let n = 1 + case % 9;
            let a = DMatrix::from_fn(20, n, |_, _| random());
            let b = DVector::from_fn(20, |_, _| random());
            let nonnegative: Vec<bool> = (0..n).map(|_| random() < 0.6).collect();
            let x = nonnegative_least_squares(&a.tr_mul(&a), &a.tr_mul(&b), &nonnegative);
            let gradient = a.tr_mul(&(&b - &a * &x));
            for k in 0..n {
                // Sums of twenty products of numbers below one, with a condition number of a hundred or so.
                if nonnegative[k] {
                    assert!(x[k] >= 0.0 && gradient[k] <= 1e-9, "case {case}: {x} {gradient}");
                }
                if !nonnegative[k] || x[k] > 0.0 {
                    assert!(gradient[k].abs() <= 1e-9, "case {case}: {x} {gradient}");
                }
            }
        }
    }

    #[test]
    fn equal_columns_and_columns_of_zeros_give_numbers() {
        let a = DMatrix::from_row_slice(3, 3, &[1., 1., 0., 2., 2., 0., 3., 3., 0.]);
        let b = DVector::from_vec(vec![2., 4., 6.]);
        for nonnegative in [[true; 3], [false; 3]] {
            let x = nonnegative_least_squares(&a.tr_mul(&a), &a.tr_mul(&b), &nonnegative);
            assert!((x[0] + x[1] - 2.0).abs() < 1e-9 && x[2] == 0.0, "{x}");
        }
    }
}
