//! Route 2: Gauss-Newton in log-Cholesky coordinates with a decreasing barrier.
//!
//! Every body is `S = U Uᵀ` with
//!
//! ```text
//!     U = e^α [ e^d1  s12  s13  t1 ]
//!             [   0  e^d2  s23  t2 ]
//!             [   0    0  e^d3  t3 ]
//!             [   0    0    0    1 ]
//! ```
//!
//! (Rucker and Wensing, RA-L 7 (2022) 2771, eq. 19), so any ten numbers are a consistent body. If the best body lies
//! on the cone's boundary, the plain fit diverges (d → −∞). Here `−μ ln det S` keeps the optimum of every stage
//! finite, and μ decreases until the duality gap `μ ν` is below the tolerance. The coordinates map all numbers one to
//! one onto the interior of the cone, so the optimum is the only stationary point of a stage.
//!
//! A step is the ten numbers of a second such matrix V that multiplies U from the right. Upper triangular matrices
//! form a group, and relative to U every body is the unit matrix, so the barrier's Hessian is constant and small
//! eigenvalues keep their digits. The rest of the Hessian is `Jᵀ H J`; the neglected part is multiplied by the
//! gradient in x, which is zero at the optimum, so steps become Newton steps. With stiff data straight valleys become
//! curved; a long step may therefore also follow the straight line of S, `V Vᵀ = 1 + U⁻¹ ΔS U⁻ᵀ`, for which the theory
//! of self-concordant barriers guarantees progress (Boyd and Vandenberghe 9.6.4).

use super::cone::{congruence, inverse, log_determinant, upper_factor};
use super::conic::{BlockMap, Certificate, Multipliers, Program, Slacks};
use super::coordinates::{Matrix10, PAIRS, Vector10, vector_of};
use super::interior_point::{Ending, InteriorPointResult};
use super::precise::Precise;
use super::stacked::{LocalRows, RightSide, Rows, StackedSystem};
use nalgebra::{DMatrix, DVector, Matrix4};

/// Factors of μ between stages: the first one, the slowest (after a stage with many steps) and the fastest (after a
/// short stage).
const REDUCTION: f64 = 0.1;
const SLOWEST_REDUCTION: f64 = 0.7;
const FASTEST_REDUCTION: f64 = 0.02;

/// Value of μ times the number of constraints, relative to the objective, below which the pull towards the references
/// is removed.
const PULL_RELEASE_RATIO: f64 = 0.3;

const MAX_STEPS_WITHOUT_PROGRESS: usize = 25;

/// One body: its first variable and the constant part of its block.
type Body = (usize, Vector10);

/// Solves a program whose plain blocks all have separate variables; `None` if `start` is not strictly inside or a
/// block is shared.
pub(super) fn log_cholesky(
    program: &Program,
    start: &DVector<f64>,
    tolerance: f64,
    max_iterations: usize,
) -> Option<InteriorPointResult> {
    let plain = || program.blocks.iter().filter(|block| block.entropy == 0.0);
    let bodies = plain()
        .map(|block| match block.map {
            BlockMap::Own(first) => Some((first, block.offset)),
            BlockMap::General(_) => None,
        })
        .collect::<Option<Vec<Body>>>()?;
    let mut point = Point {
        factors: plain().map(|block| upper_factor(&block.value(start))).collect::<Option<Vec<_>>>()?,
        x: Precise::new(start.clone()),
        rows: program.rows.iter().map(|row| row.value(start)).collect(),
    };
    let degree = (4 * bodies.len() + program.rows.len()).max(1) as f64;
    let mut mu = program.gradient(&Precise::new(start.clone())).0.amax().clamp(1.0e-3, 1.0e12);
    let mut best: Option<InteriorPointResult> = None;
    let (mut stage, mut idle, mut iterations) = (0, 0, 0);
    let mut pull = mu;
    let (mut ending, mut reduction) = (Ending::Limit, REDUCTION);
    while iterations < max_iterations {
        iterations += 1;
        let (multipliers, certificate) = point.certified(program, mu)?;
        idle += 1;
        if best.as_ref().is_none_or(|b| certificate.residual() < b.certificate.residual()) {
            let x = point.x.high.clone();
            best = Some(InteriorPointResult { x, multipliers, certificate, iterations, ending: Ending::Limit });
            idle = 0;
        }
        if certificate.residual() <= tolerance {
            ending = Ending::Solved;
            break;
        }
        let scale = 1.0 + certificate.objective.abs();
        let last = mu * degree <= tolerance * scale;
        let predicted = point.step(program, &bodies, mu, pull);
        stage += 1;
        if last {
            if predicted.is_none() || idle > MAX_STEPS_WITHOUT_PROGRESS && stage > MAX_STEPS_WITHOUT_PROGRESS {
                ending = Ending::Stalled;
                break;
            }
        } else if predicted.is_none_or(|predicted| predicted <= 0.05 * mu) {
            // Region of quadratic convergence of Newton's steps (decrement below a third).
            reduction = match stage {
                ..5 => (reduction * reduction).max(FASTEST_REDUCTION),
                5..9 => reduction,
                _ => reduction.sqrt().min(SLOWEST_REDUCTION),
            };
            stage = 0;
            // The pull is removed while μ is large. If it decreased with μ, it would hold back bodies that must grow
            // by powers of ten until steps are short.
            if pull > 0.0 && mu * degree <= PULL_RELEASE_RATIO * scale {
                let held = pull * point.factors.iter().map(Matrix4::norm_squared).sum::<f64>();
                pull = if held <= 0.01 * mu { 0.0 } else { 0.1 * pull };
            } else {
                mu = (mu * reduction).max(0.8 * tolerance * scale / degree);
                pull = if pull > 0.0 { mu } else { 0.0 };
            }
        }
    }
    let mut best = best?;
    (best.iterations, best.ending) = (iterations, ending);
    Some(best)
}

