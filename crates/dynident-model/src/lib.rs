//! Robot models: spatial algebra, joints, the link tree, the ten inertial parameters of a body, torque terms of
//! friction, drives and couplings; readers and writers of robot descriptions; the audit of a model's physics.
//!
//! Conventions: inertial parameters are in the order [`INERTIAL_NAMES`], inertia is about the body frame's origin,
//! units are SI units and radians, and joints are identified by name.
//!
//! | task | use |
//! | --- | --- |
//! | read a robot from a file | [`load_robot`]: URDF, MJCF, SDF or Denavit-Hartenberg table |
//! | read a robot from a text | [`read_urdf`], [`read_mjcf`], [`read_sdf`], [`read_dh`] |
//! | build it in code | [`Model::new`] with [`Joint`]s and [`Body`]s |
//! | gravity, mounting, locked joints | [`Model::with_gravity`], [`Model::with_base_orientation`], [`Model::locked`] |
//! | masses, centres of mass, inertias | [`Model::inertials`], [`InertialParameters`] |
//! | replace the inertials | [`Model::with_inertials`] |
//! | friction, drive inertia, offsets of every joint | [`terms::terms_per_joint`]; single terms: [`terms::TorqueTerm`] |
//! | characteristic time and length of the robot | [`Model::characteristic_scale`] |
//! | check physical consistency | [`audit()`], [`InertialParameters::pseudo_inertia`] |
//! | write inertials into the user's robot description | [`link_changes`], [`rewrite_urdf`], [`rewrite_mjcf`], [`rewrite_sdf`], [`rewrite_dh`] |
//! | write any model as URDF | [`write_urdf`] |
//!
//! ```
//! use dynident_model::terms::{CoulombShape, DriveChoice, terms_per_joint};
//! use dynident_model::{AuditLevel, audit, read_urdf};
//!
//! let text = r#"
//! <robot name="pendulum">
//!   <link name="base"/>
//!   <link name="rod">
//!     <inertial>
//!       <origin xyz="0 0 -0.5"/> <mass value="2"/>
//!       <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/>
//!     </inertial>
//!   </link>
//!   <joint name="hinge" type="revolute">
//!     <parent link="base"/> <child link="rod"/> <axis xyz="0 1 0"/>
//!     <limit lower="-2" upper="2" velocity="3" effort="20"/>
//!   </joint>
//! </robot>"#;
//! let pendulum = read_urdf(text)?.model;
//! let rod = pendulum.inertials()[0];
//! assert_eq!((rod.mass_kg(), rod.first_moment().0[2]), (2.0, -1.0));
//! assert!(audit(&pendulum).iter().all(|finding| finding.level != AuditLevel::Problem));
//!
//! // Torque terms in addition to the rigid-body dynamics, one parameter each.
//! let coulomb = Some(CoulombShape::Smooth { width: 0.01 });
//! let terms = terms_per_joint(&pendulum, |_| DriveChoice { viscous: true, coulomb, ..DriveChoice::default() });
//! assert_eq!(terms.iter().map(|term| term.symbol()).collect::<Vec<_>>(), ["fv1", "fc1"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod audit;
mod characteristic_scale;
pub mod collision;
mod coupling;
pub mod dh;
mod dh_convention;
mod error;
mod inertial;
mod joint;
pub mod loops;
pub mod mjcf;
mod place;
mod read;
pub mod sample;
pub mod sdf;
mod spatial;
mod steps;
mod structure;
pub mod terms;
mod tree;
pub mod urdf;
mod xacro;
mod xml;

pub use audit::{
    AuditFinding, AuditLevel, AuditSettings, Correction, DescriptionError, SlipKind, SlipSettings, Slips, audit,
    audit_with, slips, slips_with,
};
pub use characteristic_scale::CharacteristicScale;
pub use coupling::JointCoupling;
pub use dh::{DhError, DhFault, DhWriteError, read_dh, rewrite_dh};
pub use dh_convention::DhConvention;
pub use error::ModelError;
pub use inertial::{INERTIAL_NAMES, InertialParameters};
pub use joint::{Joint, JointKind, JointLimits, JointMap, JointSpring, Mimic, MimicSource};
pub use loops::{LoopClosure, LoopError};
pub use mjcf::{
    MjcfError, MjcfFault, MjcfNotice, MjcfRobot, MjcfWriteError, read_mjcf, read_mjcf_in, read_mjcf_with, rewrite_mjcf,
};
pub use place::{Located, line_and_column};
pub use read::{
    DescriptionFormat, MAX_DESCRIPTION_BYTES, ReadError, Robot, has_xacro_macros, load_robot, load_robot_with,
    read_robot,
};
pub use sdf::{SdfError, SdfFault, SdfLoss, SdfNotice, SdfRobot, SdfWriteError, read_sdf, rewrite_sdf};
pub use spatial::{Mat3, Transform, Vec3};
pub use steps::{JointStep, ParentRelation, StepRotation};
pub use structure::Shift;
pub use tree::{Body, Link, Model, STANDARD_GRAVITY};
pub use urdf::{
    JointChange, LinkChange, StatedInertial, UnreadElement, UrdfError, UrdfFault, UrdfIrregularity, UrdfRobot,
    UrdfWriteError, link_changes, read_urdf, rewrite_inertials, rewrite_urdf, stated_inertials, write_urdf,
};
pub use xacro::required_xacro_arguments;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
