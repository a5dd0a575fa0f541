//! Whether the torque is that of motors, which turn with their rotors, or that of sensors behind them.

use super::draft::{Draft, Table};
use crate::error::Error;
use crate::jobs::identify::identify;
use crate::jobs::options::RunOptions;
use crate::result::BaseParameterResult;
use crate::study::Study;
use core::fmt::Write;
use std::path::Path;

/// Standard deviations of [`together`] from which drive inertia counts as seen: by chance once in some 30,000 studies.
const SEEN: f64 = 4.0;

/// What the logs say of drive inertia: the table `[drive]` that a study should have where they show it, else the figures
/// that do not.
pub(super) enum DriveInertia {
    /// Written into the study.
    Seen(Table),
    /// Said in a comment; empty where no drive stands apart from the bodies.
    NotSeen(String),
}

/// Fits the study of `draft` with drive inertia of every joint and the simple friction (the choice of friction would
/// take longer, and drive inertia is told by accelerations).
///
/// # Errors
/// Those of [`identify`].
pub(super) fn drive_inertia(draft: &Draft, out: &Path, options: &RunOptions<'_>) -> Result<DriveInertia, Error> {
    let trial = Table::new("[drive]", "").with("drive_inertia", "true", "").with("friction", "\"stated\"", "");
    let study = Study::parse(&draft.with(trial).text(), out)?;
    let fitted = identify(&study, out, options)?.result.base_parameters;
    let drives: Vec<&BaseParameterResult> = fitted.iter().filter(|parameter| stands_apart(parameter)).collect();
    if drives.is_empty() {
        return Ok(DriveInertia::NotSeen(String::new()));
    }
    let mut figures = String::new();
    for drive in &drives {
        let _ = write!(figures, "{} {:.3} ± {:.3}, ", drive.symbol, drive.value, drive.half_width_95);
    }
    let figures = figures.trim_end_matches([',', ' ']);
    if together(&drives) < SEEN {
        return Ok(DriveInertia::NotSeen(format!("Drive inertia was tried and is not seen (kg m², 95 %): {figures}")));
    }
    let reason = format!("The torque is the motors', whose rotors and gears turn too (kg m², 95 %): {figures}");
    Ok(DriveInertia::Seen(Table::new("[drive]", "").with("drive_inertia", "true", reason)))
}

/// Whether a base parameter is a drive's own inertia: that of the first joints joins with their bodies'.
fn stands_apart(parameter: &BaseParameterResult) -> bool {
    parameter.symbol.starts_with("Ia") && parameter.std > 0.0
}

/// The sum of estimates over their standard deviations, over the root of their number (Stouffer): of standard normal
/// distribution where no drive has inertia. Rotors only add, so a negative one speaks against the others.
fn together(drives: &[&BaseParameterResult]) -> f64 {
    let sum: f64 = drives.iter().map(|drive| drive.value / drive.std).sum();
    sum / (drives.len() as f64).sqrt()
}
