//! What speaks against loading a result's model into a robot.

use super::{ResultFile, StudyCheck};
use dynident_identification::examination::LogValidation;
use dynident_recording::Level;

/// Times the estimate's error that the consistent set may have on a held-out log. On the real logs that Dynident is
/// tested on it lies between 0.8 and 1.14, with dead torque channels at 1.6.
const MOST_TIMES_OF_ALL: f64 = 1.5;
/// The same for a single joint, of which some have little torque to be judged by: 0.6 to 1.7, dead channels at 5.2.
const MOST_TIMES_OF_JOINT: f64 = 2.5;
/// A joint's torque that errors count against, as a share of the largest joint's: below it, friction alone is left.
const LEAST_SHARE: f64 = 1.0e-3;

impl ResultFile {
    /// Everything that speaks against loading the model that was written into a robot, a sentence each; empty where
    /// nothing does. Problems of the logs, an estimator that did not settle, and a consistent set (which is what is
    /// written) that predicts clearly worse than the estimate it was made from.
    pub fn problems(&self) -> Vec<String> {
        let mut problems: Vec<String> = self.check.iter().flat_map(StudyCheck::problems).collect();
        for log in &self.logs {
            let findings = log.import.findings.iter().chain(&log.model_findings);
            for finding in findings.filter(|finding| finding.level == Level::Problem) {
                problems.push(format!("log `{}`, {}: {}", log.log, finding.channel, finding.message));
            }
        }
        if !self.method.is_settled() {
            problems.push(format!(
                "the estimator {} did not settle: its values are those of its last iteration",
                self.method.estimator
            ));
        }
        problems.extend(self.validation.iter().filter_map(worse_when_consistent));
        problems
    }
}

/// The consistent set beside the estimate on one held-out log, where it is clearly worse.
fn worse_when_consistent(log: &LogValidation) -> Option<String> {
    let consistent = log.physical.as_ref()?;
    let largest = log.model.joints.iter().map(torque_norm).fold(0.0, f64::max);
    let times = |before: f64, after: f64| if before > 0.0 { after / before } else { 1.0 };
    let joints = log.model.joints.iter().zip(&consistent.joints);
    let joints = joints.filter(|(free, _)| torque_norm(free) > LEAST_SHARE * largest);
    let worst = joints
        .map(|(free, held)| (times(free.rmse_nm, held.rmse_nm), free, held))
        .filter(|(ratio, ..)| *ratio > MOST_TIMES_OF_JOINT)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let percent = |value: Option<f64>| value.map_or_else(|| "?".to_owned(), |value| format!("{value:.2}"));
    let cause = "no physically consistent robot moves as this log says: a reversed or exchanged channel, a wrong unit, \
                 or a wrong description";
    if let Some((_, free, held)) = worst {
        return Some(format!(
            "log `{}`, joint `{}`: the consistent set that is written leaves {} % of the torque, the estimate alone {} %; {cause}",
            log.log,
            free.name,
            percent(held.relative_error_percent),
            percent(free.relative_error_percent)
        ));
    }
    (times(log.model.rmse_nm, consistent.rmse_nm) > MOST_TIMES_OF_ALL).then(|| {
        format!(
            "log `{}`: the consistent set that is written leaves {} % of the torque, the estimate alone {} %; {cause}",
            log.log,
            percent(consistent.relative_error_percent),
            percent(log.model.relative_error_percent)
        )
    })
}

/// Root mean square of a joint's measured torque.
fn torque_norm(joint: &dynident_estimation::diagnostics::JointValidation) -> f64 {
    joint
        .relative_error_percent
        .map_or(0.0, |percent| if percent > 0.0 { 100.0 * joint.rmse_nm / percent } else { 0.0 })
}
