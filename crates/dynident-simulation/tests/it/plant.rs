//! The simulated robot against mechanics: energy, analytic motions, inverse dynamics, the reduced model.

use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::sample::{Random, planar_2r, random_tree};
use dynident_model::terms::{
    Coulomb, CoulombShape, Coupling, CouplingEffect, Declared, DeclaredLaw, Direction, DirectionalCoulomb,
    DirectionalViscous, DriveInertia, Expression, JointMotion, JointNames, LoadFriction, MaxwellSlip, Offset, Power,
    PowerExponent, Sigmoid, Stribeck, TorqueTerm, Viscous,
};
use dynident_model::{InertialParameters, Mat3, Model, Vec3};
use dynident_simulation::controllers::ControllerModel;
use dynident_simulation::{Disturbance, Integrator, Plant, PlantFault, TimeCourse};

const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };
const EULER: Integrator = Integrator::SemiImplicitEuler { steps_per_sample: 1 };
const RK4: Integrator = Integrator::Rk4 { steps_per_sample: 1 };
const TIGHT: Integrator = Integrator::Adaptive { relative_tolerance: 1e-11, absolute_tolerance: 1e-11 };

type Make = fn(usize) -> Integrator;

fn point(mass: f64) -> InertialParameters {
    InertialParameters::from_centre_of_mass(mass, Vec3([1.0, 0.0, 0.0]), &Mat3::ZERO)
}

/// Unit inertia about joint 1 with joint 2 locked straight, without gravity: a flywheel.
fn flywheel(terms: &[TorqueTerm], parameters: &[f64]) -> Plant {
    let model = planar_2r(1.0, point(1.0), InertialParameters::ZERO).with_gravity(Vec3::ZERO).unwrap();
    let terms: Vec<TorqueTerm> =
        terms.iter().cloned().chain([TorqueTerm::DriveInertia(DriveInertia { joint: 1 })]).collect();
    let parameters: Vec<f64> = parameters.iter().copied().chain([1.0]).collect();
    Plant::new(&model, &terms, &parameters).unwrap()
}

fn coulomb(joint: usize) -> TorqueTerm {
    TorqueTerm::Coulomb(Coulomb { joint, shape: SIGN })
}

fn random_state(seed: u64, dof: usize) -> [Vec<f64>; 3] {
    let mut random = Random::new(seed);
    core::array::from_fn(|_| (0..dof).map(|_| random.uniform(-1.0, 1.0)).collect())
}

/// The energy of a free frictionless tree is constant: for the adaptive integrator up to its tolerance times some
/// thousand steps, for RK4 up to its order (1e-6 with fast joints of light tips).
#[test]
fn free_trees_keep_their_energy() {
    for seed in 0..4 {
        let model = random_tree(seed, 5);
        let terms = [TorqueTerm::DriveInertia(DriveInertia { joint: 2 })];
        let mut plant = Plant::new(&model, &terms, &[0.2]).unwrap();
        let [q, dq, _] = random_state(seed, 5);
        for (integrator, allowed) in [(TIGHT, 1e-8), (Integrator::Rk4 { steps_per_sample: 4 }, 1e-5)] {
            plant.set_state(0.0, &q, &dq);
            let before = plant.energy_j();
            for _ in 0..1000 {
                plant.advance(&[0.0; 5], 1e-3, integrator).unwrap();
            }
            let drift = (plant.energy_j() - before).abs();
            assert!(drift < allowed * before.abs().max(10.0), "seed {seed}: {drift:e} J of {before:e} J");
        }
    }
}

/// Both methods have their order: halving the step divides the error, relative to the adaptive integrator, by 2 and by
/// 16, within a factor of 1.5.
#[test]
fn methods_have_their_order() {
    let model = random_tree(2, 4);
    let [q, dq, tau] = random_state(5, 4);
    let viscous: Vec<TorqueTerm> = (0..4).map(|joint| TorqueTerm::Viscous(Viscous { joint })).collect();
    let mut plant = Plant::new(&model, &viscous, &[0.3; 4]).unwrap();
    let mut end = |integrator| {
        plant.set_state(0.0, &q, &dq);
        for _ in 0..20 {
            plant.advance(&tau, 0.01, integrator).unwrap();
        }
        plant.q().to_vec()
    };
    let truth = end(TIGHT);
    let mut error = |integrator| end(integrator).iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let euler: Make = |steps_per_sample| Integrator::SemiImplicitEuler { steps_per_sample };
    let rk4: Make = |steps_per_sample| Integrator::Rk4 { steps_per_sample };
    for (make, steps, order) in [(euler, 16, 2.0), (rk4, 2, 16.0)] {
        let ratio = error(make(steps)) / error(make(2 * steps));
        assert!(ratio > order / 1.5 && ratio < order * 1.5, "ratio {ratio}, not {order}");
    }
}

