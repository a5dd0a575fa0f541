//! **Rigid-body dynamics**: inverse and forward dynamics, torque regressor and base parameters.
//!
//! The interface consists of free functions named after the quantity that they compute. They use an immutable
//! [`Model`](dynident_model::Model) and a [`Workspace`] per thread, and do not allocate once the workspace exists.
//! Each algorithm is written once over a scalar trait. It runs on one sample, on several samples in SIMD lanes, and
//! on dual numbers (the oracle of the tests).
//!
//! | quantity | function | algorithm |
//! | --- | --- | --- |
//! | joint torques of a motion | [`inverse_dynamics()`]; several samples: [`inverse_dynamics_batch`] | recursive Newton-Euler (RNEA) |
//! | accelerations under torques | [`forward_dynamics()`] | articulated bodies (ABA) |
//! | mass matrix | [`mass_matrix()`]; with bias torque: [`mass_matrix_and_bias`]; several samples: [`mass_matrices`] | composite bodies (CRBA) |
//! | Coriolis matrix, `Ṁ = C + Cᵀ` | [`coriolis_matrix`] | analytic, in one frame |
//! | torque of gravity, its derivative, energies | [`gravity_torque`], [`gravity_torque_derivative`], [`kinetic_energy`], [`potential_energy`] | |
//! | torques and mass matrix over a custom scalar | [`inverse_dynamics_over`], [`mass_matrix_over`] | the same |
//! | derivatives of the torque by q, q̇, q̈ | [`inverse_dynamics_derivatives`]; several samples: [`inverse_dynamics_derivative_matrices`] | analytic, in one frame |
//! | derivatives of the acceleration by q, q̇, τ | [`forward_dynamics_derivatives`] | from the derivatives of the torque, with `M = LᵀL` along the tree |
//! | poses of the bodies, Jacobian of a point | [`body_placements`], [`point_jacobian`] | forward kinematics |
//! | torque regressor, all ten parameters of each body | [`torque_regressor`] | linear in the parameters |
//! | regressor of selected columns, several samples | [`regressor_panels()`] with a [`PanelLayout`]; derivatives: [`regressor_panels_adjoint`] | |
//! | base parameters | [`BaseParameters`]; cross-check: [`numerical_rank`] | from the robot's structure |
//! | **complete model for identification** | [`ParametricModel`] | robot, torque terms, base parameters, layout, nominal values |
//!
//! ```
//! use dynident_dynamics::{Workspace, forward_dynamics, inverse_dynamics, mass_matrix};
//! # let text = r#"<robot name="arm"><link name="base"/>
//! #   <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
//! #     <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
//! #   <link name="fore"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
//! #     <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
//! #   <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
//! #   <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
//! #     <origin xyz="0 0 0.4"/></joint></robot>"#;
//! let arm = dynident_model::read_urdf(text)?.model;
//! let mut workspace = Workspace::new(&arm);
//! let (q, dq, ddq) = ([0.3, -0.8], [0.5, 1.0], [2.0, -1.0]);
//!
//! let tau = inverse_dynamics(&arm, &mut workspace, &q, &dq, &ddq).to_vec();
//! let again = forward_dynamics(&arm, &mut workspace, &q, &dq, &tau);
//! assert!(again.iter().zip(ddq).all(|(found, ddq)| (found - ddq).abs() < 1e-12));
//!
//! let inertia = mass_matrix(&arm, &mut workspace, &q);
//! assert!(inertia[0] > inertia[3] && inertia[1] == inertia[2]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod base_parameters;
mod body_frames;
mod columns;
mod composite;
mod composite_moments;
mod coriolis;
mod derivatives;
mod energy;
mod forward_dynamics;
mod forward_dynamics_derivatives;
mod gravity;
mod ground;
mod hinge;
mod independent_columns;
mod inverse_dynamics;
mod joint_matrices;
mod kinematics;
mod mass_matrix;
mod motion_equation;
mod over_scalar;
mod own_turn;
mod parametric_model;
mod regressor;
mod regressor_adjoint;
mod regressor_panels;
mod same_tree;
mod sample_lanes;
mod states;
mod term_history;
mod tree_scratch;
mod varied_body;
mod workspace;

pub use base_parameters::{
    BaseParameterSettings, BaseParameters, Determination, NumericalRank, numerical_rank, numerical_rank_by_body,
};
pub use coriolis::coriolis_matrix;
pub use derivatives::{InverseDynamicsDerivatives, inverse_dynamics_derivative_matrices, inverse_dynamics_derivatives};
pub use energy::{kinetic_energy, potential_energy};
pub use forward_dynamics::forward_dynamics;
pub use forward_dynamics_derivatives::{ForwardDynamicsDerivatives, forward_dynamics_derivatives};
pub use gravity::{gravity_torque, gravity_torque_derivative};
pub use independent_columns::{IndependentColumns, independent_columns};
pub use inverse_dynamics::{inverse_dynamics, inverse_dynamics_batch};
pub use joint_matrices::JointMatrices;
pub use kinematics::{PointJacobian, body_placements, point_jacobian};
pub use mass_matrix::{mass_matrices, mass_matrix};
pub use motion_equation::mass_matrix_and_bias;
pub use over_scalar::{inverse_dynamics_over, mass_matrix_over};
pub use parametric_model::{ParametricModel, ParametricModelError};
pub use regressor::torque_regressor;
pub use regressor_adjoint::{MotionGradient, regressor_panels_adjoint};
pub use regressor_panels::{
    Column, PanelLayout, Panels, all_columns, regressor_panels, regressor_panels_following, regressor_panels_of_sample,
    term_panels_following,
};
pub use term_history::TermHistory;
pub use workspace::{BatchWorkspace, Workspace};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
