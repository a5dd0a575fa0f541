//! What changed between two results: nothing, a load, friction; and what differs from the robot description.

use crate::common::{Job, Motion, Random, Truth, format, header, plain, repository, write_log};
use dynident::model::{InertialParameters, Mat3, Vec3};
use dynident::result::{ChangesFrom, ComparisonFile};
use dynident::{ResultFile, compare, comparison_page, explanation_words};
use std::path::PathBuf;

const NOISE_NM: f64 = 0.2;

const ROBOT: &str = "robots/ur10.urdf";

/// A load of 1 kg on the forearm.
const LOADED_BODY: usize = 2;
const LOAD_KG: f64 = 1.0;
const LOAD_AT_M: [f64; 3] = [0.1, -0.05, 0.08];

/// A robot equal to its description, with friction.
fn bare() -> Truth {
    Truth::near(&repository(ROBOT), 0.0, false)
}

fn loaded() -> Truth {
    let mut truth = bare();
    let mut bodies = truth.model.inertials().to_vec();
    let inertia = Mat3::IDENTITY.scale(LOAD_KG * 0.05 * 0.05);
    let load = InertialParameters::from_centre_of_mass(LOAD_KG, Vec3(LOAD_AT_M), &inertia);
    bodies[LOADED_BODY] = bodies[LOADED_BODY].plus(&load);
    truth.model = truth.model.with_inertials(&bodies).unwrap();
    truth
}

fn identified(truth: &Truth, seed: u64) -> (ResultFile, PathBuf) {
    identified_with(truth, seed, "")
}

/// With further drive terms.
fn identified_with(truth: &Truth, seed: u64, terms: &str) -> (ResultFile, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let dof = truth.model.dof();
    for (file, seed) in [("log.csv", seed), ("other.csv", seed + 1)] {
        let mut random = Random(seed);
        let motion = Motion::within(&truth.model, 1.5, seed);
        write_log(&folder.path().join(file), truth, &motion, (100.0, 30.0), &header(dof), |q, tau| {
            let noisy: Vec<f64> = tau.iter().map(|tau| tau + NOISE_NM * random.normal()).collect();
            plain(q, &noisy)
        });
    }
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}, {{ file = \"other.csv\", role = \"validate\" }}]\n\
         drive = {{ friction = \"stated\", viscous = true, coulomb = \"smooth\", offset = true{terms} }}\n{}",
        repository(ROBOT).display().to_string(),
        format(dof)
    );
    (Job::new(folder.path(), &text).identify().result, PathBuf::from(format!("result_{seed}.json")))
}

fn best(found: &ComparisonFile) -> (&ChangesFrom, String) {
    let changes = &found.changes[0];
    (changes, explanation_words(&changes.explanations[0]))
}

#[test]
fn a_load_is_named_and_nothing_else_is() {
    let (monday, friday, tool) = (identified(&bare(), 1), identified(&bare(), 11), identified(&loaded(), 21));

    let same = compare(&[monday.clone(), friday.clone()]).unwrap();
    let (changes, words) = best(&same);
    assert_eq!(words, "nothing changed", "{changes:?}");
    assert!(changes.p_value > 1e-3, "{changes:?}");

    let body = monday.0.bodies[LOADED_BODY].name.clone();
    for (results, from) in [(vec![monday.clone(), tool.clone()], Some(0)), (vec![tool.clone()], None)] {
        let found = compare(&results).unwrap();
        let (changes, words) = best(&found);
        assert_eq!(changes.from, from);
        let best = &changes.explanations[0];
        assert!(best.probability > 0.5 && best.parts.len() == 1, "{changes:?}");
        let part = &best.parts[0];
        assert!(part.part == format!("body `{body}`") && words.contains(&body), "{words}");
        let (mass, bar) = part.mass_kg.zip(part.half_width_95_kg).unwrap();
        // Three standard deviations, and within 5 % for a load that moves the torque this much.
        assert!((mass - LOAD_KG).abs() <= 1.5 * bar && (mass - LOAD_KG).abs() <= 0.05, "{part:?}");
        let centre = part.centre_m.unwrap();
        assert!((0..3).all(|axis| (centre[axis] - LOAD_AT_M[axis]).abs() < 0.02), "{part:?}");
        let page = comparison_page(&found, None).unwrap();
        assert!(page.contains(&body) && page.contains("What changed from"));
    }
}

#[test]
fn a_joint_with_other_friction_is_named() {
    let mut worn = bare();
    worn.drive[3][1] *= 2.0;
    worn.drive[3][2] *= 2.0;
    let found = compare(&[identified(&bare(), 1), identified(&worn, 31)]).unwrap();
    let (changes, words) = best(&found);
    let joint = &found.friction[3].joint;
    assert_eq!(words, format!("friction and offset of joint `{joint}`"), "{changes:?}");
}

/// Torque does not distinguish the drive inertia of the first joint from the inertia of the first link.
#[test]
fn the_drive_of_the_first_joint_is_listed_beside_the_first_link() {
    let geared = Truth::near(&repository(ROBOT), 0.0, true);
    let mut heavier = geared.clone();
    heavier.drive[0][0] *= 2.0;
    let with_inertia = ", drive_inertia = true";
    let results = [identified_with(&geared, 1, with_inertia), identified_with(&heavier, 41, with_inertia)];
    let found = compare(&results).unwrap();
    let changes = &found.changes[0];
    let name = format!("drive inertia of joint `{}`", found.friction[0].joint);
    let drive = changes.explanations.iter().find(|own| own.parts.len() == 1 && own.parts[0].part == name);
    let drive = drive.unwrap_or_else(|| panic!("{changes:?}"));
    assert!(drive.probability > 0.05 * changes.explanations[0].probability, "{changes:?}");
}

/// No single body is named if all bodies of another robot of this type differ.
#[test]
fn bodies_that_all_differ_are_not_named() {
    for seed in [51, 61] {
        let mut other = bare();
        let mut random = Random(seed);
        let bodies: Vec<_> = other
            .model
            .inertials()
            .iter()
            .map(|body| {
                let factor = 1.0 + 0.2 * random.next();
                InertialParameters(body.0.map(|value| factor * value))
            })
            .collect();
        other.model = other.model.with_inertials(&bodies).unwrap();
        let found = compare(&[identified(&bare(), 1), identified(&other, seed)]).unwrap();
        let (changes, _) = best(&found);
        assert!(changes.explanations[0].everything, "{changes:?}");
    }
}

#[test]
fn other_robots_are_refused() {
    let arm = identified(&bare(), 1);
    let mut other = arm.clone();
    other.0.robot.joints[0] = "elbow".into();
    let message = compare(&[arm, other]).unwrap_err().to_string();
    assert!(message.contains("one type of robot"), "{message}");
}