/// Coulomb friction alone: a flywheel of inertia I at velocity v stops after I v/F, after rotating by I v²/(2F), and
/// then rests exactly. Runge-Kutta methods find the stop up to rounding, Euler within a step.
#[test]
fn a_flywheel_runs_down_and_rests() {
    let mut plant = flywheel(&[coulomb(0)], &[0.7]);
    let turned = 0.5 * 1.3 * 1.3 / 0.7;
    for (integrator, allowed) in [(RK4, 1e-11), (TIGHT, 1e-9), (EULER, 1.3 * 1e-3)] {
        plant.set_state(0.0, &[0.0, 0.0], &[1.3, 0.0]);
        for _ in 0..1857 {
            plant.advance(&[0.0, 0.0], 1e-3, integrator).unwrap();
            assert!(plant.dq()[0] > 0.0);
        }
        for _ in 0..200 {
            plant.advance(&[0.0, 0.0], 1e-3, integrator).unwrap();
        }
        assert!((plant.q()[0] - turned).abs() < allowed, "{integrator:?}: {} {turned}", plant.q()[0]);
        assert_eq!(plant.dq()[0], 0.0);
        let at = plant.q()[0];
        for step in 0..500 {
            let tau = 0.69 * f64::from(step).sin();
            plant.advance(&[tau, 0.0], 1e-3, integrator).unwrap();
            assert_eq!((plant.q()[0], plant.dq()[0]), (at, 0.0));
        }
        for _ in 0..100 {
            plant.advance(&[-0.9, 0.0], 1e-3, integrator).unwrap();
        }
        assert!((plant.dq()[0] + 0.2 * 0.1).abs() < 1e-12);
    }
}

/// The breakaway torque is Coulomb plus Stribeck friction; in motion the Stribeck part vanishes.
#[test]
fn stribeck_friction_breaks_away() {
    let stribeck = TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.05, exponent: 2.0, shape: SIGN });
    let mut plant = flywheel(&[coulomb(0), stribeck], &[0.5, 0.4]);
    for integrator in [EULER, RK4, TIGHT] {
        plant.set_state(0.0, &[0.0, 0.0], &[0.0, 0.0]);
        for _ in 0..100 {
            plant.advance(&[0.899, 0.0], 1e-3, integrator).unwrap();
        }
        assert_eq!(plant.q()[0], 0.0);
        for _ in 0..2000 {
            plant.advance(&[0.95, 0.0], 1e-3, integrator).unwrap();
        }
        // Long after breakaway the driving torque is reduced by 0.5.
        let mut ddq = [0.0; 2];
        plant.accelerations(&[0.95, 0.0], &mut ddq).unwrap();
        assert!((ddq[0] - 0.45).abs() < 1e-6, "{ddq:?}");
    }
}

/// An arm whose friction exceeds its weight rests bitwise exactly, and one with less friction falls; both joints at
/// once, coupled.
#[test]
fn an_arm_is_held_by_its_friction() {
    let model = planar_2r(1.0, point(1.0), point(1.0));
    for integrator in [EULER, RK4, TIGHT] {
        let mut plant = Plant::new(&model, &[coulomb(0), coulomb(1)], &[30.0, 10.0]).unwrap();
        plant.set_state(0.0, &[0.1, 0.2], &[0.0, 0.0]);
        for _ in 0..300 {
            plant.advance(&[0.0, 0.0], 1e-3, integrator).unwrap();
        }
        assert_eq!((plant.q(), plant.dq()), (&[0.1, 0.2][..], &[0.0, 0.0][..]));
        let mut plant = Plant::new(&model, &[coulomb(0), coulomb(1)], &[60.0, 5.0]).unwrap();
        plant.set_state(0.0, &[0.1, 0.2], &[0.0, 0.0]);
        for _ in 0..300 {
            plant.advance(&[0.0, 0.0], 1e-3, integrator).unwrap();
        }
        assert!(plant.q()[0] == 0.1 && plant.q()[1] < 0.0, "{integrator:?} {:?}", plant.q());
    }
}

