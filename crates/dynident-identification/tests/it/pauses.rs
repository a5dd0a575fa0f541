//! Held-out motion with pauses and another speed, for a correct model.

use dynident_dynamics::{BatchWorkspace, ParametricModel, inverse_dynamics_batch};
use dynident_identification::{DiagnosisChoice, Execution, IdentificationTask, Recording, identify};
use dynident_model::Model;
use dynident_model::sample::Random;
use dynident_model::terms::{CoulombShape, DriveChoice, JointMotion, terms_per_joint};
use dynident_recording::{JointSamples, Log};
use std::f64::consts::TAU;

const RATE_HZ: f64 = 200.0;
const WIDTH: f64 = 0.015;
const NOISE_NM: f64 = 0.02;
/// Viscous (Nm s/rad) and Coulomb friction (Nm) of each joint.
const FRICTION: [[f64; 2]; 2] = [[1.0, 2.0], [0.4, 0.8]];

/// Positions, velocities and accelerations of both joints at a time, and the share of the Coulomb friction that holds
/// them.
type Instant = [[f64; 2]; 4];

fn log(name: &str, model: &Model, seconds: f64, random: &mut Random, at: impl Fn(f64) -> Instant) -> Log {
    let samples = (RATE_HZ * seconds) as usize;
    let instants: Vec<Instant> = (0..samples).map(|sample| at(sample as f64 / RATE_HZ)).collect();
    let column = |order: usize| -> Vec<f64> {
        (0..2).flat_map(|joint| instants.iter().map(move |instant| instant[order][joint])).collect()
    };
    let [q, dq, ddq, held] = [0, 1, 2, 3].map(column);
    let mut tau = vec![0.0; q.len()];
    let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
    inverse_dynamics_batch(model, &mut BatchWorkspace::new(model), &motion, &mut tau);
    for (place, tau) in tau.iter_mut().enumerate() {
        let [viscous, coulomb] = FRICTION[place / samples];
        *tau += viscous * dq[place] + coulomb * ((dq[place] / WIDTH).tanh() + held[place]) + NOISE_NM * random.normal();
    }
    let columns = |values: &[f64]| values.chunks(samples).map(<[f64]>::to_vec).collect();
    let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    JointSamples::at_rate(RATE_HZ, columns(&q), columns(&tau)).into_log(name, &names).unwrap()
}

/// Five harmonics of 0.1 Hz with peak velocities of about 1 rad/s.
fn training(t: f64) -> Instant {
    let mut found = [[0.0; 2]; 4];
    for k in 1..=5 {
        let w = f64::from(k) * TAU / 10.0;
        for joint in 0..2 {
            let (sin, cos) = (w * t + f64::from(k * k) * (1.0 + 1.7 * joint as f64)).sin_cos();
            found[0][joint] += 0.3 / w * sin;
            found[1][joint] += 0.3 * cos;
            found[2][joint] -= 0.3 * w * sin;
        }
    }
    found
}

/// Strokes of 0.8 s and 1 rad, each with a pause of 0.6 s in which a share of the Coulomb friction holds the joints.
fn pick_and_place(t: f64) -> Instant {
    let (stroke_s, turn_s) = (0.8, 1.4);
    let (turn, u) = ((t / turn_s).floor(), (t % turn_s / stroke_s).min(1.0));
    let direction = if turn % 2.0 == 0.0 { 1.0 } else { -1.0 };
    let from = if direction > 0.0 { 0.0 } else { 1.0 };
    let q = from + direction * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    let dq = direction * 30.0 * u * u * (1.0 - u) * (1.0 - u) / stroke_s;
    let ddq = direction * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (stroke_s * stroke_s);
    let held = |joint: f64| if u < 1.0 { 0.0 } else { (12.3 * turn + 2.0 * joint).sin() };
    [[q, -q], [dq, -dq], [ddq, -ddq], [held(0.0), held(1.0)]]
}

#[test]
fn pauses_and_fast_strokes_do_not_contradict_a_correct_model() {
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/planar2r.urdf");
    let model = dynident_model::load_robot(robot).unwrap().model;
    let coulomb = Some(CoulombShape::Smooth { width: WIDTH });
    let drive = DriveChoice { viscous: true, coulomb, offset: true, ..DriveChoice::default() };
    let terms = terms_per_joint(&model, |_| drive);
    let mut random = Random::new(5);
    let recordings = vec![
        Recording::training("training", log("training", &model, 30.0, &mut random, training)),
        Recording::held_out("test", log("test", &model, 28.0, &mut random, pick_and_place)),
    ];
    let mut task = IdentificationTask::new(ParametricModel::new(model, terms).unwrap(), recordings);
    task.settings.diagnosis = DiagnosisChoice::Never;
    task.settings.consistency = None;
    let found = identify(&task, Execution::default()).unwrap();
    let validation = &found.held_out[0].validation;
    let report = validation.in_fit_band.as_ref().unwrap_or(&validation.model);
    for (joint, residuals) in validation.residuals.iter().enumerate() {
        let (sigma, all) = (found.estimate.joint_sigma[joint], report.joints[joint].rmse_nm);
        // The parameters are correct, and the whole residual is far above that of the training motion.
        assert!(all > 4.0 * sigma, "{all} {sigma}");
        assert!(residuals.rmse_in_motion_nm.unwrap() < 2.0 * sigma, "{residuals:?} {sigma}");
        let band = residuals.band.as_ref().unwrap();
        assert!(band.coverage_percent >= 90.0, "{band:?}");
    }
}
