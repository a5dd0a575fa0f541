//! **What is this machine?** Spatial algebra, joints, the link tree, the ten inertial parameters of a body, the laws of friction,
//! drives and couplings; readers and writers of robot descriptions; the audit of a model's physics.
//!
//! One convention everywhere: inertial parameters in the order [`INERTIAL_NAMES`], inertia about the body frame's origin; SI units and
//! radians; joints by name.

#![forbid(unsafe_code)]

mod error;
mod inertial;
mod joint;
pub mod laws;
pub mod sample;
mod spatial;
mod tree;

pub use error::ModelError;
pub use inertial::{INERTIAL_NAMES, InertialParameters};
pub use joint::{Joint, JointKind, JointLimits, JointMap, Mimic};
pub use spatial::{Mat3, Transform, Vec3};
pub use tree::{Body, Link, Model, STANDARD_GRAVITY};
