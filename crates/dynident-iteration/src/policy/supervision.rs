use crate::policy::record::RunRecord;
use crate::robot::{ExpectedTorque, RobotRun, RunPurpose, SampleObserver, StopSignal};
use crate::setup::rehearsal::Rehearsal;
use dynident_simulation::Reference;

/// A motion that is about to be commanded.
#[derive(Clone, Debug)]
pub struct NextMotion {
    /// Number of the run, from 1.
    pub run: usize,
    /// Index of the trajectory in the run, from 0, and the number of trajectories.
    pub leg: (usize, usize),
    /// Name of the controller.
    pub controller: String,
    /// Whether the controller has a model.
    pub model_based: bool,
    /// Duration, s.
    pub duration_s: f64,
    /// Share of the trajectory's speed; below 1 only in slow runs before the first run.
    pub speed: f64,
    /// Purpose of the motion.
    pub purpose: RunPurpose,
    /// The largest velocity of each joint, with the joint's name, rad/s (m/s).
    pub largest_speed: Vec<(String, f64)>,
    /// Result of the rehearsal (simulation of the motion before it is commanded), if any.
    pub rehearsal: Option<Rehearsal>,
    /// The paths from and to the home posture, if there is one.
    pub ways: Option<NextWays>,
}

/// The paths from the home posture to a motion and back.
#[derive(Clone, Debug, PartialEq)]
pub struct NextWays {
    /// Duration of the approach, s.
    pub approach_s: f64,
    /// Duration of the return, s.
    pub return_s: f64,
    /// The largest velocity of each joint on both paths, with the joint's name, rad/s (m/s).
    pub largest_speed: Vec<(String, f64)>,
    /// Number of via postures of the approach and of the return; 0 for a direct path.
    pub over_postures: [usize; 2],
}

/// A motion that begins now, for an observer.
#[derive(Clone, Copy, Debug)]
pub struct BegunMotion<'a> {
    /// The motion.
    pub motion: &'a NextMotion,
    /// The trajectory, without the paths from and to the home posture.
    pub reference: &'a Reference,
    /// Torque that the newest estimate predicts along the trajectory; `None` without an estimate.
    pub expected: Option<&'a ExpectedTorque>,
}

/// Supervises an iteration.
pub trait Supervisor {
    /// The signal that stops the iteration.
    fn stop(&self) -> Option<&StopSignal> {
        None
    }

    /// Whether every motion needs the permission of a person.
    fn asks(&self) -> bool {
        false
    }

    /// Whether the motion may be commanded. If not, the iteration waits for the next call.
    fn allows(&mut self, _motion: &NextMotion) -> bool {
        true
    }

    /// Receives the samples of a motion while the robot moves; `None` if nobody observes.
    fn observer(&self) -> Option<&dyn SampleObserver> {
        None
    }

    /// Called before a motion is commanded, if there is an [`observer`](Self::observer).
    fn begins(&mut self, _motion: &BegunMotion<'_>) {}

    /// Called after each motion with its record, if there is an [`observer`](Self::observer).
    fn ended(&mut self, _run: &RobotRun) {}

    /// Called after every new run.
    fn made(&mut self, _record: &RunRecord, _runs: &[RobotRun]) {}
}

pub(crate) struct Watching<'a>(pub(crate) &'a mut dyn FnMut(&RunRecord, &[RobotRun]));

impl Supervisor for Watching<'_> {
    fn made(&mut self, record: &RunRecord, runs: &[RobotRun]) {
        (self.0)(record, runs);
    }
}
