//! Exports identified models to controllers and simulators: converts a [`RobotModel`] to the text of a file.
//!
//! The recursive Newton-Euler and composite-rigid-body algorithms of `dynident-dynamics` run over symbols instead of
//! numbers. The result is an expression graph that contains the constants of this robot (as base parameters, because
//! their number is minimal). It has no zeros, and common values are shared. Every language prints that graph as code
//! without branches:
//!
//! | target | output |
//! | --- | --- |
//! | [`Target::C`] | one header, C99, only math.h |
//! | [`Target::Cpp`] | one header, C++17, a namespace, `std::array` |
//! | [`Target::Rust`] | one module, no `std`, no dependency |
//! | [`Target::Python`] | one module over NumPy, many states at once |
//! | [`Target::Matlab`] | one function file for MATLAB and Octave |
//! | [`Target::Casadi`] | one Python module with a `casadi.Function` for each function |
//! | [`Target::Jax`] | one Python module of pure functions over JAX |
//! | [`Target::Pinocchio`] | one Python module that builds a model of Pinocchio, with a torque function |
//! | [`Target::Mjcf`], [`Target::Urdf`], [`Target::Sdf`] | descriptions for simulators, with the nearest friction that they support |
//! | [`Target::Ros2Yaml`] | parameters of a ROS 2 node |
//! | [`Target::Json`] | all numbers, as a [`ModelFile`] |
//!
//! The error bars of armature, damping, friction, delay and gain of every joint are in a [`SimulatorFile`].
//!
//! [`isaac_lab`] writes drives with a position controller as actuators of Isaac Lab.
//!
//! [`payload_command`] writes a payload as the command of a controller.
//!
//! Functions: `inverse_dynamics`, `gravity`, `coriolis`, `friction` (with constant offsets), `mass_matrix` (with the
//! inertia of drives) and `forward_dynamics`, so that `inverse_dynamics = mass_matrix · ddq + coriolis + gravity +
//! friction`. Load-dependent friction is in a separate function `load_friction`, friction with hysteresis in a
//! function `step` with state ([`RobotModel::with_state_terms`]).

#![forbid(unsafe_code)]

mod declared_torque;
mod descriptions;
mod drive_torque;
mod equation;
mod equations;
mod error;
mod exported;
mod forward;
mod from_file;
mod graph;
mod isaac_lab;
mod languages;
mod model_file;
mod nearest_friction;
mod payload;
mod recorded_velocity;
mod regressor;
mod robot_model;
mod ros2_parameters;
mod rotation;
mod sdf;
mod simulator;
mod statements;
mod symbol;
mod target;

pub use descriptions::{notes_on_omitted, terms_left_out};
pub use drive_torque::own_friction;
pub use error::ExportError;
pub use exported::Exported;
pub use isaac_lab::{Actuator, isaac_lab};
pub use model_file::{
    MODEL_SCHEMA, ModelBody, ModelConstant, ModelFile, ModelJoint, ModelLimits, ModelLink, ModelPlacement, ModelTerm,
};
pub use nearest_friction::{ComparedOver, NearestFriction, TermSensitivity};
pub use payload::{ControllerBrand, PayloadBody, payload_command};
pub use recorded_velocity::RecordedVelocity;
pub use robot_model::RobotModel;
pub use simulator::{DriveKnowledge, FrictionError, SIMULATOR_SCHEMA, SimulatorFile, SimulatorJoint, SimulatorValue};
pub use target::{CodeOptions, Target, export, export_with};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
