//! Verdicts on held-out motion with pauses and another speed: only a wrong model is a problem.

use crate::common::{Job, Motion, Random, Truth, header, plain, repository, write_log};
use dynident::dynamics::Workspace;
use dynident::model::InertialParameters;
use std::fmt::Write;
use std::path::Path;

const NOISE_NM: f64 = 0.05;
/// Peak speed of the training motion, rad/s.
const SPEED: f64 = 1.5;
const SPEEDS: [f64; 3] = [0.5, 1.0, 2.0];

/// Pick-and-place: quintic strokes with the given peak speed between four poses, and pauses of 0.6 s in which any part
/// of the Coulomb friction holds the joints. `gain` scales the logged torque.
fn write_pick_and_place(path: &Path, truth: &Truth, speed: f64, gain: f64, seed: u64) {
    const POSES: [[f64; 2]; 4] = [[0.0, 0.3], [0.9, -0.8], [-0.7, 1.0], [1.2, 0.8]];
    let (rate_hz, pause_s) = (200.0, 0.6);
    let (mut random, mut workspace) = (Random(seed), Workspace::new(&truth.model));
    let mut text = header(2);
    let (mut turn, mut from_s, mut held) = (0, 0.0, [0.0; 2]);
    for k in 0..(rate_hz * 40.0) as usize {
        let t = k as f64 / rate_hz;
        let [here, there] = [POSES[turn % 4], POSES[(turn + 1) % 4]];
        let way: [f64; 2] = core::array::from_fn(|joint| there[joint] - here[joint]);
        // The peak speed of a quintic is 1.875 times its mean.
        let stroke_s = 1.875 * way.iter().fold(0.0_f64, |most, way| most.max(way.abs())) / speed;
        let u = ((t - from_s) / stroke_s).min(1.0);
        let shape = [
            u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u),
            30.0 * (u * (1.0 - u)).powi(2) / stroke_s,
            60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (stroke_s * stroke_s),
        ];
        let [q, dq, ddq] = shape.map(|shape| way.map(|way| way * shape));
        let q: Vec<f64> = q.iter().zip(here).map(|(q, here)| here + q).collect();
        let mut tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        if u >= 1.0 {
            tau.iter_mut().zip(held).for_each(|(tau, held)| *tau += held);
        } else {
            held = core::array::from_fn(|joint| truth.drive[joint][2] * random.next());
        }
        if t - from_s >= stroke_s + pause_s {
            (turn, from_s) = (turn + 1, t);
        }
        let tau: Vec<f64> = tau.iter().map(|tau| gain * tau + NOISE_NM * random.normal()).collect();
        write!(text, "\n{t}").unwrap();
        for value in plain(&q, &tau) {
            write!(text, ",{value}").unwrap();
        }
    }
    std::fs::write(path, text + "\n").unwrap();
}

/// Problems of a fit to a smooth motion of `training`, by held-out log: each tested robot with its torque gain, at
/// every speed.
fn problems(training: &Truth, tested: &[(&str, &Truth, f64)]) -> Vec<(String, Vec<String>)> {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(3);
    let motion = Motion::within(&training.model, SPEED, 1);
    write_log(&folder.path().join("training.csv"), training, &motion, (200.0, 40.0), &header(2), |q, tau| {
        let noisy: Vec<f64> = tau.iter().map(|tau| tau + NOISE_NM * random.normal()).collect();
        plain(q, &noisy)
    });
    let mut logs = Vec::new();
    for (name, truth, gain) in tested {
        for speed in SPEEDS {
            let file = format!("{name}_{speed}.csv");
            write_pick_and_place(&folder.path().join(&file), truth, speed * SPEED, *gain, 1 + logs.len() as u64);
            logs.push(file);
        }
    }
    let entry = |file: &String| format!(", {{ file = {file:?}, role = \"validate\" }}");
    let list = logs.iter().map(entry).collect::<Vec<_>>().concat();
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"training.csv\" }}{list}]\n\
         [format]\ntime = {{ column = \"t\" }}\nposition = {{ columns = \"q{{1..2}}\" }}\n\
         torque = {{ columns = \"tau{{1..2}}\" }}",
        repository("robots/planar2r.urdf").display().to_string(),
    );
    let found = Job::new(folder.path(), &text).identify().result;
    let named = |file: &str| file.trim_end_matches(".csv").to_owned();
    let about = |file: &str| {
        let place = format!("log `{}`", named(file));
        found.problems.iter().filter(|problem| problem.contains(&place)).cloned().collect()
    };
    logs.iter().map(|file| (named(file), about(file))).collect()
}

/// Half of the mass of the second body.
fn lighter(truth: &Truth) -> Truth {
    let mut bodies: Vec<InertialParameters> = truth.model.inertials().to_vec();
    if let Some(last) = bodies.last_mut() {
        *last = InertialParameters(last.0.map(|value| 0.5 * value));
    }
    Truth { model: truth.model.with_inertials(&bodies).unwrap(), drive: truth.drive.clone() }
}

#[test]
fn pick_and_place_contradicts_only_a_wrong_model() {
    let truth = Truth::near(&repository("robots/planar2r.urdf"), 0.05, false);
    let light = lighter(&truth);
    let found = problems(&truth, &[("correct", &truth, 1.0), ("half", &light, 1.0), ("gain", &truth, 0.8)]);
    for (log, problems) in found {
        assert_eq!(problems.is_empty(), log.starts_with("correct"), "{log}: {problems:?}");
    }
}

/// A model without Coulomb friction, from a robot without it.
#[test]
fn pick_and_place_contradicts_a_missing_friction_law() {
    let truth = Truth::near(&repository("robots/planar2r.urdf"), 0.05, false);
    let mut smooth = truth.clone();
    smooth.drive.iter_mut().for_each(|drive| drive[2] = 0.0);
    for (log, problems) in problems(&smooth, &[("correct", &smooth, 1.0), ("dry", &truth, 1.0)]) {
        assert_eq!(problems.is_empty(), log.starts_with("correct"), "{log}: {problems:?}");
    }
}
