//! Simulation of the robot with its drives for recorded commands.
//!
//! A step of length `h` starts in the state `(q, v)` (positions and velocities). It solves the following equation for
//! the velocity `x` at its end:
//!
//! ```text
//! τ(q + (1 - w) h v, v, a) + armature a = t(u)        a = (x - v) / h        u = w x + (1 - w) v        q' = q + h u
//! ```
//!
//! where `τ` is the inverse dynamics of the bodies and `t` the torque of the drives (`step.rs`). With the weight
//! `w = 1/2` (midpoint rule), smooth torques are exact to second order, and no damping is added; `w = 1` adds the
//! damping stiffness × h. Dry friction acts against `x`. `sensitivity.rs` computes the derivatives.

use crate::command::{Reach, SetPoint};
use crate::law::DriveLaw;
use crate::parameters::VariedRobot;
use crate::quantity::Quantity;
use crate::run::Run;
use crate::sensitivity::Sensitivity;
use crate::step::{JointLaw, StepSolver};
use crate::step_state::{StepState, Stepping};
use dynident_dynamics::{Workspace, mass_matrix_and_bias};
use dynident_model::Model;

/// A simulation for the commands of one run.
#[derive(Debug)]
pub(crate) struct Rollout<'a> {
    varied: &'a VariedRobot,
    run: &'a Run,
    /// The bodies, including the payloads of the run.
    model: Model,
    workspace: Workspace,
    solver: StepSolver,
    step: StepState,
    stepping: Stepping,
    /// Derivatives of the motion; `None` if they are not needed.
    sensitivity: Option<Sensitivity>,
}

/// Simulated position of one joint at one time stamp, and its derivatives.
pub(crate) struct Predicted<'a> {
    pub(crate) joint: usize,
    pub(crate) sample: usize,
    pub(crate) position: f64,
    /// Derivative of the position by each coordinate; empty if derivatives are not computed.
    pub(crate) derivatives: &'a [f64],
}

impl<'a> Rollout<'a> {
    /// Prepares a simulation; `None` if a payload of the run is not a valid body.
    pub(crate) fn new(
        varied: &'a VariedRobot,
        run: &'a Run,
        stepping: Stepping,
        with_derivatives: bool,
    ) -> Option<Self> {
        let dof = varied.robot.model.dof();
        let points = varied.robot.floor.as_ref().map_or(0, |floor| floor.points.len());
        let model = with_payloads(&varied.robot.model, run)?;
        let q = run.positions.iter().map(|joint| joint[0]).collect();
        let step = StepState::at_rest(q, &stepping, points);
        Some(Self {
            varied,
            run,
            workspace: Workspace::new(&model),
            model,
            solver: StepSolver::new(dof),
            step,
            stepping,
            sensitivity: with_derivatives
                .then(|| Sensitivity::new(dof, varied.robot.model.body_count(), varied.columns)),
        })
    }

