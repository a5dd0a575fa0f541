//! The findings of a diagnosis in words.

use super::changes::{changes, keys_of_log, keys_of_study};
use super::wording::{alternative, evidence};
use crate::result::{CheckFinding, ReadingResult, StudyChange, StudyCheck};
use crate::study::{Study, StudyRobot};
use dynident_identification::Role;
use dynident_identification::diagnosis::{
    BeyondLimit, Channels, DescriptionFit, Diagnosis, DuplicateChannel, HeldOutHypothesis, Hypothesis,
    InconsistentTorque, Mistake, StudyKeys, UnmodelledPayload, WrongMass,
};
use dynident_identification::{GainChoice, IdentificationSettings};
use dynident_model::{AuditFinding, Model, audit};
use dynident_recording::Level;
use dynident_recording::log::OneOrMany;

/// Largest unexplained share of all torque for an explanation; most real sets have 0.1.
const MAX_LEFT: f64 = 0.3;
/// The same as a share of that of the study as written, for noisy logs.
const MAX_LEFT_RATIO: f64 = 0.75;
/// Unexplained share of all torque from which even the best hypothesis explains nothing. A correct study of a slow
/// pendulum's noisy log has 0.81.
const NOTHING_EXPLAINED: f64 = 0.92;

/// Times the least factor of a joint's torque that the largest may be where they are one unit, or the currents of
/// drives: motor constants times gear ratios of an arm lie within five of each other.
const MOST_SPREAD: f64 = 10.0;

/// A problem without keys to write.
fn finding(kind: &str, what: String, evidence: String) -> CheckFinding {
    CheckFinding { level: Level::Problem, kind: kind.to_owned(), what, evidence, write: Vec::new(), or: Vec::new() }
}

