//! Converts a diagnosis to findings.

use super::CheckSettings;
use super::changes::{changes_of_log, keys_of_log, keys_of_study, successive_changes};
use super::description::{another_robot, torque_unit, wrong_mass};
use super::torques::{
    are_most_joints_unexplained, mostly_unexplained, torque_of_description, unexplained, unrelated_torques,
};
use super::wording::{FindingContext, alternative, evidence, finding};
use crate::result::{CheckFinding, HypothesisResult, StudyChange, StudyCheck};
use crate::study::{Study, StudyRobot};
use dynident_identification::Role;
use dynident_identification::changes::LogLoad;
use dynident_identification::diagnosis::{
    BeyondLimit, Channels, DescriptionFit, Diagnosis, DuplicateChannel, HeldOutHypothesis, Hypothesis,
    InconsistentTorque, Mistake, Search, UnmodelledPayload,
};
use dynident_identification::examination::PositionTorque;
use dynident_identification::{GainChoice, IdentificationSettings};
use dynident_model::Model;
use dynident_recording::Level;
use dynident_recording::log::OneOrMany;

/// Findings of a diagnosis, with the scores of the study as written and of the best hypothesis.
pub(super) fn study_check(
    study: &Study,
    robot: &StudyRobot,
    settings: &IdentificationSettings,
    diagnosis: &Diagnosis,
    thresholds: &CheckSettings,
) -> StudyCheck {
    let joints = robot.parametric.joint_names();
    let keys = keys_of_study(study, robot);
    let words = FindingContext { joints: &joints, keys: keys.as_ref(), thresholds };
    let search = &diagnosis.search;
    let spoilt = spoilt_columns(diagnosis, &joints);
    let is_spoilt = !spoilt.is_empty();
    let best = explanation(search, thresholds).filter(|_| !is_spoilt);
    let foreign = diagnosis.description_fit.as_ref().filter(|fit| fit.is_of_another_robot());
    let mut findings = if is_spoilt {
        spoilt
    } else if let Some(fit) = foreign {
        vec![words.another_robot(fit, best)]
    } else if let Some(best) = best {
        words.mistakes(search, best)
    } else {
        search.as_written.beyond.iter().map(|beyond| behind_limit(beyond, &joints)).collect()
    };
    let has_stated_gains = settings.gains == GainChoice::Stated;
    let bodies = diagnosis.description_fit.as_ref();
    if let Some(fit) = bodies.filter(|_| has_stated_gains && foreign.is_none() && !is_spoilt) {
        findings.extend(words.wrong_scale(fit, robot.model()));
    }
    // The iteration evaluates its held-out runs separately; they are not logs of the study.
    let payloads = diagnosis.unmodelled_payloads.iter().filter(|payload| payload.log < study.log.len());
    findings.extend(payloads.map(|payload| unmodelled_payload(study, robot, payload)));
    let held_out = diagnosis.held_out.iter().filter(|found| found.log < study.log.len());
    findings.extend(held_out.map(|found| of_held_out_log(study, robot, found, &joints)));
    let repeated = diagnosis.repeated_motions.iter().filter(|log| **log < study.log.len());
    let repeated: Vec<CheckFinding> = repeated.map(|log| repeated_motion(&study.log_name(*log))).collect();
    if findings.is_empty() {
        findings.extend(diagnosis.inconsistent_torques.iter().map(|torque| inconsistent_torque(torque, &joints)));
    }
    if findings.is_empty() && diagnosis.is_unexplained() {
        findings.push(unexplained(search, &joints));
    }
    if findings.is_empty() && search.believed().left_of_all > thresholds.min_unrelated_share {
        findings.push(unrelated_torques(search));
    }
    let is_problem = |finding: &CheckFinding| finding.level == Level::Problem;
    let is_unexplained = diagnosis.unexplained_beyond_noise() > thresholds.max_unexplained_beyond_noise;
    let are_most_unexplained = are_most_joints_unexplained(diagnosis, thresholds);
    if (is_unexplained || are_most_unexplained) && !findings.iter().any(is_problem) {
        let level = if are_most_unexplained { Level::Problem } else { Level::Warning };
        findings.push(CheckFinding { level, ..mostly_unexplained(diagnosis, &joints) });
    }
    if diagnosis.is_torque_of_description {
        findings.push(torque_of_description());
    }
    findings.extend(repeated);
    StudyCheck {
        findings,
        as_written: Some(hypothesis_result(&search.as_written, &joints)),
        best: best.map(|best| hypothesis_result(best, &joints)),
        joints,
        tried: search.tried,
        unexplained_percent: Some(100.0 * search.believed().left_of_all),
        noise_percent: diagnosis.noise.iter().map(|noise| 100.0 * noise).collect(),
        noise_of_all_percent: Some(100.0 * diagnosis.noise_of_all),
        commanded_logs: 0,
    }
}