    /// Simulates from rest at the first measured position to the last time stamp, and calls `each` for each joint and
    /// stamp in order of time. Returns false if a step has no solution or the motion diverges.
    #[must_use]
    pub(crate) fn simulate(mut self, mut each: impl FnMut(&Predicted<'_>)) -> bool {
        let drives = &self.varied.robot.drives;
        let stamps = &self.run.times_s;
        let latest = drives.iter().map(|drive| drive.read_delay_s).fold(0.0, f64::max);
        let (start, end) = (stamps[0], stamps[stamps.len() - 1] + latest);
        let with_derivatives = self.sensitivity.is_some();
        let set_point = |(values, drive)| SetPoint::new(stamps, values, drive, with_derivatives);
        let mut commands: Vec<SetPoint<'_>> =
            self.run.commands.iter().map(Vec::as_slice).zip(drives).map(set_point).collect();
        let mut next = vec![0; drives.len()];
        let mut derivatives = vec![0.0; if self.sensitivity.is_some() { self.varied.columns } else { 0 }];
        let h = self.step.h;
        let steps = ((end - start) / h).floor() as usize + 1;
        let period = (self.stepping.restart_s / h).max(1.0);
        for step in 0..steps {
            let from = start + h * step as f64;
            let to = from + h;
            // Without restarts the period is infinite, and its conversion saturates at the largest integer.
            if step > 0 && step % period as usize == 0 {
                self.restart(from);
            }
            if !self.advance(&mut commands, from, to) {
                return false;
            }
            for (joint, next) in next.iter_mut().enumerate() {
                while let Some(stamp) = stamps.get(*next) {
                    let rest = to - (stamp + drives[joint].read_delay_s);
                    if rest <= 0.0 {
                        break;
                    }
                    self.derivatives_before_end(joint, rest, &mut derivatives);
                    let position = self.step.q[joint] - rest * self.step.mean[joint];
                    each(&Predicted { joint, sample: *next, position, derivatives: &derivatives });
                    *next += 1;
                }
            }
        }
        self.step.q.iter().all(|q| q.is_finite())
    }

    fn derivatives_before_end(&self, joint: usize, rest: f64, out: &mut [f64]) {
        let Some(sensitivity) = &self.sensitivity else { return };
        sensitivity.before_end(joint, rest, out);
        let is_own = |quantity: Quantity, index: usize| quantity == Quantity::ReadDelay && index == joint;
        for effect in self.varied.effects.iter().filter(|effect| is_own(effect.quantity, effect.index)) {
            out[effect.column] += self.step.mean[joint] * effect.derivative;
        }
    }

    /// Makes one step from time `from` to time `to`. Returns false if the step has no solution.
    fn advance(&mut self, commands: &mut [SetPoint<'_>], from: f64, to: f64) -> bool {
        self.set_equation(commands, from, to);
        let step = &mut self.step;
        if !self.solver.solve(&step.a, &step.w, &mut step.laws, &mut step.x) {
            return false;
        }
        let weight = step.end_weight;
        for ((mean, x), v) in step.mean.iter_mut().zip(&step.x).zip(&step.v) {
            *mean = weight * x + (1.0 - weight) * v;
        }
        if let Some(sensitivity) = &mut self.sensitivity {
            sensitivity.advance(self.varied, (&self.model, &mut self.workspace), &self.solver, step);
        }
        step.v.copy_from_slice(&step.x);
        for (q, mean) in step.q.iter_mut().zip(&step.mean) {
            *q += step.h * mean;
        }
        true
    }

    /// Sets the state of the simulation to the measured motion at time `at`.
    fn restart(&mut self, at: f64) {
        let drives = &self.varied.robot.drives;
        for (joint, drive) in drives.iter().enumerate() {
            (self.step.q[joint], self.step.v[joint]) = self.run.measured(joint, at - drive.read_delay_s);
        }
        if let Some(sensitivity) = &mut self.sensitivity {
            sensitivity.restart();
        }
    }

    /// Computes the matrix, the right side and the torque laws of the step.
    fn set_equation(&mut self, commands: &mut [SetPoint<'_>], from: f64, to: f64) {
        let (robot, step) = (&self.varied.robot, &mut self.step);
        let dof = step.q.len();
        let (weight, h) = (step.end_weight, step.h);
        // Share of the velocity at the beginning of the step in the mean velocity.
        let known = 1.0 - weight;
        for (joint, drive) in robot.drives.iter().enumerate() {
            step.in_model[joint] = step.q[joint] + drive.zero + known * h * step.v[joint];
        }
        let (mass, bias) = mass_matrix_and_bias(&self.model, &mut self.workspace, &step.in_model, &step.v);
        step.loads.copy_from_slice(bias);
        for (a, mass) in step.a.iter_mut().zip(mass) {
            *a = mass / step.h;
        }
        for (joint, drive) in robot.drives.iter().enumerate() {
            step.a[joint * dof + joint] += drive.armature / step.h;
            let stiffness = self.run.gain(joint) * drive.stiffness;
            let reach = match self.stepping.law {
                DriveLaw::Identified => {
                    Reach { centre: step.q[joint] + weight * h * step.v[joint], half: drive.torque_limit / stiffness }
                }
                // Simulators evaluate one command in a step.
                DriveLaw::Implicit | DriveLaw::Explicit => Reach::UNLIMITED,
            };
            let command = commands[joint].during(from - drive.delay_s, to - drive.delay_s, reach);
            step.commands[joint] = command;
            step.at_rest[joint] = (-(step.v[joint] / drive.stribeck_speed).powi(2)).exp();
            let friction =
                drive.coulomb + drive.load_friction * step.loads[joint].abs() + drive.stribeck * step.at_rest[joint];
            let identified = JointLaw {
                stiffness,
                pull: stiffness * (command.mean - step.q[joint] - weight * known * h * step.v[joint]),
                slope: stiffness * h * weight * weight,
                limit: drive.torque_limit,
                damping: drive.damping * weight,
                friction,
            };
            step.laws.joints[joint] = match self.stepping.law {
                DriveLaw::Identified => identified,
                DriveLaw::Implicit => identified.with_limited_damping(),
                DriveLaw::Explicit => {
                    let torque = stiffness * (command.mean - step.q[joint]) - drive.damping * step.v[joint];
                    JointLaw::held(torque.clamp(-drive.torque_limit, drive.torque_limit), friction)
                }
            };
            let row = &step.a[joint * dof..(joint + 1) * dof];
            step.w[joint] = row.iter().zip(&step.v).map(|(a, v)| a * v).sum::<f64>()
                - step.loads[joint]
                - drive.damping * known * step.v[joint];
        }
        let Some(floor) = &robot.floor else { return };
        for ((point, height), contact) in floor.points.iter().zip(&mut step.heights).zip(&mut step.laws.contacts) {
            height.compute(&self.model, &mut self.workspace, &step.q, point);
            let rise: f64 = height.first.iter().zip(&step.v).map(|(j, v)| j * v).sum();
            contact.push = floor.stiffness * (floor.height_m - height.height - known * h * rise);
            contact.slope = floor.stiffness * h * weight;
            contact.by_joint.copy_from_slice(&height.first);
        }
    }
}

/// The model with the payloads of a run.
fn with_payloads(model: &Model, run: &Run) -> Option<Model> {
    if run.payloads.is_empty() {
        return Some(model.clone());
    }
    let mut inertials = model.inertials().to_vec();
    for (body, payload) in &run.payloads {
        let inertial = inertials.get_mut(*body)?;
        *inertial = inertial.plus(payload);
    }
    model.with_inertials(&inertials).ok()
}
