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

/// Why a simulated robot cannot go on. Its state is then that of the last moment which could be computed, or not a
/// number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PlantFault {
    /// The mass matrix is not positive definite.
    #[error("the mass matrix of the simulated robot is not positive definite")]
    MassMatrix,
    /// Positions or velocities have grown beyond all numbers.
    #[error("the simulated robot's motion has grown beyond all numbers")]
    NotFinite,
    /// The adaptive integrator found no step that keeps its tolerance.
    #[error("no integration step keeps the tolerance")]
    StepSize,
}

/// Time, positions and velocities.
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
/// `M(q) q̈ + h(q, q̇) + terms = τ + d(t)`. Signs without smoothing (`CoulombShape::Sign`, its dead band ignored) are
/// dry friction with stiction: a joint at rest stays at rest, exactly, until the other torques exceed its friction at
/// rest (Coulomb and Stribeck together). A sign of a drive that turns with two joints holds that drive. Load-dependent
/// friction takes the load of the evaluation before.
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
/// // Falling freely, it keeps its energy.
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
    /// The robot with the model's own inertial parameters and the terms with theirs, at rest at zero.
    ///
    /// # Errors
    /// Counts that differ, numbers that are not finite, friction or drive inertia below zero, terms of joints that do
    /// not exist, or a mass matrix that is not positive definite at position zero.
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

    /// The same robot under disturbances, in place of any it had.
    ///
    /// # Errors
    /// A joint that does not exist, a number that is not finite.
    pub fn with_disturbances(mut self, disturbances: &[Disturbance]) -> Result<Self, SimulationError> {
        let placed = disturbances
            .iter()
            .map(|one| JointDisturbance::new(&self.equations.model, one))
            .collect::<Result<_, _>>()?;
        self.equations.disturbances = placed;
        Ok(self)
    }

    /// The same robot with the named joints locked where they are when a run begins: they do not move whatever the
    /// torques. In place of any that were locked.
    ///
    /// # Errors
    /// A joint that does not exist.
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

    /// The true robot.
    pub fn model(&self) -> &Model {
        &self.equations.model
    }

    /// The true terms and their parameters.
    pub fn terms(&self) -> (&[TorqueTerm], &[f64]) {
        (&self.terms.0, &self.terms.1)
    }

    /// Time since the run's begin, s.
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

    /// How many steps ended before the friction torques of several joints had settled to 1e-13 of the largest velocity.
    /// Zero in all that was seen.
    pub fn unsettled_steps(&self) -> usize {
        self.equations.unsettled
    }

    /// Puts the robot somewhere: a new run begins. Springs of friction are undeflected; locked joints have no velocity.
    ///
    /// # Panics
    /// If the vectors have not one entry per joint.
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

    /// Checks positions and velocities that somebody gives, for [`set_state`](Self::set_state).
    ///
    /// # Errors
    /// Another number of joints, a number that is not finite.
    pub fn check_state(&self, q: &[f64], dq: &[f64]) -> Result<(), SimulationError> {
        for (what, values) in [("start positions", q), ("start speeds", dq)] {
            require_length(what, self.dof(), values.len())?;
            for &value in values {
                require(value.is_finite(), what, value, "give finite numbers")?;
            }
        }
        Ok(())
    }

    /// Accelerations under the drives' torques in the present state, with friction: at a joint at rest whatever holds
    /// it, as far as it can.
    ///
    /// # Errors
    /// [`PlantFault`].
    ///
    /// # Panics
    /// If the vectors have not one entry per joint.
    pub fn accelerations(&mut self, tau: &[f64], out: &mut [f64]) -> Result<(), PlantFault> {
        let State { time_s, q, dq } = &self.state;
        let at = StateView { time_s: *time_s, q, dq, tau };
        self.equations.decide(at)?;
        self.equations.in_modes(at)?;
        out.copy_from_slice(&self.equations.acceleration);
        if out.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(PlantFault::NotFinite) }
    }

    /// Goes on for `duration_s` with constant torques of the drives. The fixed-step integrators allocate nothing.
    ///
    /// # Errors
    /// [`PlantFault`]: the motion cannot be continued.
    ///
    /// # Panics
    /// If `tau` has not one entry per joint.
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

    /// Sets the clock: a loop that counts samples keeps it free of rounding.
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
