//! **What is this machine?** Spatial algebra, joints, the link tree, the ten inertial parameters of a body, the laws of friction,
//! drives and couplings; readers and writers of robot descriptions; the audit of a model's physics.
//!
//! One convention everywhere: inertial parameters in the order [`INERTIAL_NAMES`], inertia about the body frame's origin; SI units and
//! radians; joints by name.

#![forbid(unsafe_code)]

pub mod audit;
pub mod dh;
mod error;
mod inertial;
mod joint;
pub mod laws;
mod place;
mod read;
pub mod sample;
mod spatial;
mod tree;
pub mod urdf;

pub use audit::{AuditFinding, AuditLevel, audit};
pub use dh::{DhError, DhFault, read_dh};
pub use error::ModelError;
pub use inertial::{INERTIAL_NAMES, InertialParameters};
pub use joint::{Joint, JointKind, JointLimits, JointMap, Mimic};
pub use place::{Located, line_and_column};
pub use read::{DescriptionFormat, MAX_DESCRIPTION_BYTES, ReadError, Robot, load_robot};
pub use spatial::{Mat3, Transform, Vec3};
pub use tree::{Body, Link, Model, STANDARD_GRAVITY};
pub use urdf::{
    JointChange, LinkChange, UnreadElement, UrdfError, UrdfFault, UrdfRobot, UrdfWriteError, link_changes, read_urdf,
    rewrite_urdf,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
