//! Warm-up: repeats the motion before a run, so that friction reaches its working temperature, and records the change.

use crate::setup::home::FoundPaths;
use crate::setup::leg::Leg;
use crate::setup::safety::SafetySettings;
use core::fmt::Write as _;
use dynident_simulation::{Record, Reference};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Result of a warm-up: repetitions (passes) of the run's motion, which are not used for a fit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WarmUp {
    /// Number of passes.
    pub passes: usize,
    /// Duration of all passes, including the paths from and to the home posture, s.
    pub duration_s: f64,
    /// Mean power loss of all joints in each pass, W: the integral `Σ ∫τ q̇ dt` divided by the time. For a motion
    /// that ends where it begins, this is the power of friction, for any bodies.
    pub lost_power_w: Vec<f64>,
    /// Mean torque in the direction of motion for each pass and joint, Nm (N): `∫τ q̇ dt / ∫|q̇| dt`. It includes the
    /// coupling between joints, which is the same in every pass, so its change is the change of friction. Zero for a
    /// joint at rest.
    pub friction_torque: Vec<Vec<f64>>,
}

impl WarmUp {
    /// Returns the increase of the power loss from the first to the last pass, in percent of the first; `None` for a
    /// single pass.
    pub fn change_percent(&self) -> Option<f64> {
        let [first, .., last] = self.lost_power_w[..] else { return None };
        (first != 0.0).then(|| 100.0 * (last - first) / first.abs())
    }

    /// Returns the increase of the power loss from the second-last to the last pass, percent.
    pub fn last_change_percent(&self) -> Option<f64> {
        let [.., before, last] = self.lost_power_w[..] else { return None };
        (before != 0.0).then(|| 100.0 * (last - before) / before.abs())
    }

    /// Returns the index of the joint whose mean friction torque changed most from the first to the last pass, and the
    /// change, Nm (N).
    pub fn largest_change(&self) -> Option<(usize, f64)> {
        let [first, .., last] = &self.friction_torque[..] else { return None };
        let changes = first.iter().zip(last).map(|(first, last)| last - first).enumerate();
        changes.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// Returns a summary, with the names of the joints.
    pub fn sentence(&self, joints: &[String]) -> String {
        let Self { passes, duration_s, lost_power_w, .. } = self;
        let times = if *passes == 1 { "once".to_owned() } else { format!("{passes} times") };
        let mut text = format!("warmed up with its motion {times}, {duration_s:.0} s");
        if let (Some(change), Some(last_change)) = (self.change_percent(), self.last_change_percent())
            && let [first, .., last] = lost_power_w[..]
        {
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                ": friction took {first:.3} W in the first pass and {last:.3} W in the last ({change:+.1} %; {last_change:+.1} % in the last pass)"
            );
        }
        if let Some((joint, change)) = self.largest_change() {
            let name = joints.get(joint).map_or_else(|| format!("joint {}", joint + 1), Clone::clone);
            let _ = write!(text, ", most at {name}: {change:+.3} Nm");
        }
        text
    }
}

/// Number of passes before the next run: zero if the robot has moved within the warm-up time, otherwise as many as
/// fill that time.
pub(crate) fn passes(
    safety: &SafetySettings,
    legs: &[Leg],
    ways: &[Option<FoundPaths>],
    last_motion: Option<Instant>,
) -> usize {
    let wanted_s = safety.warm_up_s;
    if wanted_s == 0.0 || last_motion.is_some_and(|last| last.elapsed().as_secs_f64() <= wanted_s) {
        return 0;
    }
    (wanted_s / pass_s(legs, ways).max(f64::MIN_POSITIVE)).ceil().max(1.0) as usize
}

fn pass_s(legs: &[Leg], ways: &[Option<FoundPaths>]) -> f64 {
    let motions: f64 = legs.iter().map(|leg| leg.reference().duration_s()).sum();
    let ways = ways.iter().flatten().map(|found| &found.ways);
    motions + ways.map(|ways| ways.approach.duration_s() + ways.back.duration_s()).sum::<f64>()
}

#[derive(Debug)]
pub(crate) struct WarmUpWatch {
    pass_s: f64,
    passes: Vec<Pass>,
}

#[derive(Debug)]
struct Pass {
    work: Vec<f64>,
    path: Vec<f64>,
    duration_s: f64,
}

impl WarmUpWatch {
    pub(crate) fn new(legs: &[Leg], ways: &[Option<FoundPaths>]) -> Self {
        Self { pass_s: pass_s(legs, ways), passes: Vec::new() }
    }

    /// Adds the record of one trajectory in a pass (counted from 1). A torque that is held from sample to sample does
    /// the work `τ Δq`, independent of the motion between samples. The path length is that of the reference, which
    /// has no noise.
    pub(crate) fn add(&mut self, pass: usize, reference: &Reference, record: &Record) {
        let joints = record.joints.len();
        while self.passes.len() < pass {
            self.passes.push(Pass { work: vec![0.0; joints], path: vec![0.0; joints], duration_s: 0.0 });
        }
        let Some(own) = self.passes.last_mut() else { return };
        let last = reference.samples() - 1;
        for sample in 0..record.samples.saturating_sub(1) {
            let step_s = record.times_s[sample + 1] - record.times_s[sample];
            let place = ((record.times_s[sample] * reference.rate_hz()).round().max(0.0) as usize).min(last);
            for joint in 0..joints {
                let dq = reference.motion().dq[joint * reference.samples() + place];
                let at = joint * record.samples + sample;
                own.work[joint] += record.tau[at] * (record.q[at + 1] - record.q[at]);
                own.path[joint] += dq.abs() * step_s;
            }
            own.duration_s += step_s;
        }
    }

    pub(crate) fn shown(&self) -> Option<WarmUp> {
        let torque = |pass: &Pass| -> Vec<f64> {
            pass.work.iter().zip(&pass.path).map(|(work, path)| if *path > 0.0 { work / path } else { 0.0 }).collect()
        };
        let power = |pass: &Pass| pass.work.iter().sum::<f64>() / pass.duration_s.max(f64::MIN_POSITIVE);
        (!self.passes.is_empty()).then(|| WarmUp {
            passes: self.passes.len(),
            duration_s: self.passes.len() as f64 * self.pass_s,
            lost_power_w: self.passes.iter().map(power).collect(),
            friction_torque: self.passes.iter().map(torque).collect(),
        })
    }
}
