//! The friction torques of all units at once.
//!
//! Velocities (or accelerations) after a step are `w = r - c A f` with the units' inverse inertia `A = C M⁻¹ Cᵀ`, and
//! every torque belongs to its unit's map: `f_u ∈ f_u(w_u)`, a jump at rest (implicit time stepping of dry friction:
//! Moreau 1988; Acary and Brogliato, *Numerical Methods for Nonsmooth Dynamical Systems*, 2008). `A` is positive
//! (semi-)definite and the maps are monotone, so that velocities are unique, friction takes energy, and a unit that its
//! friction can hold stays at rest exactly.
//!
//! Newton's method on the pattern of units at rest, as long as it brings the torques nearer to their solution;
//! Gauss-Seidel sweeps, which always do (they descend in a convex function), where it does not.

use super::factor::eliminate;
use super::friction_unit::{FrictionParts, FrictionUnit};

/// Sweeps after which the torques are taken as they are. Newton's method ends after two or three rounds in all that was
/// seen.
const ROUNDS: usize = 400;
/// Share of the largest velocity below which a change counts as none.
const SETTLED: f64 = 1e-13;
/// Velocities below this are none: their products are too small for floating-point numbers.
const NONE: f64 = 1e-250;

/// Torques and scratch, kept from step to step: the last solution is the next start.
#[derive(Clone, Debug, Default)]
pub(super) struct FrictionSolver {
    /// The torques of the units.
    pub(super) torque: Vec<f64>,
    /// The units' velocities (accelerations) with them; exactly zero where a unit is held.
    pub(super) speed: Vec<f64>,
    trial: Vec<f64>,
    matrix: Vec<f64>,
}

impl FrictionSolver {
    pub(super) fn new(units: usize) -> Self {
        let zeros = || vec![0.0; units];
        Self { torque: zeros(), speed: zeros(), trial: zeros(), matrix: vec![0.0; units * units] }
    }

    /// Solves `w = r - c A f`, `f_u ∈ f_u(w_u)`. False if the torques had not settled; they are within their maps all
    /// the same.
    ///
    /// `chosen` are the places of the units in `units`; `a` and `r` follow `chosen`. With `jumps` only the jumps of the
    /// maps count.
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
        for _ in 0..ROUNDS {
            if self.sweep(&problem) <= SETTLED * scale.max(NONE) {
                return true;
            }
            if self.newton(&problem) && problem.defect(&self.trial) < problem.defect(&self.torque) {
                self.torque[..n].copy_from_slice(&self.trial[..n]);
            }
        }
        false
    }

    /// One pass over the units, each solved exactly with the others' torques as they are. Returns the largest change,
    /// as a velocity.
    fn sweep(&mut self, problem: &Problem<'_>) -> f64 {
        let mut change = 0.0_f64;
        for u in 0..problem.chosen.len() {
            let own = problem.own(u);
            if own <= 0.0 {
                // A unit that nothing can turn (its joints are locked).
                (self.torque[u], self.speed[u]) = (0.0, 0.0);
                continue;
            }
            let found = problem.resolve(u, &self.torque);
            change = change.max(own * (found.torque - self.torque[u]).abs());
            (self.torque[u], self.speed[u]) = (found.torque, found.speed);
        }
        change
    }

    /// The torques that solve the equations linearised at the last sweep, into `trial`.
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
    /// `c A_uu`.
    fn own(&self, u: usize) -> f64 {
        self.c * self.a[u * self.chosen.len() + u]
    }

    /// What unit `u` does with the others' torques as they are.
    fn resolve(&self, u: usize, torque: &[f64]) -> FrictionParts {
        let n = self.chosen.len();
        let row = &self.a[u * n..(u + 1) * n];
        let others = row.iter().zip(torque).map(|(a, f)| a * f).sum::<f64>() - row[u] * torque[u];
        let unit = &self.units[self.chosen[u]];
        let (free, own) = (self.r[u] - self.c * others, self.own(u));
        if self.jumps { unit.resolve_jump(free, own) } else { unit.resolve(free, own) }
    }

    /// How far each torque is from what its unit asks for with the others as they are: the largest, as a velocity.
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

    /// Strongly coupled units of all kinds: every torque is in its map to rounding (1e-11 of the largest velocity),
    /// whatever the mixture of rest and motion.
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