/// The methods agree on an arm that sticks and slides: RK4 with the adaptive one up to its local error at the stops,
/// Euler up to its order.
#[test]
fn methods_agree_on_stick_and_slip() {
    let model = planar_2r(1.0, point(1.0), point(1.0));
    let terms =
        [coulomb(0), coulomb(1), TorqueTerm::Viscous(Viscous { joint: 0 }), TorqueTerm::Viscous(Viscous { joint: 1 })];
    let mut plant = Plant::new(&model, &terms, &[3.0, 1.5, 1.0, 0.5]).unwrap();
    let mut end = |integrator, steps: i32| {
        plant.set_state(0.0, &[-1.0, 0.5], &[0.0, 0.0]);
        for step in 0..3 * steps {
            let time = (f64::from(step) * 1000.0 / f64::from(steps)).floor() / 1000.0;
            let tau = [5.0 * (2.0 * time).sin(), 3.0 * (5.0 * time).sin()];
            plant.advance(&tau, 1.0 / f64::from(steps), integrator).unwrap();
        }
        assert_eq!(plant.unsettled_steps(), 0);
        plant.q().to_vec()
    };
    let truth = end(TIGHT, 1000);
    let error = |q: Vec<f64>| q.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (rk4, coarse, fine) = (error(end(RK4, 1000)), error(end(EULER, 1000)), error(end(EULER, 8000)));
    assert!(rk4 < 1e-5, "RK4 {rk4:e}");
    assert!(coarse < 0.02 && fine < 0.4 * coarse, "Euler {coarse:e} and {fine:e}");
}

/// Friction of every kind is dissipative. With the adaptive integrator the energy never increases by more than the
/// tolerance; with Euler and smooth friction a thousand times too steep for an explicit method, the arm comes to rest
/// without chatter.
#[test]
fn friction_creates_no_energy() {
    let weightless = random_tree(3, 4).with_gravity(Vec3::ZERO).unwrap();
    let steep = CoulombShape::Smooth { width: 1e-4 };
    let terms = [
        coulomb(0),
        TorqueTerm::Coulomb(Coulomb { joint: 1, shape: CoulombShape::Smooth { width: 0.05 } }),
        TorqueTerm::Power(Power { joint: 2, exponent: PowerExponent::CubeRoot, rounding: 1e-3 }),
        coulomb(3),
        TorqueTerm::Viscous(Viscous { joint: 2 }),
    ];
    let [q, dq, _] = random_state(8, 4);
    let mut plant = Plant::new(&weightless, &terms, &[0.4, 0.3, 0.1, 0.2, 0.1]).unwrap();
    plant.set_state(0.0, &q, &dq);
    let mut before = plant.energy_j();
    for _ in 0..1500 {
        plant.advance(&[0.0; 4], 1e-3, TIGHT).unwrap();
        let after = plant.energy_j();
        assert!(after <= before + 1e-9, "{before} {after}");
        before = after;
    }
    let terms: Vec<TorqueTerm> = (0..4).map(|joint| TorqueTerm::Coulomb(Coulomb { joint, shape: steep })).collect();
    let mut plant = Plant::new(&weightless, &terms, &[2.0; 4]).unwrap();
    plant.set_state(0.0, &q, &dq);
    // The slowest joint has about 20 kg m²: 2 Nm stop it within ten seconds.
    for _ in 0..12_000 {
        plant.advance(&[0.0; 4], 1e-3, EULER).unwrap();
    }
    assert!(plant.dq().iter().all(|dq| dq.abs() < 1e-9), "{:?}", plant.dq());
    assert_eq!(plant.unsettled_steps(), 0);
}

