//! Reasons against loading a result's model into a robot.

use super::{CheckFinding, LogSummary, ResultFile, StudyCheck};
use dynident_identification::Role;
use dynident_identification::estimators::{NoiseInRegressor, NoiseVerdict};
use dynident_identification::examination::{JointResiduals, LogValidation};
use dynident_recording::Level;
use dynident_recording::log::Quantity;
use dynident_study::ProblemSettings;

impl LogSummary {
    /// Problems found in the log.
    pub fn problems(&self) -> Vec<String> {
        let findings = self.import.findings.iter().chain(&self.model_findings);
        let problems = findings.filter(|finding| finding.level == Level::Problem);
        problems.map(|finding| format!("log `{}`, {}: {}", self.log, finding.channel, finding.message)).collect()
    }
}

impl ResultFile {
    /// All problems: [`problems_of_the_model`](Self::problems_of_the_model), then the problems of the logs.
    pub fn found_problems(&self) -> Vec<String> {
        let mut problems = self.problems_of_the_model();
        problems.extend(self.logs.iter().flat_map(LogSummary::problems));
        problems
    }

    /// Problems that do not concern a single log: problems that `check` found in the study, an estimator that did not
    /// converge, and a physically consistent set (which is exported) with clearly larger errors than the unconstrained
    /// estimate. Errors on held-out logs are compared. Without held-out logs, errors on the training rows are compared,
    /// and only a significant difference is a problem.
    pub fn problems_of_the_model(&self) -> Vec<String> {
        let settings = &self.thresholds.problems;
        let mut problems: Vec<String> = self.check.iter().flat_map(StudyCheck::problems).collect();
        if !self.method.is_settled() {
            problems.push(format!(
                "the estimator {} did not converge: the values are those of its last iteration",
                self.method.estimator
            ));
        }
        problems.extend(self.noise_in_regressor.as_ref().and_then(|noise| self.noise_problem(noise)));
        problems.extend(self.at_rest(settings));
        problems.extend(self.unexplained(settings));
        let tested = self.validation.iter().filter_map(|log| {
            let [free, written] = [&log.model, log.physical.as_ref()?].map(|report| Errors {
                relative_percent: report.relative_error_percent,
                joints: report.joints.iter().map(|j| (&j.name[..], j.rmse_nm, j.relative_error_percent)).collect(),
            });
            worse_when_consistent(&format!("log `{}`", log.log), &free, &written, settings)
        });
        problems.extend(tested);
        problems.extend(self.inconsistent_torques(settings));
        problems.extend(self.validation.iter().filter_map(|log| self.overfit(log, settings)));
        // On training rows the unconstrained estimate always has the smaller error, so only a significant difference is
        // a problem.
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
            problems.extend(worse_when_consistent("logs that were fitted to", &free, &written, settings));
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

    /// Training logs in which no joint moves.
    fn at_rest(&self, settings: &ProblemSettings) -> Option<String> {
        let logs = self.logs.iter().filter(|log| log.role == Role::Identify);
        let positions = logs
            .flat_map(|log| &log.import.channels)
            .filter(|channel| channel.channel == Quantity::Position)
            .collect::<Vec<_>>();
        let range = |joint: &str| {
            let of_joint = positions.iter().filter(|channel| channel.joint == joint);
            let [low, high] = of_joint.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], channel| {
                [low.min(channel.min), high.max(channel.max)]
            });
            high - low
        };
        let largest = positions.iter().map(|channel| range(&channel.joint)).fold(0.0, f64::max);
        (!positions.is_empty() && largest < settings.max_range_at_rest).then(|| {
            format!(
                "the training logs are at rest: no position changes by more than {largest:.1e} rad (m). They determine only the torque that \
                 holds this posture, and no mass, inertia or friction; small errors on logs in the same posture do not validate the model. \
                 Record a motion: `dynident design` computes one from the robot and its limits"
            )
        })
    }

    /// A model that leaves most of the training or held-out torque unexplained.
    fn unexplained(&self, settings: &ProblemSettings) -> Option<String> {
        let physical = self.training.physical.as_ref().map(|physical| physical.relative_error_percent);
        let percent = physical.unwrap_or(self.training.relative_error_percent)?;
        let most = settings.max_unexplained_percent;
        let tested = |log: &LogValidation| {
            let percent = log.physical.as_ref().unwrap_or(&log.model).relative_error_percent?;
            (percent > most).then(|| {
                format!(
                    "{percent:.0} % of the torque of log `{}` is unexplained: the model does not fit this robot, or the log is of another robot \
                     or motion; {}",
                    log.log,
                    self.advice()
                )
            })
        };
        let of_training = (percent > most).then(|| {
            format!(
                "{percent:.0} % of the training torque is unexplained: the study does not describe this robot or these logs, or position \
                 noise exceeds the motion (`position_noise` of the logs); {}",
                self.advice()
            )
        });
        of_training.or_else(|| self.validation.iter().find_map(tested))
    }

    /// How to fix unexplained torque; depends on the result of `check`.
    fn advice(&self) -> &'static str {
        let Some(check) = &self.check else { return "run `dynident check`" };
        if check.problems().next().is_some() {
            "correct the problems that `check` found"
        } else {
            "no mistake that `check` tests explains it: compare clock, columns and units of the log with its recorder, and the kind of \
             the robot with `file` under [robot]"
        }
    }

    /// A held-out log with a much larger error than the training logs.
    fn overfit(&self, log: &LogValidation, settings: &ProblemSettings) -> Option<String> {
        let times = self.held_out_ratio(log, settings)?;
        if times <= settings.max_held_out_ratio {
            return None;
        }
        Some(format!(
            "log `{}`: its residual is {times:.1} times that of the training logs: the fit follows \
             their noise, or the logs differ (payload, temperature, motion); record longer training logs, with a motion from `design`",
            log.log
        ))
    }

    /// Joint torques that no physically consistent model explains, if a held-out log also has a large error. Either
    /// finding alone may have other reasons.
    fn inconsistent_torques<'a>(&'a self, settings: &'a ProblemSettings) -> impl Iterator<Item = String> + 'a {
        let worst = self.validation.iter().filter_map(|log| self.held_out_ratio(log, settings)).fold(0.0, f64::max);
        let findings = self.check.iter().flat_map(|check| &check.findings);
        let is_doubted = |finding: &&CheckFinding| finding.kind == "torque" && finding.level == Level::Warning;
        findings
            .filter(move |finding| worst > settings.max_held_out_ratio_if_inconsistent && is_doubted(finding))
            .map(CheckFinding::sentence)
    }

    /// Residual of a held-out log relative to the training logs. Torque that is explained by friction at rest and by
    /// the low-pass of the positions is excluded ([`JointResiduals::rmse_in_motion_nm`]). `None` for a small held-out
    /// error.
    fn held_out_ratio(&self, log: &LogValidation, settings: &ProblemSettings) -> Option<f64> {
        // Both errors must use the same frequency band; in the band of the fit, only the unconstrained estimate has
        // errors.
        let written = || self.training.physical.as_ref().map_or(&self.training.joints, |physical| &physical.joints);
        let (fitted, held_out) = match &log.in_fit_band {
            Some(report) => (&self.training.joints, report),
            None => (written(), log.physical.as_ref().unwrap_or(&log.model)),
        };
        // Residuals are stored for the unconstrained estimate only; results of older versions have none for joints in
        // motion.
        let estimated = &log.in_fit_band.as_ref().unwrap_or(&log.model).joints;
        let in_motion = |joint: usize| {
            let residuals: &JointResiduals = log.residuals.get(joint)?;
            let of_motion = residuals.rmse_in_motion_nm?;
            let of_all = estimated.get(joint)?.rmse_nm;
            (of_all > 0.0).then(|| (of_motion / of_all).min(1.0))
        };
        let (mut squares, mut joints, mut unexplained, mut torque) = (0.0, 0, 0.0, 0.0);
        for (joint, (fitted, held)) in fitted.iter().zip(&held_out.joints).enumerate() {
            let rmse_nm = held.rmse_nm * in_motion(joint).unwrap_or(1.0);
            unexplained += rmse_nm * rmse_nm;
            torque += torque_norm(&(&held.name, held.rmse_nm, held.relative_error_percent)).powi(2);
            if fitted.rmse_nm > 0.0 {
                squares += (rmse_nm / fitted.rmse_nm).powi(2);
                joints += 1;
            }
        }
        // Without torque there is no relative error.
        let is_good = torque <= 0.0 || 100.0 * (unexplained / torque).sqrt() < settings.min_held_out_percent;
        (!is_good).then(|| (squares / f64::from(joints.max(1))).sqrt())
    }
}

