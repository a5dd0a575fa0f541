//! A crane with its own friction and noise, not a scaled log.

use super::{AS_IT_IS, Scale};
use crate::common::{Job, Motion, Random, Truth, header, repository, write_log};
use std::path::Path;

/// Mass and friction relative to an arm.
const THOUSANDFOLD: f64 = 1e3;

const RATE_HZ: f64 = 250.0;
const SECONDS: f64 = 16.0;

/// Noise as in real logs: encoders with 2¹⁷ counts per turn, torque noise of 1 to 2 % of the root mean square, which is
/// about 20 kNm at the shoulder and 100 Nm at the wrist.
const COUNT_RAD: f64 = core::f64::consts::TAU / 131_072.0;
const TORQUE_NOISE: [f64; 6] = [300.0, 300.0, 150.0, 20.0, 10.0, 5.0];

fn recorded(folder: &Path, name: &str, truth: &Truth, seed: u64) {
    let mut random = Random(seed);
    let noisy = |q: &[f64], tau: &[f64]| {
        let counts = q.iter().map(|q| (q / COUNT_RAD).round() * COUNT_RAD);
        let noise = tau.iter().zip(TORQUE_NOISE).map(|(tau, noise)| tau + noise * random.normal());
        counts.chain(noise).collect()
    };
    write_log(&folder.join(name), truth, &Motion::new(6, seed), (RATE_HZ, SECONDS), &header(6), noisy);
}

/// At this scale the exported model once had 32.7 % error and the estimate 0.95 %. The limit is 2 % of the error.
#[test]
fn the_exported_model_of_a_crane_is_as_good_as_the_free_fit() {
    let folder = tempfile::tempdir().unwrap();
    let description = folder.path().join("crane.urdf");
    let arm = std::fs::read_to_string(repository("robots/ur10.urdf")).unwrap();
    std::fs::write(&description, Scale { mass: THOUSANDFOLD, ..AS_IT_IS }.urdf(&arm)).unwrap();
    let mut truth = Truth::other(&description, &mut Random(11));
    for drive in &mut truth.drive {
        *drive = drive.map(|of_an_arm| THOUSANDFOLD * of_an_arm);
    }
    truth.drive[0][1] = 2000.0;
    recorded(folder.path(), "train.csv", &truth, 1);
    recorded(folder.path(), "test.csv", &truth, 2);
    let study = r#"
        robot.file = "crane.urdf"
        [format]
        time = { column = "t" }
        position = { columns = "q{1..6}" }
        torque = { columns = "tau{1..6}" }
        [[log]]
        file = "train.csv"
        [[log]]
        file = "test.csv"
        role = "validate"
    "#;
    let found = Job::new(folder.path(), study).identify();
    let held_out = &found.result.validation[0];
    let error = |report: &dynident::estimation::ValidationReport| report.relative_error_percent.unwrap();
    let (free, exported) = (error(&held_out.model), error(held_out.physical.as_ref().unwrap()));
    assert!(exported <= 1.02 * free, "{exported} % where the free fit has {free} %");
    // Both are good: the noise alone is 1 to 2 %.
    assert!(free < 5.0, "{free} %");
}
