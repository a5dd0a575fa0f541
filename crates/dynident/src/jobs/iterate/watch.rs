//! Who hears of an iteration's progress, permits its motions and stops it.

use core::ops::ControlFlow;
use dynident_excitation::DesignProgress;
use dynident_iteration::{NextMotion, RobotRun, RunRecord, StopSignal, Supervisor};
use dynident_system::ProgramPermission;

/// Callbacks and permissions of an iteration.
pub struct IterationWatch<'a> {
    /// Hears of the search for the trajectory, if there is one.
    pub design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    /// Hears of every new run.
    pub run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    /// Requests a stop: the robot is stopped, the recorded samples are kept, and no further run is commanded.
    pub stop: StopSignal,
    /// Asked before each motion of an external robot whether it may be commanded. `None` permits all motions.
    pub allow: Option<&'a mut dyn FnMut(&NextMotion) -> bool>,
    /// Whether the program that a study names as its robot may be started. By default it may not.
    pub programs: ProgramPermission<'a>,
}

impl<'a> IterationWatch<'a> {
    /// Only hears: nobody stops the iteration, every motion may be commanded, and no program is started.
    pub fn new(
        design: &'a (dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
        run: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
    ) -> Self {
        Self { design, run, stop: StopSignal::default(), allow: None, programs: ProgramPermission::Refuse }
    }
}

/// Hears of the runs of a stage, and asks for permission.
pub(super) struct Watched<'a, 'b> {
    pub(super) stop: &'a StopSignal,
    pub(super) allow: &'a mut Option<&'b mut dyn FnMut(&NextMotion) -> bool>,
    pub(super) made: &'a mut dyn FnMut(&RunRecord, &[RobotRun]),
}

impl Supervisor for Watched<'_, '_> {
    fn stop(&self) -> Option<&StopSignal> {
        Some(self.stop)
    }

    fn asks(&self) -> bool {
        self.allow.is_some()
    }

    fn allows(&mut self, motion: &NextMotion) -> bool {
        self.allow.as_mut().is_none_or(|allow| allow(motion))
    }

    fn made(&mut self, record: &RunRecord, runs: &[RobotRun]) {
        (self.made)(record, runs);
    }
}
