//! Contents of a document that the model cannot represent.

use super::classes::Stated;
use super::expanded::{Expanded, Place};
use crate::audit::AuditLevel;
use thiserror::Error;

/// A part of an MJCF that the model does not represent.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfNotice {
    /// Included file; `None` for the main file.
    pub file: Option<String>,
    /// Line, from 1.
    pub line: u32,
    /// The part of the document that is not represented, and its consequence.
    pub loss: MjcfLoss,
}

/// Kind of the part that is not represented.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum MjcfLoss {
    /// MuJoCo computes the mass from the geoms of the body, and Dynident cannot compute it here. Only jobs that need
    /// nominal masses (`design` with torque limits, `simulate`, `iterate`) need the `<inertial>`.
    #[error("the mass of body `{body}` {why}: it is unknown; give the body an <inertial>")]
    UnknownMass { body: String, why: String },
    /// A body that moves freely and has no drive is not part of the robot. No action is needed.
    #[error("body `{body}` has a free joint and no actuated joint: it is an object of the scene and is left out")]
    FreeObject { body: String },
    /// The base of the robot can move, such as that of a humanoid. Dynident identifies only with a base at rest; use
    /// such logs.
    #[error(
        "body `{body}` has a free joint: the robot has no fixed base, but is read as fixed to the world at `{body}` in its drawn pose; \
         use only logs in which this body stands still and level as drawn"
    )]
    FloatingBase { body: String },
    /// Dynident models springs as linear. The nonlinear part of the torque stays unexplained; declare it by a
    /// `[[torque]]` if it is large.
    #[error("joint {joint} has a nonlinear spring (`stiffness`): only its linear coefficient is used")]
    SpringPolynomial { joint: String },
    /// Dynident reads viscous damping only. The fit estimates friction from the logs, so usually no action is needed.
    #[error("the damping of joint {joint} is a polynomial: only its linear coefficient is used")]
    DampingPolynomial { joint: String },
    /// Dynident reads one effort limit for both directions. State a limit for `design` under `[design.limits]`.
    #[error("joint {joint} has the effort limits {low:?} and {high:?}: an asymmetric limit is ignored")]
    OneSidedEffort { joint: String, low: f64, high: f64 },
    /// MuJoCo removes a part of the weight of this body; a real robot does not. If the robot has a balancer, declare
    /// its torque by a `[[torque]]`.
    #[error("body `{body}` has `gravcomp`, which is not supported: its full weight is used")]
    GravityCompensation { body: String },
    /// Dynident reads trees. The forces of this connection are ignored, so torques of the connected joints may be
    /// wrong. Delete the connection if the real robot does not have it.
    #[error(
        "<{element}> under <equality> connects {between}, which is not supported: torques are those of the tree without it"
    )]
    Constraint { element: String, between: String },
    /// The robot has a closed chain that Dynident cannot use, for the reason in parentheses. Only parallelograms are
    /// supported; their torques are correct, those of other chains may be wrong.
    #[error(
        "<connect> under <equality> closes a chain at {between}, which is not supported ({why}): torques are those of the tree without it"
    )]
    Chain { between: String, why: String },
    /// Dynident supports linear couplings of joints only. The log must therefore contain the position of this joint.
    #[error("joint `{joint}` follows another by a polynomial, which is not supported: it is treated as independent")]
    CouplingPolynomial { joint: String },
    /// The torques of this tendon are missing in the model. Declare them by a `[[torque]]` if the real robot has them.
    #[error("tendon {tendon} has a spring, damping, friction or inertia, which is not supported")]
    Tendon { tendon: String },
    /// Forces of air or water are missing in the model. In air they are negligible for robot arms.
    #[error("<option> has a medium (`density`, `viscosity`), whose forces are not supported")]
    Medium,
    /// Dynident does not know this element or attribute, and MuJoCo probably does not either. Correct its spelling or
    /// its place.
    #[error("{}<{element}> was not read: misspelt?", attribute.as_ref().map_or(String::new(), |name| format!("`{name}` of ")))]
    Unread {
        element: String,
        /// The attribute; `None` for the element itself.
        attribute: Option<String>,
    },
}

impl MjcfLoss {
    /// Severity: information if the torques of the robot do not depend on the part.
    pub fn level(&self) -> AuditLevel {
        if matches!(self, Self::FreeObject { .. }) { AuditLevel::Info } else { AuditLevel::Warning }
    }

    /// Short name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::UnknownMass { .. } => "unknown-mass",
            Self::FreeObject { .. } => "free-object",
            Self::FloatingBase { .. } => "floating-base",
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

#[derive(Default)]
pub(super) struct Notices {
    pub(super) list: Vec<MjcfNotice>,
}

impl Notices {
    const MAX_NOTICES: usize = 200;

    pub(super) fn note(&mut self, stated: &Stated<'_>, loss: MjcfLoss) {
        self.note_at(stated.document, stated.place, loss);
    }

    pub(super) fn note_at(&mut self, document: &Expanded, place: Place, loss: MjcfLoss) {
        if self.list.len() < Self::MAX_NOTICES {
            let (file, line) = document.line(place);
            self.list.push(MjcfNotice { file, line, loss });
        }
    }
}
