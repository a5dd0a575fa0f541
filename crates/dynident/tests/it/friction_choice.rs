//! Selection of friction by cross-validation, for a two-joint arm with known friction.
use crate::common::{Job, Random};
use dynident::Folders;
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::identification::friction::{FrictionSource, chosen_model};
use dynident::identification::{Execution, Identification, identify};
use dynident::model::load_robot;
use dynident::result::JointFrictionResult;
use dynident::study::FrictionTerm;
use dynident::{IdentificationOutcome, validate};
use std::fmt::Write;
use std::path::Path;

const ARM: &str = r#"<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="3"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.15 0 0.02"/><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/></joint></robot>"#;

/// Torque noise, Nm: 1 % of the friction.
const NOISE: f64 = 0.02;
const STEP: f64 = 0.02;
/// Number of logs for coverage.
const SEEDS: u64 = 10;

/// A log of `rows` rows at 200 Hz; `moving` scales the elbow's motion, `stribeck` is its additional friction near rest
/// with a velocity of 0.08 rad/s.
fn write_log(path: &Path, arm: &Path, rows: usize, moving: f64, stribeck: f64, seed: u64) {
    write_loaded_log(path, arm, rows, seed, moving, stribeck, 0.0);
}

/// The same with dry friction of the shoulder that increases by `load` per unit of gear load.
fn write_loaded_log(path: &Path, arm: &Path, rows: usize, seed: u64, moving: f64, stribeck: f64, load: f64) {
    let model = load_robot(arm).unwrap().model;
    let (mut workspace, mut random) = (Workspace::new(&model), Random(seed));
    let mut text = "t,q1,q2,tau1,tau2\n".to_owned();
    let waves = [[0.9, 1.3, 0.2], [0.5, 0.37, 1.0], [0.7, 1.7, 2.0], [0.4, 0.53, 0.7]];
    for k in 0..rows {
        let t = k as f64 / 200.0;
        let joint = |from: usize, scale: f64| {
            waves[from..from + 2].iter().fold([0.0; 3], |[q, dq, ddq], [a, w, p]| {
                let (s, c) = (w * t + p + 0.1 * seed as f64).sin_cos();
                [q + scale * a * s, dq + scale * a * w * c, ddq - scale * a * w * w * s]
            })
        };
        let [a, b] = [joint(0, 1.0), joint(2, moving)];
        let tau = inverse_dynamics(&model, &mut workspace, &[a[0], b[0]], &[a[1], b[1]], &[a[2], b[2]]).to_vec();
        let shoulder = 1.0 * a[1] + (2.0 + load * tau[0].abs()) * (a[1] / STEP).tanh();
        let near_rest = stribeck * (-(b[1] / 0.08).powi(2)).exp();
        let elbow = 0.8 * b[1] + (1.0 + near_rest) * (b[1] / STEP).tanh();
        let noise = [NOISE * random.normal(), NOISE * random.normal()];
        writeln!(text, "{t},{},{},{},{}", a[0], b[0], tau[0] + shoulder + noise[0], tau[1] + elbow + noise[1]).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

fn job(folder: &Path, drive: &str) -> Job {
    let text = format!(
        "log = [{{ file = \"a.csv\" }}, {{ file = \"b.csv\", role = \"validate\" }}]\n[robot]\nfile = \"arm.urdf\"\n{}\n\
         [parallel_filter]\nenabled = false\n[drive]\n{drive}",
        crate::common::format(2)
    );
    Job::new(folder, &text)
}

fn arm(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("arm.urdf");
    std::fs::write(&path, ARM).unwrap();
    path
}

fn all_finite(found: &IdentificationOutcome) -> bool {
    found.result.base_parameters.iter().all(|p| p.value.is_finite() && p.std.is_finite())
        && found.result.validation.iter().all(|log| log.model.rmse_nm.is_finite())
}

#[test]
fn the_friction_that_was_put_in_is_chosen_and_the_model_can_be_tested_again() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_log(&folder.path().join("a.csv"), &arm, 6000, 1.0, 1.5, 1);
    write_log(&folder.path().join("b.csv"), &arm, 2000, 1.0, 1.5, 2);
    let job = job(folder.path(), "friction = \"auto\"");
    let found = job.identify();
    let [shoulder, elbow] = &found.result.friction_choice[..] else { panic!("two joints") };
    assert_eq!(shoulder.chosen, "viscous + coulomb", "{shoulder:?}");
    assert!(elbow.chosen.contains("stribeck"), "{elbow:?}");
    let terms = elbow.drive.as_ref().unwrap().terms.clone().unwrap();
    // 0.08 lies between 0.05 and 0.1 of the grid: the tolerance of 10 % is far below the grid step and above the noise.
    let near =
        |term: &FrictionTerm| matches!(term, FrictionTerm::Stribeck(own) if (own.speed / 0.08 - 1.0).abs() < 0.1);
    assert!(terms.iter().any(near), "{terms:?}");
    // Noise plus 10 % for inexact constants.
    assert!(found.result.validation[0].model.rmse_nm < 1.1 * NOISE, "{:?}", found.result.validation[0].model);
    let plain = job_with_stated(folder.path()).identify();
    assert!(plain.result.validation[0].model.rmse_nm > 3.0 * NOISE);

    let path = folder.path().join("result.json");
    std::fs::write(&path, serde_json::to_string(&found.result).unwrap()).unwrap();
    let again = validate(&path, &job.study, &job.path, &Job::options(1)).unwrap();
    // Numbers are converted to text and back without loss.
    assert!((again.validation[0].model.rmse_nm - found.result.validation[0].model.rmse_nm).abs() < 1e-12);
    let threads = dynident::identify(&job.study, &job.path, &Job::options(2)).unwrap();
    assert_eq!(threads.estimate.values, found.estimate.values);
}

/// The elbow has Stribeck friction, the shoulder friction under load. Restricted laws give a larger error, which the
/// result states; the elbow is unrestricted if the study names its law.
#[test]
fn restricted_laws_are_obeyed_and_their_cost_is_stated() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_loaded_log(&folder.path().join("a.csv"), &arm, 3000, 1, 1.0, 1.5, 0.3);
    write_loaded_log(&folder.path().join("b.csv"), &arm, 1000, 2, 1.0, 1.5, 0.3);
    let free = job(folder.path(), "friction = \"auto\"").identify().result;
    assert!(free.friction_choice[0].chosen.contains("load"), "{:?}", free.friction_choice[0]);
    assert!(free.friction_choice.iter().all(|joint| joint.unrestricted.is_none()));
    for (keys, of_elbow) in [("exportable = \"urdf\"", None), ("candidates = [\"stribeck\"]", Some("stribeck"))] {
        let found = job(folder.path(), keys).identify().result;
        let [shoulder, elbow] = &found.friction_choice[..] else { panic!("two joints") };
        assert_eq!(shoulder.chosen, "viscous + coulomb", "{keys}");
        let cost = shoulder.unrestricted.as_ref().unwrap();
        assert!(cost.chosen.contains("load") && cost.restricted_cv_error_nm > 1.5 * cost.cv_error_nm, "{cost:?}");
        assert!(shoulder.restriction().unwrap().contains("which the study excludes"));
        assert_eq!(elbow.chosen.contains("stribeck"), of_elbow.is_some(), "{keys}: {}", elbow.chosen);
        assert_eq!(elbow.restriction().is_some(), of_elbow.is_none(), "{keys}: {elbow:?}");
    }
    for (bad, message) in [
        ("candidates = [\"dahl\"]", "drive.candidates: unknown law `dahl`; known: "),
        ("exportable = \"code\"\nfriction = \"stated\"", "it restricts the selection of friction"),
    ] {
        let text = format!("robot.file = \"arm.urdf\"\n[drive]\n{bad}");
        let refused = dynident::Study::parse(&text, Path::new("study.toml")).unwrap_err().to_string();
        assert!(refused.contains(message), "{refused}");
    }
}

