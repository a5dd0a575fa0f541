//! Findings about torque that no hypothesis explains, or that was not measured.

use super::CheckSettings;
use super::wording::finding;
use crate::result::CheckFinding;
use dynident_identification::diagnosis::{Diagnosis, Search};
use dynident_recording::Level;

/// No hypothesis explains the torque as well as separate parameters of each joint.
pub(super) fn unexplained(search: &Search, joints: &[String]) -> CheckFinding {
    let left = &search.as_written.left;
    let worst = (0..left.len()).max_by(|&a, &b| left[a].total_cmp(&left[b])).unwrap_or(0);
    finding(
        "description",
        "the robot description is of another robot, or the study has several mistakes".to_owned(),
        format!(
            "none of {} hypotheses (signs, orders, zeros, mounting) explains the logs with this robot: {} of the torque of `{}` is unexplained; \
             check link lengths, axes and the kind of the robot",
            search.tried,
            percent(left[worst]),
            joints[worst]
        ),
    )
}

/// Smallest number of joints with unexplained torque that are a PROBLEM.
const MIN_UNEXPLAINED_JOINTS: usize = 3;

/// Whether neither the best hypothesis nor noise explains most of the torque of most joints.
pub(super) fn are_most_joints_unexplained(diagnosis: &Diagnosis, thresholds: &CheckSettings) -> bool {
    let left = &diagnosis.search.believed().left;
    let beyond_noise = |(left, noise): (&f64, &f64)| left.powi(2) - noise.powi(2);
    let most = thresholds.max_unexplained_of_joint.powi(2);
    let count = left.iter().zip(&diagnosis.noise).map(beyond_noise).filter(|share| *share > most).count();
    count >= MIN_UNEXPLAINED_JOINTS && 2 * count > left.len()
}

/// The bodies of the description explain the torque completely, without friction: it was computed.
pub(super) fn torque_of_description() -> CheckFinding {
    let found = finding(
        "torque",
        "the torques are those of the robot description".to_owned(),
        "the bodies of the description explain the torque of every joint without friction, so the torque was computed by \
         a model or a simulator without friction, and the estimate repeats the description: log the measured torque or \
         the motor current (in ROS, `effort` of the hardware and not of a model)"
            .to_owned(),
    );
    CheckFinding { level: Level::Warning, ..found }
}

/// Most of the torque is unexplained although no tested mistake explains more of it.
///
/// With a weak or a single joint this is only a warning, because friction and position noise of an honest log can cause
/// it: `check` fits at a few hundred instants.
pub(super) fn mostly_unexplained(diagnosis: &Diagnosis, joints: &[String]) -> CheckFinding {
    let search = &diagnosis.search;
    let believed = search.believed();
    let shares = believed.left.iter().zip(joints).map(|(left, joint)| format!("{joint} {}", percent(*left)));
    finding(
        "torque",
        "most of the torque is unexplained, and no tested mistake of the study explains it".to_owned(),
        format!(
            "with the best of {} hypotheses, {} of all torque is unexplained, of which noise explains {} ({}): plot torque against position. Check \
                 that each row contains torque and position of the same instant (recorders with different rates), that the torque does not \
                 overflow or saturate, and that `columns` and `file` under [robot] are those of this robot",
            search.tried,
            percent(believed.left_of_all),
            percent(diagnosis.noise_of_all),
            shares.collect::<Vec<_>>().join(", "),
        ),
    )
}

/// A share in percent; a share above ten is not meaningful as a number.
fn percent(share: f64) -> String {
    if share > 10.0 { "more than 1000 %".to_owned() } else { format!("{:.0} %", 100.0 * share) }
}

pub(super) fn unrelated_torques(search: &Search) -> CheckFinding {
    finding(
        "torque",
        "the torques are unrelated to the motion".to_owned(),
        format!(
            "with the best of {} hypotheses, {:.0} % of all torque is unexplained: compare `columns` under torque and position with the log's \
             header, check that both come from one run, and do not use commanded positions or positions that repeat for many rows",
            search.tried,
            100.0 * search.believed().left_of_all
        ),
    )
}