#[derive(Clone)]
struct Point {
    /// U, one per body.
    factors: Vec<Matrix4<f64>>,
    x: Precise,
    rows: Vec<f64>,
}

/// A Newton step in the bodies' own coordinates.
struct NewtonStep {
    step: DVector<f64>,
    predicted: f64,
}

/// 1 if the k-th coordinate of a body is a logarithm on the diagonal, else 0.
fn is_diagonal(k: usize) -> f64 {
    f64::from(PAIRS[k].0 == PAIRS[k].1)
}

/// Rows whose squares are the Hessian of one body's barrier, exact in these coordinates: −ln det V Vᵀ contains only
/// the logarithms on the diagonal, and tr(G²) is 4 for them and 2 for the others.
fn barrier_rows(mu: f64) -> DMatrix<f64> {
    DMatrix::from_fn(10, 10, |i, j| if i == j { ((2.0 + 2.0 * is_diagonal(i)) * mu).sqrt() } else { 0.0 })
}

impl Point {
    fn slacks(&self, program: &Program) -> Slacks {
        let mut factors = self.factors.iter();
        let blocks = program.blocks.iter().map(|block| match block.entropy {
            0.0 => factors.next().map_or_else(Matrix4::zeros, |u| u * u.transpose()),
            _ => block.value(&self.x.high),
        });
        Slacks { blocks: blocks.collect(), rows: self.rows.clone() }
    }

    /// Certificate with the multipliers of the barrier: `Z = μ S⁻¹`, `z = μ/s`.
    fn certified(&self, program: &Program, mu: f64) -> Option<(Multipliers, Certificate)> {
        let slacks = self.slacks(program);
        let mut factors = self.factors.iter();
        let blocks = program
            .blocks
            .iter()
            .zip(&slacks.blocks)
            .map(|(block, s)| match block.entropy {
                0.0 => factors.next().and_then(|u| {
                    let inverse = u.solve_upper_triangular(&Matrix4::identity())?;
                    Some(inverse.transpose() * inverse * mu)
                }),
                gamma => inverse(s).map(|inverse| inverse * gamma),
            })
            .collect::<Option<Vec<_>>>()?;
        let multipliers = Multipliers { blocks, rows: slacks.rows.iter().map(|s| mu / s).collect() };
        let certificate = program.certificate_of(&self.x, &slacks, &multipliers)?;
        Some((multipliers, certificate))
    }

    /// `f − μ Σ ln det S − μ Σ ln s + pull Σ tr S`, or `None` outside. In early stages with large μ the pull keeps
    /// undetermined directions near the reference.
    fn barrier(&self, program: &Program, mu: f64, pull: f64) -> Option<f64> {
        let mut sum = program.smooth_objective(&self.x);
        for block in program.blocks.iter().filter(|block| block.entropy > 0.0) {
            sum -= block.entropy * log_determinant(&block.value(&self.x.high))?;
        }
        for u in &self.factors {
            sum -= 2.0 * mu * (0..4).map(|k| u[(k, k)].ln()).sum::<f64>();
            sum += pull * u.norm_squared();
        }
        for &s in &self.rows {
            if s.is_nan() || s <= 0.0 {
                return None;
            }
            sum -= mu * s.ln();
        }
        sum.is_finite().then_some(sum)
    }

