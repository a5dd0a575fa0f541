//! Contents of a document that the model cannot represent.

use super::classes::Stated;
use super::expanded::{Expanded, Place};
use core::fmt;

/// A part of an MJCF that the model does not represent.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfNotice {
    /// Included file; `None` for the main file.
    pub file: Option<String>,
    /// Line, from 1.
    pub line: u32,
    /// The part.
    pub loss: Loss,
}

/// Kind of the part that is not represented.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum Loss {
    /// The mass of a body is unknown, because one of its geoms is not a simple solid.
    UnknownMass { body: String, why: &'static str },
    /// A joint with a nonlinear spring, of which only the linear coefficient is used.
    SpringPolynomial { joint: String },
    /// Nonlinear damping.
    DampingPolynomial { joint: String },
    /// An asymmetric effort limit.
    OneSidedEffort {
        joint: String,
        /// Lowest, Nm or N.
        low: f64,
        /// Highest, Nm or N.
        high: f64,
    },
    /// A body with gravity compensation.
    GravityCompensation { body: String },
    /// A constraint between bodies or joints.
    Constraint { element: String, between: String },
    /// A closed chain that the model does not represent.
    Chain { between: String, why: String },
    /// A nonlinear coupling of two joints.
    CouplingPolynomial { joint: String },
    /// A tendon with a spring, damping, friction or inertia.
    Tendon { tendon: String },
    /// A fluid around the robot.
    Medium,
    /// An element or attribute that this reader does not know for joints, bodies and inertials.
    Unread {
        element: String,
        /// The attribute; `None` for the element itself.
        attribute: Option<String>,
    },
}

impl Loss {
    /// Short name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::UnknownMass { .. } => "unknown-mass",
            Self::SpringPolynomial { .. } => "spring-polynomial",
            Self::DampingPolynomial { .. } => "damping-polynomial",
            Self::OneSidedEffort { .. } => "one-sided-effort",
            Self::GravityCompensation { .. } => "gravity-compensation",
            Self::Constraint { .. } => "constraint",
            Self::Chain { .. } => "chain",
            Self::CouplingPolynomial { .. } => "coupling-polynomial",
            Self::Tendon { .. } => "tendon",
            Self::Medium => "medium",
            Self::Unread { .. } => "not-read",
        }
    }
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownMass { body, why } => {
                write!(
                    f,
                    "the mass of body `{body}` {why}, which is not supported, so that it is unknown: give the body an <inertial>"
                )
            }
            Self::SpringPolynomial { joint } => {
                write!(f, "joint {joint} has a nonlinear spring (`stiffness`): only its linear coefficient is used")
            }
            Self::DampingPolynomial { joint } => {
                write!(f, "the damping of joint {joint} is a polynomial: only its linear coefficient is used")
            }
            Self::OneSidedEffort { joint, low, high } => {
                write!(f, "joint {joint} has the effort limits {low:?} and {high:?}: an asymmetric limit is ignored")
            }
            Self::GravityCompensation { body } => {
                write!(f, "body `{body}` has `gravcomp`, which is not supported: its full weight is used")
            }
            Self::Constraint { element, between } => {
                write!(
                    f,
                    "<{element}> under <equality> connects {between}, which is not supported: torques are those of the tree without it"
                )
            }
            Self::Chain { between, why } => {
                write!(
                    f,
                    "<connect> under <equality> closes a chain at {between}, which is not supported ({why}): torques are those of the tree without it"
                )
            }
            Self::CouplingPolynomial { joint } => {
                write!(
                    f,
                    "joint `{joint}` follows another by a polynomial, which is not supported: it is treated as independent"
                )
            }
            Self::Tendon { tendon } => {
                write!(f, "tendon {tendon} has a spring, damping, friction or inertia, which is not supported")
            }
            Self::Medium => {
                write!(f, "<option> has a medium (`density`, `viscosity`), whose forces are not supported")
            }
            Self::Unread { element, attribute: None } => write!(f, "<{element}> was not read: misspelt?"),
            Self::Unread { element, attribute: Some(attribute) } => {
                write!(f, "`{attribute}` of <{element}> was not read: misspelt?")
            }
        }
    }
}

#[derive(Default)]
pub(super) struct Notices {
    pub(super) list: Vec<MjcfNotice>,
}

impl Notices {
    const MAX_NOTICES: usize = 200;

    pub(super) fn note(&mut self, stated: &Stated<'_>, loss: Loss) {
        self.note_at(stated.document, stated.place, loss);
    }

    pub(super) fn note_at(&mut self, document: &Expanded, place: Place, loss: Loss) {
        if self.list.len() < Self::MAX_NOTICES {
            let (file, line) = document.line(place);
            self.list.push(MjcfNotice { file, line, loss });
        }
    }
}
