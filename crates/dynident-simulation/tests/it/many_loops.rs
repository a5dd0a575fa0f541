//! Many loops at once: every run is that of the loop by itself, to the last bit.

use dynident_excitation::Motion;
use dynident_model::sample::{Random, random_tree};
use dynident_model::terms::{
    Coulomb, CoulombShape, Coupling, CouplingEffect, DriveInertia, Offset, TorqueTerm, Viscous,
};
use dynident_model::{InertialParameters, Model, load_robot};
use dynident_simulation::controllers::{ComputedTorqueSettings, JointPdSettings, JointPidSettings, Measured, Target};
use dynident_simulation::{
    ClosedLoop, Controller, ControllerModel, ControllerSettings, Disturbance, FrictionCompensation, Integrator,
    LoopSettings, Plant, Reference, Run, RunLimits, SensorSettings, SimulationError, Start, TimeCourse, VelocitySource,
    closed_loop, closed_loops,
};
use std::path::Path;

/// A loop's parts, which many loops borrow and a single one takes.
struct Parts {
    plant: Plant,
    controller: Box<dyn Controller>,
    reference: Reference,
    settings: LoopSettings,
}

fn loops_of(parts: &mut [Parts]) -> Vec<ClosedLoop<'_>> {
    parts
        .iter_mut()
        .map(|Parts { plant, controller, reference, settings }| ClosedLoop {
            plant,
            controller: controller.as_mut(),
            reference,
            settings,
        })
        .collect()
}

fn many(parts: &mut [Parts]) -> Vec<Run> {
    closed_loops(&mut loops_of(parts), |_, run| run).unwrap()
}

fn alone(parts: &mut Parts) -> Run {
    closed_loop(&mut parts.plant.clone(), parts.controller.as_mut(), &parts.reference, &parts.settings).unwrap()
}

/// All numbers of a run by their bits. The sign of a zero counts for none: a sum that begins with nothing has another
/// than one that begins with minus nothing.
fn bits(run: &Run) -> Vec<u64> {
    [&run.q, &run.dq, &run.ddq, &run.tau, &run.measured_q, &run.measured_dq, &run.max_error, &run.rms_error]
        .into_iter()
        .flatten()
        .map(|x| (x + 0.0).to_bits())
        .collect()
}

fn check(parts: &mut [Parts], what: &str) {
    let runs = many(parts);
    assert_eq!(runs.len(), parts.len());
    for (index, (run, parts)) in runs.iter().zip(parts).enumerate() {
        let single = alone(parts);
        assert_eq!(run.status, single.status, "{what}, loop {index}");
        assert_eq!(bits(run), bits(&single), "{what}, loop {index}");
        assert_eq!(run, &single, "{what}, loop {index}");
    }
}

fn robot(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(format!("{name}.urdf"));
    load_robot(path).unwrap().model
}

/// The robot with masses and moments that are off by a share.
fn other_bodies(model: &Model, random: &mut Random) -> Model {
    let bodies: Vec<InertialParameters> = (0..model.body_count())
        .map(|body| {
            let factor = random.uniform(0.8, 1.25);
            InertialParameters(model.inertials()[body].0.map(|x| factor * x))
        })
        .collect();
    model.with_inertials(&bodies).unwrap()
}

fn sines(joints: usize, samples: usize, rate_hz: f64, random: &mut Random) -> Reference {
    let mut motion = Motion::default();
    motion.reset(joints, samples);
    for joint in 0..joints {
        let (size, speed) = (random.uniform(0.1, 0.6), random.uniform(0.5, 4.0));
        for sample in 0..samples {
            let (sine, cosine) = (speed * sample as f64 / rate_hz).sin_cos();
            let at = joint * samples + sample;
            (motion.q[at], motion.dq[at]) = (size * sine, size * speed * cosine);
            motion.ddq[at] = -size * speed * speed * sine;
        }
    }
    Reference::new(rate_hz, motion).unwrap()
}

