//! Torque limits with friction, drive inertia and springs: values and derivatives of the search, and the check.

use crate::common::{Harmonics, grid, ur10};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_excitation::Motion;
use dynident_excitation::check::check_limits;
use dynident_excitation::limits::{JointLimit, KnownTorque, LimitKind, LimitSet, Limits};
use dynident_model::sample::Random;
use dynident_model::terms::{
    Coulomb, CoulombShape, Coupling, CouplingEffect, Declared, DeclaredLaw, Direction, DirectionalCoulomb,
    DriveInertia, Expression, JointNames, LoadFriction, MaxwellSlip, Offset, Sigmoid, Stribeck, TorqueTerm, Viscous,
};
use dynident_model::{Model, read_urdf};

const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };

fn limited(model: &Model, known_torque: KnownTorque) -> Limits {
    let joint = |name: &String| JointLimit {
        joint: name.clone(),
        torque: Some(40.0),
        torque_margin: 0.2,
        power_w: Some(50.0),
        ..JointLimit::default()
    };
    let joints = model.joints().iter().map(|own| joint(&own.name)).collect();
    Limits { joints, known_torque, ..Limits::default() }
}

/// Every kind of term.
fn all_terms() -> KnownTorque {
    let expression = Expression::parse("sin(q) * dq", &JointNames { own: Some(3), names: &[] }).unwrap();
    let declared = Declared {
        name: "cable".to_owned(),
        joint: 3,
        law: DeclaredLaw::Expression(expression),
        unit: "Nm".to_owned(),
        nominal: None,
        is_spring: false,
    };
    let coupling = |effect| {
        TorqueTerm::Coupling(Coupling { name: "wrist".to_owned(), first: 4, second: 5, ratios: [1.0, -2.0], effect })
    };
    KnownTorque::new([
        (TorqueTerm::Viscous(Viscous { joint: 0 }), 12.0),
        (TorqueTerm::Coulomb(Coulomb { joint: 0, shape: SIGN }), 9.0),
        (TorqueTerm::Coulomb(Coulomb { joint: 1, shape: SIGN }), -3.0),
        (TorqueTerm::Stribeck(Stribeck { joint: 1, speed: 0.3, exponent: 1.5, shape: SIGN }), 7.0),
        (TorqueTerm::Load(LoadFriction { joint: 2, shape: SIGN }), 0.2),
        (TorqueTerm::DriveInertia(DriveInertia { joint: 2 }), 3.0),
        (TorqueTerm::Declared(declared), 15.0),
        (TorqueTerm::Sigmoid(Sigmoid { joint: 3, steepness: 3.0, offset_speed: 0.1 }), 6.0),
        (TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 3, yield_displacement: 0.1 }), 2.0),
        (
            TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint: 4, direction: Direction::Forward, shape: SIGN }),
            8.0,
        ),
        (TorqueTerm::Offset(Offset { joint: 4 }), -5.0),
        (coupling(CouplingEffect::Inertia), 1.5),
        (coupling(CouplingEffect::Viscous), 2.5),
        (coupling(CouplingEffect::Coulomb(SIGN)), 4.0),
    ])
}

/// Slow motion is on the ramps that replace signs, fast motion outside them.
#[test]
fn the_derivatives_are_central_differences() {
    let model = ur10();
    let set = LimitSet::new(&limited(&model, all_terms()), &model).unwrap();
    for (seed, pace) in [(1, 1.0), (2, 1.0), (3, 0.004), (4, 0.004), (5, 0.01)] {
        let mut random = Random::new(seed);
        let mut motion = Motion::default();
        Harmonics::random(&mut random, model.dof(), 0.8).motion(&grid(1.0, 12), &mut motion);
        motion.dq.iter_mut().for_each(|dq| *dq *= pace);
        let mut values = Vec::new();
        let mut cost = |motion: &Motion, weights: &[f64]| -> f64 {
            set.values(&mut set.workspace(), motion, &mut values);
            values.iter().zip(weights).map(|(c, w)| c * w).sum()
        };
        let weights: Vec<f64> =
            (0..set.constraints().len() * motion.samples).map(|_| random.uniform(-1.0, 1.0)).collect();
        let mut adjoint = Motion::default();
        adjoint.reset(model.dof(), motion.samples);
        set.apply_adjoint(&mut set.workspace(), &motion, &weights, &mut adjoint);
        let h = 1e-7;
        for place in 0..motion.dq.len() {
            for array in 0..3 {
                let moved = |by: f64| {
                    let mut moved = motion.clone();
                    [&mut moved.q, &mut moved.dq, &mut moved.ddq][array][place] += by;
                    moved
                };
                let difference = (cost(&moved(h), &weights) - cost(&moved(-h), &weights)) / (2.0 * h);
                let pulled = [&adjoint.q, &adjoint.dq, &adjoint.ddq][array][place];
                // Rounding 1e-14 / h of values of some tens; slopes of ramps are some hundreds.
                let error = (difference - pulled).abs() / (1.0 + pulled.abs());
                assert!(error < 1e-5, "seed {seed}, {place}, {array}: {difference} {pulled}");
            }
        }
    }
}

