//! Torques that are inconsistent with the torques of the other joints: noise, another channel, a separate clock, or a
//! gain that no hypothesis corrects.

use super::error::DiagnosisError;
use super::explanation::Explanation;
use super::further_friction::ratio_with_further_friction;
use super::hypothesis::Hypothesis;
use super::motion_rows::MotionRows;
use crate::diagnosis_settings::ChannelSettings;
use dynident_dynamics::ParametricModel;

/// A joint torque that no robot model explains together with the torques of the other joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InconsistentTorque {
    /// Index of the joint.
    pub joint: usize,
    /// Unexplained share of the joint's torque with one set of base parameters for all joints. Further friction laws
    /// are used if they explain more.
    pub left: f64,
    /// Unexplained share of the joint's torque with separate parameters of this joint.
    pub alone: f64,
    /// Share of the joint's torque that results from position noise.
    pub noise: f64,
    settings: ChannelSettings,
}

impl InconsistentTorque {
    /// Whether the torque is independent of the motion.
    pub fn is_motionless(&self) -> bool {
        self.alone > self.settings.min_independent_alone && self.left > self.settings.min_independent
    }

    /// Whether the torque is so inconsistent that it does not belong to this robot.
    pub fn is_foreign(&self) -> bool {
        self.unexplained_ratio() > self.settings.min_foreign_ratio
    }

    /// Ratio of the joint's unexplained torque with one robot for all joints to the unexplained torque with separate
    /// parameters of the joint. The effect of position noise is included in the latter, because separate parameters fit
    /// this noise, but one robot does not.
    pub fn unexplained_ratio(&self) -> f64 {
        self.left / self.alone.hypot(self.noise).max(f64::MIN_POSITIVE)
    }

    fn is_inconsistent(&self) -> bool {
        self.left > self.settings.min_doubted_unexplained && self.unexplained_ratio() > self.settings.min_doubted_ratio
    }
}

/// The inconsistent torques of a hypothesis: all torques that are independent of the motion; if there are none, only
/// the torque with the largest ratio, because it disturbs the fit of the neighbouring joints. `robot` and `rows` belong
/// to the hypothesis. `noise` computes the share of each joint's torque that results from position noise; it is called
/// only if needed.
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
        settings: hypothesis.settings.channels,
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
                torque.left *= ratio_with_further_friction(robot, rows, torque.joint, theta);
            }
        }
    }
    Ok(all
        .into_iter()
        .filter(InconsistentTorque::is_inconsistent)
        .max_by(|a, b| a.unexplained_ratio().total_cmp(&b.unexplained_ratio()))
        .into_iter()
        .collect())
}
