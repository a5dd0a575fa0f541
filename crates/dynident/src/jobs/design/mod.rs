//! `design`: optimal excitation trajectory within all limits, with an independent check and a forecast.

mod check;
mod family;
mod forecast;
mod limit_check;
mod limits_in_force;
mod outcome;
mod prior;
mod search;
mod setup;
mod step_wise;
mod stopwatch;
mod table;

pub(super) use check::log_pieces;
pub use check::{check_log, check_trajectory};
pub(super) use family::{MotionFamily, motion_family};
pub(super) use limits_in_force::{limits_of, limits_of_commands};
pub use outcome::DesignOutcome;
pub(super) use table::trajectory as trajectory_table;

use crate::error::{Error, Expected};
use crate::jobs::options::RunOptions;
use crate::jobs::provenance::motion_provenance;
use crate::result::WindowedFile;
use crate::study::{CriterionChoice, DesignSection, Study, StudyFile};
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use dynident_excitation::check::CHECK_RATE_HZ;
use dynident_excitation::{DesignProgress, Motion, grid};
use limit_check::LimitCheck;
use outcome::{MotionOrigin, MotionReview};
use search::{changes, search};
use setup::DesignSetup;
use std::path::Path;
use step_wise::step_wise;

/// Designs the motion of a study's `[design]` (with defaults if this section is missing). `watch` receives the
/// progress and can stop the search. The best motion so far is then the result, with limits checked at a tenth of the
/// sampling rate.
///
/// The terms are those of `[drive]`, with a smoothed sign function for Coulomb friction. Limits are checked again at
/// 10 kHz. A motion that violates a limit is returned with `feasible` false and a diagnosis.
///
/// # Errors
/// If the study, the robot description, the settings of the family, the start, the prior, the task or the limits are
/// invalid, or torque is limited without a prior.
pub fn design_study(
    study: &Study,
    study_path: &Path,
    options: &RunOptions<'_>,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<DesignOutcome, Error> {
    let study = StudyFile::new(study, study_path);
    let mut setup = DesignSetup::for_search(study, options)?;
    let longest = Expected::Range(0.0, DesignSection::longest_s(setup.robot.model()));
    longest.check("duration_s", setup.section.duration_s).map_err(Error::section(study.path, "design"))?;
    // The search takes long, so files could change after they were read and hashed.
    let provenance = setup.inputs.while_unchanged(|| motion_provenance(study, options.data.as_deref(), &[]))?;
    let is_stopped = AtomicBool::new(false);
    let watch = |progress: &DesignProgress| {
        let answer = watch(progress);
        is_stopped.fetch_or(answer.is_break(), Ordering::Relaxed);
        answer
    };

    let found = match &setup.section.criterion {
        CriterionChoice::WindowedCondition(windowed) => {
            let found = step_wise(&setup.section, windowed, &setup.robot, &setup.limits, watch)
                .map_err(Error::section(study.path, "design"))?;
            setup.notes.push(WINDOWED_NOTE.to_owned());
            found
        }
        _ => search(&setup, study.path, watch)?,
    };

    // The limit check is independent of the search.
    let duration_s = found.family.duration_s();
    let check_rate_hz = setup.robot.model().characteristic_scale().round_hertz(CHECK_RATE_HZ);
    let motion_at = |times: &[f64], out: &mut Motion| found.family.motion(&found.parameters, times, out);
    let single = || match found.windowed {
        Some(_) => Ok(Vec::new()),
        None => changes(&setup, study.path, &found, watch),
    };
    let stop = || watch(&found.progress("check")).is_break();
    let mut check = LimitCheck::of(
        &setup,
        study.path,
        duration_s,
        check_rate_hz,
        "the motion itself",
        &motion_at,
        (&single, &stop),
    )?;
    check.diagnosis.extend(found.windowed.iter().flat_map(WindowedFile::sentences));
    let rate_hz = setup.section.search.rate_hz;
    let times = grid(duration_s, (duration_s * rate_hz).round() as usize + 1);
    let information = setup.information(&times, &motion_at);
    let review = MotionReview { duration_s, rate_hz, information, check };
    let origin = MotionOrigin::search(&setup, found);
    let mut outcome = DesignOutcome::new(setup, origin, review).with_provenance(provenance);
    outcome.file.stopped = is_stopped.into_inner();
    Ok(outcome)
}

const WINDOWED_NOTE: &str = "the search for strokes uses only the position, velocity and acceleration limits; limits of jerk, torque, power and workspace are checked afterwards on the whole motion";
