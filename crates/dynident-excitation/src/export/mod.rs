//! **Export**: a sampled motion as tables and programs for robots, one format per file.

mod fitness_csv;
mod lerobot;
mod ros2;
mod trajectory_csv;
mod urscript;
mod waypoints;

pub use fitness_csv::fitness_csv;
pub use lerobot::{EpisodeFiles, LEROBOT_FILES, LeRobotEpisode, lerobot_episode};
pub use ros2::{ros2_commands, ros2_joint_trajectory};
pub use trajectory_csv::trajectory_csv;
pub use urscript::{UrScriptSettings, urscript};
pub use waypoints::waypoints_csv;

use crate::motion::Motion;
use thiserror::Error;

/// A motion at a list of times, with the names of its joints.
#[derive(Clone, Copy, Debug)]
pub struct Sampled<'a> {
    /// Names of the joints, in the order of the motion.
    pub joints: &'a [String],
    /// Times from the start, s, ascending.
    pub times_s: &'a [f64],
    /// The motion at these times.
    pub motion: &'a Motion,
}

/// Reason why a motion cannot be written in a format.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ExportError {
    /// A program passed joint names, times and motion of different lengths. Correct the call.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// The list.
        what: &'static str,
        /// Expected length.
        expected: usize,
        /// Given length.
        found: usize,
    },
    /// A position, velocity or acceleration of the motion is NaN or infinite. Correct the trajectory table, or design
    /// the motion again.
    #[error("the motion of joint `{joint}` is not finite at {at_s} s: export a finite motion")]
    NotFinite {
        /// Name of the joint.
        joint: String,
        /// Time, s.
        at_s: f64,
    },
    /// The format `URScript` is for arms with six joints. Choose another format, such as CSV.
    #[error(
        "URScript needs the six joints of a UR arm, but the robot has {joints}: lock the others, or choose another format"
    )]
    SixJoints {
        /// Number of joints of the robot.
        joints: usize,
    },
    /// This program was compiled without the writer of this format. Use the released program, or build with the feature
    /// that the message names.
    #[error("this build does not write {format}: build with the feature `{feature}` of dynident-excitation")]
    NotBuilt {
        /// The format.
        format: &'static str,
        /// The required feature.
        feature: &'static str,
    },
    /// The table of a data set cannot be encoded. The motion is not the cause; report the message and the study.
    #[error("the Parquet table cannot be written: {message}; this is a bug in Dynident: please report it")]
    Parquet {
        /// Message of the encoder.
        message: String,
    },
    /// A setting of the export is outside its range. Write a value within the range that the message names.
    #[error("{setting} = {value}: give {needed}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// Valid range.
        needed: &'static str,
    },
}

impl Sampled<'_> {
    fn check(&self) -> Result<(), ExportError> {
        let Motion { samples, joints, .. } = *self.motion;
        for (what, expected, found) in
            [("joint names", joints, self.joints.len()), ("times", samples, self.times_s.len())]
        {
            if expected != found {
                return Err(ExportError::Shape { what, expected, found });
            }
        }
        for (joint, name) in self.joints.iter().enumerate() {
            for (sample, &at_s) in self.times_s.iter().enumerate() {
                if !(at_s.is_finite() && self.at(joint, sample).iter().all(|x| x.is_finite())) {
                    return Err(ExportError::NotFinite { joint: name.clone(), at_s });
                }
            }
        }
        Ok(())
    }

    /// q, q̇, q̈ of one joint at one sample.
    fn at(&self, joint: usize, sample: usize) -> [f64; 3] {
        let index = joint * self.motion.samples + sample;
        [self.motion.q[index], self.motion.dq[index], self.motion.ddq[index]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::{Fourier, FourierSettings};
    use crate::{Family, grid};

    pub(super) fn sampled(joints: usize, samples: usize) -> (Vec<String>, Vec<f64>, Motion) {
        let family = Fourier::new(joints, 2.0, &FourierSettings::default()).unwrap();
        let parameters: Vec<f64> = (0..family.parameters()).map(|k| (k as f64).sin()).collect();
        let (times, mut motion) = (grid(2.0, samples), Motion::default());
        family.motion(&parameters, &times, &mut motion);
        ((0..joints).map(|joint| format!("joint \"{joint}\", a")).collect(), times, motion)
    }

    #[test]
    fn different_lengths_are_named() {
        let (mut joints, times, mut motion) = sampled(6, 5);
        let error = trajectory_csv(&Sampled { joints: &joints, times_s: &times[1..], motion: &motion }).unwrap_err();
        assert_eq!(error, ExportError::Shape { what: "times", expected: 5, found: 4 });
        motion.dq[7] = f64::NAN;
        let error = waypoints_csv(&Sampled { joints: &joints, times_s: &times, motion: &motion }).unwrap_err();
        assert_eq!(error, ExportError::NotFinite { joint: joints[1].clone(), at_s: times[2] });
        joints.pop();
        let error = ros2_joint_trajectory(&Sampled { joints: &joints, times_s: &times, motion: &motion }).unwrap_err();
        assert_eq!(error, ExportError::Shape { what: "joint names", expected: 6, found: 5 });
    }

    #[test]
    fn the_table_holds_the_motion_to_the_last_bit() {
        let (joints, times, motion) = sampled(2, 9);
        let csv = trajectory_csv(&Sampled { joints: &joints, times_s: &times, motion: &motion }).unwrap();
        let mut lines = csv.lines();
        assert_eq!(lines.next(), Some("t_s,q1,q2,dq1,dq2,ddq1,ddq2"));
        for (sample, line) in lines.enumerate() {
            let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
            let at = |values: &[f64], joint: usize| values[joint * 9 + sample];
            let (q, dq, ddq) = (&motion.q, &motion.dq, &motion.ddq);
            let expected = [times[sample], at(q, 0), at(q, 1), at(dq, 0), at(dq, 1), at(ddq, 0), at(ddq, 1)];
            assert_eq!(numbers, expected);
        }
        assert_eq!(csv.lines().count(), 10);
    }
}
