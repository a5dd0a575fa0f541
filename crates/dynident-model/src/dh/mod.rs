//! Denavit-Hartenberg tables in TOML, standard and modified.
//!
//! ```
//! let table = r#"
//! name = "two-link"
//! convention = "modified"            # or "standard"
//! gravity_m_s2 = [0.0, -9.81, 0.0]   # in the base frame; default [0, 0, -9.81]
//!
//! [base]                             # all optional
//! link = "base"                      # name of the fixed link
//! xyz_m = [0.0, 0.0, 0.0]            # origin of D-H frame 0 in the base frame
//! rpy_deg = [0.0, 0.0, 0.0]          # or rpy_rad; fixed axes, as in URDF
//!
//! [[joint]]
//! name = "shoulder"
//! link = "upper_arm"                 # default: name + "_link"
//! limits = { lower_deg = -170, upper_deg = 170, velocity_deg_s = 120, effort_nm = 80 }
//! dynamics = { damping = 0.5, friction = 1.2 }   # Nm s/rad and Nm (N s/m and N)
//! inertial = { mass_kg = 3.0, com_m = [0.2, 0, 0], inertia_at_com = [0.01, 0, 0, 0.04, 0, 0.04] }
//!
//! [[joint]]
//! name = "elbow"
//! parent = "upper_arm"               # default: the link of the joint before; for the first, the base
//! kind = "revolute"                  # default; or "continuous", "prismatic"
//! a_m = 0.4                          # a, alpha, d, theta: default 0
//! alpha_deg = 0                      # or alpha_rad
//! d_m = 0.0
//! theta_deg = 90                     # or theta_rad; of a revolute joint: its offset
//! sign = -1                          # default 1: positive q turns (slides) along +z
//! "#;
//! let model = dynident_model::read_dh(table)?;
//! assert_eq!(model.dof(), 2);
//! assert_eq!(model.joints()[1].placement.translation.0, [0.4, 0.0, 0.0]);
//! # Ok::<(), dynident_model::DhError>(())
//! ```
//!
//! With `s` = `sign` of a row and the joint position q, a revolute joint has `θ = theta + s q`, a prismatic joint `d
//! = d_m + s q`.
//!
//! | convention | frame i in frame i-1 | `a`, `alpha` of row i are |
//! | --- | --- | --- |
//! | `modified` (Craig 1986; Khalil and Kleinfinger 1986) | `Rx(α) Tx(a) Rz(θ) Tz(d)` | the values before joint i: `a_{i-1}`, `α_{i-1}` |
//! | `standard` (Denavit and Hartenberg 1955; Paul 1981) | `Rz(θ) Tz(d) Tx(a) Rx(α)` | the values after joint i: `a_i`, `α_i` |
//!
//! **Frames.** In the modified convention the model's body frame i is D-H frame i: its z axis is the joint's axis. In
//! the standard convention the axis of joint i is z of frame i-1. There the body frame is frame i-1 rotated by `Rz(θ)`
//! (or translated along z by `s q`), and D-H frame i in it is `Tz(d) Tx(a) Rx(α)`. Inertials in the table are always
//! given in D-H frame i; the reader transforms them into the body frame.
//!
//! **Inertials** are given in one of two forms. A body without an inertial has unknown mass; it is not massless:
//! - `mass_kg`, `com_m` and `inertia_at_com` (kg m², about the centre of mass) or `inertia_at_origin` (about the origin
//!   of D-H frame i), both as `[Ixx, Ixy, Ixz, Iyy, Iyz, Izz]`;
//! - `parameters`, all ten in the order [`INERTIAL_NAMES`](crate::INERTIAL_NAMES).

mod build;
mod table;
mod write;

pub use write::{DhWriteError, rewrite_dh};

use crate::error::ModelError;
use crate::place::Located;
use crate::tree::Model;
use thiserror::Error;

/// Why a D-H table could not be read, with line and column.
pub type DhError = Located<DhFault>;

/// A fault in a D-H table, with the fix.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum DhFault {
    /// The D-H table is not valid TOML, or a key is unknown or misspelt.
    #[error("{reason}; fix this entry of the D-H table")]
    Toml { reason: String },
    /// The value is infinite, NaN or at least 1e9. Check the number and its unit.
    #[error("`{key}` is {value:e}: write a finite number below 1e9")]
    Number { key: &'static str, value: f64 },
    /// One quantity is given in two units, for example in rad and in degrees.
    #[error("`{first}` and `{second}` are the same quantity: keep one")]
    BothUnits { first: &'static str, second: &'static str },
    /// Keys in rad, degrees and Nm belong to revolute joints, keys in m and N to prismatic joints. This key belongs to
    /// the other type.
    #[error("`{key}` does not fit a {kind} joint: use {fix}")]
    WrongUnit { key: &'static str, kind: &'static str, fix: &'static str },
    /// `sign` states whether the joint turns (or moves) along its D-H axis or against it.
    #[error("`sign` is {sign}: write 1 or -1")]
    Sign { sign: f64 },
    /// Names of joints and links must not be empty. The study and the logs refer to these names.
    #[error("a {what} has an empty name: give it one")]
    EmptyName { what: &'static str },
    /// Two joints or two links of the table have the same name.
    #[error("duplicate {what} `{name}`: rename one")]
    DuplicateName { what: &'static str, name: String },
    /// `parent` names a link that is not defined before this joint. It is misspelt, or the entries are in the wrong
    /// order.
    #[error("there is no link `{parent}` above this joint: order joints from base to tip; known here: {}", known.join(", "))]
    UnknownParent { parent: String, known: Vec<String> },
    /// The file has no `[[joint]]`. It may be another TOML file, such as a study.
    #[error("the table has no joint: add [[joint]] entries")]
    NoJoint,
    /// The table contains more joints than Dynident can identify at once.
    #[error("the table has more than {limit} joints: remove some")]
    TooManyJoints { limit: usize },
    /// The keys of a link's inertia are incomplete, or state it twice. Write one of the three forms in the message.
    #[error(
        "the inertial is incomplete or redundant: give mass_kg, com_m and one of inertia_at_com and inertia_at_origin; or parameters (ten numbers) alone; or no inertial, if it is unknown"
    )]
    Inertial,
    /// The table is valid, but its joints and links are not a valid robot model. The text has the cause.
    #[error("{0}; fix the table")]
    Model(#[from] ModelError),
}

/// Reads a D-H table (format: [module documentation](self)).
///
/// # Errors
/// The text is not TOML, contains unknown keys or invalid values, or does not describe a tree; with line and column.
pub fn read_dh(text: &str) -> Result<Model, DhError> {
    let (text, table) = parsed(text)?;
    build::model(text, &table)
}

/// The text without a byte order mark (positions start after it, as in editors), and its keys.
fn parsed(text: &str) -> Result<(&str, table::Table), DhError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let table = toml::from_str(text)
        .map_err(|error| toml_fault(text, error.span().map_or(0, |span| span.start), error.message()))?;
    Ok((text, table))
}

fn toml_fault(text: &str, at: usize, message: &str) -> DhError {
    let reason = message.lines().next().unwrap_or_default().to_owned();
    Located::at(text, at, DhFault::Toml { reason })
}
