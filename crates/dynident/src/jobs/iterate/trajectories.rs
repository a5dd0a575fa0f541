//! Trajectories of an iteration, stored between calls.

use super::inputs::Inputs;
use super::job::Job;
use super::legs;
use super::trajectory::Trajectory;
use super::watch::IterationWatch;
use crate::error::Error;
use crate::output::write_atomically;
use crate::result::read_result;
use dynident_iteration::other_settings;
use serde::{Deserialize, Serialize};
use std::path::Path;

#[derive(Serialize, Deserialize)]
pub(super) struct Trajectories {
    pub(super) trajectories: Vec<Trajectory>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) held_out: Option<Trajectory>,
}

impl Trajectories {
    pub(super) fn of_study(job: &Job<'_>, inputs: &Inputs, watch: &IterationWatch<'_>) -> Result<Self, Error> {
        let Inputs { section, simulation, robot, .. } = inputs;
        let Job { study, options, .. } = *job;
        let rate_hz = section.rate_hz.unwrap_or(simulation.rate_hz);
        let trajectories = legs::trajectories(study, robot, rate_hz, options, watch.design)?;
        // An interrupted search must not be stored, because later calls would use its trajectory.
        if watch.stop.is_requested() {
            return Err(Error::Interrupted { what: "the search for the trajectory" });
        }
        let held_out = match section.held_out_study(&study) {
            Some(other) => {
                let other = study.with_study(&other);
                Some(Trajectory::of_study(other, robot, rate_hz, options, watch.design)?)
            }
            None => None,
        };
        if watch.stop.is_requested() {
            return Err(Error::Interrupted { what: "the search for the held-out motion" });
        }
        Ok(Self { trajectories, held_out })
    }
}

/// Returns the trajectories of an earlier call, or new ones, which are stored before the first run.
pub(super) fn load_or_make(
    path: &Path,
    fingerprint: &str,
    resume: bool,
    make: impl FnOnce() -> Result<Trajectories, Error>,
) -> Result<Trajectories, Error> {
    #[derive(Serialize, Deserialize)]
    struct TrajectoryFile {
        fingerprint: String,
        #[serde(flatten)]
        all: Trajectories,
    }
    let wrong = |message: String| Error::Result { path: path.to_owned(), message };
    if resume && path.is_file() {
        let text = read_result(path)?;
        let kept: TrajectoryFile = serde_json::from_slice(&text)
            .map_err(|error| wrong(format!("invalid trajectory file ({error}): remove it")))?;
        if kept.fingerprint == fingerprint {
            return Ok(kept.all);
        }
        return Err(wrong(other_settings(&kept.fingerprint, fingerprint)));
    }
    let kept = TrajectoryFile { fingerprint: fingerprint.to_owned(), all: make()? };
    let bytes = dynident_text::json::to_string(&kept).map_err(|error| wrong(error.to_string()))?;
    write_atomically(path, bytes.as_bytes())?;
    Ok(kept.all)
}