/// The difference between the written model and the estimate depends on torque noise only: both have the same selected
/// constants, whose uncertainty is irrelevant here.
#[test]
fn what_is_unknown_of_constants_does_not_blunt_the_test_of_the_written_model() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_log(&folder.path().join("a.csv"), &arm, 6000, 1.0, 1.5, 1);
    write_log(&folder.path().join("b.csv"), &arm, 500, 1.0, 1.5, 2);
    let chosen = job(folder.path(), "friction = \"auto\"").identify();
    let line = |joint: &JointFrictionResult| {
        let drive = toml::Value::try_from(joint.drive.as_ref().unwrap()).unwrap();
        format!("joints.{} = {drive}\n", joint.joint)
    };
    let lines: String = chosen.result.friction_choice.iter().map(line).collect();
    let stated = job(folder.path(), &lines).identify();
    let [of_chosen, of_stated] =
        [&chosen, &stated].map(|found| found.result.physical.fit.as_ref().unwrap().difference.unwrap().f);
    // The same rows and columns; 5 % for constants that the search left one step from the optimum.
    assert!((of_chosen / of_stated - 1.0).abs() < 0.05, "{of_chosen} and {of_stated}");
}

/// Unstated friction is selected; a key for the step's shape is a statement; if the study rules out a selection, the
/// result has the reason.
#[test]
fn friction_is_chosen_by_default_where_no_key_states_it() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_log(&folder.path().join("a.csv"), &arm, 6000, 1.0, 1.5, 1);
    write_log(&folder.path().join("b.csv"), &arm, 500, 1.0, 1.5, 2);
    let choice = |drive: &str| job(folder.path(), drive).identify().result.friction_choice;
    let by_default = choice("");
    let text = |choice: &_| serde_json::to_string(choice).unwrap();
    assert_eq!(text(&by_default), text(&choice("friction = \"auto\"")));
    assert!(by_default.iter().all(|joint| joint.drive.is_some()), "{by_default:?}");
    assert!(choice("friction = \"stated\"").is_empty() && choice("coulomb_width = 0.03").is_empty());
    let elbow_stated = choice("joints.elbow.viscous = true");
    assert!(elbow_stated.len() == 1 && elbow_stated[0].joint == "shoulder", "{elbow_stated:?}");
    // A single log has no separate offset.
    assert_eq!(text(&by_default), text(&choice("offsets = \"per-log\"")));
    let refused = choice("[estimator.physical]\nlaws = { fv1 = [0.5, 1.5] }");
    assert_eq!(refused.len(), 2);
    assert!(refused.iter().all(|joint| joint.chosen.contains("constrains") && joint.drive.is_none()), "{refused:?}");
}

