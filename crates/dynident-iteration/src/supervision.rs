//! Who watches over an iteration: asks for stops, allows motions, hears of runs.

use crate::record::RunRecord;
use crate::rehearsal::{Rehearsal, RehearsalSettings};
use crate::robot::{Envelope, RobotRun, StopSignal};
use dynident_simulation::{SimulationError, require};

/// What keeps runs safe, apart from the robot itself.
#[derive(Clone, Debug, Default)]
pub struct SafetySettings {
    /// Whether the robot is one outside. A run of it that was stopped early ends the iteration until somebody has
    /// looked and calls again, unless every run is allowed one by one anyhow. Default false.
    pub outside: bool,
    /// What no sample may leave. Default none.
    pub envelope: Option<Envelope>,
    /// How every motion is rehearsed before it is commanded. Default not at all.
    pub rehearsal: Option<RehearsalSettings>,
    /// Shares of its speed at which the motion is run before the first run, slowest first; those of 1 are the run
    /// itself. Default none. These runs are not identified.
    pub speed_steps: Vec<f64>,
}

impl SafetySettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Shares that are not within (0, 1]; [`RehearsalSettings::validate`].
    pub fn validate(&self) -> Result<(), SimulationError> {
        for &step in &self.speed_steps {
            require(step > 0.0 && step <= 1.0, "speed_steps", step, "give shares of the speed: above 0, at most 1")?;
        }
        self.rehearsal.as_ref().map_or(Ok(()), RehearsalSettings::validate)
    }
}

/// A motion that is about to be commanded.
#[derive(Clone, Debug)]
pub struct NextMotion {
    /// Number of the run, from 1.
    pub run: usize,
    /// Place of the trajectory among those of the run, from 0, and how many there are.
    pub leg: (usize, usize),
    /// The controller's name.
    pub controller: String,
    /// Whether it has a model.
    pub model_based: bool,
    /// Length, s.
    pub duration_s: f64,
    /// Share of the trajectory's own speed; 1 but for slow runs before the first.
    pub speed: f64,
    /// For each joint, by name, the largest velocity of the motion, rad/s (m/s).
    pub largest_speed: Vec<(String, f64)>,
    /// What its rehearsal has shown, if there was one.
    pub rehearsal: Option<Rehearsal>,
}

/// Who watches over an iteration.
pub trait Supervisor {
    /// Where stops are asked for.
    fn stop(&self) -> Option<&StopSignal> {
        None
    }

    /// Whether somebody is asked before every motion.
    fn asks(&self) -> bool {
        false
    }

    /// Whether the motion may be commanded. If not, the iteration waits for the next call.
    fn allows(&mut self, _motion: &NextMotion) -> bool {
        true
    }

    /// Hears of every new run.
    fn made(&mut self, _record: &RunRecord, _runs: &[RobotRun]) {}
}

/// Only hears of runs.
pub(crate) struct Watching<'a>(pub(crate) &'a mut dyn FnMut(&RunRecord, &[RobotRun]));

impl Supervisor for Watching<'_> {
    fn made(&mut self, record: &RunRecord, runs: &[RobotRun]) {
        (self.0)(record, runs);
    }
}
