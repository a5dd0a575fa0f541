//! Samples and expected torque of a motion, for an observer of the moving robot such as a live page.

use super::ways::RunPart;
use core::fmt::Debug;

/// A sample of a motion, passed on when it arrives. Joints are in the model's order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedSample<'a> {
    /// The part of the run to which the sample belongs.
    pub part: RunPart,
    /// Time since the start of this part, s.
    pub time_s: f64,
    /// Measured positions, rad (m).
    pub q: &'a [f64],
    /// Torque: measured, or commanded in the mode `step`; Nm (N).
    pub tau: &'a [f64],
}

/// Receives the samples of a motion while the robot moves. It is called by the thread that monitors the robot, so it
/// must return immediately.
pub trait SampleObserver: Debug + Sync {
    /// Called for every valid sample.
    fn sample(&self, sample: &ObservedSample<'_>);
}

/// Torque that a model predicts along a trajectory, with a 95 % band.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExpectedTorque {
    /// Times along the trajectory, s.
    pub times_s: Vec<f64>,
    /// Torque by joint and time, Nm (N).
    pub torque: Vec<Vec<f64>>,
    /// Half-width of the 95 % band by joint and time, from the covariance of the parameters and the residual; Nm (N).
    pub half_width_95: Vec<Vec<f64>>,
}
