//! Derivatives of a simulated motion by all unknowns.
//!
//! The derivative of the equation of a step (`rollout.rs`) by one coordinate, with the derivatives `S_q`, `S_v` of the
//! state at its beginning and `D` of the bodies' torque with constant `a`, gives that of the velocity at its end:
//!
//! ```text
//! (A + slopes) S_x = A S_v - D + ∂t/∂state + ∂t/∂coordinate        A = (M + armature) / h        S_u = w S_x + (1 - w) S_v
//! ```
//!
//! for the moving joints; a resting joint has `S_x = 0`. `A + slopes` is the matrix that solved the step.

use crate::floor::Floor;
use crate::parameters::VariedRobot;
use crate::quantity::Quantity;
use crate::step::{Clip, StepSolver, subtract};
use crate::step_state::StepState;
use dynident_dynamics::{Workspace, inverse_dynamics_derivatives, torque_regressor};
use dynident_model::Model;

/// Derivatives of position and velocity: dof rows with one value for each coordinate.
#[derive(Debug)]
pub(crate) struct Sensitivity {
    columns: usize,
    by_q: Vec<f64>,
    by_v: Vec<f64>,
    /// Of the mean velocity of the last step.
    by_mean: Vec<f64>,
    rows: Vec<f64>,
    loads: Vec<f64>,
    still: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Sensitivity {
    pub(crate) fn new(dof: usize, columns: usize) -> Self {
        let zeros = || vec![0.0; dof * columns];
        let (still, acceleration) = (vec![0.0; dof], vec![0.0; dof]);
        Self {
            columns,
            by_q: zeros(),
            by_v: zeros(),
            by_mean: zeros(),
            rows: zeros(),
            loads: zeros(),
            still,
            acceleration,
        }
    }

    /// The state no longer depends on the coordinates.
    pub(crate) fn restart(&mut self) {
        self.by_q.fill(0.0);
        self.by_v.fill(0.0);
    }

    /// Derivatives of the position of a joint `rest` seconds before the end of the last step.
    pub(crate) fn before_end(&self, joint: usize, rest: f64, out: &mut [f64]) {
        let own = joint * self.columns..(joint + 1) * self.columns;
        for ((out, q), v) in out.iter_mut().zip(&self.by_q[own.clone()]).zip(&self.by_mean[own]) {
            *out = q - rest * v;
        }
    }

    /// Advances the derivatives by a step that `solver` has just solved.
    pub(crate) fn advance(
        &mut self,
        varied: &VariedRobot,
        (model, workspace): (&Model, &mut Workspace),
        solver: &StepSolver,
        step: &StepState,
    ) {
        let (dof, columns) = (step.q.len(), self.columns);
        for (joint, acceleration) in self.acceleration.iter_mut().enumerate() {
            *acceleration = (step.x[joint] - step.v[joint]) / step.h;
        }
        let states = (&self.by_q[..], &self.by_v[..]);
        if varied.has_load_friction {
            bodies(&mut self.loads, states, varied, (model, &mut *workspace), (step, &self.still));
        }
        bodies(&mut self.rows, states, varied, (model, workspace), (step, &self.acceleration));
        for joint in 0..dof {
            let row = &mut self.rows[joint * columns..(joint + 1) * columns];
            for value in &mut *row {
                *value = -*value;
            }
            for (other, a) in step.a[joint * dof..(joint + 1) * dof].iter().enumerate() {
                subtract(row, &self.by_v[other * columns..(other + 1) * columns], -a);
            }
        }
        if let Some(floor) = &varied.robot.floor {
            self.add_contacts(floor, varied, step);
        }
        self.add_drives(varied, step);
        self.solve(solver, step);
    }

    /// Adds the derivatives of the drives' torques.
    fn add_drives(&mut self, varied: &VariedRobot, step: &StepState) {
        let (columns, robot) = (self.columns, &varied.robot);
        let (weight, known) = (step.end_weight, 1.0 - step.end_weight);
        for (joint, drive) in robot.drives.iter().enumerate() {
            let mode = step.laws.modes[joint];
            let own = joint * columns..(joint + 1) * columns;
            let row = &mut self.rows[own.clone()];
            if mode.clip == Clip::Inside {
                subtract(row, &self.by_q[own.clone()], drive.stiffness);
                subtract(row, &self.by_v[own.clone()], drive.stiffness * weight * known * step.h);
            }
            subtract(row, &self.by_v[own.clone()], drive.damping * known);
            let sign = mode.motion.sign();
            if varied.has_load_friction {
                let factor = sign * drive.load_friction * step.loads[joint].signum();
                subtract(row, &self.loads[own.clone()], factor);
            }
            let by_v = drive.stribeck * step.at_rest[joint] * -2.0 * step.v[joint] / drive.stribeck_speed.powi(2);
            subtract(row, &self.by_v[own], sign * by_v);
        }
        for effect in varied.effects.iter().filter(|effect| effect.quantity != Quantity::FloorHeight) {
            let joint = effect.index;
            let (mode, drive) = (step.laws.modes[joint], &robot.drives[joint]);
            let (x, sign) = (step.x[joint], mode.motion.sign());
            let inside = mode.clip == Clip::Inside;
            let torque = match effect.quantity {
                Quantity::Stiffness if inside => {
                    step.laws.joints[joint].pull / drive.stiffness - step.h * weight * weight * x
                }
                Quantity::Delay if inside => drive.stiffness * step.command_rates[joint],
                Quantity::Damping => -step.mean[joint],
                Quantity::Armature => -self.acceleration[joint],
                Quantity::Coulomb => -sign,
                Quantity::LoadFriction => -sign * step.loads[joint].abs(),
                Quantity::Stribeck => -sign * step.at_rest[joint],
                Quantity::TorqueLimit => match mode.clip {
                    Clip::Inside => 0.0,
                    Clip::Upper => 1.0,
                    Clip::Lower => -1.0,
                },
                _ => 0.0,
            };
            self.rows[joint * columns + effect.column] += torque * effect.derivative;
        }
    }

    /// Adds the derivatives of the contacts' torques `J N`, whose force is `N = K (height - z - h J u)`.
    fn add_contacts(&mut self, floor: &Floor, varied: &VariedRobot, step: &StepState) {
        let (dof, columns) = (step.q.len(), self.columns);
        let known = 1.0 - step.end_weight;
        let touching = step.laws.contacts.iter().zip(&step.heights).filter(|(contact, _)| contact.touches);
        for (contact, height) in touching {
            for other in 0..dof {
                let turned: f64 = (0..dof).map(|k| step.mean[k] * height.second[k * dof + other]).sum();
                let by_force = floor.stiffness * (height.first[other] + step.h * turned);
                for joint in 0..dof {
                    let factor = contact.force * height.second[joint * dof + other] - height.first[joint] * by_force;
                    let row = &mut self.rows[joint * columns..(joint + 1) * columns];
                    let own = other * columns..(other + 1) * columns;
                    subtract(row, &self.by_q[own.clone()], -factor);
                    let by_v = height.first[joint] * floor.stiffness * known * step.h * height.first[other];
                    subtract(row, &self.by_v[own], by_v);
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

    /// Derivatives of the velocity at the end of the step, and of the position.
    fn solve(&mut self, solver: &StepSolver, step: &StepState) {
        let (columns, weight) = (self.columns, step.end_weight);
        for (row, &joint) in solver.moving.iter().enumerate() {
            if row != joint {
                self.rows.copy_within(joint * columns..(joint + 1) * columns, row * columns);
            }
        }
        solver.apply_inverse(&mut self.rows, columns);
        for (mean, v) in self.by_mean.iter_mut().zip(&self.by_v) {
            *mean = (1.0 - weight) * v;
        }
        self.by_v.fill(0.0);
        for (row, &joint) in solver.moving.iter().enumerate() {
            let solved = &self.rows[row * columns..(row + 1) * columns];
            let own = joint * columns..(joint + 1) * columns;
            self.by_v[own.clone()].copy_from_slice(solved);
            subtract(&mut self.by_mean[own], solved, -weight);
        }
        subtract(&mut self.by_q, &self.by_mean, -step.h);
    }
}

/// `D`: derivatives of the bodies' torque `τ(q + (1 - w) h v, v, a)` with constant acceleration.
fn bodies(
    out: &mut [f64],
    (by_q, by_v): (&[f64], &[f64]),
    varied: &VariedRobot,
    (model, workspace): (&Model, &mut Workspace),
    (step, acceleration): (&StepState, &[f64]),
) {
    let (dof, columns) = (step.q.len(), varied.columns);
    out.fill(0.0);
    let by = inverse_dynamics_derivatives(model, workspace, &step.in_model, &step.v, acceleration);
    for joint in 0..dof {
        let row = &mut out[joint * columns..(joint + 1) * columns];
        for other in 0..dof {
            let p = by.by_position[joint * dof + other];
            // The position in the middle of the step depends on the velocity.
            let s = by.by_velocity[joint * dof + other] + (1.0 - step.end_weight) * step.h * p;
            let own = other * columns..(other + 1) * columns;
            for ((row, q), v) in row.iter_mut().zip(&by_q[own.clone()]).zip(&by_v[own]) {
                *row += p * q + s * v;
            }
        }
    }
    // The zero of a joint moves the position in the model.
    for effect in varied.effects.iter().filter(|effect| effect.quantity == Quantity::Zero) {
        for joint in 0..dof {
            out[joint * columns + effect.column] += by.by_position[joint * dof + effect.index] * effect.derivative;
        }
    }
    if varied.body_effects.is_empty() {
        return;
    }
    let width = 10 * model.body_count();
    let regressor = torque_regressor(model, workspace, &step.in_model, &step.v, acceleration);
    for effect in &varied.body_effects {
        for joint in 0..dof {
            let block = &regressor[joint * width + 10 * effect.body..][..10];
            out[joint * columns + effect.column] +=
                block.iter().zip(&effect.derivative).map(|(y, d)| y * d).sum::<f64>();
        }
    }
}
