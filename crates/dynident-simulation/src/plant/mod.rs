//! The simulated robot.

mod adaptive;
mod disturbance;
mod drives;
mod equations;
mod euler;
mod factor;
mod friction_solver;
mod friction_unit;
mod integrator;
mod lengths;
mod runge_kutta;

pub use disturbance::{Disturbance, TimeCourse};
pub use integrator::Integrator;
pub use lengths::{with_length_errors, with_placements};

use crate::error::{SimulationError, require, require_length};
use disturbance::JointDisturbance;
use drives::Drives;
use dynident_dynamics::{kinetic_energy, potential_energy};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;
use equations::{Equations, Mode, StateView};
use runge_kutta::Stages;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Reason why the simulation of a robot cannot continue. Its state is then the last computed one, or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PlantFault {
    /// A joint of the simulated robot moves no mass at this posture, or an inertia is negative. Correct the inertias in
    /// the robot description.
    #[error("the mass matrix of the simulated robot is not positive definite")]
    MassMatrix,
    /// The simulated motion grew without bound, usually because the controller is unstable. Lower the gains, or raise
    /// `rate_hz`.
    #[error("the motion of the simulated robot is not finite")]
    NotFinite,
    /// The simulated motion changes too fast for the integrator, for example because of very stiff friction or a very
    /// high gain. Lower the gains, or use friction that changes less steeply around zero velocity.
    #[error("the adaptive integrator cannot keep its tolerance")]
    StepSize,
}

#[derive(Clone, Debug, PartialEq)]
struct State {
    time_s: f64,
    q: Vec<f64>,
    dq: Vec<f64>,
}

impl State {
    fn is_finite(&self) -> bool {
        self.q.iter().chain(&self.dq).all(|x| x.is_finite())
    }
}

/// A simulated robot: rigid bodies, drives and friction, disturbances, locked joints.
///
/// Equation of motion `M(q) q̈ + h(q, q̇) + terms = τ + d(t)`: mass matrix M, Coriolis, centrifugal and gravity
/// torque h, drive torques τ and disturbances d. Sign functions without smoothing (`CoulombShape::Sign`; its dead
/// band is ignored) are dry friction with stiction: a joint at rest stays exactly at rest until the other torques
/// exceed its friction at rest (Coulomb and Stribeck together). The sign function of a drive that moves with two
/// joints holds that drive. Load-dependent friction uses the transmitted torque of the previous evaluation.
///
/// ```
/// use dynident_simulation::{Integrator, Plant};
/// use dynident_model::{InertialParameters, Mat3, Vec3, sample::planar_2r};
/// let rod = InertialParameters::from_centre_of_mass(1.0, Vec3([1.0, 0.0, 0.0]), &Mat3::ZERO);
/// let model = planar_2r(1.0, rod, rod);
/// let mut plant = Plant::new(&model, &[], &[])?;
/// plant.set_state(0.0, &[-1.0, 0.0], &[0.0, 0.0]);
/// let before = plant.energy_j();
/// for _ in 0..1000 {
///     plant.advance(&[0.0, 0.0], 1e-3, Integrator::Rk4 { steps_per_sample: 1 }).unwrap();
/// }
/// // In free fall the energy is constant.
/// assert!((plant.energy_j() - before).abs() < 1e-8);
/// # Ok::<(), dynident_simulation::SimulationError>(())
/// ```
#[derive(Clone)]
pub struct Plant {
    equations: Equations,
    stages: Stages,
    state: State,
    terms: (Vec<TorqueTerm>, Vec<f64>),
}

impl core::fmt::Debug for Plant {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Plant")
            .field("model", &self.equations.model.name())
            .field("state", &self.state)
            .finish_non_exhaustive()
    }
}

impl Plant {
    /// Creates the robot at rest at position zero, with the inertial parameters of the model and the terms with their
    /// parameters.
    ///
    /// # Errors
    /// Different lengths, values that are not finite, negative friction or drive inertia, terms of missing joints, or a
    /// mass matrix that is not positive definite at position zero.
    pub fn new(model: &Model, terms: &[TorqueTerm], term_parameters: &[f64]) -> Result<Self, SimulationError> {
        let dof = model.dof();
        let drives = Drives::new(model, terms, term_parameters)?;
        let mut plant = Self {
            equations: Equations::new(model.clone(), drives),
            stages: Stages::new(dof),
            state: State { time_s: 0.0, q: vec![0.0; dof], dq: vec![0.0; dof] },
            terms: (terms.to_vec(), term_parameters.to_vec()),
        };
        let still = vec![0.0; dof];
        plant.set_state(0.0, &still, &still);
        let mut accelerations = still.clone();
        plant.accelerations(&still, &mut accelerations).map_err(|_| SimulationError::MassMatrix)?;
        Ok(plant)
    }

    /// Replaces the disturbances.
    ///
    /// # Errors
    /// A missing joint, a value that is not finite.
    pub fn with_disturbances(mut self, disturbances: &[Disturbance]) -> Result<Self, SimulationError> {
        let placed = disturbances
            .iter()
            .map(|one| JointDisturbance::new(&self.equations.model, one))
            .collect::<Result<_, _>>()?;
        self.equations.disturbances = placed;
        Ok(self)
    }