struct Errors<'a> {
    relative_percent: Option<f64>,
    /// For each joint its name, root mean square error (Nm or N) and relative error in percent.
    joints: Vec<(&'a str, f64, Option<f64>)>,
}

/// Message if the physically consistent set has clearly larger errors than the unconstrained estimate on the same rows.
fn worse_when_consistent(
    place: &str,
    free: &Errors<'_>,
    written: &Errors<'_>,
    settings: &ProblemSettings,
) -> Option<String> {
    let largest = free.joints.iter().map(torque_norm).fold(0.0, f64::max);
    let times = |before: f64, after: f64| if before > 0.0 { after / before } else { 1.0 };
    let joints = free.joints.iter().zip(&written.joints);
    let is_shown = |percent: Option<f64>| percent.is_none_or(|percent| percent >= settings.min_held_out_percent);
    let worst = joints
        .filter(|(free, _)| torque_norm(free) > settings.min_torque_share * largest)
        .map(|(free, held)| (times(free.1, held.1), free, held))
        .filter(|(ratio, _, held)| *ratio > settings.max_joint_error_ratio && is_shown(held.2))
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
    // Both errors are relative to the same torque, so their ratio equals the ratio of the root mean square errors.
    let ratio = free.relative_percent.zip(written.relative_percent).map(|(before, after)| times(before, after));
    (ratio? > settings.max_error_ratio && is_shown(written.relative_percent))
        .then(|| sentence(place.to_owned(), free.relative_percent, written.relative_percent))
}

/// Root mean square of a joint's measured torque, Nm (N).
fn torque_norm(joint: &(&str, f64, Option<f64>)) -> f64 {
    let (_, rmse_nm, relative) = joint;
    relative.map_or(0.0, |percent| if percent > 0.0 { 100.0 * rmse_nm / percent } else { 0.0 })
}