/// Any loop of the robot: bodies, terms, reference, rate, start, gains, limits, sensors and integrator all its own.
fn any_loop(model: &Model, random: &mut Random) -> Parts {
    let joints = model.dof();
    let chance = |random: &mut Random, share: f64| random.uniform(0.0, 1.0) < share;
    let body = other_bodies(model, random);
    let mut terms = Vec::new();
    for joint in 0..joints {
        terms.push((TorqueTerm::DriveInertia(DriveInertia { joint }), random.uniform(0.01, 0.5)));
        terms.push((TorqueTerm::Viscous(Viscous { joint }), random.uniform(0.0, 2.0)));
    }
    terms.push((TorqueTerm::Offset(Offset { joint: 0 }), random.normal()));
    if joints > 1 {
        let drive = |effect| {
            let ratios = [1.0, -0.5];
            TorqueTerm::Coupling(Coupling { name: "pair".into(), first: 0, second: joints - 1, ratios, effect })
        };
        terms.push((drive(CouplingEffect::Inertia), random.uniform(0.0, 0.1)));
        terms.push((drive(CouplingEffect::Viscous), random.uniform(0.0, 0.1)));
    }
    if chance(random, 0.15) {
        let shape = CoulombShape::Sign { dead_band: 0.0 };
        terms.push((TorqueTerm::Coulomb(Coulomb { joint: 0, shape }), random.uniform(0.0, 1.0)));
    }
    let (terms, values): (Vec<_>, Vec<_>) = terms.into_iter().unzip();
    let mut plant = Plant::new(&body, &terms, &values).unwrap();
    if chance(random, 0.1) {
        let (joint, time) = (model.joints()[0].name.clone(), TimeCourse::Constant);
        plant = plant.with_disturbances(&[Disturbance::Joint { joint, torque: 0.3, time }]).unwrap();
    }
    if chance(random, 0.1) {
        plant = plant.with_locked(&[model.joints()[joints - 1].name.clone()]).unwrap();
    }
    let gains = JointPdSettings { kp: random.uniform(5.0, 80.0).into(), kd: random.uniform(1.0, 10.0).into() };
    let believed = ControllerModel::new(model, &[], &[]).unwrap();
    let (controller, model) = match random.bits() % 8 {
        0 => (ControllerSettings::PdGravity(gains), Some(&believed)),
        1 => {
            let friction = FrictionCompensation::default();
            let settings = ComputedTorqueSettings { kp: 25.0.into(), kd: 10.0.into(), friction };
            (ControllerSettings::ComputedTorque(settings), Some(&believed))
        }
        2 => {
            let JointPdSettings { kp, kd } = gains;
            (ControllerSettings::JointPid(JointPidSettings { kp, ki: 3.0.into(), kd, integral_limit: None }), None)
        }
        _ => (ControllerSettings::JointPd(gains), None),
    };
    let rate_hz = [500.0, 1000.0][(random.bits() % 2) as usize];
    let samples = 1 + (random.bits() % 90) as usize;
    let start = match random.bits() % 3 {
        0 => Start::Reference,
        1 => Start::AtRest,
        _ => Start::At {
            q: (0..joints).map(|_| random.uniform(-1.0, 1.0)).collect(),
            dq: (0..joints).map(|_| random.uniform(-1.0, 1.0)).collect(),
        },
    };
    let steps_per_sample = 1 + (random.bits() % 2) as usize;
    let integrator = match random.bits() % 9 {
        0 => Integrator::Adaptive { relative_tolerance: 1e-8, absolute_tolerance: 1e-8 },
        1..5 => Integrator::Rk4 { steps_per_sample },
        _ => Integrator::SemiImplicitEuler { steps_per_sample },
    };
    let limits = RunLimits {
        torque: chance(random, 0.4).then(|| random.uniform(1.0, 30.0).into()),
        lower: chance(random, 0.2).then(|| (-1.1).into()),
        upper: chance(random, 0.2).then(|| 1.1.into()),
        speed: chance(random, 0.2).then(|| random.uniform(2.0, 6.0).into()),
        tracking_error: chance(random, 0.2).then(|| random.uniform(0.5, 1.5).into()),
    };
    let sensors = if chance(random, 0.3) {
        SensorSettings {
            position_std: 1e-4.into(),
            encoder_steps: Some(4096.0.into()),
            speed: VelocitySource::Differences { cutoff_hz: 60.0 },
            feedback_delay_samples: 1,
            seed: random.bits(),
            ..SensorSettings::default()
        }
    } else {
        SensorSettings::default()
    };
    let accelerations = chance(random, 0.2);
    Parts {
        plant,
        controller: controller.build(joints, model).unwrap(),
        reference: sines(joints, samples, rate_hz, random),
        settings: LoopSettings { integrator, start, limits, sensors, accelerations },
    }
}

/// Robots of every shape and size, of which some lanes hold what others do not, runs of any length that end early or
/// late, whatever goes over lanes and whatever does not.
#[test]
fn every_run_is_the_one_of_its_loop_by_itself() {
    let mut random = Random::new(11);
    let trees = (1..=9).map(|joints| (format!("tree of {joints}"), random_tree(3 * joints as u64, joints)));
    let arms = ["planar2r", "ur10", "panda_arm7"].map(|name| (name.to_owned(), robot(name)));
    for (name, model) in trees.chain(arms) {
        for count in [1, 2, 7, 60] {
            let mut parts: Vec<Parts> = (0..count).map(|_| any_loop(&model, &mut random)).collect();
            check(&mut parts, &format!("{name}, {count} loops"));
        }
    }
}

