//! Tests whether torque is measured at the motors (with rotor inertia) or at joint sensors.

use super::NewStudy;
use super::draft::{Draft, Table};
use crate::error::Error;
use crate::jobs::identify::identify;
use crate::jobs::options::RunOptions;
use core::fmt::Write;

/// Result of the test for drive inertia: the table `[drive]` if the logs show drive inertia, for commands without
/// logs; otherwise a comment with the estimates.
pub(super) enum DriveInertiaFinding {
    /// Table for the study.
    Present(Table),
    /// Comment for the study; empty if no drive inertia is identifiable.
    Absent(String),
}

/// Runs [`identify()`] with simple friction, because the selection of friction takes longer and does not change the
/// result of this test.
///
/// # Errors
/// Those of [`identify()`].
pub(super) fn drive_inertia(
    request: &NewStudy,
    draft: &Draft,
    options: &RunOptions<'_>,
) -> Result<DriveInertiaFinding, Error> {
    let trial = Table::new("[drive]", "").with("friction", "\"stated\"", "");
    let study = request.study(&draft.with(trial))?;
    let found = identify(&study, &request.out, options)?.result.drive_inertia_choice;
    let Some(choice) = found.filter(|choice| !choice.drives.is_empty()) else {
        return Ok(DriveInertiaFinding::Absent(String::new()));
    };
    let mut figures = String::new();
    for drive in &choice.drives {
        let _ = write!(figures, "{} {:.3} ± {:.3}, ", drive.joint, drive.inertia, drive.half_width_95);
    }
    let figures = figures.trim_end_matches([',', ' ']);
    if !choice.seen {
        return Ok(DriveInertiaFinding::Absent(format!(
            "Drive inertia was tested and is not significant (kg m², 95 %): {figures}"
        )));
    }
    let reason =
        format!("The torque is measured at the motors and includes rotor and gear inertia (kg m², 95 %): {figures}");
    Ok(DriveInertiaFinding::Present(Table::new("[drive]", "").with("drive_inertia", "true", reason)))
}
