//! **Excitation trajectories.** Computes the motion that determines the parameters of a robot best within all limits,
//! and predicts the error bars.
//!
//! | task | where |
//! | --- | --- |
//! | parametrise a motion | a [`Family`] of [`families`]: Fourier series, splines, multisines, logistic functions, .. |
//! | set the limits of the robot | [`limits::Limits`]: joints, boxes, floor, column, distances between the arm's own links |
//! | choose the optimality criterion | a [`Criterion`](criteria::Criterion) of [`criteria`]: D-, A-, E-optimal, prediction |
//! | find the best motion | [`design()`], or [`design_without_gradients()`] for comparison |
//! | check all limits independently | [`check::check_limits`], which shares no code with the search |
//! | find why no motion keeps the limits | [`limits::diagnose_until()`] |
//! | predict the error bars | [`Information`] of the motion, [`predicted_covariance()`] of every parameter |
//! | move one joint after another | [`step_wise`]: a short motion of each joint in its own time window |
//! | export the motion to a robot | [`export`]: CSV, ROS 2, URScript |
//!
//! A [`Motion`] consists of plain arrays: q, q̇, q̈ and jerk, joint after joint. All searches are deterministic for a
//! given seed, on any number of threads. To add a family, a criterion or a limit, implement its trait: [`design()`]
//! takes trait references.
//!
//! Example: design a motion, check its limits and predict the error bars.
//!
//! ```
//! use core::ops::ControlFlow;
//! use dynident_dynamics::ParametricModel;
//! use dynident_excitation::check::{CHECK_RATE_HZ, check_limits};
//! use dynident_excitation::criteria::DOptimal;
//! use dynident_excitation::families::{Fourier, FourierSettings};
//! use dynident_excitation::limits::{LimitSet, Limits};
//! use dynident_excitation::{DesignSettings, DesignTask, Family, design, predicted_covariance};
//!
//! // An arm with two horizontal axes, and limits in addition to those of its URDF.
//! let arm = dynident_model::read_urdf(
//!     r#"<robot name="arm">
//!       <link name="base"/>
//!       <link name="upper"/>
//!       <link name="fore"/>
//!       <joint name="shoulder" type="revolute">
//!         <parent link="base"/> <child link="upper"/> <axis xyz="0 1 0"/>
//!         <limit lower="-2" upper="2" velocity="2" effort="100"/>
//!       </joint>
//!       <joint name="elbow" type="revolute">
//!         <parent link="upper"/> <child link="fore"/> <axis xyz="0 1 0"/> <origin xyz="0 0 0.5"/>
//!         <limit lower="-2" upper="2" velocity="2" effort="50"/>
//!       </joint>
//!     </robot>"#,
//! )?;
//! let robot = ParametricModel::new(arm.model, Vec::new())?;
//! let mut limits = Limits::from_model(robot.model());
//! for joint in &mut limits.joints {
//!     joint.acceleration = Some(8.0);
//!     // Torque can be limited only where the inertials are known.
//!     joint.torque = None;
//! }
//!
//! // The most informative Fourier series of 6 s with rest at both ends.
//! let family = Fourier::new(2, 6.0, &FourierSettings { harmonics: 3, ..FourierSettings::default() })?;
//! let task = DesignTask {
//!     family: &family,
//!     criteria: &[&DOptimal],
//!     limits: &LimitSet::new(&limits, robot.model())?,
//!     layout: robot.layout(),
//!     torque_std_nm: &[0.5, 0.5],
//!     prior: None,
//! };
//! let settings = DesignSettings { starts: Some(2), rounds: Some(0), evaluations_per_start: Some(300), ..DesignSettings::default() };
//! let best = design(&task, &settings, |_| ControlFlow::Continue(()))?;
//!
//! // Every limit, 10,000 times a second.
//! let reports = check_limits(&limits, robot.model(), family.duration_s(), CHECK_RATE_HZ, |times, motion| {
//!     family.motion(&best.parameters, times, motion);
//! })?;
//! assert!(reports.iter().all(|report| !report.violated), "{reports:?}");
//!
//! // Predicted standard deviations of m r_x, m r_z and I_yy of both links, for white torque noise.
//! let predicted = predicted_covariance(&best.information, 1);
//! assert_eq!(predicted.std.len(), 6);
//! assert!(predicted.std.iter().all(|std| std.is_some_and(|std| std < 0.1)), "{predicted:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod check;
mod column_products;
pub mod criteria;
mod definite_inverse;
mod derivative_free;
mod design;
pub mod export;
pub mod families;
mod family;
mod information;
pub mod limits;
mod motion;
pub mod optimisers;
mod predicted_covariance;
pub mod step_wise;
mod symmetric_eigen;

pub use derivative_free::{DerivativeFree, design_without_gradients};
pub use design::{Design, DesignProgress, DesignSettings, DesignTask, design, grid, single_changes};
pub use family::Family;
pub use information::Information;
pub use motion::{Motion, MotionAdjoint};
pub use predicted_covariance::{Direction, PredictedCovariance, predicted_covariance};