/// The findings of a diagnosis, with the evidence of the study as written and of the best hypothesis.
pub(super) fn study_check(
    study: &Study,
    robot: &StudyRobot,
    settings: &IdentificationSettings,
    diagnosis: &Diagnosis,
) -> StudyCheck {
    let joints = robot.parametric.joint_names();
    let keys = keys_of_study(study, robot);
    let keys = keys.as_ref();
    let search = &diagnosis.search;
    let mut findings = Vec::new();
    // One finding for each mistake of the best hypothesis; the last one names hypotheses that are not distinguishable.
    // A hypothesis that explains nothing is no advice.
    let spoilt = spoilt_columns(diagnosis, &joints);
    let is_spoilt = !spoilt.is_empty();
    let most_left = MAX_LEFT.max(MAX_LEFT_RATIO * search.as_written.left_of_all);
    let explains = |best: &&Hypothesis| !is_spoilt && !best.is_unexplained() && best.left_of_all < most_left;
    let best = search.best.as_ref().filter(explains);
    let foreign = diagnosis.description_fit.as_ref().filter(|fit| fit.is_of_another_robot());
    if is_spoilt {
        findings.extend(spoilt);
    } else if let Some(fit) = foreign {
        let mut found = another_robot(fit, &joints);
        // Some mistake of the study always makes a little less of it.
        let others = best.iter().flat_map(|best| best.mistakes.iter().map(|mistake| (mistake, best.factors_alike)));
        let text = |(mistake, range): (&Mistake, Option<[f64; 2]>)| {
            let range = range.map_or_else(String::new, |range| mistake.other_factors(range));
            alternative(mistake, &joints, keys) + &range
        };
        found.or = others.map(text).collect();
        findings.push(found);
    } else if let Some(best) = best {
        for (number, mistake) in best.mistakes.iter().enumerate() {
            let evidence = evidence(mistake, &search.as_written, best, &joints);
            let mut found = finding(mistake.key(), mistake.sentence(&joints), evidence);
            found.write = changes(mistake, keys);
            if number + 1 == best.mistakes.len() {
                let others = search.alike.iter().filter_map(|other| other.mistakes.last());
                found.or = others.map(|other| alternative(other, &joints, keys)).collect();
            }
            findings.push(found);
        }
    } else if !search.as_written.beyond.is_empty() {
        findings.extend(search.as_written.beyond.iter().map(|beyond| behind_limit(beyond, &joints)));
    }
    let is_stated = settings.gains == GainChoice::Stated;
    let bodies = diagnosis.description_fit.as_ref();
    if let Some(unit) = bodies.filter(|_| is_stated && foreign.is_none() && !is_spoilt) {
        let far = unit.joints_in_another_unit();
        if let Some(wrong) = &unit.wrong_mass {
            findings.push(wrong_mass(wrong, robot.model()));
        } else if !far.is_empty() {
            findings.push(torque_unit(unit, &far, robot.model(), &joints, keys));
        }
    }
    // The runs of an iteration are no logs of its study: whether the held-out ones are predicted is judged there.
    let payloads = diagnosis.unmodelled_payloads.iter().filter(|payload| payload.log < study.log.len());
    findings.extend(payloads.map(|payload| unmodelled_payload(study, robot, payload)));
    let held_out = diagnosis.held_out.iter().filter(|found| found.log < study.log.len());
    findings.extend(held_out.map(|found| of_held_out_log(study, robot, found, &joints)));
    if findings.is_empty() {
        findings.extend(diagnosis.inconsistent_torques.iter().map(|torque| inconsistent_torque(torque, &joints)));
    }
    if findings.is_empty() && diagnosis.is_unexplained() {
        let left = &search.as_written.left;
        let worst = (0..left.len()).max_by(|&a, &b| left[a].total_cmp(&left[b])).unwrap_or(0);
        findings.push(finding(
            "description",
            "the description is not this robot's, or several mistakes were made at once".to_owned(),
            format!(
                "none of {} readings of the logs (signs, orders, zeros, mounting) makes a robot of this description that explains them: {:.0} % of the torque of `{}` is left; \
                 check link lengths, axes and the kind of the robot",
                search.tried,
                100.0 * left[worst],
                joints[worst]
            ),
        ));
    }
    if findings.is_empty() && search.believed().left_of_all > NOTHING_EXPLAINED {
        findings.push(finding(
            "torque",
            "the torques have nothing to do with the motion".to_owned(),
            format!(
                "the best of {} readings of the logs leaves {:.0} % of all torque: compare `columns` under torque and position with the log's \
                 header, and whether both are of one run; commanded positions, or positions that are held for many rows, are no measured ones",
                search.tried,
                100.0 * search.believed().left_of_all
            ),
        ));
    }
    StudyCheck {
        findings,
        as_written: Some(hypothesis_result(&search.as_written, &joints)),
        best: best.map(|best| hypothesis_result(best, &joints)),
        joints,
        tried: search.tried,
    }
}

