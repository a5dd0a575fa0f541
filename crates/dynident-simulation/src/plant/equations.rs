//! Equation of motion of a simulated robot at one state, `M q̈ = τ + d(t) - h(q, q̇) - τ₀ - springs - k f(q, q̇) -
//! F_v q̇ - Cᵀ f`: mass matrix M, drive torques τ, disturbances d, Coriolis, centrifugal and gravity torque h,
//! constant torques τ₀, declared torques k f(q, q̇), viscous friction F_v, and friction torques f of the units that C
//! selects.

use super::PlantFault;
use super::disturbance::JointDisturbance;
use super::drives::Drives;
use super::factor::{eliminate, factor_and_solve, solve_all};
use super::friction_solver::FrictionSolver;
use super::friction_unit::FrictionUnit;
use dynident_dynamics::{Workspace, mass_matrix_and_bias};
use dynident_model::Model;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// Moving, or unable to hold: friction of this branch.
    Forward,
    Backward,
    /// At rest: friction is the torque that holds the unit there.
    Held,
}

#[derive(Clone, Copy)]
pub(super) struct StateView<'a> {
    pub(super) time_s: f64,
    pub(super) q: &'a [f64],
    pub(super) dq: &'a [f64],
    pub(super) tau: &'a [f64],
}

pub(super) struct Equations {
    pub(super) model: Model,
    pub(super) drives: Drives,
    pub(super) disturbances: Vec<JointDisturbance>,
    pub(super) locked: Vec<bool>,
    pub(super) any_locked: bool,
    workspace: Workspace,
    /// Mass matrix, then its factor.
    matrix: Vec<f64>,
    /// Right-hand side, then accelerations.
    pub(super) acceleration: Vec<f64>,
    /// Torque of the bodies at the last acceleration, for friction that depends on the transmitted torque.
    load: Vec<f64>,
    /// `M⁻¹ c_u` of every friction unit u: accelerations per unit of its friction torque.
    responses: Vec<f64>,
    /// `C M⁻¹ Cᵀ` of the chosen units, their inverse inertia.
    compliance: Vec<f64>,
    free: Vec<f64>,
    pub(super) solver: FrictionSolver,
    pub(super) modes: Vec<Mode>,
    chosen: Vec<usize>,
    /// Number of steps without convergence of the friction torques.
    pub(super) unsettled: usize,
}

impl Clone for Equations {
    fn clone(&self) -> Self {
        Self {
            workspace: Workspace::with_level(&self.model, self.workspace.level()),
            model: self.model.clone(),
            drives: self.drives.clone(),
            disturbances: self.disturbances.clone(),
            locked: self.locked.clone(),
            any_locked: self.any_locked,
            matrix: self.matrix.clone(),
            acceleration: self.acceleration.clone(),
            load: self.load.clone(),
            responses: self.responses.clone(),
            compliance: self.compliance.clone(),
            free: self.free.clone(),
            solver: self.solver.clone(),
            modes: self.modes.clone(),
            chosen: Vec::with_capacity(self.drives.units.len()),
            unsettled: self.unsettled,
        }
    }
}

impl Equations {
    pub(super) fn new(model: Model, drives: Drives) -> Self {
        let (n, units) = (model.dof(), drives.units.len());
        let zeros = |count: usize| vec![0.0; count];
        Self {
            workspace: Workspace::new(&model),
            disturbances: Vec::new(),
            locked: vec![false; n],
            any_locked: false,
            matrix: zeros(n * n),
            acceleration: zeros(n),
            load: zeros(n),
            responses: zeros(n * units),
            compliance: zeros(units * units),
            free: zeros(units),
            solver: FrictionSolver::new(units),
            modes: vec![Mode::Forward; units],
            chosen: Vec::with_capacity(units),
            unsettled: 0,
            model,
            drives,
        }
    }

    pub(super) fn workspace(&mut self) -> (&Model, &mut Workspace) {
        (&self.model, &mut self.workspace)
    }

