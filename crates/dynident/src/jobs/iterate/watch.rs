//! Progress callbacks, permissions and stop signal of an iteration.

use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_iteration::robot::SampleObserver;
use dynident_iteration::{BegunMotion, NextMotion, RobotRun, RunRecord, StopSignal, Supervisor};
use dynident_system::ProgramPermission;

/// Observes the motions of an iteration while they run, for example for a live page.
pub trait MotionObserver: SampleObserver {
    /// Called when a motion is commanded.
    fn begins(&self, begun: &BegunMotion<'_>);
    /// Called after each motion with its record.
    fn ended(&self, run: &RobotRun);
}

/// Callbacks and permissions of an iteration.
pub struct IterationWatch<'a> {
    /// Receives the progress of a trajectory search.
    pub design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    /// Receives every new run.
    pub run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    /// Requests a stop: the robot is stopped, recorded samples are kept, and no further run is commanded.
    pub stop: StopSignal,
    /// Called before each motion of an external robot; returns whether it may be commanded. `None` permits all motions.
    pub allow: Option<&'a mut dyn FnMut(&NextMotion) -> bool>,
    /// Whether the program of the study's robot may be started; by default not.
    pub programs: ProgramPermission<'a>,
    /// Observes the motions while they run; no observer by default.
    pub observer: Option<&'a dyn MotionObserver>,
}

impl<'a> IterationWatch<'a> {
    /// Creates a watch with callbacks only: no stop, all motions permitted, no program is started.
    pub fn new(
        design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
        run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    ) -> Self {
        let (stop, programs) = (StopSignal::default(), ProgramPermission::Refuse);
        Self { design, run, stop, allow: None, programs, observer: None }
    }
}

pub(super) struct StageSupervisor<'a, 'b> {
    pub(super) stop: &'a StopSignal,
    pub(super) allow: &'a mut Option<&'b mut dyn FnMut(&NextMotion) -> bool>,
    pub(super) made: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    pub(super) observer: Option<&'a dyn MotionObserver>,
}

impl Supervisor for StageSupervisor<'_, '_> {
    fn stop(&self) -> Option<&StopSignal> {
        Some(self.stop)
    }

    fn asks(&self) -> bool {
        self.allow.is_some()
    }

    fn allows(&mut self, motion: &NextMotion) -> bool {
        self.allow.as_mut().is_none_or(|allow| allow(motion))
    }

    fn observer(&self) -> Option<&dyn SampleObserver> {
        self.observer.map(|observer| observer as &dyn SampleObserver)
    }

    fn begins(&mut self, begun: &BegunMotion<'_>) {
        self.observer.inspect(|observer| observer.begins(begun));
    }

    fn ended(&mut self, run: &RobotRun) {
        self.observer.inspect(|observer| observer.ended(run));
    }

    fn made(&mut self, record: &RunRecord, runs: &[RobotRun]) {
        (self.made)(record, runs);
    }
}
