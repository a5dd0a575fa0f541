//! Decision about friction terms with constants on a grid. This is sufficient to estimate a lag and takes a third of
//! the time.

use super::choices::FrictionChoice;
use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::chosen_friction::{ChosenFriction, GridTerms, friction_by_grid};
use crate::error::IdentificationError;
use crate::training::TrainingPasses;

pub(super) struct GridOfFriction(pub(super) GridTerms);

impl Decision for GridOfFriction {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        if matches!(work.choices.friction, FrictionChoice::Open) {
            let Self(terms) = *self;
            let robot = work.drives().robot;
            let logs = work.logs_at(work.choices.friction_cutoff_hz())?;
            let passes = TrainingPasses::of_logs(&logs, &work.settings, work.training, &work.task.payloads);
            work.choices.friction = match friction_by_grid(&passes, &robot, terms)? {
                Some(grid) => FrictionChoice::Grid(grid),
                None => FrictionChoice::Made(ChosenFriction::as_stated(robot.into())),
            };
        }
        Ok(Next::Proceed)
    }
}