fn job_with_stated(folder: &Path) -> Job {
    job(folder, "friction = \"stated\"")
}

#[test]
fn a_joint_that_stands_and_a_log_that_is_short_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_log(&folder.path().join("a.csv"), &arm, 3000, 0.0, 0.0, 1);
    write_log(&folder.path().join("b.csv"), &arm, 500, 0.0, 0.0, 2);
    let found = job(folder.path(), "friction = \"auto\"").identify();
    let elbow = &found.result.friction_choice[1];
    assert!(elbow.joint == "elbow" && elbow.chosen.contains("does not move") && elbow.drive.is_none());
    assert!(all_finite(&found));

    write_log(&folder.path().join("a.csv"), &arm, 60, 1.0, 0.0, 1);
    let found = job(folder.path(), "friction = \"auto\"").identify();
    assert!(found.result.friction_choice.iter().all(|joint| joint.chosen.contains("too short")));
    assert!(all_finite(&found));
}

#[test]
fn stated_terms_are_fitted_and_bad_constants_refused() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_log(&folder.path().join("a.csv"), &arm, 3000, 1.0, 1.0, 1);
    write_log(&folder.path().join("b.csv"), &arm, 1000, 1.0, 1.0, 2);
    let terms =
        "laws = [{ law = \"stribeck\", speed = 0.08, exponent = 2.0 }, { law = \"load\" }, { law = \"quadratic\" },
        { law = \"maxwell-slip\", yield_displacements = [0.001, 0.01] }]";
    let job = job(folder.path(), &format!("coulomb_width = {STEP}\n{terms}"));
    let found = job.identify();
    let elbow = &found.result.joints[1].terms;
    let value = |symbol: &str| elbow.iter().find(|term| term.symbol == symbol).unwrap().value;
    // Twenty standard deviations of a fit to 3000 rows, a tenth of which are near rest.
    assert!((value("fs2") - 1.0).abs() < 0.05 && (value("fc2") - 1.0).abs() < 0.05, "{elbow:?}");
    assert!(value("fl2").abs() < 0.05 && value("slip2_0.01").abs() < 0.05, "{elbow:?}");
    assert!(found.result.method.load_parameters.is_some() && all_finite(&found));
    let path = folder.path().join("result.json");
    std::fs::write(&path, serde_json::to_string(&found.result).unwrap()).unwrap();
    let again = validate(&path, &job.study, &job.path, &Job::options(1)).unwrap();
    assert!((again.validation[0].model.rmse_nm - found.result.validation[0].model.rmse_nm).abs() < 1e-12);

    for (bad, word) in [
        ("{ law = \"stribeck\", speed = 0.0, exponent = 2.0 }", "speed"),
        ("{ law = \"stribeck\", speed = nan, exponent = 2.0 }", "speed"),
        ("{ law = \"maxwell-slip\", yield_displacements = [] }", "yield_displacements"),
        ("{ law = \"maxwell-slip\", yield_displacements = [0.1, 0.1] }", "twice"),
        ("{ law = \"sigmoid\", steepness = -1.0 }", "steepness"),
        ("{ law = \"dahl\" }", "dahl"),
    ] {
        let text = format!("robot.file = \"arm.urdf\"\n[drive]\nlaws = [{bad}]");
        let message = dynident::Study::parse(&text, Path::new("study.toml")).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
}

/// Selected constants are unknowns of the fit: their intervals, and those of dependent friction, contain the truth.
#[test]
fn bars_hold_what_is_unknown_of_the_constants() {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    let (mut constants, mut parameters) = (Vec::new(), Vec::new());
    let truth = [("fv1", 1.0), ("fc1", 2.0), ("fv2", 0.8), ("fc2", 1.0)];
    for seed in 1..=SEEDS {
        write_log(&folder.path().join("a.csv"), &arm, 4000, 1.0, 0.0, seed);
        write_log(&folder.path().join("b.csv"), &arm, 500, 1.0, 0.0, 99);
        let found = job(folder.path(), "").identify().result;
        for own in found.friction_choice.iter().flat_map(|joint| &joint.constants) {
            let [from, to] = own.interval_95;
            assert!(from > 0.0 && from <= own.value && own.value <= to, "{own:?}");
            if own.term == "coulomb" {
                constants.push((from..=to).contains(&STEP));
            }
        }
        let of_truth = |(symbol, value): &(&str, f64)| {
            let own = found.base_parameters.iter().find(|own| own.symbol == *symbol)?;
            Some((own.value - value).abs() <= own.half_width_95)
        };
        parameters.extend(truth.iter().filter_map(of_truth));
    }
    // One joint of ten may have directional friction.
    let seeds = SEEDS as usize;
    assert!(constants.len() >= 18 * seeds / 10 && parameters.len() >= 36 * seeds / 10, "{constants:?} {parameters:?}");
    // Of 20 intervals with 95 %, fewer than 16 contain the truth once in 400 times; of 40, fewer than 34 once in 300.
    let share = |held: &[bool]| held.iter().filter(|held| **held).count() as f64 / held.len() as f64;
    assert!(share(&constants) >= 0.8 && share(&parameters) >= 0.85, "{} {}", share(&constants), share(&parameters));
}

/// A fit with friction that was selected earlier from the same logs has the same error bars, because both include the
/// uncertainty of the constants.
#[test]
fn bars_hold_what_is_unknown_of_constants_that_were_chosen_before() {
    bars_with_constants_chosen_before(0.0);
}

/// The constants are estimated with the known load; without it, load-dependent friction would increase their error bars
/// several times.
#[test]
fn bars_hold_no_more_than_that_where_friction_depends_on_the_load() {
    bars_with_constants_chosen_before(0.1);
}

fn bars_with_constants_chosen_before(load: f64) {
    let folder = tempfile::tempdir().unwrap();
    let arm = arm(folder.path());
    write_loaded_log(&folder.path().join("a.csv"), &arm, 2000, 3, 1.0, 0.8, load);
    write_loaded_log(&folder.path().join("b.csv"), &arm, 500, 99, 1.0, 0.8, load);
    let job = job(folder.path(), "");
    let robot = job.robot();
    let mut task = job.study.task(&job.path, &robot, &Folders::new(&job.study, &job.path, None)).unwrap();
    let chosen = identify(&task, Execution::default()).unwrap();
    let joints = &chosen.training.friction_choice;
    assert!(joints.iter().all(|joint| !joint.constants.is_empty()), "{joints:?}");
    assert_eq!(chosen.training.model.needs_load(), load > 0.0, "{joints:?}");

    task.robot = chosen_model(&task.robot, joints).unwrap();
    task.settings.friction = FrictionSource::Stated;
    task.settings.motion = chosen.motion.clone();
    let without = identify(&task, Execution::default()).unwrap();
    task.settings.friction = FrictionSource::SelectedBefore(joints.clone());
    let with = identify(&task, Execution::default()).unwrap();
    let bar = |found: &Identification, symbol: &str| {
        let column = found.training.problem.columns().iter().position(|own| own == symbol).unwrap();
        found.estimate().covariance[(column, column)].sqrt()
    };
    let dry: Vec<String> = with
        .training
        .problem
        .columns()
        .iter()
        .filter(|own| own.starts_with("fc") || own.starts_with("fs"))
        .cloned()
        .collect();
    assert!(dry.len() >= 2, "{:?}", with.training.problem.columns());
    for symbol in &dry {
        let [of_chosen, with, without] = [&chosen, &with, &without].map(|found| bar(found, symbol));
        // The lag and the last step of the constants differ slightly.
        assert!((with / of_chosen - 1.0).abs() < 0.15, "{symbol}: {with} with, {of_chosen} where it was chosen");
        assert!(without < with, "{symbol}: {without} without, {with} with");
    }
    let narrowed = dry.iter().filter(|symbol| bar(&without, symbol) < 0.7 * bar(&with, symbol)).count();
    assert!(narrowed > 0, "no error bar depends on the constants");
}
