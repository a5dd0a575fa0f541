//! Least squares with nonnegativity constraints, for a few unknowns.

use nalgebra::{DMatrix, DVector};

/// A column is dependent if the square of the share of it that other columns do not explain is smaller than this.
const MIN_REMAINING_SQUARE: f64 = 1.0e-12;

/// Solves `argmin ‖A x − b‖²` with `x_k ≥ 0` where `nonnegative[k]` is set, from `gram = AᵀA` and `right = Aᵀb`.
///
/// Active-set method of Lawson and Hanson, *Solving Least Squares Problems* (1974), ch. 23; unconstrained unknowns are
/// never active. A column that others explain up to 1e-6 of its norm is excluded (zero). After at most `4 n + 10`
/// changes of the set the last feasible point is returned. `gram` is n × n, `right` and `nonnegative` have n entries;
/// any units.
///
/// # Panics
/// If sizes differ.
pub fn nonnegative_least_squares(gram: &DMatrix<f64>, right: &DVector<f64>, nonnegative: &[bool]) -> DVector<f64> {
    let n = right.len();
    // Scaled to a unit diagonal, so that one tolerance is valid for all columns.
    let scale: Vec<f64> = (0..n).map(|k| if gram[(k, k)] > 0.0 { gram[(k, k)].sqrt() } else { 0.0 }).collect();
    let usable = |k: usize| scale[k] > 0.0;
    let scaled = |i: usize, j: usize| if usable(i) && usable(j) { gram[(i, j)] / (scale[i] * scale[j]) } else { 0.0 };
    let matrix: Vec<f64> = (0..n * n).map(|at| scaled(at / n, at % n)).collect();
    let right: Vec<f64> = (0..n).map(|k| if usable(k) { right[k] / scale[k] } else { 0.0 }).collect();
    let mut passive = PassiveSet::new((&matrix, &right));
    for k in 0..n {
        if usable(k) && !nonnegative[k] {
            passive.push(k, MIN_REMAINING_SQUARE);
        }
    }
    let mut x = vec![0.0; n];
    let mut target = Vec::with_capacity(n);
    passive.solve(&mut target);
    passive.places.iter().zip(&target).for_each(|(&k, value)| x[k] = *value);
    let size = right.iter().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
    let mut refused = vec![false; n];
    for _ in 0..4 * n + 10 {
        // The unknown with the largest gradient; the first such unknown if several are equal.
        let gradient = |k: usize| right[k] - matrix[k * n..(k + 1) * n].iter().zip(&x).map(|(a, x)| a * x).sum::<f64>();
        let enters = (0..n)
            .filter(|k| nonnegative[*k] && usable(*k) && !refused[*k] && !passive.places.contains(k))
            .map(|k| (k, gradient(k)))
            .filter(|(_, gradient)| *gradient > 1.0e-12 * size)
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((enters, _)) = enters else { break };
        if !passive.push(enters, MIN_REMAINING_SQUARE) {
            // The unknown is a combination of those already in the set.
            refused[enters] = true;
            continue;
        }
        // Moves back from the unconstrained point until all unknowns are feasible.
        loop {
            passive.solve(&mut target);
            let own = || passive.places.iter().copied().zip(target.iter().copied());
            let negative = |k: usize, target: f64| nonnegative[k] && target <= 0.0;
            let to_zero = |(k, target): (usize, f64)| if x[k] > target { x[k] / (x[k] - target) } else { 0.0 };
            let blocked = own().filter(|&(k, target)| negative(k, target));
            let is_blocked = blocked.clone().next().is_some();
            let step = blocked.map(to_zero).fold(1.0_f64, f64::min);
            passive.places.iter().zip(&target).for_each(|(&k, target)| x[k] += step * (target - x[k]));
            if !is_blocked {
                break;
            }
            let leaves = |&(k, target): &(usize, f64)| negative(k, target) && x[k] <= 1.0e-14 * (1.0 + target.abs());
            let leaving: Vec<usize> = own().filter(leaves).map(|(k, _)| k).collect();
            for &k in &leaving {
                x[k] = 0.0;
                refused[k] |= k == enters;
            }
            passive.remove(&leaving);
            if leaving.is_empty() {
                break;
            }
        }
    }
    DVector::from_fn(n, |k, _| if usable(k) { x[k] / scale[k] } else { 0.0 })
}

