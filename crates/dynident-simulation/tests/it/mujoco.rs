//! The simulated robot against MuJoCo 4.0: 10 s of the Panda arm under joint PD with matched steps of 1 ms.

use dynident_excitation::Motion;
use dynident_model::load_robot;
use dynident_model::terms::{Coulomb, CoulombShape, Stribeck, TorqueTerm, Viscous};
use dynident_simulation::controllers::{JointPd, JointPdSettings};
use dynident_simulation::{Integrator, LoopSettings, Plant, Reference, closed_loop};
use serde_json::Value;
use std::path::Path;

/// Tolerance that the project guarantees. Two programs with the same method differ only by rounding, which a stable
/// loop does not amplify; the observed differences are far smaller.
const TOLERANCE: f64 = 1e-6;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The reference of the golden file, with a number of samples.
fn sines(golden: &Value, samples: usize) -> Reference {
    let [centre, amplitude, omega, phase] = ["centre", "amplitude", "omega", "phase"].map(|key| numbers(&golden[key]));
    let mut motion = Motion::default();
    motion.reset(7, samples);
    for joint in 0..7 {
        for sample in 0..samples {
            let (sine, cosine) = (omega[joint] * sample as f64 / 1000.0 + phase[joint]).sin_cos();
            let at = joint * samples + sample;
            motion.q[at] = centre[joint] + amplitude[joint] * sine;
            motion.dq[at] = amplitude[joint] * omega[joint] * cosine;
            motion.ddq[at] = -amplitude[joint] * omega[joint] * omega[joint] * sine;
        }
    }
    Reference::new(1000.0, motion).unwrap()
}

#[test]
fn ten_seconds_of_panda_agree() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let golden: Value =
        serde_json::from_str(&std::fs::read_to_string(root.join("golden/mujoco_closed_loop.json")).unwrap()).unwrap();
    let model = load_robot(root.join("robots/panda_arm7.urdf")).unwrap().model;
    let names: Vec<&str> = golden["joints"].as_array().unwrap().iter().map(|x| x.as_str().unwrap()).collect();
    assert!(names.iter().eq(model.joints().iter().map(|joint| &joint.name)));
    let of = |key: &str| numbers(&golden[key]);
    let samples = golden["samples"].as_u64().unwrap() as usize + 1;
    let reference = sines(&golden, samples);
    let gains = JointPdSettings { kp: of("kp").into(), kd: of("kd").into() };
    let mut controller = JointPd::new(7, &gains).unwrap();
    let viscous: Vec<TorqueTerm> = (0..7).map(|joint| TorqueTerm::Viscous(Viscous { joint })).collect();
    let every = golden["every"].as_u64().unwrap() as usize;
    for (run, integrator, terms) in [
        ("euler", Integrator::SemiImplicitEuler { steps_per_sample: 1 }, &viscous[..0]),
        ("euler_damped", Integrator::SemiImplicitEuler { steps_per_sample: 1 }, &viscous[..]),
        ("rk4", Integrator::Rk4 { steps_per_sample: 1 }, &viscous[..0]),
    ] {
        let damping = if terms.is_empty() { Vec::new() } else { of("damping") };
        let mut plant = Plant::new(&model, terms, &damping).unwrap();
        let settings = LoopSettings { integrator, ..LoopSettings::default() };
        let own = closed_loop(&mut plant, &mut controller, &reference, &settings).unwrap();
        assert!(own.status.is_done(), "{}", own.status);
        let worst = ["q", "dq"].map(|key| {
            let own = if key == "q" { &own.q } else { &own.dq };
            let rows = golden["runs"][run][key].as_array().unwrap().iter().enumerate();
            rows.flat_map(|(row, theirs)| {
                let theirs = numbers(theirs).into_iter().enumerate();
                theirs.map(move |(joint, theirs)| (own[joint * samples + row * every] - theirs).abs())
            })
            .fold(0.0, f64::max)
        });
        println!("{run}: {:.1e} rad, {:.1e} rad/s", worst[0], worst[1]);
        assert!(worst[0] < TOLERANCE, "{run}: {:e} rad", worst[0]);
    }
}

