//! Decision whether the torque contains the inertia of the drives.
//!
//! The other decisions need it, so it is first made with friction as the study states it. Presliding friction, which
//! these terms lack, depends on the motion like a spring, and can hide drive inertia in slow motion with pauses.
//! Drive inertia that was not detected is therefore tested again, once, with the selected friction. If it is detected
//! then, friction is selected again.

use super::choices::{Drives, FrictionChoice};
use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::drive_inertia::{choose_drive_inertia, drives_with_friction};
use crate::error::IdentificationError;
use crate::training::TrainingPasses;

pub(super) struct DriveInertia;

impl Decision for DriveInertia {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        if work.choices.drives.is_none() {
            let robot = &work.task.robot;
            let (robot, choice) = if work.arm().is_some() {
                (robot.clone(), None)
            } else {
                let logs = work.logs_at(None)?;
                choose_drive_inertia(&logs, &work.settings, robot, work.training, &work.task.payloads)?
            };
            work.choices.drives = Some(Drives { robot, choice });
        }
        Ok(Next::Proceed)
    }
}

/// Decision whether the torque contains drive inertia that was not detected with the stated friction.
pub(super) struct DriveInertiaWithFriction;

impl Decision for DriveInertiaWithFriction {
    fn decide(&self, work: &mut Workspace<'_, '_>) -> Result<Next, IdentificationError> {
        let is_undetected = work.drives().choice.is_some_and(|choice| !choice.seen);
        let FrictionChoice::Made(friction) = &work.choices.friction else { return Ok(Next::Proceed) };
        if friction.joints.is_empty() || !is_undetected || work.choices.has_drives_with_friction {
            return Ok(Next::Proceed);
        }
        let with_friction = friction.model.clone();
        let (robot, training) = (work.drives().robot, work.training);
        let payloads = &work.task.payloads;
        let fit = work.fit()?;
        let passes = TrainingPasses::of_logs(&fit.logs, &fit.settings, training, payloads);
        let (robot, choice) = drives_with_friction(&passes, &robot, &with_friction)?;
        let is_seen = choice.as_ref().is_some_and(|choice| choice.seen);
        work.choices.drives = Some(Drives { robot, choice });
        work.choices.has_drives_with_friction = true;
        if is_seen {
            work.choices.reopen_friction();
            work.fit = None;
        }
        Ok(if is_seen { Next::StartAgain } else { Next::Proceed })
    }
}