/// Torques of another size than the description's bodies make: another unit of theirs, or of the masses.
fn torque_unit(
    fit: &DescriptionFit,
    far: &[usize],
    model: &Model,
    joints: &[String],
    keys: Option<&StudyKeys>,
) -> CheckFinding {
    let factors = far.iter().map(|&joint| format!("{} {:.3}", joints[joint], fit.scale[joint].unwrap_or(1.0)));
    let factors = factors.collect::<Vec<_>>().join(", ");
    let common = fit.common_unit();
    // Where the description is absurd by itself it is not the torques' unit.
    let audited = audit(model);
    let of_inertia = |found: &&AuditFinding| found.check == "inertia-too-large";
    let most_have_it = 2 * audited.iter().filter(of_inertia).count() > model.bodies().len();
    let absurd = audited.iter().find(|found| ["mass-absurd", "length-unit"].contains(&found.check));
    let absurd = absurd.or_else(|| audited.iter().find(of_inertia).filter(|_| most_have_it));
    if let Some(absurd) = absurd {
        return finding(
            "description",
            format!("the description is in other units: {} {}", absurd.place, absurd.message),
            format!(
                "its bodies would need other torques than the log has, times {factors}: `dynident inspect` says more; where the \
                 description is right the torque is not in Nm (N)"
            ),
        );
    }
    let scales = || far.iter().filter_map(|&joint| fit.scale[joint]);
    let (least, most) = (scales().fold(f64::INFINITY, f64::min), scales().fold(0.0, f64::max));
    // One joint of several may have a body that is described badly.
    let is_alone = far.len() == 1 && joints.len() > 1;
    if is_alone || (common.is_none() && most > MOST_SPREAD * least) {
        return finding(
            "description",
            "the description's masses are not this robot's, or the torques of some joints are in another unit"
                .to_owned(),
            format!(
                "its bodies, friction aside, would need other torques than the log has, times {factors}: {}; compare the \
                 masses of the bodies beyond these joints with the maker's data (`dynident inspect`), and the units of \
                 their columns",
                if is_alone {
                    "one joint, which says nothing of the others' unit"
                } else {
                    "too far apart for one unit or for the currents of drives"
                }
            ),
        );
    }
    let mut found = finding(
        "unit",
        common.map_or_else(|| "the torque is not in Nm (N)".to_owned(), |(name, _)| format!("the torque is in {name}")),
        format!(
            "by the description's bodies, friction aside, a unit of it is worth this many Nm (N): {factors}; for currents that is \
             motor constant times gear ratio, which the maker's data say better, or write `gains = \"unknown\"` under [estimator] and \
             add a log with a known payload"
        ),
    );
    let of_joints = |scale: &[Option<f64>]| keys.map(|keys| StudyChange::from(keys.torque_scale(scale)));
    match common {
        Some((_, unit)) => {
            found.write.extend(keys.map(|keys| keys.torque_unit(unit).into()));
            let other = of_joints(&fit.scale).map(|change| format!("currents ({} {})", change.place(), change.line));
            found.or.extend(other);
        }
        None => found.write.extend(of_joints(&fit.scale)),
    }
    found
}

/// One body of the description is far too heavy or too light: no fit of base parameters suffers, but the nominal ones.
fn wrong_mass(wrong: &WrongMass, model: &Model) -> CheckFinding {
    let name = model.bodies()[wrong.body].name();
    let mass_kg = model.inertials()[wrong.body].mass_kg();
    let found = finding(
        "description",
        format!("the description's mass of `{name}` is not this robot's"),
        format!(
            "with {:.4} kg in place of {mass_kg:.4} (times {:.3}, its inertia as well) its bodies leave {:.0} % of the torques, friction \
             aside, where no units of the torques explain more; correct the description: `dynident inspect` looks at it, too",
            wrong.factor * mass_kg,
            wrong.factor,
            100.0 * wrong.left
        ),
    );
    CheckFinding { level: Level::Warning, ..found }
}

/// What the study alone says of units.
pub(super) fn currents_without_scale(study: &Study, settings: &IdentificationSettings) -> Option<CheckFinding> {
    let index = *study.logs_of_role(Role::Identify).first()?;
    let torque = study.format_of(index).torque;
    let units = match torque.unit.as_ref()? {
        OneOrMany::One(unit) => vec![unit.clone()],
        OneOrMany::Many(units) => units.clone(),
    };
    let odd = units.into_iter().find(|unit| matches!(unit.as_str(), "A" | "mA" | "%" | "raw"))?;
    let is_told = torque.scale.is_some() || torque.matrix.is_some() || torque.inverse_matrix.is_some();
    if is_told || settings.gains == GainChoice::Unknown {
        return None;
    }
    let mut found = finding(
        "unit",
        format!("the torque columns are in {odd} and no `scale` says what that is in Nm (N)"),
        "every mass would come out in units of the motor constant".to_owned(),
    );
    let line = "scale = [...]   # motor constant times gear ratio, Nm per unit, one for each joint".to_owned();
    found.write.push(StudyChange { table: "format.torque".to_owned(), line });
    Some(found)
}

/// Columns that are not what the study states: with these, no hypothesis about the others means much.
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
            format!("{what} one and the same column"),
            "sample by sample one is a multiple of the other, and no robot explains both: compare `columns` with the log's header".to_owned(),
        )
    };
    let mut found: Vec<CheckFinding> = diagnosis.duplicate_channels.iter().map(same).collect();
    if found.is_empty() && diagnosis.lost_signs {
        found.push(finding(
            "sign",
            "the torques are magnitudes: their signs are lost".to_owned(),
            "no joint's torque is ever negative though all joints turn to and fro, and no robot explains them: log currents or torques with their signs".to_owned(),
        ));
    }
    found
}

