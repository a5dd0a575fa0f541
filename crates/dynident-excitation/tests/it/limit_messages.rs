//! Every contradiction of limits, with itself or with a motion, has its own message; no input causes a panic or NaN.

use crate::common::{Harmonics, all_limits, grid, ur10};
use dynident_excitation::Motion;
use dynident_excitation::check::check_limits;
use dynident_excitation::limits::{
    BoxLimit, ColumnLimit, JointLimit, LimitError, LimitKind, LimitSet, Limits, LinkCapsule, LinkPoint, Relaxation,
    SelfCollision, diagnose_until,
};
use dynident_model::sample::{Random, planar_2r};
use dynident_model::{Body, InertialParameters, Link, Mat3, Model, Transform, Vec3};
use proptest::prelude::*;

/// The UR10's limits with one change, and the resulting error.
fn error_of(change: impl FnOnce(&mut Limits)) -> (LimitError, String) {
    let model = ur10();
    let mut limits = Limits::from_model(&model);
    assert_eq!(limits.validate(&model), Ok(()));
    change(&mut limits);
    let error = LimitSet::new(&limits, &model).expect_err("the change contradicts");
    let message = error.to_string();
    (error, message)
}

#[test]
fn contradictions_are_named() {
    let (error, message) = error_of(|limits| limits.joints[2].position = Some([1.0, -1.0]));
    assert!(matches!(error, LimitError::LowerAboveUpper { .. }) && message.contains("elbow_joint"), "{message}");
    let (error, message) = error_of(|limits| limits.joints[2].position = Some([0.5, 0.5]));
    assert!(matches!(error, LimitError::ZeroRange { position: 0.5, .. }) && message.contains("lock"), "{message}");
    let (error, message) = error_of(|limits| limits.joints[0].speed = Some(0.0));
    assert!(matches!(error, LimitError::NotPositive { .. }) && message.contains("shoulder_pan_joint"), "{message}");
    let (error, message) = error_of(|limits| limits.joints[0].jerk = Some(f64::NAN));
    assert!(matches!(error, LimitError::NotFinite { .. }) && message.contains("jerk"), "{message}");
    let (error, message) = error_of(|limits| limits.joints[0].position = Some([f64::NEG_INFINITY, 0.0]));
    assert!(matches!(error, LimitError::NotFinite { .. }) && message.contains("lower end"), "{message}");
    let (error, _) = error_of(|limits| limits.joints[0].torque_margin = 1.0);
    assert!(matches!(error, LimitError::OutOfRange { .. }));
    let (error, message) = error_of(|limits| limits.joints[0].joint = "knee".to_owned());
    assert!(matches!(error, LimitError::UnknownJoint { .. }) && message.contains("elbow_joint"), "{message}");
    let (error, _) = error_of(|limits| limits.joints.push(limits.joints[1].clone()));
    assert!(matches!(error, LimitError::DuplicateJoint { .. }));
    let tool = |link: &str| LinkPoint { link: link.to_owned(), radius_m: 0.3, ..LinkPoint::default() };
    let (error, message) = error_of(|limits| {
        limits.column = Some(ColumnLimit { radius_m: 0.2, points: vec![tool("hand")], ..ColumnLimit::default() });
    });
    assert!(matches!(error, LimitError::UnknownLink { .. }) && message.contains("wrist_3_link"), "{message}");
    let (error, _) = error_of(|limits| limits.column = Some(ColumnLimit { radius_m: 0.2, ..ColumnLimit::default() }));
    assert!(matches!(error, LimitError::NoPoints { .. }));
    let (error, message) = error_of(|limits| {
        let points = vec![tool("wrist_3_link")];
        limits.boxes.push(BoxLimit { y_m: Some([0.0, 0.5]), points, ..BoxLimit::default() });
    });
    assert!(matches!(error, LimitError::NoRoom { .. }) && message.contains("y of box 1"), "{message}");
    let (error, _) = error_of(|limits| {
        let capsule = LinkCapsule { link: "forearm_link".to_owned(), from_m: [0.0; 3], to_m: [0.0; 3], radius_m: -0.1 };
        limits.self_collision = Some(SelfCollision { capsules: vec![capsule], ..SelfCollision::default() });
    });
    assert!(matches!(error, LimitError::NotPositive { .. }));
}

