//! Source of the joints' friction.

use super::candidates::FrictionSearch;
use super::joint_friction::JointFriction;

/// Source of the joints' friction.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum FrictionSource {
    /// The friction terms that the robot model states.
    #[default]
    Stated,
    /// The terms of the robot model, which were selected from other recordings. The error bars include the uncertainty
    /// of their constants according to the present recordings.
    SelectedBefore(Vec<JointFriction>),
    /// Selected from the training logs for these joints; other joints keep the terms of the robot model.
    Selected(Vec<FrictionSearch>),
}

impl FrictionSource {
    /// Settings of the selection for each joint; empty without a selection.
    pub fn searches(&self) -> &[FrictionSearch] {
        if let Self::Selected(searches) = self { searches } else { &[] }
    }

    /// Friction that was selected from other recordings; empty if there is none.
    pub fn before(&self) -> &[JointFriction] {
        if let Self::SelectedBefore(before) = self { before } else { &[] }
    }

    /// Whether the friction of any joint is selected from the training logs.
    pub fn is_selected(&self) -> bool {
        matches!(self, Self::Selected(_))
    }

    /// The same source, but the terms of the robot model replace a selection.
    #[must_use]
    pub fn without_selection(self) -> Self {
        if self.is_selected() { Self::Stated } else { self }
    }

    /// The same source after every search is changed.
    #[must_use]
    pub fn with_searches(self, change: impl FnMut(FrictionSearch) -> FrictionSearch) -> Self {
        match self {
            Self::Selected(searches) => Self::Selected(searches.into_iter().map(change).collect()),
            other => other,
        }
    }

    /// The same source with only the searches that `keep` accepts.
    #[must_use]
    pub fn retaining(self, keep: impl FnMut(&FrictionSearch) -> bool) -> Self {
        match self {
            Self::Selected(mut searches) => {
                searches.retain(keep);
                searches.into()
            }
            other => other,
        }
    }
}

/// Selects friction for these joints; without joints, the terms of the robot model are used.
impl From<Vec<FrictionSearch>> for FrictionSource {
    fn from(searches: Vec<FrictionSearch>) -> Self {
        if searches.is_empty() { Self::Stated } else { Self::Selected(searches) }
    }
}
