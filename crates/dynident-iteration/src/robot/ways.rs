//! The ways of a run from the posture where the robot waits to the motion and back, and what was recorded along them.

use dynident_excitation::Motion;
use dynident_simulation::{Record, Reference, SimulationError, require, require_length};
use serde::{Deserialize, Serialize};

/// How exactly a way ends where the motion begins, rad (m): both come from the same numbers.
const JOINED: f64 = 1e-9;

/// A part of a run with ways.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum RunPart {
    /// From home to the motion's first posture.
    Approach,
    /// The motion itself.
    #[default]
    Motion,
    /// From the motion's last posture home.
    Return,
}

impl RunPart {
    /// All, in the order in which they are run.
    pub const ALL: [Self; 3] = [Self::Approach, Self::Motion, Self::Return];

    /// Whether it is the motion.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde wants")]
    pub(crate) fn is_motion(&self) -> bool {
        *self == Self::Motion
    }

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Motion => "motion",
            Self::Return => "return",
        }
    }
}

/// The ways of one run, each from rest to rest: from home to the first posture of the motion, and from its last home.
#[derive(Clone, Debug, PartialEq)]
pub struct Ways {
    /// From home to the motion.
    pub approach: Reference,
    /// From the motion home.
    pub back: Reference,
}

impl Ways {
    /// That they join a motion: same joints and rate, and no step where one ends and the next begins.
    ///
    /// # Errors
    /// Ways of another motion.
    pub fn validate(&self, motion: &Reference) -> Result<(), SimulationError> {
        for way in [&self.approach, &self.back] {
            require_length("joints of the way", motion.joints(), way.joints())?;
            require(way.rate_hz() == motion.rate_hz(), "rate_hz of the way", way.rate_hz(), "give the motion's rate")?;
        }
        let (first, last) = (0, motion.samples() - 1);
        for joint in 0..motion.joints() {
            let position = |of: &Reference, sample: usize| of.motion().q[joint * of.samples() + sample];
            let steps = [
                position(&self.approach, self.approach.samples() - 1) - position(motion, first),
                position(&self.back, 0) - position(motion, last),
            ];
            for step in steps {
                require(step.abs() <= JOINED, "step from the way to the motion", step, "give ways that end at it")?;
            }
        }
        Ok(())
    }

    /// The same at a share of their speed.
    ///
    /// # Errors
    /// As [`Reference::slowed`].
    pub fn slowed(&self, speed: f64) -> Result<Self, SimulationError> {
        Ok(Self { approach: self.approach.slowed(speed)?, back: self.back.slowed(speed)? })
    }

    /// Approach, motion and return as one: what is commanded where one controller runs through all of them.
    ///
    /// # Errors
    /// As [`validate`](Self::validate).
    pub fn around(&self, motion: &Reference) -> Result<Reference, SimulationError> {
        self.validate(motion)?;
        let (before, after) = (self.approach.samples() - 1, self.back.samples() - 1);
        let samples = before + motion.samples() + after;
        let mut whole = Motion::default();
        whole.reset(motion.joints(), samples);
        whole.dddq.clear();
        // The shared samples are the motion's own.
        for (from, to, of) in [
            (0..before, 0, &self.approach),
            (0..motion.samples(), before, motion),
            (1..after + 1, samples - after, &self.back),
        ] {
            let part = of.motion();
            let arrays = [(&part.q, &mut whole.q), (&part.dq, &mut whole.dq), (&part.ddq, &mut whole.ddq)];
            for (values, whole) in arrays {
                for joint in 0..part.joints {
                    let at = joint * samples + to;
                    whole[at..at + from.len()].copy_from_slice(&values[joint * part.samples..][from.start..from.end]);
                }
            }
        }
        Reference::new(motion.rate_hz(), whole)
    }
}

/// What was recorded along the ways of a run, times from the begin of each: it is kept, and not identified.
#[derive(Clone, Debug, PartialEq)]
pub struct WayRecords {
    /// From home to the motion.
    pub approach: Record,
    /// From the motion home.
    pub back: Record,
}

/// The samples of a record from a time to a time (that one is not included), with times from `zero_s` on.
pub(super) fn cut(record: &Record, window_s: [f64; 2], zero_s: f64) -> Record {
    let [from_s, to_s] = window_s;
    let kept: Vec<usize> =
        (0..record.samples).filter(|&sample| (from_s..to_s).contains(&record.times_s[sample])).collect();
    let some = |values: &[f64]| -> Vec<f64> {
        let joints = 0..record.joints.len();
        joints.flat_map(|joint| kept.iter().map(move |sample| values[joint * record.samples + sample])).collect()
    };
    Record {
        joints: record.joints.clone(),
        rate_hz: record.rate_hz,
        samples: kept.len(),
        // The first may come out as less than nothing by a rounding.
        times_s: kept.iter().map(|&sample| (record.times_s[sample] - zero_s).max(0.0)).collect(),
        q: some(&record.q),
        tau: some(&record.tau),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(from: f64, to: f64, samples: usize) -> Reference {
        let mut motion = Motion::default();
        motion.reset(2, samples);
        for sample in 0..samples {
            let share = sample as f64 / (samples - 1).max(1) as f64;
            motion.q[sample] = from + share * (to - from);
            motion.dq[sample] = to - from;
        }
        Reference::new(10.0, motion).unwrap()
    }

    /// Each shared sample stands there once.
    #[test]
    fn three_parts_are_one() {
        let ways = Ways { approach: line(0.0, 1.0, 3), back: line(4.0, 0.0, 2) };
        let whole = ways.around(&line(1.0, 4.0, 4)).unwrap();
        assert_eq!(whole.samples(), 2 + 4 + 1);
        assert_eq!(whole.motion().q[..7], [0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 0.0]);
        assert_eq!(whole.motion().dq[..7], [1.0, 1.0, 3.0, 3.0, 3.0, 3.0, -4.0]);
        assert_eq!(whole.motion().q[7..], [0.0; 7]);
        // From where the robot stands already there is nothing to run.
        let there = Ways { approach: line(1.0, 1.0, 1), back: line(4.0, 4.0, 1) };
        assert_eq!(there.around(&line(1.0, 4.0, 4)).unwrap().motion().q[..4], [1.0, 2.0, 3.0, 4.0]);
        // A step from one to the next is no way.
        assert!(ways.around(&line(1.1, 4.0, 4)).is_err());
    }
}