/// In motion, the accelerations under the torque of the inverse dynamics with all laws are the original ones.
/// Tolerance: rounding times the condition number of the mass matrix (below 1e4).
#[test]
fn forward_after_inverse_with_every_term() {
    let model = random_tree(6, 4);
    let couple = |name: &str, effect| {
        TorqueTerm::Coupling(Coupling { name: name.to_owned(), first: 1, second: 2, ratios: [1.0, -0.5], effect })
    };
    let terms = vec![
        TorqueTerm::Viscous(Viscous { joint: 0 }),
        coulomb(0),
        TorqueTerm::DirectionalViscous(DirectionalViscous { joint: 1, direction: Direction::Forward }),
        TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint: 1, direction: Direction::Backward, shape: SIGN }),
        TorqueTerm::DirectionalCoulomb(DirectionalCoulomb {
            joint: 1,
            direction: Direction::Forward,
            shape: CoulombShape::Smooth { width: 0.1 },
        }),
        TorqueTerm::Stribeck(Stribeck { joint: 2, speed: 0.5, exponent: 1.5, shape: SIGN }),
        TorqueTerm::Stribeck(Stribeck {
            joint: 3,
            speed: 0.5,
            exponent: 1.5,
            shape: CoulombShape::Smooth { width: 0.2 },
        }),
        TorqueTerm::Sigmoid(Sigmoid { joint: 2, steepness: 3.0, offset_speed: 0.1 }),
        TorqueTerm::Power(Power { joint: 3, exponent: PowerExponent::Quadratic, rounding: 1e-3 }),
        TorqueTerm::Offset(Offset { joint: 3 }),
        TorqueTerm::DriveInertia(DriveInertia { joint: 1 }),
        TorqueTerm::DriveInertia(DriveInertia { joint: 2 }),
        couple("a", CouplingEffect::Inertia),
        couple("b", CouplingEffect::Viscous),
        couple("c", CouplingEffect::Coulomb(SIGN)),
        couple("d", CouplingEffect::Coulomb(CoulombShape::Smooth { width: 0.3 })),
        declared("e", 0, "sin(q - 0.3) * cos(q3) - dq2 * abs(dq)"),
        declared("f", 2, "q^3 + max(q, 0) * q1"),
    ];
    let mut random = Random::new(2);
    let parameters: Vec<f64> = terms.iter().map(|_| random.uniform(0.1, 1.0)).collect();
    let mut plant = Plant::new(&model, &terms, &parameters).unwrap();
    let mut workspace = Workspace::new(&model);
    for seed in 0..20 {
        let [q, dq, ddq] = random_state(100 + seed, 4);
        let mut tau = inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq).to_vec();
        let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
        for (term, value) in terms.iter().zip(&parameters) {
            for joint in term.joints() {
                let mut column = [0.0];
                term.column(joint, &motion, &mut column);
                tau[joint] += value * column[0];
            }
        }
        plant.set_state(0.0, &q, &dq);
        let mut found = [0.0; 4];
        plant.accelerations(&tau, &mut found).unwrap();
        for joint in 0..4 {
            assert!((found[joint] - ddq[joint]).abs() < 1e-10, "{seed}: {found:?} {ddq:?}");
        }
    }
}

fn declared(name: &str, joint: usize, text: &str) -> TorqueTerm {
    let expression = Expression::parse(text, &JointNames { own: Some(joint), names: &[] }).unwrap();
    let (name, law) = (name.to_owned(), DeclaredLaw::Expression(expression));
    TorqueTerm::Declared(Declared { name, joint, law, unit: "Nm".to_owned(), nominal: None, is_spring: false })
}

