//! Derivatives of a simulated motion by all unknowns (coordinates).
//!
//! `S_q` and `S_v` are the derivatives of position and velocity at the beginning of a step by one coordinate.
//! Differentiating the equation of the step (`rollout.rs`) gives the derivative `S_x` of the velocity at its end:
//!
//! ```text
//! (A + slopes) S_x = C_q S_q + C_v S_v + effect of the coordinate        A = (M + armature) / h        S_u = w S_x + (1 - w) S_v
//! ```
//!
//! The equation applies to the moving joints; a resting joint has `S_x = 0`. `A + slopes` is the matrix of the step's
//! equation. `C_q` and `C_v` contain the derivatives of the torques of bodies, drives and contacts by the state, with
//! constant `A`. They are computed once for all coordinates.

use crate::floor::Floor;
use crate::parameters::VariedRobot;
use crate::quantity::Quantity;
use crate::step::{Clip, StepSolver, subtract};
use crate::step_state::StepState;
use dynident_dynamics::{Workspace, inverse_dynamics_derivatives, torque_regressor};
use dynident_lanes::{Kernel, Lane, Level, dispatch_single};
use dynident_model::Model;

/// Derivatives of positions and velocities by the coordinates: `dof` rows with one value for each coordinate.
#[derive(Debug)]
pub(crate) struct Sensitivity {
    columns: usize,
    level: Level,
    by_q: Vec<f64>,
    by_v: Vec<f64>,
    /// Derivatives of the mean velocity of the last step.
    by_mean: Vec<f64>,
    /// Direct effects of the coordinates on the equation; later the right sides, then the derivatives of the velocity
    /// at the end of the step.
    rows: Vec<f64>,
    /// Matrices `C_q` and `C_v`, dof × dof, row-major.
    of_q: Vec<f64>,
    of_v: Vec<f64>,
    /// Regressor of the bodies' torque.
    regressor: Vec<f64>,
    still: Vec<f64>,
    acceleration: Vec<f64>,
    /// Derivative of each joint's friction by its load torque.
    by_load: Vec<f64>,
}

impl Sensitivity {
    pub(crate) fn new(dof: usize, bodies: usize, columns: usize) -> Self {
        let zeros = |count: usize| vec![0.0; count];
        Self {
            columns,
            level: Level::detect(),
            by_q: zeros(dof * columns),
            by_v: zeros(dof * columns),
            by_mean: zeros(dof * columns),
            rows: zeros(dof * columns),
            of_q: zeros(dof * dof),
            of_v: zeros(dof * dof),
            regressor: zeros(dof * 10 * bodies),
            still: zeros(dof),
            acceleration: zeros(dof),
            by_load: zeros(dof),
        }
    }

    /// Sets all derivatives to zero, because the state was set to the measured motion.
    pub(crate) fn restart(&mut self) {
        self.by_q.fill(0.0);
        self.by_v.fill(0.0);
    }

    /// Derivatives of the position of a joint at the time `rest` seconds before the end of the last step.
    pub(crate) fn before_end(&self, joint: usize, rest: f64, out: &mut [f64]) {
        let own = joint * self.columns..(joint + 1) * self.columns;
        for ((out, q), v) in out.iter_mut().zip(&self.by_q[own.clone()]).zip(&self.by_mean[own]) {
            *out = q - rest * v;
        }
    }

    /// Advances the derivatives over the step that `solver` has just solved.
    pub(crate) fn advance(
        &mut self,
        varied: &VariedRobot,
        (model, workspace): (&Model, &mut Workspace),
        solver: &StepSolver,
        step: &mut StepState,
    ) {
        // The velocities of resting joints do not depend on the coordinates.
        if !solver.moving.is_empty() {
            self.set_equation(varied, (model, workspace), solver, step);
        }
        dispatch_single(self.level, Solve { sensitivity: self, solver, step });
    }

    /// Computes the matrices and the direct effects of the coordinates. Rows of resting joints are not used.
    fn set_equation(
        &mut self,
        varied: &VariedRobot,
        (model, workspace): (&Model, &mut Workspace),
        solver: &StepSolver,
        step: &mut StepState,
    ) {
        for (joint, acceleration) in self.acceleration.iter_mut().enumerate() {
            *acceleration = (step.x[joint] - step.v[joint]) / step.h;
        }
        self.of_q.fill(0.0);
        self.of_v.copy_from_slice(&step.a);
        self.rows.fill(0.0);
        self.add_bodies(varied, (model, workspace), solver, step);
        if let Some(floor) = &varied.robot.floor {
            self.add_contacts((floor, varied), (model, workspace), step);
        }
        self.add_drives(varied, step);
    }

