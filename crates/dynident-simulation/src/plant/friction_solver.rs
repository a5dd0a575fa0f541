//! Solver for the friction torques of all units.
//!
//! Velocities (or accelerations) after a step are `w = r - c A f`: r without friction, c a time factor, `A = C M⁻¹
//! Cᵀ` the inverse inertia of the units. Every friction torque satisfies the law of its unit, `f_u ∈ f_u(w_u)`, with
//! a jump at rest (implicit time stepping of dry friction: Moreau 1988; Acary and Brogliato, *Numerical Methods for
//! Nonsmooth Dynamical Systems*, 2008). `A` is positive (semi-)definite and the laws are monotone. The velocities are
//! therefore unique, friction is dissipative, and a unit that its friction can hold stays exactly at rest.
//!
//! Newton's method on the set of units at rest is used while it reduces the error; otherwise Gauss-Seidel sweeps, which
//! always converge because they descend in a convex function.

use super::factor::eliminate;
use super::friction_unit::{FrictionParts, FrictionUnit};

const MAX_ROUNDS: usize = 400;
/// Tolerance of the velocity change, relative to the largest velocity.
const RELATIVE_TOLERANCE: f64 = 1e-13;
/// Smaller velocities are treated as zero, because their products underflow.
const MIN_SPEED: f64 = 1e-250;

/// Torques and scratch. The last solution is the start of the next step.
#[derive(Clone, Debug, Default)]
pub(super) struct FrictionSolver {
    pub(super) torque: Vec<f64>,
    /// Velocities (accelerations) of the units; exactly zero for held units.
    pub(super) speed: Vec<f64>,
    trial: Vec<f64>,
    matrix: Vec<f64>,
}

impl FrictionSolver {
    pub(super) fn new(units: usize) -> Self {
        let zeros = || vec![0.0; units];
        Self { torque: zeros(), speed: zeros(), trial: zeros(), matrix: vec![0.0; units * units] }
    }

    /// Solves `w = r - c A f`, `f_u ∈ f_u(w_u)`. Returns false if the torques did not converge; they satisfy the
    /// limits of their friction laws in any case.
    ///
    /// `chosen` contains indices into `units`; `a` and `r` are in the order of `chosen`. With `jumps`, only the jumps
    /// of the friction laws at zero velocity are used.
    pub(super) fn solve(
        &mut self,
        units: &[FrictionUnit],
        chosen: &[usize],
        a: &[f64],
        r: &[f64],
        c: f64,
        jumps: bool,
    ) -> bool {
        let problem = Problem { units, chosen, a, r, c, jumps };
        let n = chosen.len();
        let scale = r.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if scale == 0.0 {
            self.torque[..n].fill(0.0);
            self.speed[..n].fill(0.0);
            return true;
        }
        for _ in 0..MAX_ROUNDS {
            if self.sweep(&problem) <= RELATIVE_TOLERANCE * scale.max(MIN_SPEED) {
                return true;
            }
            if self.newton(&problem) && problem.defect(&self.trial) < problem.defect(&self.torque) {
                self.torque[..n].copy_from_slice(&self.trial[..n]);
            }
        }
        false
    }

    /// One pass over the units, each solved exactly with the current torques of the others. Returns the largest
    /// change, as a velocity.
    fn sweep(&mut self, problem: &Problem<'_>) -> f64 {
        let mut change = 0.0_f64;
        for u in 0..problem.chosen.len() {
            let own = problem.own(u);
            if own <= 0.0 {
                // A unit that cannot move, because its joints are locked.
                (self.torque[u], self.speed[u]) = (0.0, 0.0);
                continue;
            }
            let found = problem.resolve(u, &self.torque);
            change = change.max(own * (found.torque - self.torque[u]).abs());
            (self.torque[u], self.speed[u]) = (found.torque, found.speed);
        }
        change
    }

