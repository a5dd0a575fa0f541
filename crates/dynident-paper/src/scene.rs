//! The arm in three dimensions, with the paper's trajectories.

use crate::arm::Arm;
use crate::equal_conditions::Comparison;
use crate::joint_runs::Runs;
use dynident::RobotAppearance;
use dynident_excitation::Motion;
use dynident_excitation::limits::{CAPSULE_RADIUS_SHARE, arm_length_m};
use dynident_model::{Mat3, Vec3};
use dynident_report::{Gauge, Scene, SceneMotion, Surface};
use dynident_simulation::Run;

/// The page shows z upwards, the paper's arm moves in its x-y plane with gravity along −y.
const UPRIGHT: Mat3 = Mat3([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]);

/// Largest number of samples of a played motion; the picture interpolates.
const MAX_SAMPLES: usize = 500;

/// The arm, which plays the excitation trajectory of Eq. 14 (Figs. 2 to 6), the three runs of joint 2 and of joint 1
/// (Figs. 9 to 14), and the motions of Fig. 15.
pub(crate) fn scene(arm: &Arm, runs: &[Runs; 2], both: &Comparison) -> Scene {
    let robot = RobotAppearance::new(&arm.model, &arm.description);
    let mut scene = robot.scene("The arm");
    // The description has no frame at the tip. The second rod reaches to its point mass.
    if let (Some(tip), Some(inertial)) = (scene.bodies.last_mut(), arm.model.inertials().last()) {
        let end = inertial.first_moment().scale(1.0 / inertial.mass_kg());
        tip.surface = Surface::rod([0.0; 3], end.0, CAPSULE_RADIUS_SHARE * arm_length_m(&arm.model));
    }
    scene.bodies[0].rotation = UPRIGHT.0;
    for body in &mut scene.bodies {
        let (rotation, origin) = (Mat3(body.pose.0), Vec3(body.pose.1));
        body.pose = (UPRIGHT.mul_mat(&rotation).0, UPRIGHT.mul_vec(origin).0);
    }
    let [one, two] = runs;
    let figures = [(two, 1, ["Fig. 9", "Fig. 10", "Fig. 11"]), (one, 0, ["Fig. 13", "Fig. 13", "Fig. 13"])];
    // The desired motion is the same in all runs of a joint.
    scene.motions.extend(figures.iter().filter_map(|(runs, joint, _)| {
        let run = runs.runs.first()?;
        Some(planned(format!("joint {}: excitation trajectory, Figs. 2 to 6", joint + 1), &run.reference, run.rate_hz))
    }));
    for (runs, joint, figures) in figures {
        let played = runs.runs.iter().zip(figures).enumerate();
        scene.motions.extend(
            played.map(|(number, (run, figure))| {
                tracked(format!("joint {}: run {}, {figure}", joint + 1, number + 1), run)
            }),
        );
    }
    let [logistic, fourier] = &both.motions;
    for (name, motion) in [("Fourier series, Fig. 15", fourier), ("logistic strokes of both joints", logistic)] {
        scene.motions.push(planned(name.to_owned(), motion.reference.motion(), motion.reference.rate_hz()));
    }
    scene.words = "the planar arm of two rods in the vertical plane".into();
    scene.note = "solid: true motion of the simulated arm; pale: desired motion; gravity acts downwards".into();
    scene
}

fn step_of(samples: usize) -> usize {
    samples.div_ceil(MAX_SAMPLES).max(1)
}

/// Values of each joint at the samples of the picture.
fn kept(values: &[f64], samples: usize, of: usize) -> Vec<Vec<f64>> {
    let joints = values.len() / samples.max(1);
    let joint = |joint: usize| values[joint * samples..][..of].iter().copied().step_by(step_of(of)).collect();
    (0..joints).map(joint).collect()
}

fn times_s(samples: usize, rate_hz: f64) -> Vec<f64> {
    (0..samples).step_by(step_of(samples)).map(|sample| sample as f64 / rate_hz).collect()
}

fn planned(name: String, motion: &Motion, rate_hz: f64) -> SceneMotion {
    let samples = motion.samples;
    let speed = Gauge {
        name: "speed, rad/s".into(),
        values: kept(&motion.dq, samples, samples),
        limits: vec![None; motion.joints],
    };
    SceneMotion {
        name,
        times_s: times_s(samples, rate_hz),
        q: kept(&motion.q, samples, samples),
        gauges: vec![speed],
        ..SceneMotion::default()
    }
}

fn tracked(name: String, run: &Run) -> SceneMotion {
    let [q, desired, torque] = [&run.q, &run.reference.q, &run.tau].map(|values| {
        let samples = values.len() / run.joints.len().max(1);
        kept(values, samples, run.samples)
    });
    let error = q.iter().zip(&desired).map(|(q, desired)| q.iter().zip(desired).map(|(q, d)| d - q).collect());
    let none = vec![None; run.joints.len()];
    let gauges = vec![
        Gauge { name: "tracking error, rad".into(), values: error.collect(), limits: none.clone() },
        Gauge { name: "torque, Nm".into(), values: torque, limits: none },
    ];
    SceneMotion {
        name,
        times_s: times_s(run.samples, run.rate_hz),
        q,
        ghost: desired,
        gauges,
        ..SceneMotion::default()
    }
}