/// An undamped spring conserves energy, including its `k q²/2`; the controller's model holds the robot in its posture,
/// with spring and weight.
#[test]
fn a_spring_keeps_its_energy_and_the_model_holds_it() {
    let model = random_tree(6, 2);
    let (stiffness, rest) = (30.0, 0.4);
    let terms = [declared("spring", 1, "q - 0.4")];
    let mut plant = Plant::new(&model, &terms, &[stiffness]).unwrap();
    plant.set_state(0.0, &[0.2, -0.5], &[0.0, 1.0]);
    let energy = |plant: &mut Plant| plant.energy_j() + 0.5 * stiffness * (plant.q()[1] - rest).powi(2);
    let before = energy(&mut plant);
    for _ in 0..2000 {
        plant.advance(&[0.0; 2], 1e-3, Integrator::Rk4 { steps_per_sample: 1 }).unwrap();
    }
    // Runge-Kutta error of order h⁴ over two seconds, of some joules.
    assert!((energy(&mut plant) - before).abs() < 1e-7 * (1.0 + before.abs()), "{} {before}", energy(&mut plant));

    let mut controller = ControllerModel::new(&model, &terms, &[stiffness]).unwrap();
    let (q, still) = ([0.9, -1.1], [0.0; 2]);
    let mut tau = [0.0; 2];
    controller.reference_torque(&q, &still, &still, &mut tau);
    plant.set_state(0.0, &q, &still);
    let mut accelerations = [1.0; 2];
    plant.accelerations(&tau, &mut accelerations).unwrap();
    assert!(accelerations.iter().all(|a| a.abs() < 1e-10), "{accelerations:?}");
    // The motion ends where the expression is undefined.
    let mut plant = Plant::new(&model, &[declared("root", 1, "sqrt(q + 1)")], &[1.0]).unwrap();
    plant.set_state(0.0, &[0.0, -2.0], &still);
    assert_eq!(plant.accelerations(&[0.0; 2], &mut accelerations), Err(PlantFault::NotFinite));
}

/// With a locked joint the others move as in the reduced model.
#[test]
fn locked_joints_are_the_reduced_model() {
    let model = random_tree(9, 5);
    let name = model.joints()[2].name.clone();
    let reduced = model.locked(&[(name.clone(), 0.4)]).unwrap();
    let (mut whole, mut less) =
        (Plant::new(&model, &[], &[]).unwrap().with_locked(&[name]).unwrap(), Plant::new(&reduced, &[], &[]).unwrap());
    let [mut q, dq, tau] = random_state(3, 5);
    q[2] = 0.4;
    let without = |v: &[f64]| [v[0], v[1], v[3], v[4]];
    whole.set_state(0.0, &q, &dq);
    less.set_state(0.0, &without(&q), &without(&dq));
    assert_eq!(whole.dq()[2], 0.0);
    for _ in 0..300 {
        whole.advance(&tau, 1e-3, RK4).unwrap();
        less.advance(&without(&tau), 1e-3, RK4).unwrap();
    }
    assert_eq!(whole.q()[2], 0.4);
    // The same method on the same motion: rounding, amplified over 0.3 s.
    assert!(without(whole.q()).iter().zip(less.q()).all(|(a, b)| (a - b).abs() < 1e-10));
}

/// A drive that moves with both joints and has friction at rest: torques on the drive below its friction do not move
/// it, while the motion that does not move the drive is free.
#[test]
fn a_shared_drive_sticks() {
    let model = planar_2r(1.0, point(1.0), point(1.0)).with_gravity(Vec3::ZERO).unwrap();
    let drive = TorqueTerm::Coupling(Coupling {
        name: "wrist".to_owned(),
        first: 0,
        second: 1,
        ratios: [1.0, 1.0],
        effect: CouplingEffect::Coulomb(SIGN),
    });
    for integrator in [EULER, RK4, TIGHT] {
        let mut plant = Plant::new(&model, core::slice::from_ref(&drive), &[50.0]).unwrap();
        plant.set_state(0.0, &[0.0, 0.5], &[0.0, 0.0]);
        for _ in 0..200 {
            plant.advance(&[1.0, 0.0], 1e-3, integrator).unwrap();
            assert!((plant.dq()[0] + plant.dq()[1]).abs() < 1e-12, "{integrator:?} {:?}", plant.dq());
        }
        assert!(plant.dq()[0] > 0.01);
    }
}

/// A slipping spring returns to its origin unless it yields, and yields at W.
#[test]
fn slipping_springs_remember() {
    let slip = TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 0, yield_displacement: 0.01 });
    let damper = TorqueTerm::Viscous(Viscous { joint: 0 });
    for integrator in [EULER, RK4, TIGHT] {
        let mut plant = flywheel(&[slip.clone(), damper.clone()], &[1.0, 20.0]);
        plant.set_state(0.0, &[0.3, 0.0], &[0.0, 0.0]);
        for _ in 0..3000 {
            plant.advance(&[0.5, 0.0], 1e-3, integrator).unwrap();
        }
        // Half of the yield torque: half of the yield displacement (spring 100 Nm/rad, damped with a time constant of
        // 0.2 s).
        assert!((plant.q()[0] - 0.305).abs() < 1e-6, "{}", plant.q()[0]);
        for _ in 0..3000 {
            plant.advance(&[0.0, 0.0], 1e-3, integrator).unwrap();
        }
        assert!((plant.q()[0] - 0.3).abs() < 1e-6);
        for _ in 0..3000 {
            plant.advance(&[2.0, 0.0], 1e-3, integrator).unwrap();
        }
        // Yielded: (2 - 1) Nm divided by 20 Nm s.
        assert!((plant.dq()[0] - 0.05).abs() < 1e-9);
    }
}