    /// Solves the equations linearised at the last sweep, into `trial`.
    fn newton(&mut self, problem: &Problem<'_>) -> bool {
        let n = problem.chosen.len();
        let Problem { a, r, c, .. } = *problem;
        for u in 0..n {
            let row = &mut self.matrix[u * n..(u + 1) * n];
            if problem.own(u) <= 0.0 {
                row.fill(0.0);
                row[u] = 1.0;
                self.trial[u] = 0.0;
                continue;
            }
            let found = problem.resolve(u, &self.torque);
            // f = f₀ + s (w - w₀) or w = 0, with w = r - c A f.
            let factor = found.slope.map_or(c, |slope| slope * c);
            for (to, entry) in row.iter_mut().zip(&a[u * n..]) {
                *to = factor * entry;
            }
            self.trial[u] = r[u];
            if let Some(slope) = found.slope {
                row[u] += 1.0;
                self.trial[u] = found.torque + slope * (r[u] - found.speed);
            }
        }
        let trial = &mut self.trial[..n];
        eliminate(&mut self.matrix[..n * n], n, trial) && trial.iter().all(|x| x.is_finite())
    }
}

struct Problem<'a> {
    units: &'a [FrictionUnit],
    chosen: &'a [usize],
    a: &'a [f64],
    r: &'a [f64],
    c: f64,
    jumps: bool,
}

impl Problem<'_> {
    fn own(&self, u: usize) -> f64 {
        self.c * self.a[u * self.chosen.len() + u]
    }

    /// Solution of unit `u` with the current torques of the others.
    fn resolve(&self, u: usize, torque: &[f64]) -> FrictionParts {
        let n = self.chosen.len();
        let row = &self.a[u * n..(u + 1) * n];
        let others = row.iter().zip(torque).map(|(a, f)| a * f).sum::<f64>() - row[u] * torque[u];
        let unit = &self.units[self.chosen[u]];
        let (free, own) = (self.r[u] - self.c * others, self.own(u));
        if self.jumps { unit.resolve_jump(free, own) } else { unit.resolve(free, own) }
    }

    /// Largest difference between a torque and the solution of its unit with the current torques, as a velocity.
    fn defect(&self, torque: &[f64]) -> f64 {
        (0..self.chosen.len())
            .filter(|&u| self.own(u) > 0.0)
            .map(|u| self.own(u) * (self.resolve(u, torque).torque - torque[u]).abs())
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;
    use dynident_model::terms::{Coulomb, CoulombShape, TorqueTerm};

    /// Strongly coupled units of all kinds: every torque is in its map up to rounding (1e-11 of the largest velocity),
    /// for any combination of rest and motion.
    #[test]
    fn torques_belong_to_their_speeds() {
        let mut random = Random::new(4);
        for _ in 0..300 {
            let n = 1 + (random.bits() % 8) as usize;
            let root: Vec<f64> = (0..n * n).map(|_| 1.0 + 0.3 * random.normal()).collect();
            let a: Vec<f64> =
                (0..n * n).map(|at| (0..n).map(|k| root[at / n * n + k] * root[at % n * n + k]).sum::<f64>()).collect();
            let units: Vec<FrictionUnit> = (0..n)
                .map(|joint| {
                    let mut unit = FrictionUnit::new(vec![(joint, 1.0)]);
                    let shape = if random.uniform(0.0, 1.0) < 0.7 {
                        CoulombShape::Sign { dead_band: 0.0 }
                    } else {
                        CoulombShape::Smooth { width: 0.01 }
                    };
                    unit.add_term(&TorqueTerm::Coulomb(Coulomb { joint, shape }), random.uniform(0.1, 3.0));
                    unit
                })
                .collect();
            let c = 1e-3;
            let r: Vec<f64> = (0..n).map(|_| 0.02 * random.normal()).collect();
            let mut solver = FrictionSolver::new(n);
            let all: Vec<usize> = (0..n).collect();
            assert!(solver.solve(&units, &all, &a, &r, c, false));
            let scale = r.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            for (u, unit) in units.iter().enumerate() {
                let speed = r[u] - c * (0..n).map(|k| a[u * n + k] * solver.torque[k]).sum::<f64>();
                assert!((speed - solver.speed[u]).abs() < 1e-11 * scale);
                assert!(solver.speed[u] * solver.torque[u] >= 0.0);
                if unit.holds() {
                    let level = unit.level()[0];
                    assert!(solver.torque[u].abs() <= level * (1.0 + 1e-12));
                    assert!(solver.speed[u] == 0.0 || (solver.torque[u].abs() - level).abs() < 1e-12 * level);
                }
            }
        }
    }
}
