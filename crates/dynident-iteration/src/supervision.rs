//! Who watches over an iteration: asks for stops, allows motions, hears of runs.

use crate::record::RunRecord;
use crate::rehearsal::Rehearsal;
use crate::robot::{RobotRun, RunPurpose, StopSignal};

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
    /// What it is made for.
    pub purpose: RunPurpose,
    /// For each joint, by name, the largest velocity of the motion, rad/s (m/s).
    pub largest_speed: Vec<(String, f64)>,
    /// What its rehearsal has shown, if there was one.
    pub rehearsal: Option<Rehearsal>,
    /// The ways to it and back, where the robot waits at a home.
    pub ways: Option<NextWays>,
}

/// The ways of a motion that is about to be commanded.
#[derive(Clone, Debug, PartialEq)]
pub struct NextWays {
    /// Length of the way to the motion, s.
    pub approach_s: f64,
    /// Length of the way back, s.
    pub return_s: f64,
    /// For each joint, by name, the largest velocity of both, rad/s (m/s).
    pub largest_speed: Vec<(String, f64)>,
    /// Postures in between that each goes over, since the straight one is not clear.
    pub over_postures: [usize; 2],
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