#[test]
fn torque_limits_need_a_prior_of_what_the_joint_carries() {
    let robot = ur10();
    let mut bodies = robot.bodies().to_vec();
    for link in &mut bodies[3].links {
        link.inertial = None;
    }
    let base = Body {
        links: vec![Link {
            name: "floor".to_owned(),
            placement: Transform::IDENTITY,
            inertial: None,
            collision: Vec::new(),
        }],
    };
    let model = Model::new("ur10 without one prior", base, robot.joints().to_vec(), bodies).unwrap();
    let limits = Limits::from_model(&model);
    let error = limits.validate(&model).unwrap_err();
    assert!(error.to_string().contains("wrist_1_link"), "{error}");
    // The joints beyond the body without inertia do not carry it.
    let mut beyond = limits.clone();
    for limit in &mut beyond.joints[..4] {
        limit.torque = None;
    }
    assert_eq!(beyond.validate(&model), Ok(()));
}

#[test]
fn a_start_outside_is_named_with_its_amount() {
    let model = ur10();
    let limits = Limits::from_model(&model);
    // Upright: gravity on the shoulder within its limit. UR10 joints turn ±2π, the elbow ±π.
    let upright = [0.0, -1.57, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(limits.check_start(&model, &upright), Ok(()));
    let error = limits.check_start(&model, &[0.0, -1.57, 4.0, 0.0, 0.0, 0.0]).unwrap_err();
    assert!(
        matches!(&error, LimitError::StartOutside { kind: LimitKind::Position, subject, .. } if subject == "elbow_joint")
    );
    assert!(error.to_string().contains("4.0000 rad"), "{error}");
    assert!(matches!(limits.check_start(&model, &[0.0; 5]), Err(LimitError::Length { expected: 6, found: 5, .. })));
    assert!(matches!(limits.check_start(&model, &[f64::NAN; 6]), Err(LimitError::NotFinite { .. })));
    let mut weak = limits.clone();
    weak.joints[1].torque = Some(50.0);
    let error = weak.check_start(&model, &[0.0; 6]).unwrap_err();
    assert!(matches!(error, LimitError::StartOutside { kind: LimitKind::Torque, .. }), "stretched out: {error}");
}

#[test]
fn a_duration_too_short_for_any_motion_is_named() {
    let model = ur10();
    let mut limits = Limits::from_model(&model);
    for limit in &mut limits.joints {
        limit.acceleration = Some(4.0);
    }
    limits.joints[3].acceleration = Some(1.0);
    // 1 rad at 1 rad/s²: 2 s; the others 1 s.
    assert_eq!(limits.check_duration(&model, 2.001, 1.0), Ok(()));
    let error = limits.check_duration(&model, 1.9, 1.0).unwrap_err();
    assert!(
        matches!(&error, LimitError::TooShort { joint, shortest_s, .. } if joint == "wrist_1_joint" && (shortest_s - 2.0).abs() < 1e-12)
    );
    assert!(matches!(limits.check_duration(&model, f64::NAN, 1.0), Err(LimitError::NotFinite { .. })));
    assert!(matches!(limits.check_duration(&model, 0.0, 1.0), Err(LimitError::NotPositive { .. })));
}

/// One joint of the planar arm with a harmonic, the other at rest.
fn swing(amplitude: f64, frequency: f64, offset: f64) -> (Model, Vec<f64>, Motion) {
    let rod = InertialParameters::from_centre_of_mass(1.0, Vec3([0.5, 0.0, 0.0]), &Mat3::IDENTITY.scale(0.1));
    let model = planar_2r(1.0, rod, rod);
    let family =
        Harmonics { joints: vec![(offset, [[amplitude, frequency, 0.0], [0.0; 3], [0.0; 3]]), (0.0, [[0.0; 3]; 3])] };
    let times = grid(4.0, 4000);
    let mut motion = Motion::default();
    family.motion(&times, &mut motion);
    (model, times, motion)
}

fn first_joint(limit: &JointLimit) -> Limits {
    Limits { joints: vec![JointLimit { joint: "joint1".to_owned(), ..limit.clone() }], ..Limits::default() }
}

#[test]
fn too_fast_a_path_gives_its_smallest_stretch() {
    let (model, times, motion) = swing(0.5, 4.0, 0.0);
    // Peaks: velocity 2, acceleration 8. The velocity needs 2 / 1.6 = 1.25, the acceleration √(8 / 4.5) = 4/3.
    let limits = first_joint(&JointLimit { speed: Some(1.6), acceleration: Some(4.5), ..JointLimit::default() });
    let diagnosis = diagnose_until(&LimitSet::new(&limits, &model).unwrap(), &times, &motion, &|| false);
    assert_eq!(diagnosis.broken.len(), 2);
    let [Relaxation::Stretch { factor, duration_s }] = diagnosis.relaxations[..] else { panic!("{diagnosis:?}") };
    // 1 kHz samples of sin(4t) miss its peak by at most (4e-3 / 2)² / 2, and the stretch by the root of that.
    assert!((factor - 4.0 / 3.0).abs() < 4e-6 && (duration_s - 4.0 * factor).abs() < 1e-12, "{factor}");
    let text = diagnosis.sentences().join(" ");
    assert!(text.contains("acceleration limit of `joint1`") && text.contains("1.3333 times as long"), "{text}");
}

#[test]
fn a_single_violated_kind_gives_the_sufficient_limit() {
    let (model, times, motion) = swing(0.5, 4.0, 0.7);
    let limits = first_joint(&JointLimit { position: Some([-1.0, 1.0]), ..JointLimit::default() });
    let diagnosis = diagnose_until(&LimitSet::new(&limits, &model).unwrap(), &times, &motion, &|| false);
    let [Relaxation::Limits { kind: LimitKind::Position, changes }] = &diagnosis.relaxations[..] else {
        panic!("a slower run does not fix a position: {diagnosis:?}")
    };
    assert!((changes[0].2 - 1.2).abs() < 1e-5, "{changes:?}");
    // The first maximum of sin(4t) is at π/8 s; it repeats later.
    let phase = (diagnosis.broken[0].at_s * 4.0).rem_euclid(core::f64::consts::TAU);
    assert!((phase - core::f64::consts::FRAC_PI_2).abs() < 4e-3);
}

#[test]
fn a_stretch_leaves_gravity() {
    let (model, times, motion) = swing(0.5, 8.0, -core::f64::consts::FRAC_PI_2);
    let limits = first_joint(&JointLimit { torque: Some(20.0), ..JointLimit::default() });
    let set = LimitSet::new(&limits, &model).unwrap();
    let diagnosis = diagnose_until(&set, &times, &motion, &|| false);
    let factor = diagnosis.relaxations.iter().find_map(|relaxation| match relaxation {
        Relaxation::Stretch { factor, .. } => Some(*factor),
        _ => None,
    });
    let factor = factor.expect("about its lowest point the arm can be swung slowly");
    let worst = |factor: f64| {
        let family = Harmonics {
            joints: vec![
                (-core::f64::consts::FRAC_PI_2, [[0.5, 8.0 / factor, 0.0], [0.0; 3], [0.0; 3]]),
                (0.0, [[0.0; 3]; 3]),
            ],
        };
        let reports =
            check_limits(&limits, &model, 4.0 * factor, 1000.0 / factor, |times, out| family.motion(times, out));
        reports.unwrap()[0].worst_ratio
    };
    assert!(worst(factor) <= 1.0 + 2e-6, "{}", worst(factor));
    assert!(worst(factor * 0.999) > 1.0 + 1e-6);
    // Held horizontally, gravity alone (1 kg at 0.5 m and 1 kg at 1.5 m: 19.6 Nm) violates 10 Nm at any velocity.
    let (model, times, motion) = swing(0.2, 8.0, 0.0);
    let limits = first_joint(&JointLimit { torque: Some(10.0), position: Some([-0.1, 0.1]), ..JointLimit::default() });
    let diagnosis = diagnose_until(&LimitSet::new(&limits, &model).unwrap(), &times, &motion, &|| false);
    let [Relaxation::Combined { factor, changes, .. }] = &diagnosis.relaxations[..] else {
        panic!("neither a slower run nor one kind of limit alone fixes both: {diagnosis:?}")
    };
    assert!(
        diagnosis.sentences().last().unwrap().starts_with("No single sufficient change"),
        "{:?}",
        diagnosis.sentences()
    );
    // The position needs a half range of 0.2 rad at any velocity. For any factor, the relaxed limits must be kept by
    // the independent check ...
    let relaxed = |scale: f64| {
        let needed = |wanted| changes.iter().find(|(kind, _)| *kind == wanted).unwrap().1.2 * scale;
        let (half, torque) = (needed(LimitKind::Position), needed(LimitKind::Torque));
        let limits =
            first_joint(&JointLimit { position: Some([-half, half]), torque: Some(torque), ..JointLimit::default() });
        let family =
            Harmonics { joints: vec![(0.0, [[0.2, 8.0 / factor, 0.0], [0.0; 3], [0.0; 3]]), (0.0, [[0.0; 3]; 3])] };
        let reports =
            check_limits(&limits, &model, 4.0 * factor, 1000.0 / factor, |times, out| family.motion(times, out));
        reports.unwrap().iter().filter(|report| report.violated).count()
    };
    assert_eq!((relaxed(1.0 + 1e-5), relaxed(0.999)), (0, 2));
    // ... and no factor on a fine grid has a smaller sum of relative changes. In a slower run the torque approaches
    // gravity's 19.6 Nm.
    let cost = |factor: f64| {
        let family =
            Harmonics { joints: vec![(0.0, [[0.2, 8.0 / factor, 0.0], [0.0; 3], [0.0; 3]]), (0.0, [[0.0; 3]; 3])] };
        let reports =
            check_limits(&limits, &model, 4.0 * factor, 1000.0 / factor, |times, out| family.motion(times, out));
        factor - 1.0 + reports.unwrap().iter().map(|report| (report.worst_ratio - 1.0).max(0.0)).sum::<f64>()
    };
    let found = cost(*factor);
    for k in 0..200 {
        // The sampled peak has an error of up to 1e-5.
        assert!(found <= cost(1.0 + 0.02 * f64::from(k)) + 1e-4, "{found} at {factor}, less at step {k}");
    }
}

#[test]
fn a_motion_that_is_not_finite_is_a_violation() {
    let model = ur10();
    let limits = all_limits(&model);
    let reports = check_limits(&limits, &model, 0.01, 1000.0, |times, out| {
        out.reset(6, times.len());
        out.q.fill(f64::NAN);
    });
    let reports = reports.unwrap();
    let positions = reports.iter().filter(|report| report.kind == LimitKind::Position);
    assert!(
        positions.clone().count() == 6
            && positions.clone().all(|report| report.violated && report.worst_ratio == f64::INFINITY)
    );
    assert!(matches!(check_limits(&limits, &model, 1e9, 1e9, |_, _| ()), Err(LimitError::OutOfRange { .. })));
    assert!(matches!(check_limits(&limits, &model, f64::NAN, 1e4, |_, _| ()), Err(LimitError::NotPositive { .. })));
}

#[test]
fn unknown_keys_are_refused_and_overlays_win_value_by_value() {
    assert!(toml::from_str::<Limits>("joints = [{ joint = \"a\", acceleraton = 3.0 }]").is_err());
    let over: Limits =
        toml::from_str("joints = [{ joint = \"elbow_joint\", acceleration = 10.0, speed = 1.0 }]").unwrap();
    let collision: Limits = toml::from_str("self_collision = { radius_m = 0.05 }").unwrap();
    assert_eq!(collision.self_collision.unwrap().min_overlap_share, 0.5);
    let model = ur10();
    let under = Limits::from_model(&model);
    let both = under.clone().overlaid(&over);
    let (elbow, before) = (both.of("elbow_joint").unwrap(), under.of("elbow_joint").unwrap());
    assert_eq!((elbow.speed, elbow.acceleration), (Some(1.0), Some(10.0)));
    assert_eq!((elbow.position, elbow.torque), (before.position, before.torque));
    assert_eq!(both.joints.len(), 6);
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        -10.0..10.0_f64,
        Just(0.0),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::MIN_POSITIVE),
        Just(f64::MAX),
    ]
}

