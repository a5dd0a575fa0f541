//! Whether the torque is that of motors, which turn with their rotors, or that of sensors behind them.

use super::NewStudy;
use super::draft::{Draft, Table};
use crate::error::Error;
use crate::jobs::identify::identify;
use crate::jobs::options::RunOptions;
use core::fmt::Write;

/// What the logs say of drive inertia: the table `[drive]` of the study where they show it, for commands that have no
/// logs to ask; else the figures that do not.
pub(super) enum DriveInertia {
    /// Written into the study.
    Seen(Table),
    /// Said in a comment; empty where no drive stands apart from the bodies.
    NotSeen(String),
}

/// What [`identify()`] finds of the drives, with the simple friction: the choice of friction would take longer, and
/// comes after.
///
/// # Errors
/// Those of [`identify()`].
pub(super) fn drive_inertia(
    request: &NewStudy,
    draft: &Draft,
    options: &RunOptions<'_>,
) -> Result<DriveInertia, Error> {
    let trial = Table::new("[drive]", "").with("friction", "\"stated\"", "");
    let study = request.study(&draft.with(trial))?;
    let found = identify(&study, &request.out, options)?.result.drive_inertia_choice;
    let Some(choice) = found.filter(|choice| !choice.drives.is_empty()) else {
        return Ok(DriveInertia::NotSeen(String::new()));
    };
    let mut figures = String::new();
    for drive in &choice.drives {
        let _ = write!(figures, "{} {:.3} ± {:.3}, ", drive.joint, drive.inertia, drive.half_width_95);
    }
    let figures = figures.trim_end_matches([',', ' ']);
    if !choice.seen {
        return Ok(DriveInertia::NotSeen(format!("Drive inertia was tried and is not seen (kg m², 95 %): {figures}")));
    }
    let reason = format!("The torque is the motors', whose rotors and gears turn too (kg m², 95 %): {figures}");
    Ok(DriveInertia::Seen(Table::new("[drive]", "").with("drive_inertia", "true", reason)))
}