    /// One step; returns the predicted decrease, or `None` if no step length decreases the barrier.
    fn step(&mut self, program: &Program, bodies: &[Body], mu: f64, pull: f64) -> Option<f64> {
        let newton = self.newton_step(program, bodies, mu, pull)?;
        let now = self.barrier(program, mu, pull)?;
        let slack = 4.0e-15 * (1.0 + now.abs());
        // Armijo's rule: a tenth of the decrease predicted by the slope.
        let better = |candidate: Option<Self>, alpha: f64, best: &mut Option<(f64, Self)>| {
            if let Some(candidate) = candidate
                && let Some(value) = candidate.barrier(program, mu, pull)
                && value <= now - 0.2 * alpha * newton.predicted + slack
                && best.as_ref().is_none_or(|(least, _)| value < *least)
            {
                *best = Some((value, candidate));
            }
        };
        let step = &newton.step;
        let mut best = None;
        let mut alpha = 1.0;
        for _ in 0..50 {
            better(self.moved(program, bodies, &(step * alpha), curved), alpha, &mut best);
            // For short steps both are equal except for the digits that the curve keeps.
            let short = bodies.iter().all(|(first, _)| (step.rows(*first, 10) * alpha).amax() < 0.1);
            if best.is_none() || !short {
                better(self.moved(program, bodies, &(step * alpha), straight), alpha, &mut best);
            }
            if let Some((_, next)) = best {
                *self = next;
                return Some(newton.predicted);
            }
            alpha *= 0.6;
        }
        None
    }

    /// Step to the minimum of the barrier's quadratic model; `None` if the model has no decrease.
    fn newton_step(&self, program: &Program, bodies: &[Body], mu: f64, pull: f64) -> Option<NewtonStep> {
        let frames = bodies.iter().zip(&self.factors).map(|((first, _), u)| (*first, jacobian(u))).collect();
        let mut rows = Rows { frames, ..Rows::default() };
        let mut outside = -&program.linear;
        let (mut local, mut wide) = (Vec::new(), vec![self.x.data_rest(&program.data, &program.target).clone()]);
        rows.wide.push(rows.framed(&program.data));
        for term in &program.local {
            let size = term.matrix.ncols();
            let framed = rows.framed_part(term.first, &term.matrix);
            rows.local.push(LocalRows { first: term.first, matrix: framed });
            local.push(&term.target - &term.matrix * self.x.high.rows(term.first, size));
        }
        for block in program.blocks.iter().filter(|block| block.entropy > 0.0) {
            let BlockMap::Own(first) = block.map else { return None };
            let value = block.value(&self.x.high);
            block.add_transposed(&vector_of(&inverse(&value)?), block.entropy, &mut outside);
            let half = value.cholesky()?.l().solve_lower_triangular(&Matrix4::identity())?;
            let square = DMatrix::from_column_slice(10, 10, congruence(&half).as_slice()) * block.entropy.sqrt();
            rows.local.push(LocalRows { first, matrix: rows.framed_part(first, &square) });
            local.push(DVector::zeros(10));
        }
        for (row, &s) in program.rows.iter().zip(&self.rows) {
            row.add_to(mu / s, &mut outside);
        }
        for (first, _) in bodies {
            let mut place = outside.rows_mut(*first, 10);
            place.axpy(-pull, &vector_of(&Matrix4::identity()), 1.0);
        }
        let mut direct = rows.framed_gradient(&outside);
        for (first, _) in bodies {
            rows.local.push(LocalRows { first: *first, matrix: barrier_rows(mu) });
            local.push(DVector::zeros(10));
            for k in 0..10 {
                direct[first + k] += 2.0 * mu * is_diagonal(k);
            }
        }
        let limits = self.limit_rows(program, &rows, mu);
        rows.add_singles(&limits).append(&vec![0.0; limits.len()], &mut local, &mut wide);
        let right = RightSide { local, wide, direct };
        let system = StackedSystem::new(program.variables, rows)?;
        let step = system.solve(&right);
        let predicted = 0.5 * system.rows().transposed(&right).dot(&step);
        if predicted.is_nan() || predicted <= 0.0 {
            return None;
        }
        Some(NewtonStep { step, predicted })
    }

