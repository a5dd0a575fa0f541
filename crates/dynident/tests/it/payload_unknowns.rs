//! A payload beside much that is unknown too: friction that the logs choose, gains, a lag of the torque.
use crate::common::{Job, Motion, Random, format, header, repository};
use dynident::IdentificationOutcome;
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::identification::examination::LagKind;
use dynident::identification::payload::Measured;
use dynident::model::{InertialParameters, Mat3, Model, Vec3, load_robot};
use dynident::study::FrictionTerm;
use std::fmt::Write;
use std::path::Path;

const MASS_KG: f64 = 2.0;
/// In the plane of the arm, from the wrist.
const COM_M: [f64; 2] = [0.21, 0.04];
const WEIGHT: &str = "{ name = \"weight\", link = \"hand\", mass_kg = 3.0, com_m = [0.25, 0.0, 0.0], inertia_at_com_kgm2 = [0.01, 0.0, 0.0, 0.01, 0.0, 0.01] }";
/// Velocity of the shoulder's Stribeck curve, rad/s: between 0.05 and 0.1 of the grid.
const STRIBECK_SPEED: f64 = 0.08;
const WIDTH: f64 = 0.02;
/// Standard deviation of the torque's noise, Nm, with a lag-1 correlation of 0.8.
const NOISE_NM: f64 = 0.1;
const GAINS: [f64; 3] = [11.0, 6.5, -3.2];
const RATE_HZ: f64 = 200.0;

/// What logs are made with.
#[derive(Clone, Copy)]
struct Making {
    gains: [f64; 3],
    lag_s: f64,
    seconds: f64,
}

fn planar() -> std::path::PathBuf {
    repository("examples/robots/planar_3r.toml")
}

/// The arm with a body in its hand.
fn arm(carried: Option<(f64, [f64; 2])>) -> Model {
    let model = load_robot(&planar()).unwrap().model;
    let Some((mass, [x, y])) = carried else { return model };
    let inertia = Mat3([[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]);
    let body = InertialParameters::from_centre_of_mass(mass, Vec3([x, y, 0.0]), &inertia);
    let mut inertials = model.inertials().to_vec();
    inertials[2] = inertials[2].plus(&body);
    model.with_inertials(&inertials).unwrap()
}

/// Friction: a Stribeck curve at the shoulder, another step forwards than backwards at the elbow, a plain one at the
/// wrist.
fn friction(joint: usize, dq: f64) -> f64 {
    let step = (dq / WIDTH).tanh();
    match joint {
        0 => 2.0 * dq + (3.0 + 3.0 * (-(dq / STRIBECK_SPEED).powi(2)).exp()) * step,
        1 => 1.2 * dq + if dq > 0.0 { 3.0 } else { 1.5 } * step,
        _ => 0.5 * dq + 0.8 * step,
    }
}

fn write_log(path: &Path, model: &Model, motion: &Motion, making: Making, random: &mut Random) {
    let mut workspace = Workspace::new(model);
    let (mut text, mut error) = (format!("{}\n", header(3)), [0.0; 3]);
    for k in 0..(RATE_HZ * making.seconds) as usize {
        let t = k as f64 / RATE_HZ;
        let [q, dq, ddq] = motion.at(t - making.lag_s);
        let mut tau = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq).to_vec();
        write!(text, "{t}").unwrap();
        for q in &motion.at(t)[0] {
            write!(text, ",{q}").unwrap();
        }
        for joint in 0..3 {
            error[joint] = 0.8 * error[joint] + 0.6 * NOISE_NM * random.normal();
            tau[joint] += friction(joint, dq[joint]) + error[joint];
            write!(text, ",{}", tau[joint] / making.gains[joint]).unwrap();
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

/// Logs of the arm alone, with the known weight, and with the box.
fn write_logs(folder: &Path, making: Making, seed: u64) {
    let random = &mut Random(1000 + seed);
    let carried = [("empty", None), ("weight", Some((3.0, [0.25, 0.0]))), ("box", Some((MASS_KG, COM_M)))];
    for (number, (name, body)) in carried.into_iter().enumerate() {
        let motion = Motion::new(3, 10 * seed + number as u64);
        write_log(&folder.join(format!("{name}.csv")), &arm(body), &motion, making, random);
    }
}

fn study(logs: &[&str], more: &str) -> String {
    let log = |name: &&str| match *name {
        "empty" => "{ file = \"empty.csv\" }".to_owned(),
        name => format!("{{ file = \"{name}.csv\", payload = {name:?} }}"),
    };
    let logs: Vec<String> = logs.iter().map(log).collect();
    format!(
        "robot.file = {:?}\npayload = [{{ name = \"box\", link = \"hand\" }}, {WEIGHT}]\nlog = [{}]\nestimator.physical = false\n{more}\n{}",
        planar().display().to_string(),
        logs.join(", "),
        format(3)
    )
}

/// Mass, m c_x, m c_y by the payload's columns, each with whether its interval holds the truth.
fn held(found: &IdentificationOutcome) -> [bool; 3] {
    let payload = &found.result.payloads[0];
    let truth = [MASS_KG, MASS_KG * COM_M[0], MASS_KG * COM_M[1]];
    core::array::from_fn(|k| {
        let parameter = &payload.parameters[k];
        println!(
            "   {} {:.4} ± {:.4} ({:.4})",
            parameter.expression, parameter.value, parameter.half_width_95, truth[k]
        );
        (parameter.value - truth[k]).abs() <= parameter.half_width_95
    })
}

#[test]
fn explore() {
    let folder = tempfile::tempdir().unwrap();
    let ones = [1.0; 3];
    for (name, gains, lag_s, logs, more) in [
        ("stated", ones, 0.0, &["empty", "box"][..], "drive.friction = \"stated\""),
        ("auto", ones, 0.0, &["empty", "box"], "drive.friction = \"auto\""),
        ("auto lag", ones, 0.004, &["empty", "box"], "drive.friction = \"auto\""),
        ("gains auto", GAINS, 0.0, &["empty", "weight", "box"], "drive.friction = \"auto\"\ndrive.gains = \"unknown\""),
        (
            "gains auto lag",
            GAINS,
            0.004,
            &["empty", "weight", "box"],
            "drive.friction = \"auto\"\ndrive.gains = \"unknown\"",
        ),
    ] {
        for seed in 1..4 {
            write_logs(folder.path(), Making { gains, lag_s, seconds: 30.0 }, seed);
            let start = std::time::Instant::now();
            let found = Job::new(folder.path(), &study(logs, more)).identify();
            println!("{name} {seed}: {:?} {:?}", held(&found), start.elapsed());
            println!("   {:?}", found.result.friction_choice.iter().map(|one| &one.chosen[..]).collect::<Vec<_>>());
            println!("   lag {:?}", found.result.method.torque_lag.sentence());
            for gain in found.result.drive_gains.iter().flatten() {
                println!("   gain {:.4} ± {:.4} {}", gain.gain, gain.half_width_95, gain.identified);
            }
        }
    }
}
