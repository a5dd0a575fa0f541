//! Torques that are inconsistent with those of the other joints: noise, another channel, a separate clock, or a gain
//! that no hypothesis corrects.

use super::error::DiagnosisError;
use super::explanation::Explanation;
use super::further_friction::left_beside_further_friction;
use super::hypothesis::Hypothesis;
use super::motion_rows::MotionRows;
use dynident_dynamics::ParametricModel;

/// Ratio of a joint's unexplained share by one robot to that by its own parameters, from which the torque is doubted,
/// and from which it is not this robot's. Seven sets of real logs reach 1.8, single logs of these 2.3.
const DOUBTED_RATIO: f64 = 2.4;
const FOREIGN_RATIO: f64 = 2.6;
/// Smallest unexplained share of a joint's torque that is doubted.
const MIN_UNEXPLAINED: f64 = 0.03;
/// Unexplained shares of a torque that is independent of the motion: by the joint's own parameters, and by one robot,
/// which predicts another torque from the other joints.
const INDEPENDENT: [f64; 2] = [0.75, 1.0];

/// A joint's torque that the robot of the other joints does not explain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InconsistentTorque {
    /// The joint's number.
    pub joint: usize,
    /// Share of its torque that one set of base parameters for all joints does not explain, with other laws of friction
    /// than the study's where these explain more.
    pub left: f64,
    /// The same for its own parameters.
    pub alone: f64,
    /// Share of its torque from noise of the positions.
    pub noise: f64,
}

impl InconsistentTorque {
    /// Whether it is independent of the motion.
    pub fn is_motionless(&self) -> bool {
        let [alone, left] = INDEPENDENT;
        self.alone > alone && self.left > left
    }

    /// Whether it is so inconsistent that it is not this robot's.
    pub fn is_foreign(&self) -> bool {
        self.times() > FOREIGN_RATIO
    }

    /// Ratio of its unexplained share by one robot to that by its own parameters and the noise of the positions: own
    /// parameters follow such noise, those of all joints do not.
    pub fn times(&self) -> f64 {
        self.left / self.alone.hypot(self.noise).max(f64::MIN_POSITIVE)
    }

    fn is_inconsistent(&self) -> bool {
        self.left > MIN_UNEXPLAINED && self.times() > DOUBTED_RATIO
    }
}

/// The inconsistent torques of a hypothesis: those that are independent of the motion, or else the one with the largest
/// ratio, since it spoils its neighbours. `robot` and `rows` are those of the hypothesis. `noise` computes the share of
/// each joint's torque from noise of the positions, only where that is needed.
///
/// # Errors
/// Those of `noise`, too few rows.
pub(super) fn inconsistent_torques(
    hypothesis: &Hypothesis,
    robot: &ParametricModel,
    rows: &MotionRows,
    noise: impl FnOnce(&Explanation) -> Result<Vec<f64>, DiagnosisError>,
) -> Result<Vec<InconsistentTorque>, DiagnosisError> {
    let of = |joint: usize| InconsistentTorque {
        joint,
        left: hypothesis.free[joint],
        alone: hypothesis.alone[joint],
        noise: 0.0,
    };
    let mut all: Vec<InconsistentTorque> =
        (0..hypothesis.free.len()).filter(|&joint| hypothesis.own_parameters_tell[joint]).map(of).collect();
    let motionless: Vec<InconsistentTorque> = all.iter().filter(|torque| torque.is_motionless()).copied().collect();
    if !motionless.is_empty() {
        return Ok(motionless);
    }
    if all.iter().any(InconsistentTorque::is_inconsistent) {
        let explained = Explanation::new(robot, rows, None)?;
        let noise = noise(&explained)?;
        for torque in &mut all {
            torque.noise = noise[torque.joint];
            if torque.is_inconsistent() {
                let theta = &explained.free_parameters;
                torque.left *= left_beside_further_friction(robot, rows, torque.joint, theta);
            }
        }
    }
    Ok(all
        .into_iter()
        .filter(InconsistentTorque::is_inconsistent)
        .max_by(|a, b| a.times().total_cmp(&b.times()))
        .into_iter()
        .collect())
}