/// Loops in another order, on other numbers of threads, beside robots of another tree: the same runs.
#[test]
fn neither_order_nor_company_nor_threads_matter() {
    let mut random = Random::new(5);
    let (one, other) = (random_tree(4, 5), random_tree(8, 5));
    let models = [&one, &other];
    let mut parts: Vec<Parts> = (0..50).map(|k| any_loop(models[k % 2], &mut random)).collect();
    let runs = many(&mut parts);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| many(&mut parts)) == runs);
    }
    parts.reverse();
    let mut reversed = many(&mut parts);
    reversed.reverse();
    assert!(reversed == runs);
    check(&mut parts[..9], "fewer");
}

/// Loops that blow up, go round for ever or ask for torques without number, beside loops that are well: each has its
/// own end, and none touches another.
#[test]
fn what_goes_wrong_in_one_loop_stays_there() {
    #[derive(Debug)]
    struct Odd(usize, f64);
    impl Controller for Odd {
        fn name(&self) -> &'static str {
            "odd"
        }
        fn joints(&self) -> usize {
            self.0
        }
        fn reset(&mut self) {}
        fn torque(&mut self, time_s: f64, _: Target<'_>, _: Measured<'_>, tau: &mut [f64]) {
            tau.fill(if time_s < 0.02 { 0.1 } else { self.1 });
        }
    }
    let model = random_tree(6, 4);
    let mut random = Random::new(3);
    for integrator in [Integrator::SemiImplicitEuler { steps_per_sample: 2 }, Integrator::default()]
        .into_iter()
        .chain([Integrator::Rk4 { steps_per_sample: 1 }])
    {
        for odd in [f64::NAN, f64::INFINITY, 1e9, 1e200, 0.0] {
            let mut parts: Vec<Parts> = (0..11).map(|_| any_loop(&model, &mut random)).collect();
            for (k, parts) in parts.iter_mut().enumerate() {
                let sensors = SensorSettings::default();
                parts.settings = LoopSettings { integrator, sensors, ..LoopSettings::default() };
                if k % 4 == 1 {
                    parts.controller = Box::new(Odd(4, odd));
                }
                if k % 5 == 2 {
                    // Beyond where sines are taken as usual, and a drive that pumps.
                    parts.settings.start = Start::At { q: vec![99_990.0; 4], dq: vec![500.0; 4] };
                }
            }
            check(&mut parts, &format!("{integrator:?}, {odd}"));
        }
    }
}

/// Free arms keep their energy, whichever lane they are in: an oracle that shares nothing with the loop by itself. RK4
/// at 1 ms leaves 1e-8 of the energies of a few joule.
#[test]
fn free_arms_keep_their_energy_side_by_side() {
    let arm = robot("ur10");
    let mut random = Random::new(2);
    let none = JointPdSettings { kp: 0.0.into(), kd: 0.0.into() };
    let mut parts: Vec<Parts> = (0..19)
        .map(|_| {
            let q: Vec<f64> = (0..6).map(|_| random.uniform(-1.0, 1.0)).collect();
            let dq = (0..6).map(|_| random.uniform(-0.5, 0.5)).collect();
            Parts {
                plant: Plant::new(&other_bodies(&arm, &mut random), &[], &[]).unwrap(),
                controller: ControllerSettings::JointPd(none.clone()).build(6, None).unwrap(),
                reference: Reference::standing(&q, 1000.0, 0.3).unwrap(),
                settings: LoopSettings {
                    integrator: Integrator::Rk4 { steps_per_sample: 1 },
                    start: Start::At { q, dq },
                    ..LoopSettings::default()
                },
            }
        })
        .collect();
    for (run, parts) in many(&mut parts).iter().zip(&mut parts) {
        assert!(run.status.is_done());
        let mut energy = |sample: usize| {
            let at = |values: &[f64]| (0..6).map(|joint| values[joint * run.samples + sample]).collect::<Vec<f64>>();
            parts.plant.set_state(0.0, &at(&run.q), &at(&run.dq));
            parts.plant.energy_j()
        };
        let (before, after) = (energy(0), energy(run.samples - 1));
        assert!((after - before).abs() < 1e-6, "{before} J, then {after} J");
    }
}

#[test]
fn loops_that_cannot_be_set_up_are_named_and_none_is_run() {
    let model = random_tree(6, 4);
    let mut random = Random::new(3);
    let mut parts: Vec<Parts> = (0..3).map(|_| any_loop(&model, &mut random)).collect();
    parts[1].settings.start = Start::At { q: vec![0.0; 3], dq: vec![0.0; 4] };
    let refused =
        closed_loops(&mut loops_of(&mut parts), |_, _| panic!("nothing may run")).map(|_: Vec<()>| ()).unwrap_err();
    assert!(matches!(refused, SimulationError::Loop { index: 1, .. }) && refused.to_string().contains("loop 1"));
    assert!(closed_loops(&mut [], |_, run| run).unwrap().is_empty());
}