#[test]
fn the_search_is_never_below_the_check_and_equal_away_from_rest() {
    let model = ur10();
    let limits = limited(&model, all_terms());
    let set = LimitSet::new(&limits, &model).unwrap();
    let mut random = Random::new(9);
    let mut states = Motion::default();
    states.reset(model.dof(), 400);
    for at in 0..states.q.len() {
        let pace = [0.0, 1e-3, 1.0][at % 400 % 3];
        (states.q[at], states.ddq[at]) = (random.uniform(-3.0, 3.0), random.uniform(-5.0, 5.0));
        states.dq[at] = pace * random.uniform(-2.0, 2.0);
    }
    let mut values = Vec::new();
    set.values(&mut set.workspace(), &states, &mut values);
    // The ramps of an arm of this size are at most 2 · 0.02 rad/s wide.
    let is_fast = |sample: usize| (0..6).all(|joint| states.dq[joint * 400 + sample].abs() > 0.05);
    let mut equal = 0;
    for sample in 0..400 {
        let at = |_: &[f64], out: &mut Motion| {
            out.reset(6, 2);
            for joint in 0..6 {
                let from = joint * 400 + sample;
                for to in [2 * joint, 2 * joint + 1] {
                    (out.q[to], out.dq[to], out.ddq[to]) = (states.q[from], states.dq[from], states.ddq[from]);
                }
            }
        };
        let reports = check_limits(&limits, &model, 0.01, 100.0, at).unwrap();
        for (row, constraint) in set.constraints().iter().enumerate() {
            let report = reports.iter().find(|r| r.kind == constraint.kind && r.joint == constraint.subject).unwrap();
            let (searched, checked) = (values[row * 400 + sample], report.worst_ratio - 1.0);
            let scale = 1.0 + checked.abs();
            assert!(searched > checked - 1e-12 * scale, "{constraint:?}: {searched} {checked}");
            let wrist = states.dq[4 * 400 + sample] - 2.0 * states.dq[5 * 400 + sample];
            if is_fast(sample) && wrist.abs() > 0.1 {
                equal += 1;
                assert!((searched - checked).abs() < 1e-12 * scale, "{constraint:?}: {searched} {checked}");
            }
        }
    }
    assert!(equal > 100, "{equal}");
}

/// Compares a pendulum with damping, friction and drive inertia in the robot description with its formula.
#[test]
fn the_check_has_the_torque_of_the_description() {
    let text = r#"<robot name="pendulum"><link name="base"/>
      <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
        <inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
        <limit velocity="3" effort="20"/><dynamics damping="4" friction="3"/></joint></robot>"#;
    let model = read_urdf(text).unwrap().model;
    let limits = Limits::from_model(&model);
    let (amplitude, pace) = (0.8_f64, 2.0_f64);
    let at = |t: f64| {
        let (sin, cos) = (pace * t).sin_cos();
        [amplitude * sin, amplitude * pace * cos, -amplitude * pace * pace * sin]
    };
    let reports = check_limits(&limits, &model, 3.0, 10_000.0, |times, out| {
        out.reset(1, times.len());
        for (place, t) in times.iter().enumerate() {
            [out.q[place], out.dq[place], out.ddq[place]] = at(*t);
        }
    })
    .unwrap();
    let mut workspace = Workspace::new(&model);
    let mut largest = [0.0_f64; 2];
    for step in 0..=30_000 {
        let [q, dq, ddq] = at(f64::from(step) / 10_000.0);
        let rigid = inverse_dynamics(&model, &mut workspace, &[q], &[dq], &[ddq])[0];
        assert!((rigid - ((0.2 + 2.0 * 0.25) * ddq + 2.0 * 9.81 * 0.5 * q.sin())).abs() < 1e-9);
        let all = rigid + 4.0 * dq + 3.0 * dq.signum();
        largest = [largest[0].max(rigid.abs()), largest[1].max(all.abs())];
    }
    let found = reports.iter().find(|report| report.kind == LimitKind::Torque).unwrap();
    assert!((found.worst_ratio - largest[1] / 20.0).abs() < 1e-12, "{found:?} {largest:?}");
    assert!(largest[1] > 2.0 * largest[0], "friction is the larger part: {largest:?}");
}

/// Friction, armature and spring of an MJCF hinge.
#[test]
fn friction_of_another_description_format_is_included() {
    let text = r#"<mujoco><compiler angle="radian"/><worldbody><body name="rod"><inertial pos="0 0 -0.5" mass="2" diaginertia="0.2 0.2 0.01"/>
      <joint name="hinge" axis="0 1 0" armature="0.3" damping="2" frictionloss="1.5" stiffness="5" springref="0.4"/></body></worldbody></mujoco>"#;
    let model = dynident_model::read_robot(text.to_owned(), std::path::Path::new("rod.xml")).unwrap().model;
    let known = KnownTorque::of_description(&model);
    let (mut low, mut high) = ([0.0], [0.0]);
    known.range(&[7.0], [&[1.0], &[-0.5], &[2.0]], &mut low, &mut high);
    let expected = 7.0 + 0.3 * 2.0 + 2.0 * -0.5 - 1.5 + 5.0 * (1.0 - 0.4);
    assert!((low[0] - expected).abs() < 1e-12 && low == high, "{low:?} {high:?} {expected}");
}