/// The best hypothesis, if it explains the logs well enough.
fn explanation<'a>(search: &'a Search, thresholds: &CheckSettings) -> Option<&'a Hypothesis> {
    let most_left =
        thresholds.max_unexplained_share.max(thresholds.max_unexplained_ratio * search.as_written.left_of_all);
    search.best.as_ref().filter(|best| !best.is_unexplained() && best.left_of_all < most_left)
}

impl FindingContext<'_> {
    /// One finding per mistake of the best hypothesis. The last finding lists hypotheses that cannot be distinguished
    /// from it.
    fn mistakes(self, search: &Search, best: &Hypothesis) -> Vec<CheckFinding> {
        let Self { joints, keys, .. } = self;
        let (mut writes, before_last) = successive_changes(&best.mistakes, keys);
        let last = best.mistakes.last().zip(best.factors_alike);
        if last.is_some_and(|(mistake, range)| !mistake.other_factors(range).is_empty()) {
            writes.last_mut().into_iter().flatten().for_each(|change| change.line += "   # one of the range above");
        }
        let one = |(mistake, write): (&Mistake, Vec<StudyChange>)| {
            let evidence = evidence(mistake, &search.as_written, best, joints);
            CheckFinding { write, ..finding(mistake.key(), mistake.sentence(joints), evidence) }
        };
        let mut all: Vec<CheckFinding> = best.mistakes.iter().zip(writes).map(one).collect();
        let others = search.alike.iter().filter_map(|other| other.mistakes.last());
        if let Some(last) = all.last_mut() {
            last.or = others.map(|other| alternative(other, joints, before_last.as_ref())).collect();
        }
        all
    }

    /// Finding for the description of a different robot. The best hypothesis is mentioned only as an alternative,
    /// because some mistake always explains slightly more than none.
    fn another_robot(self, fit: &DescriptionFit, best: Option<&Hypothesis>) -> CheckFinding {
        let Self { joints, keys, .. } = self;
        let mut found = another_robot(fit, joints);
        let others = best.iter().flat_map(|best| best.mistakes.iter().map(|mistake| (mistake, best.factors_alike)));
        let text = |(mistake, range): (&Mistake, Option<[f64; 2]>)| {
            let range = range.map_or_else(String::new, |range| mistake.other_factors(range));
            alternative(mistake, joints, keys) + &range
        };
        found.or = others.map(text).collect();
        found
    }

    fn wrong_scale(self, fit: &DescriptionFit, model: &Model) -> Option<CheckFinding> {
        let far = fit.joints_in_another_unit();
        match &fit.wrong_mass {
            Some(wrong) => Some(wrong_mass(wrong, model)),
            None => (!far.is_empty()).then(|| torque_unit(fit, &far, model, &self)),
        }
    }
}

/// A held-out log whose error is that of the training motion.
fn repeated_motion(log: &str) -> CheckFinding {
    let found = finding(
        "motion",
        format!("log `{log}` repeats the motion of the training logs"),
        "its error does not show how well the model predicts other motions: use a log of another motion with \
         role = \"validate\""
            .to_owned(),
    );
    CheckFinding { level: Level::Warning, ..found }
}

