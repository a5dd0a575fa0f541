//! Mistake: a Denavit-Hartenberg table with the wrong convention.

use super::kind::{Breadth, Facts, MistakeKind, Setup};
use dynident_dynamics::ParametricModel;
use dynident_model::DhConvention;

/// The robot description is a Denavit-Hartenberg table that states the wrong convention.
#[derive(Clone, Debug, PartialEq)]
pub struct Convention {
    /// The correct convention.
    pub convention: DhConvention,
}

impl MistakeKind for Convention {
    fn candidates(setup: Setup<'_>, breadth: Breadth<'_>) -> Vec<Self> {
        let Breadth::Usual = breadth else { return Vec::new() };
        setup.model().other_convention().map(|(convention, _)| Self { convention }).into_iter().collect()
    }

    /// The robot with the other convention. The table describes each body in its own frame, so the nominal values of
    /// the corrected model are used.
    fn corrected_robot(&self, robot: &ParametricModel) -> Option<ParametricModel> {
        let (_, meant) = robot.model().other_convention().filter(|(other, _)| *other == self.convention)?;
        ParametricModel::new(meant.clone(), robot.terms().to_vec()).ok()
    }

    fn facts(&self) -> Facts {
        Facts { is_of_all_logs: true, ..Facts::of("description") }
    }

    fn sentence(&self, _: &[String]) -> String {
        format!(
            "the Denavit-Hartenberg table is in the other convention: write `convention = \"{}\"` in its file",
            self.convention.name()
        )
    }
}