    /// Subtracts the derivatives of two torques: the bodies' torque `τ(q + (1 - w) h v, v, a)` for constant
    /// acceleration, and the friction that depends on the load `τ(q + (1 - w) h v, v, 0)`.
    fn add_bodies(
        &mut self,
        varied: &VariedRobot,
        (model, workspace): (&Model, &mut Workspace),
        solver: &StepSolver,
        step: &StepState,
    ) {
        let dof = step.q.len();
        for ((by_load, drive), (mode, load)) in
            self.by_load.iter_mut().zip(&varied.robot.drives).zip(step.laws.modes.iter().zip(&step.loads))
        {
            *by_load = mode.motion.sign() * drive.load_friction * load.signum();
        }
        let width = 10 * model.body_count();
        self.regressor.fill(0.0);
        // The position in the middle of the step depends on the velocity.
        let ahead = (1.0 - step.end_weight) * step.h;
        let has_load = varied.has_load_friction && self.by_load.iter().any(|by_load| *by_load != 0.0);
        let parts = [(&self.acceleration, false), (&self.still, true)];
        for (acceleration, is_load) in parts.into_iter().take(if has_load { 2 } else { 1 }) {
            let by = inverse_dynamics_derivatives(model, workspace, &step.in_model, &step.v, acceleration);
            for joint in 0..dof {
                let part = if is_load { self.by_load[joint] } else { 1.0 };
                for at in joint * dof..(joint + 1) * dof {
                    self.of_q[at] -= part * by.by_position[at];
                    self.of_v[at] -= part * (by.by_velocity[at] + ahead * by.by_position[at]);
                }
            }
            if varied.body_effects.is_empty() {
                continue;
            }
            let regressor = torque_regressor(model, workspace, &step.in_model, &step.v, acceleration);
            for (joint, (sum, own)) in
                self.regressor.chunks_exact_mut(width).zip(regressor.chunks_exact(width)).enumerate()
            {
                let part = if is_load { self.by_load[joint] } else { 1.0 };
                sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += part * own);
            }
        }
        // The zero of a joint shifts its position in the model.
        for effect in varied.effects.iter().filter(|effect| effect.quantity == Quantity::Zero) {
            for joint in 0..dof {
                self.rows[joint * self.columns + effect.column] +=
                    self.of_q[joint * dof + effect.index] * effect.derivative;
            }
        }
        for effect in &varied.body_effects {
            for &joint in &solver.moving {
                let block = &self.regressor[joint * width + 10 * effect.body..][..10];
                self.rows[joint * self.columns + effect.column] -=
                    block.iter().zip(&effect.derivative).map(|(y, d)| y * d).sum::<f64>();
            }
        }
    }

    /// Adds the derivatives of the drives' torques.
    fn add_drives(&mut self, varied: &VariedRobot, step: &StepState) {
        let (columns, robot, dof) = (self.columns, &varied.robot, step.q.len());
        let (weight, known) = (step.end_weight, 1.0 - step.end_weight);
        for (joint, drive) in robot.drives.iter().enumerate() {
            let (mode, law) = (step.laws.modes[joint], &step.laws.joints[joint]);
            let own = joint * dof + joint;
            if mode.clip == Clip::Inside {
                // The reach moves with the joint.
                let beyond: f64 = step.commands[joint].beyond.iter().sum();
                self.of_q[own] -= law.stiffness * (1.0 - beyond);
                self.of_v[own] -= law.stiffness * weight * step.h * (known - beyond);
            }
            let by_v = drive.stribeck * step.at_rest[joint] * -2.0 * step.v[joint] / drive.stribeck_speed.powi(2);
            self.of_v[own] -= drive.damping * known + mode.motion.sign() * by_v;
        }
        for effect in varied.effects.iter().filter(|effect| effect.quantity != Quantity::FloorHeight) {
            let joint = effect.index;
            let (mode, law, drive) = (step.laws.modes[joint], &step.laws.joints[joint], &robot.drives[joint]);
            let (x, sign, command) = (step.x[joint], mode.motion.sign(), &step.commands[joint]);
            let inside = mode.clip == Clip::Inside;
            // Part of the torque that is at the limit in a step with a change of the command.
            let [below, above] = command.beyond;
            let torque = match effect.quantity {
                Quantity::Stiffness if inside => {
                    let limited = if above > below || below > 0.0 { (above - below) * drive.torque_limit } else { 0.0 };
                    (law.pull - law.slope * x - limited) / drive.stiffness
                }
                Quantity::Delay if inside => -law.stiffness * command.rate,
                Quantity::ProfileAcceleration if inside => {
                    law.stiffness * command.by_log[0] / drive.profile_acceleration
                }
                Quantity::ProfileSpeed if inside => law.stiffness * command.by_log[1] / drive.profile_speed,
                Quantity::Damping => -step.mean[joint],
                Quantity::Armature => -self.acceleration[joint],
                Quantity::Coulomb => -sign,
                Quantity::LoadFriction => -sign * step.loads[joint].abs(),
                Quantity::Stribeck => -sign * step.at_rest[joint],
                Quantity::TorqueLimit => match mode.clip {
                    Clip::Inside => above - below,
                    Clip::Upper => 1.0,
                    Clip::Lower => -1.0,
                },
                _ => 0.0,
            };
            self.rows[joint * columns + effect.column] += torque * effect.derivative;
        }
    }

    /// Adds the derivatives of the contacts' torques `Jᵀ N`. The contact force is `N = K (height - z - h J u)`: `K` is
    /// the stiffness of the floor, `z` the height of the point, `J` its derivative by the joint positions and `u` the
    /// mean velocity.
    fn add_contacts(
        &mut self,
        (floor, varied): (&Floor, &VariedRobot),
        (model, workspace): (&Model, &mut Workspace),
        step: &mut StepState,
    ) {
        let (dof, columns) = (step.q.len(), self.columns);
        let known = 1.0 - step.end_weight;
        let points = step.laws.contacts.iter().zip(&mut step.heights).zip(&floor.points);
        for ((contact, height), point) in points.filter(|((contact, _), _)| contact.touches) {
            height.compute_second(model, workspace, &step.q, point);
            for other in 0..dof {
                let turned: f64 = (0..dof).map(|k| step.mean[k] * height.second[k * dof + other]).sum();
                let by_force = floor.stiffness * (height.first[other] + step.h * turned);
                for joint in 0..dof {
                    let at = joint * dof + other;
                    self.of_q[at] += contact.force * height.second[at] - height.first[joint] * by_force;
                    self.of_v[at] -= height.first[joint] * floor.stiffness * known * step.h * height.first[other];
                }
            }
            for effect in varied.effects.iter().filter(|effect| effect.quantity == Quantity::FloorHeight) {
                for joint in 0..dof {
                    self.rows[joint * columns + effect.column] +=
                        height.first[joint] * floor.stiffness * effect.derivative;
                }
            }
        }
    }
}