    /// Rows whose squares are the Hessian of the inequality constraints' barrier.
    fn limit_rows(&self, program: &Program, rows: &Rows, mu: f64) -> Vec<DVector<f64>> {
        let each = program.rows.iter().zip(&self.rows);
        each.map(|(row, &s)| {
            let mut dense = DVector::zeros(program.variables);
            row.add_to(mu.sqrt() / s, &mut dense);
            rows.framed_gradient(&dense)
        })
        .collect()
    }

    fn moved(
        &self,
        program: &Program,
        bodies: &[Body],
        step: &DVector<f64>,
        way: fn(&Vector10) -> Option<Change>,
    ) -> Option<Self> {
        let mut changes = step.clone();
        let mut factors = Vec::with_capacity(bodies.len());
        for ((first, _), u) in bodies.iter().zip(&self.factors) {
            let change = way(&Vector10::from_column_slice(&step.as_slice()[*first..first + 10]))?;
            changes.rows_mut(*first, 10).copy_from(&vector_of(&(u * change.difference * u.transpose())));
            factors.push(u * change.factor);
        }
        let mut x = self.x.clone();
        x.add(&changes);
        self.checked(program, factors, x, &changes)
    }

    fn checked(
        &self,
        program: &Program,
        factors: Vec<Matrix4<f64>>,
        x: Precise,
        changes: &DVector<f64>,
    ) -> Option<Self> {
        let rows: Vec<f64> = program
            .rows
            .iter()
            .zip(&self.rows)
            .map(|(row, &old)| {
                // Updating a small slack is more accurate than a difference of large numbers.
                let change = row.linear_part(changes);
                if change.abs() < 0.5 * old { old + change } else { row.value(&x.high) }
            })
            .collect();
        let finite = x.high.iter().all(|v| v.is_finite()) && rows.iter().all(|&s| s > 0.0);
        finite.then_some(Self { factors, x, rows })
    }
}

struct Change {
    /// V.
    factor: Matrix4<f64>,
    /// `V Vᵀ − 1` without cancellation.
    difference: Matrix4<f64>,
}

/// V from ten numbers, with logarithms on the diagonal.
fn curved(n: &Vector10) -> Option<Change> {
    let mut less = Matrix4::zeros();
    for (k, (i, j)) in PAIRS.into_iter().enumerate() {
        less[(i, j)] = if i == j { n[k].exp_m1() } else { n[k] };
    }
    let difference = less + less.transpose() + less * less.transpose();
    let change = Change { factor: Matrix4::identity() + less, difference };
    let usable = (0..4).all(|k| change.factor[(k, k)] > 0.0) && difference.iter().all(|value| value.is_finite());
    usable.then_some(change)
}

/// V with `V Vᵀ = 1 + G`, G the first-order change of ten numbers; `None` outside the cone.
fn straight(n: &Vector10) -> Option<Change> {
    let mut difference = Matrix4::zeros();
    for (k, (i, j)) in PAIRS.into_iter().enumerate() {
        difference[(i, j)] += n[k];
        difference[(j, i)] += n[k];
    }
    let factor = upper_factor(&(Matrix4::identity() + difference))?;
    Some(Change { factor, difference })
}

/// `∂ vec(U V Vᵀ Uᵀ) / ∂ numbers of V` at V = 1.
fn jacobian(u: &Matrix4<f64>) -> Matrix10 {
    let columns = PAIRS.map(|(i, j)| -> Vector10 {
        let product = u.column(i) * u.column(j).transpose();
        vector_of(&(product + product.transpose()))
    });
    Matrix10::from_columns(&columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobian_equals_differences_of_both_curves() {
        let numbers = Vector10::from([0.3, -0.2, 0.4, -1.0, 0.5, -0.3, 0.2, 0.1, -0.6, 0.7]);
        let u = curved(&numbers).unwrap().factor;
        assert!((upper_factor(&(u * u.transpose())).unwrap() - u).amax() < 1e-14);
        let analytic = jacobian(&u);
        for way in [curved, straight] {
            let s = |n: &Vector10| {
                let change = way(n).unwrap();
                let next = u * change.factor;
                let s = next * next.transpose();
                assert!((u * (Matrix4::identity() + change.difference) * u.transpose() - s).amax() < 1e-13);
                vector_of(&s)
            };
            for k in 0..10 {
                let h = Vector10::from_fn(|i, _| if i == k { 1.0e-5 } else { 0.0 });
                // Central differences: h² times third derivatives of order ten.
                assert!(((s(&h) - s(&-h)) / 2.0e-5 - analytic.column(k)).amax() < 1e-8, "{k}");
            }
        }
    }
}