/// A mistake of one held-out log that the training logs do not have.
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
            "the training logs' parameters leave {:.3} Nm of its torque as the study is written and {:.3} Nm so corrected; the training logs have no such mistake",
            left_as_written, left_without
        ),
    );
    found.write = changes(mistake, Some(&keys));
    found.or = alike.iter().map(|other| alternative(other, joints, Some(&keys))).collect();
    found
}

/// The description's bodies explain no joint, and other bodies do.
fn another_robot(fit: &DescriptionFit, joints: &[String]) -> CheckFinding {
    let best = fit.best_explained().map_or_else(String::new, |(joint, share)| {
        format!("{:.0} % of that of `{}`, which is the most of all joints", 100.0 * share, joints[joint])
    });
    finding(
        "description",
        "the description is of another robot, or its masses are placeholders".to_owned(),
        format!(
            "friction and drive inertia aside, its bodies, scaled as suits each joint, explain {best}, where bodies that could be explain nearly all of it: \
             compare `file` under [robot] with the robot; where nobody knows a body, leave its <inertial> element out"
        ),
    )
}

/// A torque that the robot which explains the others does not explain.
fn inconsistent_torque(torque: &InconsistentTorque, joints: &[String]) -> CheckFinding {
    let name = &joints[torque.joint];
    if torque.is_motionless() {
        return finding(
            "torque",
            format!("the torque of joint `{name}` has nothing to do with its motion"),
            format!(
                "parameters of its own leave {:.0} % of it, and where the other joints' bodies should be felt it says nothing: \
                 compare `columns` under torque with the log's header, and whether the channel lives",
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
        format!("the torque of joint `{name}` does not belong to one robot with that of the others"),
        format!(
            "one robot for all joints leaves {:.1} % of it, parameters of its own {:.1} %{}: {:.1} times as much, where logs that \
             fit together have at most 2.3; compare whether all its columns are of one clock and one run, its gain, and the \
             lengths and axes of the description",
            100.0 * torque.left,
            100.0 * torque.alone,
            noise,
            torque.times()
        ),
    );
    CheckFinding { level: if torque.is_foreign() { Level::Problem } else { Level::Warning }, ..found }
}

fn behind_limit(beyond: &BeyondLimit, joints: &[String]) -> CheckFinding {
    let what = format!("the {} of joint `{}` goes beyond its limit", beyond.quantity, joints[beyond.joint]);
    let evidence = format!(
        "it reaches {:.4} where the description allows {:.4}: compare `unit`, `scale` (gear ratio: positions of the motor side?), `sign` and `offset` under position, \
         or the limits of the description",
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
            "with {:.2} ± {:.2} kg at [{x:.3}, {y:.3}, {z:.3}] m of `{link}` what is left of its torque falls from {:.3} to {:.3} Nm",
            payload.mass_kg.abs(),
            1.96 * payload.mass_std_kg,
            payload.left_without,
            payload.left_with
        ),
    );
    let section = StudyChange { table: "[[payload]]".to_owned(), line: format!("name = \"tool\", link = {link:?}") };
    let number = if payload.mass_kg > 0.0 {
        payload.log
    } else {
        study.logs_of_role(Role::Identify).first().copied().unwrap_or(0)
    };
    found.write = vec![
        section,
        StudyChange { table: format!("[[log]] number {}", number + 1), line: "payload = \"tool\"".to_owned() },
    ];
    found
}

fn hypothesis_result(hypothesis: &Hypothesis, joints: &[String]) -> ReadingResult {
    let beyond = |beyond: &BeyondLimit| format!("{} of {}", beyond.quantity, joints[beyond.joint]);
    ReadingResult {
        left_percent: hypothesis.left.iter().map(|left| 100.0 * left).collect(),
        beyond_limits: hypothesis.beyond.iter().map(beyond).collect(),
        score: hypothesis.score(),
    }
}