/// Load-dependent friction holds a share of the load: an arm with k above 1 does not fall, with a small k it slides
/// with the load reduced by that share.
#[test]
fn load_friction_follows_the_load() {
    let term = TorqueTerm::Load(LoadFriction { joint: 0, shape: SIGN });
    let model = planar_2r(1.0, point(1.0), InertialParameters::ZERO);
    let terms = [term, TorqueTerm::DriveInertia(DriveInertia { joint: 1 })];
    let mut plant = Plant::new(&model, &terms, &[0.25, 1.0]).unwrap().with_locked(&["joint2".to_owned()]).unwrap();
    plant.set_state(0.0, &[0.0, 0.0], &[-1e-6, 0.0]);
    for _ in 0..5 {
        plant.advance(&[0.0, 0.0], 1e-4, EULER).unwrap();
    }
    // τ_load = I q̈ + m g = -friction = ∓k |τ_load|: the load vanishes, and the arm falls freely.
    assert!(plant.dq()[0] < -0.9 * 9.8 * 5e-4);
    // Held by a torque it carries m g, and a push below k m g does not move it.
    let mut plant = Plant::new(&model, &terms, &[0.25, 1.0]).unwrap().with_locked(&["joint2".to_owned()]).unwrap();
    plant.set_state(0.0, &[0.0, 0.0], &[0.0, 0.0]);
    for _ in 0..100 {
        plant.advance(&[9.8 + 2.0, 0.0], 1e-3, EULER).unwrap();
    }
    assert!(plant.q()[0].abs() < 1e-5, "{}", plant.q()[0]);
}

/// A sine torque on a flywheel: `q̇ = (1 - cos ωt)/(I ω)`. The adaptive integrator and RK4 evaluate it inside the step.
#[test]
fn disturbances_act_in_time() {
    let disturbance = Disturbance::Joint {
        joint: "joint1".to_owned(),
        torque: 2.0,
        time: TimeCourse::Sine { frequency_hz: 3.0, phase_rad: 0.0 },
    };
    let omega = 3.0 * core::f64::consts::TAU;
    for (integrator, allowed) in [(RK4, 1e-9), (TIGHT, 1e-9)] {
        let mut plant = flywheel(&[], &[]).with_disturbances(core::slice::from_ref(&disturbance)).unwrap();
        for _ in 0..250 {
            plant.advance(&[0.0, 0.0], 1e-3, integrator).unwrap();
        }
        let expected = 2.0 * (1.0 - (omega * 0.25).cos()) / omega;
        assert!((plant.dq()[0] - expected).abs() < allowed, "{} {expected}", plant.dq()[0]);
    }
}

#[test]
fn invalid_robots_are_rejected() {
    let model: Model = planar_2r(1.0, point(1.0), point(1.0));
    assert!(Plant::new(&model, &[coulomb(0)], &[]).is_err());
    assert!(Plant::new(&model, &[coulomb(0)], &[-0.1]).unwrap_err().to_string().contains("fc1"));
    assert!(Plant::new(&model, &[coulomb(2)], &[0.1]).unwrap_err().to_string().contains("fc3"));
    assert!(Plant::new(&model, &[coulomb(0)], &[f64::NAN]).is_err());
    let massless = planar_2r(1.0, point(1.0), InertialParameters::ZERO);
    assert!(Plant::new(&massless, &[], &[]).unwrap_err().to_string().contains("mass matrix"));
    assert!(Plant::new(&model, &[], &[]).unwrap().with_locked(&["elbow".to_owned()]).is_err());
    let plant = Plant::new(&model, &[], &[]).unwrap();
    assert!(plant.check_state(&[0.0], &[0.0, 0.0]).is_err());
    assert!(plant.check_state(&[0.0, f64::NAN], &[0.0, 0.0]).is_err());
}
