//! Reasons against loading a result's model into a robot.

use super::{CheckFinding, LogSummary, ResultFile, StudyCheck};
use dynident_identification::estimators::{NoiseInRegressor, NoiseVerdict};
use dynident_identification::examination::LogValidation;
use dynident_recording::Level;

/// Times the estimate's error that the consistent set may have on a held-out log. On the real logs that Dynident is
/// tested on it lies between 0.8 and 1.14, with dead torque channels at 1.6.
const MOST_TIMES_OF_ALL: f64 = 1.5;
/// The same for a single joint, of which some have little torque to be judged by: 0.6 to 1.7, dead channels at 5.2.
const MOST_TIMES_OF_JOINT: f64 = 2.5;
/// Share of the fitted torque, and of a held-out log's, percent, that no model worth writing leaves.
const MOST_LEFT_PERCENT: f64 = 60.0;
/// Times what the fit leaves of the joints' torque (root mean square over the joints) that the written model may leave
/// of a held-out log's. On ten real data sets it lies between 0.9 and 2.4; a fit of 58 parameters to three seconds
/// has 6.
const MOST_TIMES_OF_FIT: f64 = 4.0;
/// The same where a joint's torque did not belong to one robot with the others before.
const MOST_TIMES_OF_DOUBTED_FIT: f64 = 2.0;
/// Percent of a held-out log's torque below which a model is good, however much better the fit may be.
const GOOD_PERCENT: f64 = 1.0;
/// A joint's torque that errors count against, as a share of the largest joint's: below it, friction alone is left.
const LEAST_SHARE: f64 = 1.0e-3;

impl LogSummary {
    /// Problems found in the log.
    pub(crate) fn problems(&self) -> Vec<String> {
        let findings = self.import.findings.iter().chain(&self.model_findings);
        let problems = findings.filter(|finding| finding.level == Level::Problem);
        problems.map(|finding| format!("log `{}`, {}: {}", self.log, finding.channel, finding.message)).collect()
    }
}

impl ResultFile {
    /// All problems: [`problems_of_the_model`](Self::problems_of_the_model), then the problems of the logs.
    pub(crate) fn found_problems(&self) -> Vec<String> {
        let mut problems = self.problems_of_the_model();
        problems.extend(self.logs.iter().flat_map(LogSummary::problems));
        problems
    }

    /// Of [`problems`](Self::problems) those that no single log's findings name: what the examiner of studies found, an
    /// estimator that did not settle, and a consistent set (which is what is written) that predicts clearly worse than
    /// the estimate it was made from; on the held-out logs, or, where none was held out, on the rows that were fitted
    /// to if the logs tell the two apart.
    pub fn problems_of_the_model(&self) -> Vec<String> {
        let mut problems: Vec<String> = self.check.iter().flat_map(StudyCheck::problems).collect();
        if !self.method.is_settled() {
            problems.push(format!(
                "the estimator {} did not converge: the values are those of its last iteration",
                self.method.estimator
            ));
        }
        problems.extend(self.noise_in_regressor.as_ref().and_then(|noise| self.noise_problem(noise)));
        problems.extend(self.unexplained());
        let tested = self.validation.iter().filter_map(|log| {
            let [free, written] = [&log.model, log.physical.as_ref()?].map(|report| Errors {
                relative_percent: report.relative_error_percent,
                joints: report.joints.iter().map(|j| (&j.name[..], j.rmse_nm, j.relative_error_percent)).collect(),
            });
            worse_when_consistent(&format!("log `{}`", log.log), &free, &written)
        });
        problems.extend(tested);
        problems.extend(self.stray_torques());
        problems.extend(self.validation.iter().filter_map(|log| self.overfit(log)));
        // On training rows the estimate always has the smaller error, so only a significant difference is a problem.
        let difference = self.physical.fit.as_ref().and_then(|fit| fit.difference);
        let is_tested = self.validation.is_empty() && difference.is_none_or(|test| test.is_significant);
        if let (true, Some(physical)) = (is_tested, &self.training.physical) {
            let pairs = [
                (self.training.relative_error_percent, &self.training.joints),
                (physical.relative_error_percent, &physical.joints),
            ];
            let [free, written] = pairs.map(|(relative_percent, joints)| Errors {
                relative_percent,
                joints: joints.iter().map(|j| (&j.name[..], j.rmse_nm, j.relative_error_percent)).collect(),
            });
            problems.extend(worse_when_consistent("logs that were fitted to", &free, &written));
        }
        problems
    }

    /// Bias by noise in the regressor beyond the error bars, for any estimator.
    fn noise_problem(&self, noise: &NoiseInRegressor) -> Option<String> {
        let by_instruments = self.method.estimator == "instrumental";
        if by_instruments && noise.instruments.weak {
            let column = noise.instruments.weakest_column.as_deref().unwrap_or("some parameter");
            let f = noise.instruments.weakest_f.unwrap_or_default();
            return Some(format!(
                "weak instruments: they hardly determine {column} (first-stage F {f:.1}), so the estimate is biased like least squares; \
                 raise or remove cutoff_hz of estimator.instruments, or move the robot faster"
            ));
        }
        let is_plain = ["weighted", "ordinary", "generalized"].contains(&&self.method.estimator[..]);
        if !is_plain || noise.verdict != NoiseVerdict::BiasesLeastSquares {
            return None;
        }
        let followed = noise.fast_motion.map_or(0.0, |fast| 100.0 * fast.followed.clamp(0.0, 1.0));
        let apart = noise.least_squares.as_ref().map_or(String::new(), |contrast| {
            format!(", and with instruments {} differs by {:.0} error bars", contrast.column, contrast.largest)
        });
        let fix = if noise.instruments.weak {
            "instruments from the logs' motion are too weak to correct this: lower cutoff_hz of motion.differentiator, or record with less position noise or a faster motion"
        } else {
            "use estimator.method = \"auto\", or lower cutoff_hz of motion.differentiator"
        };
        Some(format!(
            "noise in the regressor biases least squares beyond its error bars: torque follows {followed:.0} % of the fast motion{apart}; {fix}"
        ))
    }

