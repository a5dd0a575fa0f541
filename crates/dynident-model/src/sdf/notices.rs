//! Contents of a document that the model cannot represent.

use super::line;
use crate::audit::AuditLevel;
use roxmltree::Node;
use thiserror::Error;

/// A part of an SDF that the model does not represent.
#[derive(Clone, Debug, PartialEq)]
pub struct SdfNotice {
    /// Line, from 1.
    pub line: u32,
    /// The part of the document that is not represented, and its consequence.
    pub loss: SdfLoss,
}

/// Kind of the part that is not represented.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum SdfLoss {
    /// Without a valid `<inertial>` the mass of the link is unknown. Only jobs that need nominal masses (`design` with
    /// torque limits, `simulate`, `iterate`) need it.
    #[error("the mass of link `{link}` {why}, so that it is unknown: give the link an <inertial>")]
    UnknownMass { link: String, why: &'static str },
    /// `<gravity>false</gravity>` removes the weight of the link in simulation. A real link has weight, so Dynident
    /// uses it.
    #[error("link `{link}` has no gravity, which is not supported: its full weight is used")]
    Weightless { link: String },
    /// The inertia of the water around the link is missing in the model. In air it is zero; no action is needed there.
    #[error("link `{link}` has `fluid_added_mass`, which is not supported")]
    AddedMass { link: String },
    /// The file refers to another model by `<include>`, which Dynident does not load. Links of that model are missing
    /// in the robot.
    #[error("the model at `{uri}` is not read: expand the file with `gz sdf -p`")]
    Include { uri: String },
    /// A model without moving joints next to the robot, such as a ground plane, is not part of the robot. If the robot
    /// is mounted on it, this has no effect on the torques. No action is needed.
    #[error("model `{model}` has no moving joint: it is an object of the scene and is left out")]
    Object { model: String },
}

impl SdfLoss {
    /// Severity: information if the torques of the robot do not depend on the part.
    pub fn level(&self) -> AuditLevel {
        if matches!(self, Self::Object { .. }) { AuditLevel::Info } else { AuditLevel::Warning }
    }

    /// Short name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::UnknownMass { .. } => "unknown-mass",
            Self::Weightless { .. } => "weightless",
            Self::AddedMass { .. } => "added-mass",
            Self::Include { .. } => "include",
            Self::Object { .. } => "object",
        }
    }
}

#[derive(Default)]
pub(super) struct Notices {
    pub(super) list: Vec<SdfNotice>,
}

impl Notices {
    const MAX_NOTICES: usize = 200;

    pub(super) fn note(&mut self, node: Node<'_, '_>, loss: SdfLoss) {
        if self.list.len() < Self::MAX_NOTICES {
            self.list.push(SdfNotice { line: line(node), loss });
        }
    }
}
