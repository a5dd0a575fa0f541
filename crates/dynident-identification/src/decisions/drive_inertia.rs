//! Decision whether the torque contains the inertia of the drives.

use super::choices::Drives;
use super::decision::{Decision, Next};
use super::workspace::Workspace;
use crate::drive_inertia::choose_drive_inertia;
use crate::error::IdentificationError;

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
