//! Route 1: a primal-dual path-following method on the 4 × 4 blocks.
//!
//! Every iterate is strictly inside the constraints: slacks are computed from x, never carried beside it. Newton's direction is that of Nesterov and Todd with
//! Mehrotra's predictor and corrector (Mehrotra, SIAM J. Optimization 2 (1992) 575; Todd, Toh and Tütüncü, SIAM J. Optimization 8 (1998) 769), reduced
//! to one positive definite system in x:
//!
//! ```text
//!     (H + Σ Mᵀ (W⁻¹ ⊗ W⁻¹) M + Σ a (z/s) aᵀ) Δx = −r + Σ Mᵀ (R⁻ᵀ D R⁻¹) + Σ a d
//! ```
//!
//! so that the cost of an iteration is one Cholesky factorisation of the size of x, and a block costs next to nothing.

use super::cone::Scaling;
use super::conic::{BlockMap, Certificate, Multipliers, Program};
use super::coordinates::{Matrix10, matrix_of, vector_of};
use super::linear_solver::DefiniteSystem;
use nalgebra::{DMatrix, DVector, Matrix4};

/// How a solver ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// Certificate within the tolerance.
    Solved,
    /// No step improves any more in double precision.
    Stalled,
    /// Iterations used up.
    Limit,
}

#[derive(Clone, Debug)]
pub(super) struct Solved {
    pub(super) x: DVector<f64>,
    pub(super) multipliers: Multipliers,
    pub(super) certificate: Certificate,
    pub(super) iterations: usize,
    pub(super) ending: Ending,
}

/// How much of the way to the boundary a step may go.
const FRACTION_TO_BOUNDARY: f64 = 0.99;

/// Solves the program from a point strictly inside; none when `start` is not.
pub(super) fn interior_point(
    program: &Program,
    start: DVector<f64>,
    tolerance: f64,
    max_iterations: usize,
) -> Option<Solved> {
    let hessian = program.hessian();
    let mut state = State::new(program, start)?;
    let mut best = state.solved(program, 0, Ending::Limit)?;
    let mut last_step = 1.0;
    let mut poor = 0;
    for iteration in 1..=max_iterations {
        let Some(step) = state.step(program, &hessian, last_step) else {
            best.ending = Ending::Stalled;
            break;
        };
        last_step = step;
        let Some(now) = state.solved(program, iteration, Ending::Limit) else {
            best.ending = Ending::Stalled;
            break;
        };
        best.iterations = iteration;
        if now.certificate.residual() < 0.9 * best.certificate.residual() {
            poor = 0;
        } else {
            poor += 1;
        }
        if now.certificate.residual() < best.certificate.residual() {
            best = now;
        }
        if best.certificate.residual() <= tolerance {
            best.ending = Ending::Solved;
            break;
        }
        // Rounding keeps the residual from falling: more steps would only wander.
        let patience = if best.certificate.residual() < 1.0e-4 { 12 } else { 60 };
        if poor >= patience {
            best.ending = Ending::Stalled;
            break;
        }
    }
    if best.certificate.residual() <= tolerance {
        best.ending = Ending::Solved;
    }
    Some(best)
}

struct State {
    x: DVector<f64>,
    blocks: Vec<Matrix4<f64>>,
    rows: Vec<f64>,
}

/// A direction in scaled coordinates, block by block and row by row.
struct Direction {
    x: DVector<f64>,
    primal: Vec<Matrix4<f64>>,
    dual: Vec<Matrix4<f64>>,
    row_primal: Vec<f64>,
    row_dual: Vec<f64>,
}

impl State {
    /// Multipliers on the central path of the start at about the size of the gradient there.
    fn new(program: &Program, x: DVector<f64>) -> Option<Self> {
        let (gradient, _) = program.gradient(&x);
        let mu = (gradient.amax()).clamp(1.0e-3, 1.0e12);
        let blocks = program
            .blocks
            .iter()
            .map(|block| super::cone::inverse(&block.value(&x)).map(|inverse| inverse * mu.max(block.entropy)))
            .collect::<Option<Vec<_>>>()?;
        let rows = program
            .rows
            .iter()
            .map(|row| Some(row.value(&x)).filter(|&s| s > 0.0).map(|s| mu / s))
            .collect::<Option<Vec<_>>>()?;
        Some(Self { x, blocks, rows })
    }

