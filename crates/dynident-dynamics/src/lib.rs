//! **What torque does a motion need?** Rigid-body algorithms, the torque regressor and base parameters.
//!
//! Free functions named after the quantity, over an immutable [`Model`](dynident_model::Model) and a per-thread [`Workspace`]:
//! [`inverse_dynamics()`], [`mass_matrix()`], [`forward_dynamics()`], [`torque_regressor`], … They allocate nothing once the workspace exists. Each
//! algorithm is written once over a small scalar trait and runs on one sample, on lanes of samples, and on dual numbers (the tests' oracle).

#![forbid(unsafe_code)]

mod base_parameters;
mod composite;
mod derivatives;
mod energy;
mod forward_dynamics;
mod gravity;
mod independent_columns;
mod inverse_dynamics;
mod kinematics;
mod law_history;
mod mass_matrix;
mod motion_equation;
mod parametric_model;
mod regressor;
mod regressor_adjoint;
mod regressor_panels;
mod states;
mod workspace;

pub use base_parameters::{
    BaseParameterSettings, BaseParameters, NumericalRank, numerical_rank, numerical_rank_by_body,
};
pub use derivatives::{InverseDynamicsDerivatives, inverse_dynamics_derivatives};
pub use energy::{kinetic_energy, potential_energy};
pub use forward_dynamics::forward_dynamics;
pub use gravity::gravity_torque;
pub use independent_columns::{IndependentColumns, independent_columns};
pub use inverse_dynamics::{inverse_dynamics, inverse_dynamics_batch};
pub use kinematics::body_placements;
pub use law_history::LawHistory;
pub use mass_matrix::mass_matrix;
pub use motion_equation::mass_matrix_and_bias;
pub use parametric_model::{ParametricModel, ParametricModelError};
pub use regressor::torque_regressor;
pub use regressor_adjoint::{MotionGradient, regressor_panels_pull_back};
pub use regressor_panels::{Column, PanelLayout, Panels, all_columns, regressor_panels, regressor_panels_following};
pub use workspace::{BatchWorkspace, Workspace};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