    /// Locks the named joints at their positions at the start of a run, and unlocks all others.
    ///
    /// # Errors
    /// A missing joint.
    pub fn with_locked(mut self, joints: &[String]) -> Result<Self, SimulationError> {
        let mut locked = vec![false; self.dof()];
        for name in joints {
            let index = self.model().joint_index(name).ok_or_else(|| dynident_model::ModelError::UnknownJoint {
                joint: name.clone(),
                known: self.model().joints().iter().map(|joint| joint.name.clone()).collect(),
            })?;
            locked[index] = true;
        }
        self.equations.any_locked = !joints.is_empty();
        self.equations.locked = locked;
        Ok(self)
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.state.q.len()
    }

    /// Model of the simulated robot.
    pub fn model(&self) -> &Model {
        &self.equations.model
    }

    /// Terms of the simulated robot and their parameters.
    pub fn terms(&self) -> (&[TorqueTerm], &[f64]) {
        (&self.terms.0, &self.terms.1)
    }

    /// Time since the start of the run, s.
    pub fn time_s(&self) -> f64 {
        self.state.time_s
    }

    /// Positions, rad or m.
    pub fn q(&self) -> &[f64] {
        &self.state.q
    }

    /// Velocities, rad/s or m/s.
    pub fn dq(&self) -> &[f64] {
        &self.state.dq
    }

    /// Number of steps in which the friction torques of several joints did not converge to 1e-13 of the largest
    /// velocity. It is zero in all known cases.
    pub fn unsettled_steps(&self) -> usize {
        self.equations.unsettled
    }

    /// Sets the state and begins a new run. Friction springs are undeflected; locked joints have zero velocity.
    ///
    /// # Panics
    /// If the vectors do not have one entry per joint.
    pub fn set_state(&mut self, time_s: f64, q: &[f64], dq: &[f64]) {
        self.state.time_s = time_s;
        self.state.q.copy_from_slice(q);
        self.state.dq.copy_from_slice(dq);
        for (dq, locked) in self.state.dq.iter_mut().zip(&self.equations.locked) {
            if *locked {
                *dq = 0.0;
            }
        }
        self.equations.drives.restart(q);
        self.equations.modes.fill(Mode::Forward);
        self.equations.acceleration.fill(0.0);
        self.equations.solver.torque.fill(0.0);
        self.equations.unsettled = 0;
    }

    /// Checks positions and velocities for [`set_state`](Self::set_state).
    ///
    /// # Errors
    /// Another number of joints, a value that is not finite.
    pub fn check_state(&self, q: &[f64], dq: &[f64]) -> Result<(), SimulationError> {
        for (what, values) in [("start positions", q), ("start speeds", dq)] {
            require_length(what, self.dof(), values.len())?;
            for &value in values {
                require(value.is_finite(), what, value, "give finite numbers")?;
            }
        }
        Ok(())
    }

    /// Computes the accelerations for the drives' torques in the current state, including friction. A joint at rest
    /// stays at rest if its friction is sufficient.
    ///
    /// # Errors
    /// [`PlantFault`].
    ///
    /// # Panics
    /// If the vectors do not have one entry per joint.
    pub fn accelerations(&mut self, tau: &[f64], out: &mut [f64]) -> Result<(), PlantFault> {
        let State { time_s, q, dq } = &self.state;
        let at = StateView { time_s: *time_s, q, dq, tau };
        self.equations.decide(at)?;
        self.equations.in_modes(at)?;
        out.copy_from_slice(&self.equations.acceleration);
        if out.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(PlantFault::NotFinite) }
    }

    /// Integrates over `duration_s` with constant torques of the drives. The fixed-step integrators do not allocate.
    ///
    /// # Errors
    /// [`PlantFault`]: the motion cannot be continued.
    ///
    /// # Panics
    /// If `tau` does not have one entry per joint.
    pub fn advance(&mut self, tau: &[f64], duration_s: f64, integrator: Integrator) -> Result<(), PlantFault> {
        let Self { equations, stages, state, .. } = self;
        match integrator {
            Integrator::SemiImplicitEuler { steps_per_sample } => {
                let h = duration_s / steps_per_sample as f64;
                (0..steps_per_sample).try_for_each(|_| euler::step(equations, state, tau, h))
            }
            Integrator::Rk4 { steps_per_sample } => {
                let h = duration_s / steps_per_sample as f64;
                (0..steps_per_sample).try_for_each(|_| runge_kutta::step(equations, stages, state, tau, h))
            }
            Integrator::Adaptive { relative_tolerance, absolute_tolerance } => {
                adaptive::advance(equations, state, tau, duration_s, relative_tolerance, absolute_tolerance)
            }
        }
    }

    /// Sets the clock, so that a loop that counts samples can remove rounding errors of the time.
    pub fn set_time_s(&mut self, time_s: f64) {
        self.state.time_s = time_s;
    }

    /// Kinetic energy of bodies and drives, and potential energy of the bodies, J.
    pub fn energy_j(&mut self) -> f64 {
        let State { q, dq, .. } = &self.state;
        let drives: f64 =
            self.equations.drives.inertia.iter().map(|&(row, column, value)| 0.5 * value * dq[row] * dq[column]).sum();
        let (model, workspace) = self.equations.workspace();
        drives + kinetic_energy(model, workspace, q, dq) + potential_energy(model, workspace, q)
    }
}