    fn solved(&self, program: &Program, iterations: usize, ending: Ending) -> Option<Solved> {
        let multipliers = Multipliers { blocks: self.blocks.clone(), rows: self.rows.clone() };
        let certificate = program.certificate(&self.x, &multipliers)?;
        Some(Solved { x: self.x.clone(), multipliers, certificate, iterations, ending })
    }

    /// One predictor and corrector; gives the step length taken, or none when double precision allows no further one.
    fn step(&mut self, program: &Program, hessian: &DMatrix<f64>, last_step: f64) -> Option<f64> {
        let scalings = program
            .blocks
            .iter()
            .zip(&self.blocks)
            .map(|(block, z)| Scaling::new(&block.value(&self.x), z))
            .collect::<Option<Vec<_>>>()?;
        let slacks: Vec<f64> = program.rows.iter().map(|row| row.value(&self.x)).collect();
        let mut matrix = hessian.clone();
        for (block, scaling) in program.blocks.iter().zip(&scalings) {
            add_block(&mut matrix, &block.map, &scaling.hessian());
        }
        for ((row, &z), &s) in program.rows.iter().zip(&self.rows).zip(&slacks) {
            for &(i, a) in &row.entries {
                for &(j, b) in &row.entries {
                    matrix[(i, j)] += a * b * z / s;
                }
            }
        }
        let system = DefiniteSystem::new(matrix)?;
        let mut residual = program.gradient(&self.x).0;
        for (block, z) in program.blocks.iter().zip(&self.blocks) {
            block.add_transposed(&vector_of(z), -1.0, &mut residual);
        }
        for (row, &z) in program.rows.iter().zip(&self.rows) {
            row.add_to(-z, &mut residual);
        }
        let floors: Vec<f64> = program.blocks.iter().map(|block| block.entropy).collect();
        let squares: Vec<Matrix4<f64>> =
            scalings.iter().map(|scaling| Matrix4::from_diagonal(&scaling.lambda.map(|l| l * l))).collect();
        let target = |mu: f64| -> Vec<Matrix4<f64>> {
            squares.iter().zip(&floors).map(|(square, &floor)| Matrix4::identity() * mu.max(floor) - square).collect()
        };
        let row_target = |mu: f64| -> Vec<f64> { slacks.iter().zip(&self.rows).map(|(&s, &z)| mu - s * z).collect() };
        let direction = |targets: &[Matrix4<f64>], row_targets: &[f64]| -> Option<Direction> {
            let mut right = -residual.clone();
            let wanted: Vec<Matrix4<f64>> =
                scalings.iter().zip(targets).map(|(scaling, target)| scaling.divided(target)).collect();
            for ((block, scaling), d) in program.blocks.iter().zip(&scalings).zip(&wanted) {
                block.add_transposed(&vector_of(&scaling.unscaled_dual(d)), 1.0, &mut right);
            }
            for ((row, target), &s) in program.rows.iter().zip(row_targets).zip(&slacks) {
                row.add_to(target / s, &mut right);
            }
            let x = system.solve(&right);
            if !x.iter().all(|v| v.is_finite()) {
                return None;
            }
            let primal: Vec<Matrix4<f64>> = program
                .blocks
                .iter()
                .zip(&scalings)
                .map(|(block, scaling)| scaling.scaled_primal(&matrix_of(&block.linear_part(&x))))
                .collect();
            let dual = wanted.iter().zip(&primal).map(|(d, p)| d - p).collect();
            let row_primal: Vec<f64> = program.rows.iter().map(|row| row.linear_part(&x)).collect();
            let row_dual = row_targets
                .iter()
                .zip(&row_primal)
                .zip(slacks.iter().zip(&self.rows))
                .map(|((target, ds), (s, z))| (target - z * ds) / s)
                .collect();
            Some(Direction { x, primal, dual, row_primal, row_dual })
        };
        // How far products stand above where they must end, on average.
        let degree = (4 * scalings.len() + slacks.len()).max(1) as f64;
        let excess = |direction: Option<(&Direction, f64)>| -> f64 {
            let (d, alpha) = direction.map_or((None, 0.0), |(d, alpha)| (Some(d), alpha));
            let blocks = (0..scalings.len()).map(|k| {
                let diagonal = Matrix4::from_diagonal(&scalings[k].lambda);
                let (s, z) =
                    d.map_or((diagonal, diagonal), |d| (diagonal + d.primal[k] * alpha, diagonal + d.dual[k] * alpha));
                (s.dot(&z) - 4.0 * floors[k]).max(0.0)
            });
            let rows = (0..slacks.len()).map(|l| {
                let (ds, dz) = d.map_or((0.0, 0.0), |d| (d.row_primal[l], d.row_dual[l]));
                ((slacks[l] + alpha * ds) * (self.rows[l] + alpha * dz)).max(0.0)
            });
            (blocks.sum::<f64>() + rows.sum::<f64>()) / degree
        };
        let longest = |d: &Direction| -> f64 {
            let mut alpha = f64::INFINITY;
            for (k, scaling) in scalings.iter().enumerate() {
                alpha = alpha.min(scaling.largest_step(&d.primal[k])).min(scaling.largest_step(&d.dual[k]));
            }
            for l in 0..slacks.len() {
                if d.row_primal[l] < 0.0 {
                    alpha = alpha.min(-slacks[l] / d.row_primal[l]);
                }
                if d.row_dual[l] < 0.0 {
                    alpha = alpha.min(-self.rows[l] / d.row_dual[l]);
                }
            }
            alpha
        };
        let affine = direction(&target(0.0), &row_target(0.0))?;
        let mu = excess(None);
        let alpha = longest(&affine).min(1.0);
        let after = excess(Some((&affine, alpha)));
        // After a short step the products are out of balance: centre before going on.
        let least = if last_step < 0.1 { 0.5 } else { 0.0 };
        let sigma = if mu > 0.0 { (after / mu).powi(3).clamp(least, 1.0) } else { 0.0 };
        let mut targets = target(sigma * mu);
        let mut row_targets = row_target(sigma * mu);
        // The corrector's second-order term holds for full steps; scaled down it does no harm after short ones.
        let share = alpha * alpha;
        for (k, target) in targets.iter_mut().enumerate() {
            let product = affine.primal[k] * affine.dual[k];
            *target -= (product + product.transpose()) * (0.5 * share);
        }
        for (l, target) in row_targets.iter_mut().enumerate() {
            *target -= share * affine.row_primal[l] * affine.row_dual[l];
        }
        let corrected = direction(&targets, &row_targets)?;
        let mut alpha = (FRACTION_TO_BOUNDARY * longest(&corrected)).min(1.0);
        // Rounding may put a point outside that lies on the boundary but for it.
        for _ in 0..30 {
            if let Some(next) = self.moved(program, &scalings, &corrected, alpha) {
                *self = next;
                return Some(alpha);
            }
            alpha *= 0.7;
        }
        None
    }

    fn moved(&self, program: &Program, scalings: &[Scaling], direction: &Direction, alpha: f64) -> Option<Self> {
        let x = &self.x + &direction.x * alpha;
        if !program.strictly_inside(&x) {
            return None;
        }
        let blocks: Vec<Matrix4<f64>> = self
            .blocks
            .iter()
            .zip(scalings)
            .zip(&direction.dual)
            .map(|((z, scaling), d)| matrix_of(&vector_of(&(z + scaling.unscaled_dual(d) * alpha))))
            .collect();
        let rows: Vec<f64> = self.rows.iter().zip(&direction.row_dual).map(|(z, d)| z + alpha * d).collect();
        let inside = blocks.iter().all(|z| z.cholesky().is_some()) && rows.iter().all(|&z| z > 0.0);
        inside.then_some(Self { x, blocks, rows })
    }
}

/// Adds `Mᵀ C M`.
pub(super) fn add_block(matrix: &mut DMatrix<f64>, map: &BlockMap, block: &Matrix10) {
    match map {
        BlockMap::Own(first) => {
            let mut place = matrix.fixed_view_mut::<10, 10>(*first, *first);
            place += block;
        }
        BlockMap::General(map) => *matrix += map.tr_mul(&(block * map)),
    }
}
