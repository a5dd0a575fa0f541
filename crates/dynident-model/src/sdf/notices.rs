//! What a document says and the model does not hold.

use super::line;
use core::fmt;
use roxmltree::Node;

/// Something in an SDF that the model does not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct SdfNotice {
    /// Line, from 1.
    pub line: u32,
    /// What is not held.
    pub loss: SdfLoss,
}

/// What is not held.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SdfLoss {
    /// The mass of a link is not stated.
    UnknownMass {
        /// The link.
        link: String,
        /// Why.
        why: &'static str,
    },
    /// A link on which gravity does not act.
    Weightless {
        /// The link.
        link: String,
    },
    /// The mass of a fluid around a link.
    AddedMass {
        /// The link.
        link: String,
    },
    /// A model in another file.
    Include {
        /// Where it is.
        uri: String,
    },
}

impl SdfLoss {
    /// A short name.
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
                write!(f, "the mass of link `{link}` {why}: it counts as unknown; give the link an <inertial>")
            }
            Self::Weightless { link } => {
                write!(f, "link `{link}` has no gravity, which the model does not hold: its weight counts in full")
            }
            Self::AddedMass { link } => {
                write!(f, "link `{link}` has `fluid_added_mass`, which the model does not hold")
            }
            Self::Include { uri } => {
                write!(f, "the model at `{uri}` is not read: write the whole out by `gz sdf -p`")
            }
        }
    }
}

/// The notices so far.
#[derive(Default)]
pub(super) struct Notices {
    pub(super) list: Vec<SdfNotice>,
}

impl Notices {
    /// Most that are kept.
    const MOST: usize = 200;

    pub(super) fn note(&mut self, node: Node<'_, '_>, loss: SdfLoss) {
        if self.list.len() < Self::MOST {
            self.list.push(SdfNotice { line: line(node), loss });
        }
    }
}