proptest! {
    #[test]
    fn limits_of_any_numbers_give_a_message_or_numbers(
        numbers in proptest::collection::vec(proptest::option::of(any_number()), 8),
        pick in 0..6_usize,
        height in any_number(),
        radius in any_number(),
    ) {
        let model = ur10();
        let limits = Limits {
            joints: vec![JointLimit {
                joint: model.joints()[pick].name.clone(),
                position: numbers[0].zip(numbers[1]).map(|(lower, upper)| [lower, upper]),
                speed: numbers[2],
                acceleration: numbers[3],
                jerk: numbers[4],
                torque: numbers[5],
                torque_margin: numbers[6].unwrap_or(0.0),
                power_w: numbers[7],
            }],
            floor: Some(dynident_excitation::limits::FloorLimit { height_m: height, ..Default::default() }),
            self_collision: Some(SelfCollision { radius_m: radius, ..SelfCollision::default() }),
            ..Limits::default()
        };
        match LimitSet::new(&limits, &model) {
            Err(error) => prop_assert!(!error.to_string().is_empty()),
            Ok(set) => {
                let mut motion = Motion::default();
                Harmonics::random(&mut Random::new(4), 6, 0.5).motion(&grid(1.0, 5), &mut motion);
                let mut values = Vec::new();
                set.values(&mut set.workspace(), &motion, &mut values);
                prop_assert!(values.iter().all(|c| !c.is_nan()));
            }
        }
    }
}