/// The free frictionless Panda arm falls for 5 s with constant energy: within some thousand times the adaptive
/// integrator's tolerance of 1e-10, and within RK4's error of order 4 (light wrist joints rotate at tens of rad/s: with
/// four steps per millisecond a thousandth of a joule).
#[test]
fn the_free_panda_keeps_its_energy() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let model = load_robot(root.join("robots/panda_arm7.urdf")).unwrap().model;
    let mut plant = Plant::new(&model, &[], &[]).unwrap();
    for (integrator, allowed) in [
        (Integrator::Adaptive { relative_tolerance: 1e-10, absolute_tolerance: 1e-10 }, 1e-6),
        (Integrator::Rk4 { steps_per_sample: 4 }, 1e-3),
    ] {
        plant.set_state(0.0, &[0.1, 0.4, -0.3, -1.2, 0.5, 1.5, 0.2], &[0.0; 7]);
        let before = plant.energy_j();
        let mut worst = 0.0_f64;
        for _ in 0..5000 {
            plant.advance(&[0.0; 7], 1e-3, integrator).unwrap();
            worst = worst.max((plant.energy_j() - before).abs());
        }
        println!("{integrator:?}: {worst:.1e} J of {before:.1} J");
        assert!(worst < allowed, "{integrator:?}: {worst:e} J");
    }
}

/// Panda with dry friction in every joint, which sticks and slides at every reversal, with all three integrators: Euler
/// and RK4 deviate from the adaptive one by their order, and all steps converge. Euler at 1 ms deviates by about h
/// times the velocities (2 rad/s); RK4 detects breakaway only at its steps, up to 1 ms late.
#[test]
fn panda_sticks_and_slips_the_same_by_all_integrators() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let golden: Value =
        serde_json::from_str(&std::fs::read_to_string(root.join("golden/mujoco_closed_loop.json")).unwrap()).unwrap();
    let model = load_robot(root.join("robots/panda_arm7.urdf")).unwrap().model;
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let terms: Vec<TorqueTerm> = (0..7)
        .flat_map(|joint| {
            [
                TorqueTerm::Coulomb(Coulomb { joint, shape }),
                TorqueTerm::Stribeck(Stribeck { joint, speed: 0.05, exponent: 2.0, shape }),
                TorqueTerm::Viscous(Viscous { joint }),
            ]
        })
        .collect();
    let size = [3.0, 3.0, 2.0, 2.0, 0.8, 0.8, 0.4];
    let values: Vec<f64> = size.iter().flat_map(|size| [*size, 0.4 * size, 0.5 * size]).collect();
    let reference = sines(&golden, 4001);
    let gains = JointPdSettings { kp: numbers(&golden["kp"]).into(), kd: numbers(&golden["kd"]).into() };
    let mut controller = JointPd::new(7, &gains).unwrap();
    let mut plant = Plant::new(&model, &terms, &values).unwrap();
    let mut motion = |integrator| {
        let settings = LoopSettings { integrator, ..LoopSettings::default() };
        let run = closed_loop(&mut plant, &mut controller, &reference, &settings).unwrap();
        assert!(run.status.is_done() && run.unsettled_steps == 0, "{} {}", run.status, run.unsettled_steps);
        run
    };
    let tight = motion(Integrator::Adaptive { relative_tolerance: 1e-9, absolute_tolerance: 1e-9 });
    let rests = tight.dq.iter().filter(|dq| **dq == 0.0).count();
    assert!(rests > 100, "{rests} samples at rest");
    for (integrator, allowed) in
        [(Integrator::Rk4 { steps_per_sample: 1 }, 1e-3), (Integrator::SemiImplicitEuler { steps_per_sample: 1 }, 4e-3)]
    {
        let own = motion(integrator);
        let worst = own.q.iter().zip(&tight.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{integrator:?}: {worst:.1e} rad");
        assert!(worst < allowed, "{integrator:?}: {worst:e} rad");
    }
}
