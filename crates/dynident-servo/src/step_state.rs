//! State and equation of one time step of the simulation.

use crate::command::StepCommand;
use crate::floor::PointHeight;
use crate::law::DriveLaw;
use crate::step::{Contact, JointLaw, Mode, StepLaws};

/// Method and step length of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stepping {
    /// Length of a step, s.
    pub(crate) step_s: f64,
    /// Weight of the velocity at the end of a step in the mean velocity of the step: 1/2 is exact to second order, 1
    /// adds damping and is stable for long steps.
    pub(crate) end_weight: f64,
    /// Time after which the simulation restarts from the measured motion, s; infinite for no restarts.
    pub(crate) restart_s: f64,
    /// Law by which the torque of the drives is computed. Derivatives are those of [`DriveLaw::Identified`] for every
    /// law.
    pub(crate) law: DriveLaw,
}

impl Stepping {
    /// Accurate steps without restarts.
    pub(crate) fn accurate(step_s: f64) -> Self {
        Self::of_law(DriveLaw::Identified, step_s)
    }

    /// Steps of a simulator with this law, without restarts.
    pub(crate) fn of_law(law: DriveLaw, step_s: f64) -> Self {
        Self { step_s, end_weight: law.end_weight(), restart_s: f64::INFINITY, law }
    }
}

/// One step: the state at its beginning, the equation, and the velocity at its end.
#[derive(Debug)]
pub(crate) struct StepState {
    /// Length of the step, s.
    pub(crate) h: f64,
    /// Weight of the velocity at the end of the step in the mean velocity.
    pub(crate) end_weight: f64,
    /// Positions that the encoders measure.
    pub(crate) q: Vec<f64>,
    /// Positions in the model (with the zeros of the joints), at which the bodies' torque is evaluated: expected
    /// positions in the middle of the step if `end_weight` is 1/2, positions at its beginning if it is 1.
    pub(crate) in_model: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// Matrix of the equation, `(M + armature) / h` with the mass matrix M.
    pub(crate) a: Vec<f64>,
    pub(crate) w: Vec<f64>,
    /// Torques of weight and velocity that the gears carry.
    pub(crate) loads: Vec<f64>,
    /// Remaining share of the Stribeck effect at the velocity of each joint.
    pub(crate) at_rest: Vec<f64>,
    /// Set points of the joints.
    pub(crate) commands: Vec<StepCommand>,
    pub(crate) laws: StepLaws,
    pub(crate) heights: Vec<PointHeight>,
    /// Velocities at the end of the step.
    pub(crate) x: Vec<f64>,
    /// Mean velocities `end_weight x + (1 - end_weight) v`.
    pub(crate) mean: Vec<f64>,
}

impl StepState {
    /// The first step, from rest at `q`. `points` is the number of points that can touch the floor.
    pub(crate) fn at_rest(q: Vec<f64>, stepping: &Stepping, points: usize) -> Self {
        let dof = q.len();
        let zeros = || vec![0.0; dof];
        Self {
            h: stepping.step_s,
            end_weight: stepping.end_weight,
            q,
            in_model: zeros(),
            v: zeros(),
            a: vec![0.0; dof * dof],
            w: zeros(),
            loads: zeros(),
            at_rest: zeros(),
            commands: vec![StepCommand::default(); dof],
            laws: StepLaws {
                joints: vec![JointLaw::default(); dof],
                modes: vec![Mode::default(); dof],
                contacts: vec![Contact { by_joint: zeros(), ..Contact::default() }; points],
            },
            heights: (0..points).map(|_| PointHeight::new(dof)).collect(),
            x: zeros(),
            mean: zeros(),
        }
    }
}
