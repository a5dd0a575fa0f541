//! Contents of a document that the model cannot represent.

use super::line;
use core::fmt;
use roxmltree::Node;

/// A part of an SDF that the model does not represent.
#[derive(Clone, Debug, PartialEq)]
pub struct SdfNotice {
    /// Line, from 1.
    pub line: u32,
    /// Kind of the part.
    pub loss: SdfLoss,
}

/// Kind of the part that is not represented.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum SdfLoss {
    /// The mass of a link is not stated.
    UnknownMass { link: String, why: &'static str },
    /// A link without gravity.
    Weightless { link: String },
    /// Added mass of a fluid around a link.
    AddedMass { link: String },
    /// A model in another file.
    Include { uri: String },
}

impl SdfLoss {
    /// Short name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::UnknownMass { .. } => "unknown-mass",
            Self::Weightless { .. } => "weightless",
            Self::AddedMass { .. } => "added-mass",
            Self::Include { .. } => "include",
        }
    }
}

impl fmt::Display for SdfLoss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownMass { link, why } => {
                write!(f, "the mass of link `{link}` {why}, so that it is unknown: give the link an <inertial>")
            }
            Self::Weightless { link } => {
                write!(f, "link `{link}` has no gravity, which is not supported: its full weight is used")
            }
            Self::AddedMass { link } => {
                write!(f, "link `{link}` has `fluid_added_mass`, which is not supported")
            }
            Self::Include { uri } => {
                write!(f, "the model at `{uri}` is not read: expand the file with `gz sdf -p`")
            }
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