/// Computes the right sides and solves for the derivatives at the end of the step.
struct Solve<'a> {
    sensitivity: &'a mut Sensitivity,
    solver: &'a StepSolver,
    step: &'a StepState,
}

impl Kernel for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { sensitivity: own, solver, step } = self;
        let (dof, columns, weight) = (step.q.len(), own.columns, step.end_weight);
        // The rows of the moving joints in the order that the solver expects.
        for (row, &joint) in solver.moving.iter().enumerate() {
            if row != joint {
                own.rows.copy_within(joint * columns..(joint + 1) * columns, row * columns);
            }
            let sum = &mut own.rows[row * columns..(row + 1) * columns];
            for other in 0..dof {
                let (of_q, of_v) = (own.of_q[joint * dof + other], own.of_v[joint * dof + other]);
                let states = other * columns..(other + 1) * columns;
                for ((sum, q), v) in sum.iter_mut().zip(&own.by_q[states.clone()]).zip(&own.by_v[states]) {
                    *sum += of_q * q + of_v * v;
                }
            }
        }
        solver.apply_inverse(&mut own.rows, columns);
        for (mean, v) in own.by_mean.iter_mut().zip(&own.by_v) {
            *mean = (1.0 - weight) * v;
        }
        own.by_v.fill(0.0);
        for (row, &joint) in solver.moving.iter().enumerate() {
            let solved = &own.rows[row * columns..(row + 1) * columns];
            let states = joint * columns..(joint + 1) * columns;
            own.by_v[states.clone()].copy_from_slice(solved);
            subtract(&mut own.by_mean[states], solved, -weight);
        }
        subtract(&mut own.by_q, &own.by_mean, -step.h);
    }
}