    /// Mass matrix `M + implicit · F_v`, and right-hand side without velocity-dependent friction.
    #[inline]
    pub(super) fn assemble(&mut self, at: StateView<'_>, implicit: f64) {
        let n = self.acceleration.len();
        let Self { model, workspace, drives, matrix, acceleration, load, .. } = self;
        let (mass_matrix, bias) = mass_matrix_and_bias(model, workspace, at.q, at.dq);
        matrix.copy_from_slice(mass_matrix);
        if drives.by_load {
            // Uses the accelerations of the previous evaluation for friction that depends on the transmitted torque.
            for j in 0..n {
                load[j] = bias[j] + (0..n).map(|k| matrix[j * n + k] * acceleration[k]).sum::<f64>();
            }
        }
        for j in 0..n {
            acceleration[j] = at.tau[j] - bias[j] - drives.constant[j];
        }
        for &(row, column, value) in &drives.inertia {
            matrix[row * n + column] += value;
        }
        for &(row, column, value) in &drives.viscous {
            matrix[row * n + column] += implicit * value;
            acceleration[row] -= value * at.dq[column];
        }
        drives.subtract_springs(at.q, acceleration);
        drives.subtract_declared(at.q, at.dq, acceleration);
        for disturbance in &self.disturbances {
            disturbance.add(model, workspace, at.time_s, at.q, acceleration);
        }
        if self.any_locked {
            for joint in 0..n {
                if self.locked[joint] {
                    for k in 0..n {
                        matrix[joint * n + k] = 0.0;
                        matrix[k * n + joint] = 0.0;
                    }
                    matrix[joint * n + joint] = 1.0;
                    acceleration[joint] = 0.0;
                }
            }
        }
        for unit in &mut drives.units {
            let speed = unit.speed(at.dq);
            unit.update(speed, if unit.by_load { load[unit.joints[0].0] } else { 0.0 });
        }
    }

    /// Subtracts the friction of sliding units from the right-hand side.
    pub(super) fn subtract_sliding_friction(&mut self, dq: &[f64]) {
        for (unit, mode) in self.drives.units.iter().zip(&self.modes) {
            let torque = match mode {
                Mode::Held => continue,
                // Without a jump the direction has no effect.
                mode => unit.sliding(unit.speed(dq), *mode == Mode::Forward),
            };
            for &(joint, ratio) in &unit.joints {
                if !self.locked[joint] {
                    self.acceleration[joint] -= ratio * torque;
                }
            }
        }
    }

    /// Solves for the accelerations; only friction that was already subtracted is included.
    #[inline]
    pub(super) fn factor_and_solve(&mut self) -> Result<(), PlantFault> {
        let n = self.acceleration.len();
        if factor_and_solve(&mut self.matrix, n, &mut self.acceleration) { Ok(()) } else { Err(PlantFault::MassMatrix) }
    }

    /// Chooses the units for the following calls; returns their number.
    pub(super) fn choose(&mut self, wanted: impl Fn(&FrictionUnit, Mode) -> bool) -> usize {
        self.chosen.clear();
        for (index, unit) in self.drives.units.iter().enumerate() {
            if wanted(unit, self.modes[index]) {
                self.chosen.push(index);
            }
        }
        self.chosen.len()
    }

    /// `M⁻¹ c_u` of the chosen units and their compliance `C M⁻¹ Cᵀ`.
    fn couple(&mut self) {
        let (n, count) = (self.acceleration.len(), self.chosen.len());
        for (place, &index) in self.chosen.iter().enumerate() {
            let response = &mut self.responses[place * n..(place + 1) * n];
            response.fill(0.0);
            for &(joint, ratio) in &self.drives.units[index].joints {
                if !self.locked[joint] {
                    response[joint] = ratio;
                }
            }
        }
        solve_all(&self.matrix, n, &mut self.responses[..count * n]);
        for (row, &index) in self.chosen.iter().enumerate() {
            for column in 0..count {
                let response = &self.responses[column * n..(column + 1) * n];
                self.compliance[row * count + column] = self.drives.units[index].speed(response);
            }
        }
    }