pub(super) fn currents_without_scale(study: &Study, settings: &IdentificationSettings) -> Option<CheckFinding> {
    let index = *study.logs_of_role(Role::Identify).first()?;
    let torque = study.format_of(index).torque?;
    let units = match torque.unit.as_ref()? {
        OneOrMany::One(unit) => vec![unit.clone()],
        OneOrMany::Many(units) => units.clone(),
    };
    let odd = units.into_iter().find(|unit| matches!(unit.as_str(), "A" | "mA" | "%" | "raw"))?;
    let is_scaled = torque.scale.is_some() || torque.matrix.is_some() || torque.inverse_matrix.is_some();
    if is_scaled || settings.gains == GainChoice::Unknown {
        return None;
    }
    let mut found = finding(
        "unit",
        format!("the torque columns are in {odd}, and their `scale` to Nm (N) is missing"),
        "every mass estimate would be multiplied by the unknown motor constant".to_owned(),
    );
    let line = "scale = [...]   # motor constant times gear ratio, Nm per unit, one for each joint".to_owned();
    found.write.push(StudyChange { table: "format.torque".to_owned(), line });
    Some(found)
}

/// Torque columns that do not contain what the study states; other hypotheses are then not reliable.
fn spoilt_columns(diagnosis: &Diagnosis, joints: &[String]) -> Vec<CheckFinding> {
    let same = |same: &DuplicateChannel| {
        let [a, b] = same.joints.map(|joint| &joints[joint]);
        let what = match same.channels {
            Channels::Both => format!("the position of joint `{a}` and the torque of joint `{b}` are"),
            Channels::Position | Channels::Torque => {
                format!("{} of joints `{a}` and `{b}` is", same.channels.text())
            }
        };
        finding(
            "order",
            format!("{what} the same column"),
            "one is a multiple of the other in all samples, and no robot explains both: compare `columns` with the log's header".to_owned(),
        )
    };
    let mut found: Vec<CheckFinding> = diagnosis.duplicate_channels.iter().map(same).collect();
    if found.is_empty() && diagnosis.lost_signs {
        found.push(finding(
            "sign",
            "the torques are magnitudes: their signs are lost".to_owned(),
            "all joints move back and forth but no torque is ever negative, and no robot explains this: log currents or torques with their signs".to_owned(),
        ));
    }
    found
}

fn of_held_out_log(
    study: &Study,
    robot: &StudyRobot,
    hypothesis: &HeldOutHypothesis,
    joints: &[String],
) -> CheckFinding {
    let HeldOutHypothesis { log, mistake, alike, left_as_written, left_without } = hypothesis;
    let keys = keys_of_log(study, robot, *log);
    let mut found = finding(
        mistake.key(),
        format!("in log `{}` {}", study.log_name(*log), mistake.sentence(joints)),
        format!(
            "rms residual with the parameters of the training logs: {left_as_written:.3} Nm as written, {left_without:.3} Nm with the correction; the training logs do not have this mistake"
        ),
    );
    found.write = changes_of_log(mistake, study, &keys, *log);
    found.or = alike.iter().map(|other| alternative(other, joints, Some(&keys))).collect();
    found
}

/// Finding about a joint torque that does not fit the robot identified from all joints.
fn inconsistent_torque(torque: &InconsistentTorque, joints: &[String]) -> CheckFinding {
    let name = &joints[torque.joint];
    if torque.is_motionless() {
        return finding(
            "torque",
            format!("the torque of joint `{name}` is unrelated to its motion"),
            format!(
                "{:.0} % of it is unexplained even with separate parameters for this joint, and it does not show the other joints' bodies: \
                 compare `columns` under torque with the log's header, and check whether the channel is dead",
                100.0 * torque.alone
            ),
        );
    }
    let noise = if torque.noise > 1.0e-3 {
        format!(", noise of the positions {:.1} %", 100.0 * torque.noise)
    } else {
        String::new()
    };
    let found = finding(
        "torque",
        format!("the torque of joint `{name}` is inconsistent with the other joints"),
        format!(
            "unexplained with one robot for all joints {:.1} %, with separate parameters for this joint {:.1} %{}: a ratio of {:.1}, \
             at most 2.3 in consistent logs; check that all its columns come from one clock and one run, its gain, and the \
             lengths and axes of the robot description",
            100.0 * torque.left,
            100.0 * torque.alone,
            noise,
            torque.unexplained_ratio()
        ),
    );
    CheckFinding { level: if torque.is_foreign() { Level::Problem } else { Level::Warning }, ..found }
}

