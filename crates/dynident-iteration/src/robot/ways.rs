use dynident_excitation::Motion;
use dynident_simulation::{Record, Reference, SimulationError, require, require_length};
use serde::{Deserialize, Serialize};

/// Largest distance between the end of a path and the motion, rad (m).
const JOIN_TOLERANCE: f64 = 1e-9;

/// Part of a run with approach and return paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum RunPart {
    /// Path from the home posture to the first posture of the motion.
    Approach,
    /// The motion.
    #[default]
    Motion,
    /// Path from the last posture of the motion to the home posture.
    Return,
}

impl RunPart {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "required by serde")]
    pub(crate) fn is_motion(&self) -> bool {
        *self == Self::Motion
    }

    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Motion => "motion",
            Self::Return => "return",
        }
    }
}

/// The approach and return paths of one run, each from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct ApproachPaths {
    /// Path from the home posture to the first posture of the motion.
    pub approach: Reference,
    /// Path from the last posture of the motion to the home posture.
    pub back: Reference,
}

impl ApproachPaths {
    /// Checks that the paths are compatible with a motion: same joints and sampling rate, and no discontinuity
    /// between the parts.
    ///
    /// # Errors
    /// Paths of another motion.
    pub fn validate(&self, motion: &Reference) -> Result<(), SimulationError> {
        for way in [&self.approach, &self.back] {
            require_length("joints of the path", motion.joints(), way.joints())?;
            require(
                way.rate_hz() == motion.rate_hz(),
                "rate_hz of the path",
                way.rate_hz(),
                "use the rate of the motion",
            )?;
        }
        let (first, last) = (0, motion.samples() - 1);
        for joint in 0..motion.joints() {
            let position = |of: &Reference, sample: usize| of.motion().q[joint * of.samples() + sample];
            let steps = [
                position(&self.approach, self.approach.samples() - 1) - position(motion, first),
                position(&self.back, 0) - position(motion, last),
            ];
            for step in steps {
                require(
                    step.abs() <= JOIN_TOLERANCE,
                    "step from the path to the motion",
                    step,
                    "use paths that end at the motion",
                )?;
            }
        }
        Ok(())
    }

    /// Returns the paths, executed at a share of their speed.
    ///
    /// # Errors
    /// Same as for [`Reference::slowed`].
    pub fn slowed(&self, speed: f64) -> Result<Self, SimulationError> {
        Ok(Self { approach: self.approach.slowed(speed)?, back: self.back.slowed(speed)? })
    }

    /// Returns approach, motion and return as one reference, for a controller that runs all of them without a pause.
    ///
    /// # Errors
    /// Same as for [`validate`](Self::validate).
    pub fn around(&self, motion: &Reference) -> Result<Reference, SimulationError> {
        self.validate(motion)?;
        let (before, after) = (self.approach.samples() - 1, self.back.samples() - 1);
        let samples = before + motion.samples() + after;
        let mut whole = Motion::default();
        whole.reset(motion.joints(), samples);
        whole.dddq.clear();
        // The samples that two parts share are taken from the motion.
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

/// Records of the paths of a run, with times since the beginning of each path; they are stored but not used for
/// identification.
#[derive(Clone, Debug, PartialEq)]
pub struct WayRecords {
    /// Record of the path from the home posture to the motion.
    pub approach: Record,
    /// Record of the path from the motion to the home posture.
    pub back: Record,
}

/// The samples of a record in a half-open time window, with times relative to `zero_s`.
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
        // Rounding can make the first time negative.
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

    /// Each shared sample appears once.
    #[test]
    fn three_parts_are_one() {
        let ways = ApproachPaths { approach: line(0.0, 1.0, 3), back: line(4.0, 0.0, 2) };
        let whole = ways.around(&line(1.0, 4.0, 4)).unwrap();
        assert_eq!(whole.samples(), 2 + 4 + 1);
        assert_eq!(whole.motion().q[..7], [0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 0.0]);
        assert_eq!(whole.motion().dq[..7], [1.0, 1.0, 3.0, 3.0, 3.0, 3.0, -4.0]);
        assert_eq!(whole.motion().q[7..], [0.0; 7]);
        // If the robot is already there, the path has one sample.
        let there = ApproachPaths { approach: line(1.0, 1.0, 1), back: line(4.0, 4.0, 1) };
        assert_eq!(there.around(&line(1.0, 4.0, 4)).unwrap().motion().q[..4], [1.0, 2.0, 3.0, 4.0]);
        // A step between the parts is an error.
        assert!(ways.around(&line(1.1, 4.0, 4)).is_err());
    }
}
