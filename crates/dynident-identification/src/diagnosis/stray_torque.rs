//! Torques that do not belong to one robot and motion with the others: noise, another channel, a clock or a gain of
//! their own that no reading mends.

use super::error::DiagnosisError;
use super::explanation::Explanation;
use super::further_friction::left_beside_further_friction;
use super::motion_rows::MotionRows;
use super::reading::Reading;
use dynident_dynamics::ParametricModel;

/// Times what parameters of the joint's own leave of its torque that one robot for all joints leaves, from which the
/// torque is doubted, and from which it is not this robot's. Of seven sets of real logs the most is 1.8, of single logs
/// of these 2.3.
const DOUBTED: f64 = 2.4;
const FOREIGN: f64 = 2.6;
/// Share of a joint's torque that counts as nothing.
const LITTLE: f64 = 0.03;
/// Share of a joint's torque that even parameters of its own leave where it has nothing to do with the motion, and that
/// one robot leaves: more than all of it, for the other joints say what it should be.
const MOTIONLESS: [f64; 2] = [0.75, 1.0];

/// A joint's torque that the robot which explains the others does not explain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrayTorque {
    /// The joint's number.
    pub joint: usize,
    /// Share of its torque that one set of base parameters for all joints leaves, with laws of friction that the study
    /// does not have where these leave less.
    pub left: f64,
    /// The same by parameters of its own.
    pub alone: f64,
    /// The share of it that noise of the positions makes.
    pub noise: f64,
}

impl StrayTorque {
    /// Whether it has nothing to do with how the robot moves.
    pub fn is_motionless(&self) -> bool {
        let [alone, left] = MOTIONLESS;
        self.alone > alone && self.left > left
    }

    /// Whether one robot leaves so much more of it than parameters of its own, and than noise, that it is not this
    /// robot's.
    pub fn is_foreign(&self) -> bool {
        self.times() > FOREIGN
    }

    /// Times what parameters of its own and the noise of the positions leave that one robot leaves: parameters of its
    /// own follow such noise where those of all joints do not.
    pub fn times(&self) -> f64 {
        self.left / self.alone.hypot(self.noise).max(f64::MIN_POSITIVE)
    }

    fn is_stray(&self) -> bool {
        self.left > LITTLE && self.times() > DOUBTED
    }
}

/// The torques of a reading that do not belong to one robot with the others: those that have nothing to do with the
/// motion, else the one of which one robot leaves most beside its own parameters, for it spoils its neighbours'.
/// `robot` and `rows` are those of the reading. `noise` tells the share of each joint's torque that noise of the
/// positions makes; it is asked only where it matters.
///
/// # Errors
/// Those of `noise`, too few rows.
pub(super) fn stray_torques(
    reading: &Reading,
    (robot, rows): (&ParametricModel, &MotionRows),
    noise: impl FnOnce(&Explanation) -> Result<Vec<f64>, DiagnosisError>,
) -> Result<Vec<StrayTorque>, DiagnosisError> {
    let of = |joint: usize| StrayTorque { joint, left: reading.free[joint], alone: reading.alone[joint], noise: 0.0 };
    let mut all: Vec<StrayTorque> =
        (0..reading.free.len()).filter(|&joint| reading.own_parameters_tell[joint]).map(of).collect();
    let motionless: Vec<StrayTorque> = all.iter().filter(|torque| torque.is_motionless()).copied().collect();
    if !motionless.is_empty() {
        return Ok(motionless);
    }
    if all.iter().any(StrayTorque::is_stray) {
        let explained = Explanation::new(robot, rows, None)?;
        let noise = noise(&explained)?;
        for torque in &mut all {
            torque.noise = noise[torque.joint];
            if torque.is_stray() {
                let theta = &explained.free_parameters;
                torque.left *= left_beside_further_friction(robot, rows, torque.joint, theta);
            }
        }
    }
    Ok(all
        .into_iter()
        .filter(StrayTorque::is_stray)
        .max_by(|a, b| a.times().total_cmp(&b.times()))
        .into_iter()
        .collect())
}