fn behind_limit(beyond: &BeyondLimit, joints: &[String]) -> CheckFinding {
    let what = format!("the {} of joint `{}` exceeds its limit", beyond.quantity, joints[beyond.joint]);
    let evidence = format!(
        "it reaches {:.4}, but the limit is {:.4}: compare `unit`, `scale` (gear ratio: positions of the motor side?), `sign` and `offset` under position, \
         or the limits in the robot description",
        beyond.value, beyond.limit
    );
    finding("limits", what, evidence)
}

fn unmodelled_payload(study: &Study, robot: &StudyRobot, payload: &UnmodelledPayload) -> CheckFinding {
    let log = study.log_name(payload.log);
    let link = robot.model().bodies().last().map_or("", |body| body.name());
    let [x, y, z] = payload.com_m;
    let mut found = finding(
        "payload",
        if payload.mass_kg > 0.0 {
            format!("log `{log}` carries a payload that the training logs do not")
        } else {
            format!("the training logs carry a payload that log `{log}` does not")
        },
        format!(
            "with {:.2} ± {:.2} kg at [{x:.3}, {y:.3}, {z:.3}] m in `{link}` its rms residual falls from {:.3} to {:.3} Nm",
            payload.mass_kg.abs(),
            1.96 * payload.mass_std_kg,
            payload.left_without,
            payload.left_with
        ),
    );
    let is_trained = |log: &usize| study.log[*log].role == Role::Identify;
    let loaded = if payload.mass_kg > 0.0 { vec![payload.log] } else { study.logs_of_role(Role::Identify) };
    // If no training log contains the payload, the payload cannot be estimated together with the arm.
    let known = (!loaded.iter().any(is_trained)).then_some((payload.mass_kg, payload.com_m));
    found.write = payload_section(link, known);
    found.write.extend(loaded.into_iter().map(carries_tool));
    found
}

/// Finding about unexplained torque of a joint that is a function of its position.
pub(super) fn position_torque(torque: &PositionTorque) -> CheckFinding {
    let what =
        format!("joint `{}` may have a spring, counterbalance or cable that the study does not state", torque.name);
    let write = torque.keys().map(|line| StudyChange { table: "[[torque]]".to_owned(), line });
    CheckFinding { level: Level::Warning, write: write.to_vec(), ..finding("position-torque", what, torque.words()) }
}

/// Keys of a payload at `link`, with mass and centre of mass if the study must contain them.
fn payload_section(link: &str, known: Option<(f64, [f64; 3])>) -> Vec<StudyChange> {
    let mut lines = vec!["name = \"tool\"".to_owned(), format!("link = {link:?}")];
    if let Some((mass_kg, [x, y, z])) = known {
        lines.push(format!("mass_kg = {mass_kg:.3}"));
        lines.push(format!("com_m = [{x:.4}, {y:.4}, {z:.4}]"));
    }
    lines.into_iter().map(|line| StudyChange { table: "[[payload]]".to_owned(), line }).collect()
}

fn carries_tool(log: usize) -> StudyChange {
    StudyChange { table: format!("[[log]] number {}", log + 1), line: "payload = \"tool\"".to_owned() }
}

/// Finding about a payload that is present in only one of several training logs.
pub(super) fn log_load(study: &Study, robot: &StudyRobot, load: &LogLoad) -> CheckFinding {
    let (log, link) = (study.log_name(load.log), robot.model().bodies()[load.body].name());
    let [x, y, z] = load.com_m;
    let mut found = finding(
        "payload",
        format!("log `{log}` carries {:.2} kg more at `{link}` than the other training logs", load.mass_kg),
        format!(
            "separate fits to this log and to the others differ by {:.2} ± {:.2} kg at [{x:.3}, {y:.3}, {z:.3}] m in `{link}` (probability {:.0} %): \
             declare the load as [[payload]]",
            load.mass_kg,
            1.96 * load.mass_std_kg,
            100.0 * load.probability
        ),
    );
    found.write = payload_section(link, None);
    found.write.push(carries_tool(load.log));
    found
}

fn hypothesis_result(hypothesis: &Hypothesis, joints: &[String]) -> HypothesisResult {
    let beyond = |beyond: &BeyondLimit| format!("{} of {}", beyond.quantity, joints[beyond.joint]);
    HypothesisResult {
        left_percent: hypothesis.left.iter().map(|left| 100.0 * left).collect(),
        beyond_limits: hypothesis.beyond.iter().map(beyond).collect(),
        score: hypothesis.score(),
    }
}
