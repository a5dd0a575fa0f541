//! Decision about friction terms, their constants, and the cut-off for a fit with these terms.

use super::choices::FrictionChoice;
use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::bandwidth::choose_cutoff;
use crate::bars::ErrorSource;
use crate::chosen_friction::{constants_of_all_rows, friction_of_logs, is_friction_open, stated_friction};
use crate::error::IdentificationError;
use crate::training::TrainingPasses;
use nalgebra::DMatrix;

pub(super) struct Friction;

impl Decision for Friction {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        let robot = work.drives().robot;
        let of_excerpt = match &work.choices.friction {
            FrictionChoice::Grid(_) | FrictionChoice::Made(_) => return Ok(Next::Proceed),
            FrictionChoice::OfExcerpt(friction) => Some(friction.clone()),
            FrictionChoice::Open => None,
        };
        let is_open = of_excerpt.is_none() && is_friction_open(&work.settings, &robot);
        let cutoff_hz = if is_open {
            work.choices.friction_cutoff_hz()
        } else {
            work.choices.cutoff().map(|choice| choice.cutoff_hz)
        };
        let grid = work.choices.grid.take();
        let logs = work.logs_at(cutoff_hz)?;
        let (settings, training) = (&work.settings, work.training);
        let passes = TrainingPasses::of_logs(&logs, settings, training, &work.task.payloads);
        let mut cutoff = None;
        let friction = match of_excerpt {
            None if !is_open => stated_friction(&passes, &robot)?,
            None => {
                // The width of the smoothed sign affects the torque mostly above the frequency band of the motion.
                let of_constants = logs.with_torque_beyond_motion(&robot.clone().into())?;
                let friction = friction_of_logs(&passes, &of_constants, &robot, grid)?;
                cutoff = choose_cutoff(&logs, settings, &friction.model, training)?;
                friction
            }
            Some(before) => {
                let of_constants = logs.with_torque_beyond_motion(&robot.clone().into())?;
                let passes = TrainingPasses { logs: &of_constants, ..passes };
                constants_of_all_rows(&passes, &robot, before)?
            }
        };
        if is_open {
            work.choices.friction_hz = cutoff_hz;
        }
        if cutoff.is_some() {
            work.choices.cutoff_with_friction = cutoff;
        }
        work.choices.friction = FrictionChoice::Made(friction);
        Ok(Next::Proceed)
    }

    fn error(&self, work: &Workspace<'_, '_>) -> Option<(ErrorSource, DMatrix<f64>)> {
        let FrictionChoice::Made(friction) = &work.choices.friction else { return None };
        let fit = work.fit.as_ref()?;
        let columns = fit.training.problem.columns();
        let covariance = friction.error_of_constants(columns, &fit.estimation.estimate)?;
        Some((ErrorSource::FrictionConstants, covariance))
    }
}