/// Unknowns that are not held at zero, and the Cholesky factor of their part of the matrix; a new unknown adds a row.
struct PassiveSet<'a> {
    /// The matrix by rows, and the right side.
    problem: (&'a [f64], &'a [f64]),
    places: Vec<usize>,
    /// Rows of L, row k with k + 1 entries.
    factor: Vec<f64>,
    /// `L⁻¹ b`.
    forward: Vec<f64>,
}

impl<'a> PassiveSet<'a> {
    fn new(problem: (&'a [f64], &'a [f64])) -> Self {
        let n = problem.1.len();
        let (places, forward) = (Vec::with_capacity(n), Vec::with_capacity(n));
        Self { problem, places, factor: Vec::with_capacity(n * (n + 1) / 2), forward }
    }

    /// Adds unknown `k` if it is independent of the others (remaining square above `least`); returns whether it was
    /// added.
    fn push(&mut self, k: usize, least: f64) -> bool {
        let (matrix, right) = self.problem;
        let (n, start) = (right.len(), self.factor.len());
        let mut before = 0;
        for (row, &place) in self.places.iter().enumerate() {
            let (above, own) = self.factor.split_at(start);
            let entries = &above[before..=before + row];
            let rest = entries.iter().zip(own).fold(matrix[k * n + place], |rest, (a, b)| rest - a * b);
            self.factor.push(rest / entries[row]);
            before += row + 1;
        }
        let own = &self.factor[start..];
        let pivot = own.iter().fold(matrix[k * n + k], |rest, entry| rest - entry * entry);
        if pivot.is_nan() || pivot < least {
            self.factor.truncate(start);
            return false;
        }
        let rest = own.iter().zip(&self.forward).fold(right[k], |rest, (a, b)| rest - a * b);
        self.forward.push(rest / pivot.sqrt());
        self.factor.push(pivot.sqrt());
        self.places.push(k);
        true
    }

    fn remove(&mut self, leaving: &[usize]) {
        let Some(first) = self.places.iter().position(|k| leaving.contains(k)) else { return };
        let behind = self.places.split_off(first);
        self.factor.truncate(first * (first + 1) / 2);
        self.forward.truncate(first);
        behind.into_iter().filter(|k| !leaving.contains(k)).for_each(|k| {
            // The unknown was independent of the larger set, so it is also independent of the remaining set.
            self.push(k, f64::MIN_POSITIVE);
        });
    }

    /// Unconstrained solution for these unknowns, in their order.
    fn solve(&self, solution: &mut Vec<f64>) {
        solution.clear();
        solution.extend_from_slice(&self.forward);
        for row in (0..solution.len()).rev() {
            let entries = &self.factor[row * (row + 1) / 2..=row * (row + 1) / 2 + row];
            let own = solution[row] / entries[row];
            solution[row] = own;
            solution.iter_mut().zip(&entries[..row]).for_each(|(above, entry)| *above -= entry * own);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Karush-Kuhn-Tucker conditions are necessary and sufficient here, and independent of the active-set method.
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
    fn equal_and_zero_columns_give_finite_results() {
        let a = DMatrix::from_row_slice(3, 3, &[1., 1., 0., 2., 2., 0., 3., 3., 0.]);
        let b = DVector::from_vec(vec![2., 4., 6.]);
        for nonnegative in [[true; 3], [false; 3]] {
            let x = nonnegative_least_squares(&a.tr_mul(&a), &a.tr_mul(&b), &nonnegative);
            assert!((x[0] + x[1] - 2.0).abs() < 1e-9 && x[2] == 0.0, "{x}");
        }
    }
}