    /// Applies friction torques f of the chosen units that satisfy their friction laws at the velocities `w = start +
    /// factor · acceleration`. `start` contains the joint velocities, `None` for zero. With `jumps`, only the jumps
    /// at zero velocity are used.
    pub(super) fn apply_friction(&mut self, start: Option<&[f64]>, factor: f64, jumps: bool) {
        let count = self.chosen.len();
        self.couple();
        for (place, &index) in self.chosen.iter().enumerate() {
            let unit = &self.drives.units[index];
            self.free[place] = factor * unit.speed(&self.acceleration) + start.map_or(0.0, |dq| unit.speed(dq));
        }
        let Self { drives, compliance, free, solver, chosen, .. } = self;
        let settled = solver.solve(&drives.units, chosen, &compliance[..count * count], &free[..count], factor, jumps);
        self.unsettled += usize::from(!settled);
        self.subtract_friction_response();
    }

    fn subtract_friction_response(&mut self) {
        let n = self.acceleration.len();
        for place in 0..self.chosen.len() {
            let torque = self.solver.torque[place];
            let response = &self.responses[place * n..(place + 1) * n];
            for (a, x) in self.acceleration.iter_mut().zip(response) {
                *a -= x * torque;
            }
        }
    }

    /// Calls `each(unit, mode, speed after)` for the chosen units.
    pub(super) fn for_each_chosen(&mut self, mut each: impl FnMut(&FrictionUnit, &mut Mode, f64)) {
        for (place, &index) in self.chosen.iter().enumerate() {
            each(&self.drives.units[index], &mut self.modes[index], self.solver.speed[place]);
        }
    }

    pub(super) fn in_modes(&mut self, at: StateView<'_>) -> Result<(), PlantFault> {
        self.assemble(at, 0.0);
        if self.drives.units.is_empty() {
            return self.factor_and_solve();
        }
        self.subtract_sliding_friction(at.dq);
        self.factor_and_solve()?;
        let count = self.choose(|_, mode| mode == Mode::Held);
        if count > 0 {
            self.couple();
            // If a joint and a drive that moves with it are both at rest, the division of the torque between them is
            // not unique; the regularised diagonal distributes it.
            for place in 0..count {
                self.compliance[place * count + place] *= 1.0 + 1e-13;
                self.solver.torque[place] = self.drives.units[self.chosen[place]].speed(&self.acceleration);
            }
            if !eliminate(&mut self.compliance[..count * count], count, &mut self.solver.torque[..count]) {
                self.solver.torque[..count].fill(0.0);
            }
            self.subtract_friction_response();
            for &index in &self.chosen {
                if let [(joint, _)] = self.drives.units[index].joints[..] {
                    self.acceleration[joint] = 0.0;
                }
            }
        }
        Ok(())
    }

    /// Determines which units friction holds: units at rest (`w = 0`, or held before) whose friction is sufficient.
    /// Returns whether friction can hold any unit.
    pub(super) fn decide(&mut self, at: StateView<'_>) -> Result<bool, PlantFault> {
        let mut at_rest = false;
        for (unit, mode) in self.drives.units.iter().zip(&mut self.modes) {
            let speed = unit.speed(at.dq);
            if unit.holds() && (speed == 0.0 || *mode == Mode::Held) {
                *mode = Mode::Held;
                at_rest = true;
            } else {
                *mode = if speed >= 0.0 { Mode::Forward } else { Mode::Backward };
            }
        }
        if at_rest {
            self.assemble(at, 0.0);
            self.subtract_sliding_friction(at.dq);
            self.factor_and_solve()?;
            self.choose(|_, mode| mode == Mode::Held);
            self.apply_friction(None, 1.0, true);
            self.for_each_chosen(|_, mode, acceleration| {
                if acceleration != 0.0 {
                    *mode = if acceleration > 0.0 { Mode::Forward } else { Mode::Backward };
                }
            });
        }
        Ok(self.drives.units.iter().any(FrictionUnit::holds))
    }
}
