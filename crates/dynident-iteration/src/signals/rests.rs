//! Samples at which a joint is at rest or near rest (zero velocity). Its static friction there does not follow from
//! its velocity.

use core::ops::Range;
use dynident_dynamics::ParametricModel;
use dynident_identification::friction::FrictionSearch;
use dynident_model::terms::TermAction;
use dynident_simulation::Reference;
use serde::{Deserialize, Serialize};

/// Share of a joint's highest velocity below which the joint is at rest.
pub(crate) const MOVING: f64 = 0.02;

/// Distance from rest above which the torque of a joint is used.
///
/// A joint with dry friction sticks, breaks loose and jumps, but its smoothed velocity does not. The resulting error
/// lasts as long as the smoothing window. Therefore samples are excluded at which the joint is slower than
/// `speed_share` of its highest velocity, and also `smoothing_periods` periods of the smoother's cut-off frequency
/// before and after them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StictionBand {
    /// Share of the joint's highest speed in the run.
    pub speed_share: f64,
    /// Number of periods of the smoother's cut-off frequency on either side.
    pub smoothing_periods: f64,
}

impl StictionBand {
    /// Only samples at rest: slower than 2 % of the highest velocity, plus half a smoothing period around rests that
    /// last longer than one period.
    pub const REST: Self = Self { speed_share: MOVING, smoothing_periods: 0.0 };

    /// Ranges of samples within this margin, for a joint with velocities `dq` and a smoother with a period of
    /// `smoothing` samples.
    pub(crate) fn samples(&self, dq: &[f64], smoothing: usize) -> Vec<Range<usize>> {
        if *self == Self::REST {
            return rests(dq, smoothing);
        }
        let wide = (self.smoothing_periods * smoothing as f64).round() as usize;
        let mut found: Vec<Range<usize>> = Vec::new();
        for slow in slower(dq, self.speed_share) {
            let (from, to) = (slow.start.saturating_sub(wide), (slow.end + wide).min(dq.len()));
            match found.last_mut() {
                Some(last) if last.end >= from => last.end = to,
                _ => found.push(from..to),
            }
        }
        found
    }
}

impl Default for StictionBand {
    fn default() -> Self {
        Self::REST
    }
}

/// Whether each joint has friction that is undetermined at rest, in the model or among the terms that can be
/// selected.
pub(crate) fn has_dry_friction(robot: &ParametricModel, friction: &[FrictionSearch]) -> Vec<bool> {
    let names = robot.joint_names();
    let in_model = |joint: usize| {
        let of_joint = robot.terms().iter().filter(|term| term.own_joint() == Some(joint));
        let mut actions = of_joint.map(|term| term.action());
        actions.any(|action| matches!(action, TermAction::Friction(_) | TermAction::Hysteresis))
    };
    let may_be_chosen = |name: &String| friction.iter().any(|search| search.joint == *name);
    names.iter().enumerate().map(|(joint, name)| in_model(joint) || may_be_chosen(name)).collect()
}

/// Ranges of samples at which a joint with velocities `dq` is at rest: slower than [`MOVING`] times its highest
/// velocity. Half of the smoothing window (`smoothing` samples) around longer rests is included. There the joint
/// breaks loose and stops suddenly, but the smoothed motion does not.
fn rests(dq: &[f64], smoothing: usize) -> Vec<Range<usize>> {
    let mut found = slower(dq, MOVING);
    for rest in &mut found {
        if rest.len() > smoothing {
            *rest = rest.start.saturating_sub(smoothing / 2)..(rest.end + smoothing / 2).min(dq.len());
        }
    }
    found
}

/// Ranges of samples at which `dq` is at most this share of its maximum, or changes its sign.
fn slower(dq: &[f64], share: f64) -> Vec<Range<usize>> {
    let fastest = dq.iter().fold(0.0_f64, |most, dq| most.max(dq.abs()));
    let is_rotary = |sample: usize| share > MOVING && dq.get(sample + 1).is_some_and(|next| next * dq[sample] < 0.0);
    let mut found: Vec<Range<usize>> = Vec::new();
    for (sample, _) in dq.iter().enumerate().filter(|(sample, dq)| dq.abs() <= share * fastest || is_rotary(*sample)) {
        match found.last_mut() {
            Some(last) if last.end == sample => last.end += 1,
            _ => found.push(sample..sample + 1),
        }
    }
    found
}

/// Highest speed of each joint along some references, rad/s (m/s).
pub(crate) fn highest_speeds<'a>(references: impl IntoIterator<Item = &'a Reference>) -> Vec<f64> {
    let mut fastest = Vec::new();
    for motion in references.into_iter().map(Reference::motion) {
        fastest.resize(motion.joints, 0.0);
        for (joint, fastest) in fastest.iter_mut().enumerate() {
            *fastest = motion.dq[motion.of(joint)].iter().fold(*fastest, |most: f64, dq| most.max(dq.abs()));
        }
    }
    fastest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversal_is_passed_and_a_rest_is_left_wide() {
        // Up, through zero, and at rest from sample 60.
        let dq: Vec<f64> = (0..100).map(|k| if k < 60 { 1.0 - f64::from(k) / 25.0 } else { 0.0 }).collect();
        let found = rests(&dq, 10);
        // |1 - k/25| ≤ 0.02 · 1.36 only at k = 25.
        assert_eq!(found, [25..26, 55..100]);
        assert_eq!(rests(&[0.0; 4], 10).len(), 1);
    }

    #[test]
    fn what_is_near_rest_is_left_as_wide_as_smoothing_reaches() {
        // From 1 to -1 rad/s in 100 steps: within 0.11 from sample 45 to 55, plus half a period of ten samples.
        let dq: Vec<f64> = (0..=100).map(|k| 1.0 - f64::from(k) / 50.0).collect();
        let margin = |speed_share, smoothing_periods| StictionBand { speed_share, smoothing_periods };
        let one = |run: Range<usize>| vec![run; 1];
        assert_eq!(margin(0.11, 0.5).samples(&dq, 10), one(40..61));
        assert_eq!(margin(0.11, 0.0).samples(&dq, 10), one(45..56));
        assert_eq!(StictionBand::REST.samples(&dq, 10), rests(&dq, 10));
        // A joint that turns between two samples is at rest in between, at any speed.
        let turned: Vec<f64> = (0..20).map(|k| if k < 10 { 1.0 } else { -1.0 }).collect();
        assert_eq!(margin(0.1, 0.5).samples(&turned, 4), one(7..12));
        // Overlapping ranges are merged.
        let two = [1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(margin(0.1, 1.0).samples(&two, 1), one(0..6));
    }
}