    /// A model that leaves most of the training or held-out torque unexplained.
    fn unexplained(&self) -> Option<String> {
        let physical = self.training.physical.as_ref().map(|physical| physical.relative_error_percent);
        let percent = physical.unwrap_or(self.training.relative_error_percent)?;
        let tested = |log: &LogValidation| {
            let percent = log.physical.as_ref().unwrap_or(&log.model).relative_error_percent?;
            (percent > MOST_LEFT_PERCENT).then(|| {
                format!(
                    "{percent:.0} % of the torque of log `{}` is unexplained: the model does not fit this robot, or the log is of another robot \
                     or motion; run `dynident check`",
                    log.log
                )
            })
        };
        let of_training = (percent > MOST_LEFT_PERCENT).then(|| {
            format!(
                "{percent:.0} % of the training torque is unexplained: the study does not describe this robot or these logs, or position \
                 noise exceeds the motion; run `dynident check`, and see `position_noise` of the logs"
            )
        });
        of_training.or_else(|| self.validation.iter().find_map(tested))
    }

    /// A held-out log with a much larger error than the training logs.
    fn overfit(&self, log: &LogValidation) -> Option<String> {
        let times = self.times_of_fit(log)?;
        if times <= MOST_TIMES_OF_FIT {
            return None;
        }
        Some(format!(
            "log `{}`: its residual is {times:.1} times that of the training logs: the fit follows \
             their noise, or the logs differ (payload, temperature, motion); record longer training logs, with a motion from `design`",
            log.log
        ))
    }

    /// Inconsistent joint torques, if a held-out log also has a large error: each alone may have other reasons.
    fn stray_torques(&self) -> impl Iterator<Item = String> + '_ {
        let worst = self.validation.iter().filter_map(|log| self.times_of_fit(log)).fold(0.0, f64::max);
        let findings = self.check.iter().flat_map(|check| &check.findings);
        let is_doubted = |finding: &&CheckFinding| finding.kind == "torque" && finding.level == Level::Warning;
        findings
            .filter(move |finding| worst > MOST_TIMES_OF_DOUBTED_FIT && is_doubted(finding))
            .map(CheckFinding::sentence)
    }

    /// Residual of a held-out log relative to the training logs; `None` if the held-out error is small.
    fn times_of_fit(&self, log: &LogValidation) -> Option<f64> {
        // Both must use the same band: in the band of the fit, only the unconstrained estimate has figures.
        let written = || self.training.physical.as_ref().map_or(&self.training.joints, |physical| &physical.joints);
        let (fitted, held_out) = match &log.in_fit_band {
            Some(report) => (&self.training.joints, report),
            None => (written(), log.physical.as_ref().unwrap_or(&log.model)),
        };
        let pairs = fitted.iter().zip(&held_out.joints).filter(|(fitted, _)| fitted.rmse_nm > 0.0);
        let squares: Vec<f64> = pairs.map(|(fitted, held)| (held.rmse_nm / fitted.rmse_nm).powi(2)).collect();
        let times = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        let is_good = held_out.relative_error_percent.is_none_or(|percent| percent < GOOD_PERCENT);
        (!is_good).then_some(times)
    }
}

struct Errors<'a> {
    relative_percent: Option<f64>,
    /// Joint, root mean square error (Nm or N), relative error in percent.
    joints: Vec<(&'a str, f64, Option<f64>)>,
}

/// Message if the consistent set is clearly worse than the estimate on the same rows.
fn worse_when_consistent(place: &str, free: &Errors<'_>, written: &Errors<'_>) -> Option<String> {
    let largest = free.joints.iter().map(torque_norm).fold(0.0, f64::max);
    let times = |before: f64, after: f64| if before > 0.0 { after / before } else { 1.0 };
    let joints = free.joints.iter().zip(&written.joints);
    let worst = joints
        .filter(|(free, _)| torque_norm(free) > LEAST_SHARE * largest)
        .map(|(free, held)| (times(free.1, held.1), free, held))
        .filter(|(ratio, ..)| *ratio > MOST_TIMES_OF_JOINT)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let percent = |value: Option<f64>| value.map_or_else(|| "?".to_owned(), |value| format!("{value:.2}"));
    let sentence = |place: String, before: Option<f64>, after: Option<f64>| {
        format!(
            "{place}: {} % of the torque is unexplained by the consistent set (exported), {} % by the unconstrained estimate; no \
             physically consistent robot explains this log: check for a reversed or exchanged channel, a wrong unit, or a \
             wrong robot description",
            percent(after),
            percent(before)
        )
    };
    if let Some((_, free, held)) = worst {
        return Some(sentence(format!("{place}, joint `{}`", free.0), free.2, held.2));
    }
    // All joints: on the same rows, the ratio of relative errors equals that of the root mean squares.
    let ratio = free.relative_percent.zip(written.relative_percent).map(|(before, after)| times(before, after));
    (ratio? > MOST_TIMES_OF_ALL).then(|| sentence(place.to_owned(), free.relative_percent, written.relative_percent))
}

/// Root mean square of a joint's measured torque, Nm (N).
fn torque_norm(joint: &(&str, f64, Option<f64>)) -> f64 {
    let (_, rmse_nm, relative) = joint;
    relative.map_or(0.0, |percent| if percent > 0.0 { 100.0 * rmse_nm / percent } else { 0.0 })
}
