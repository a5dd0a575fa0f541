//! Values, derivatives, peaks and the independent check of all limits, on random trees and a real arm.

use crate::common::{Harmonics, all_limits, grid, palletizer, ur10};
use dynident_excitation::Motion;
use dynident_excitation::check::check_limits;
use dynident_excitation::limits::{
    AssumedLimits, ColumnLimit, LimitKind, LimitSet, LimitWorkspace, Limits, LimitsInForce, LinkPoint, PeakSettings,
    ShapesOfLinks, StartPositions, peaks,
};
use dynident_model::Model;
use dynident_model::sample::{Random, random_tree};
use std::collections::BTreeMap;

#[test]
fn one_factor_scales_the_limits_of_all_joints_but_not_stated_ones() {
    let model = ur10();
    let of = |text: &str| -> Result<LimitsInForce, String> {
        let given: Limits = toml::from_str(text).map_err(|error| error.to_string())?;
        let assumed = AssumedLimits { floor: false, self_collision: false, ..AssumedLimits::default() };
        LimitsInForce::new(&model, &ShapesOfLinks::default(), &assumed, &given, &StartPositions::default())
            .map_err(|error| error.to_string())
    };
    let plain = of("").unwrap();
    assert!(!plain.assumed.iter().any(|words| words.contains("limits.scale")));
    for (text, [speed, acceleration, torque]) in [
        ("scale = 0.8", [0.8; 3]),
        ("scale = { speed = 0.5 }", [0.5, 1.0, 1.0]),
        ("scale = { acceleration = 0.25, torque = 0.9 }", [1.0, 0.25, 0.9]),
    ] {
        let scaled = of(text).unwrap();
        assert!(scaled.assumed.iter().any(|words| words.contains("limits.scale")), "{text}");
        for (joint, whole) in scaled.limits.joints.iter().zip(&plain.limits.joints) {
            assert_eq!(joint.position, whole.position, "{text}");
            assert_eq!(joint.speed, whole.speed.map(|limit| limit * speed), "{text}");
            assert_eq!(joint.acceleration, whole.acceleration.map(|limit| limit * acceleration), "{text}");
            assert_eq!(joint.torque, whole.torque.map(|limit| limit * torque), "{text}");
            assert!(joint.speed.is_some() && joint.acceleration.is_some() && joint.torque.is_some(), "{text}");
        }
    }
    // The limit of one joint stays as stated, and the factors are applied once.
    let name = &model.joints()[1].name;
    let stated = of(&format!("scale = 0.5\njoints = [{{ joint = \"{name}\", speed = 0.3 }}]")).unwrap().limits;
    assert_eq!(stated.joints[1].speed, Some(0.3));
    assert_eq!(stated.joints[1].torque, plain.limits.joints[1].torque.map(|limit| 0.5 * limit));
    assert!(stated.scale.is_one());
    for (text, words) in [
        ("scale = 0.0", "must be above 0"),
        ("scale = 1.5", "must be at most 1"),
        ("scale = { torque = nan }", "give a finite number"),
        ("scale = { velocity = 0.5 }", "scale"),
    ] {
        let error = of(text).unwrap_err();
        assert!(error.contains(words), "{text}: {error}");
    }
    // A study that states nothing is written without the key.
    assert!(!toml::to_string(&Limits::default()).unwrap().contains("scale"));
    let half: Limits = toml::from_str("scale = 0.5").unwrap();
    assert_eq!(toml::from_str::<Limits>(&toml::to_string(&half).unwrap()).unwrap(), half);
}

/// Σ w c of a motion.
fn cost(set: &LimitSet, motion: &Motion, weights: &[f64], swept: bool) -> f64 {
    let mut values = Vec::new();
    set.values(&mut workspace(set, swept), motion, &mut values);
    values.iter().zip(weights).map(|(c, w)| c * w).sum()
}

fn workspace(set: &LimitSet, swept: bool) -> LimitWorkspace {
    let mut workspace = set.workspace();
    if swept {
        workspace.test_between_samples();
    }
    workspace
}

fn gradient_agrees(model: &Model, seed: u64, swept: bool) {
    let set = LimitSet::new(&all_limits(model), model).expect("the limits fit the model");
    let mut random = Random::new(seed);
    let mut motion = Motion::default();
    Harmonics::random(&mut random, model.dof(), 0.8).motion(&grid(1.0, 8), &mut motion);
    // Each row alone with random weights, so that a larger one does not hide it.
    for row in 0..set.constraints().len() {
        let mut weights = vec![0.0; set.constraints().len() * motion.samples];
        for weight in &mut weights[row * motion.samples..(row + 1) * motion.samples] {
            *weight = random.uniform(-1.0, 1.0);
        }
        let mut adjoint = Motion::default();
        adjoint.reset(model.dof(), motion.samples);
        set.apply_adjoint(&mut workspace(&set, swept), &motion, &weights, &mut adjoint);
        let h = 1e-6;
        let mut ahead = motion.clone();
        let mut behind = motion.clone();
        let mut expected = 0.0;
        let mut size = 1.0_f64;
        for ((ahead, behind), pulled) in [
            (&mut ahead.q, &mut behind.q),
            (&mut ahead.dq, &mut behind.dq),
            (&mut ahead.ddq, &mut behind.ddq),
            (&mut ahead.dddq, &mut behind.dddq),
        ]
        .into_iter()
        .zip([&adjoint.q, &adjoint.dq, &adjoint.ddq, &adjoint.dddq])
        {
            for ((ahead, behind), pulled) in ahead.iter_mut().zip(behind).zip(pulled) {
                let direction = random.uniform(-1.0, 1.0);
                *ahead += h * direction;
                *behind -= h * direction;
                expected += pulled * direction;
                size = size.max(pulled.abs());
            }
        }
        let difference = (cost(&set, &ahead, &weights, swept) - cost(&set, &behind, &weights, swept)) / (2.0 * h);
        // Central differences: truncation h² times third derivatives, rounding 1e-16 / h = 1e-10 of the values.
        let error = (difference - expected).abs() / size;
        assert!(error < 1e-7, "seed {seed}, {:?}: {difference} {expected}", set.constraints()[row]);
    }
}

#[test]
fn the_adjoint_equals_central_differences() {
    for swept in [false, true] {
        gradient_agrees(&ur10(), 3, swept);
        gradient_agrees(&palletizer(), 4, swept);
        for seed in 0..12 {
            gradient_agrees(&random_tree(seed, 1 + seed as usize % 8), seed, swept);
        }
    }
}

/// Half a turn in one step across the column: both samples are outside, and only the path between them intersects it.
#[test]
fn a_column_is_seen_between_two_samples() {
    let model = ur10();
    let column = ColumnLimit {
        radius_m: 0.3,
        axis_xy_m: [0.0, 0.0],
        height_m: None,
        points: vec![LinkPoint { link: "wrist_3_link".to_owned(), at_m: [0.0; 3], radius_m: 0.0 }],
    };
    let set = LimitSet::new(&Limits { column: Some(column), ..Limits::default() }, &model).unwrap();
    let mut motion = Motion::default();
    motion.reset(model.dof(), 2);
    motion.q[1] = core::f64::consts::PI;
    let (mut sampled, mut swept) = (Vec::new(), Vec::new());
    set.values(&mut set.workspace(), &motion, &mut sampled);
    set.values(&mut workspace(&set, true), &motion, &mut swept);
    assert!(sampled.iter().all(|c| *c < 0.0), "{sampled:?}");
    // Half a turn moves the point to the other side of the axis, through the column.
    assert!((swept[0] - 1.0).abs() < 1e-9 && swept[1] == sampled[1], "{swept:?}");
}

/// Largest value per kind and subject.
fn worst(set: &LimitSet, values: &[f64], samples: usize) -> BTreeMap<(LimitKind, String), f64> {
    let mut worst = BTreeMap::new();
    for (constraint, values) in set.constraints().iter().zip(values.chunks_exact(samples)) {
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let at = worst.entry((constraint.kind, constraint.subject.clone())).or_insert(f64::NEG_INFINITY);
        *at = most.max(*at);
    }
    worst
}

#[test]
fn check_agrees_with_the_values_and_peaks_bound_both() {
    let mut models = vec![ur10(), palletizer()];
    models.extend((20..26).map(|seed| random_tree(seed, 2 + seed as usize % 6)));
    for (seed, model) in models.iter().enumerate() {
        let limits = all_limits(model);
        let set = LimitSet::new(&limits, model).unwrap();
        let mut workspace = set.workspace();
        let family = Harmonics::random(&mut Random::new(seed as u64), model.dof(), 0.6);
        let reports = check_limits(&limits, model, 1.0, 10_000.0, |times, out| family.motion(times, out)).unwrap();
        let times: Vec<f64> = (0..=10_000).map(|k| f64::from(k) / 10_000.0).collect();
        let (mut motion, mut values) = (Motion::default(), Vec::new());
        family.motion(&times, &mut motion);
        set.values(&mut workspace, &motion, &mut values);
        let sampled = worst(&set, &values, times.len());
        let mut checked = BTreeMap::new();
        for report in &reports {
            let ratio = checked.entry((report.kind, report.joint.clone())).or_insert(f64::NEG_INFINITY);
            *ratio = report.worst_ratio.max(*ratio);
            assert_eq!(report.violated, report.worst_ratio > 1.0 + 1e-6);
        }
        assert_eq!(sampled.keys().collect::<Vec<_>>(), checked.keys().collect::<Vec<_>>());
        for (key, c) in &sampled {
            // The distance of rods in the check converges to 1e-8 of a rod's length; the rest is rounding.
            let links = key.0 == LimitKind::SelfCollision;
            let tolerance = if links { 1e-6 } else { 1e-10 };
            // The search treats all large distances as equal.
            let expected = if links { (checked[key] - 1.0).max(-0.25) } else { checked[key] - 1.0 };
            assert!((expected - c).abs() < tolerance * (1.0 + c.abs()), "{key:?}: {} {c}", checked[key]);
        }
        let found = peaks(&set, &mut workspace, &grid(1.0, 100), PeakSettings::default(), |times, out| {
            family.motion(times, out);
        });
        let peak_values: Vec<f64> = found.iter().map(|peak| peak.value).collect();
        for (key, peak) in worst(&set, &peak_values, 1) {
            let (dense, scale) = (sampled[&key], 1.0 + sampled[&key].abs());
            assert!(peak >= dense - 1e-9 * scale, "{key:?}: refined {peak}, sampled {dense}");
            // At 10 kHz a peak of harmonics below 12 rad/s is at most (1e-4 · 12)² / 8 = 2e-7 above the samples; a
            // distance has corners.
            assert!(peak <= dense + 1e-3 * scale, "{key:?}: refined {peak}, sampled {dense}");
        }
        for (peak, constraint) in found.iter().zip(set.constraints()) {
            let mut at = Motion::default();
            family.motion(&[peak.at_s], &mut at);
            set.values(&mut workspace, &at, &mut values);
            assert!((values[peak.row] - peak.value).abs() < 1e-12 * (1.0 + peak.value.abs()), "{constraint:?}");
        }
    }
}

#[test]
fn a_peak_between_samples_is_found_to_its_last_digits() {
    let model = random_tree(1, 1);
    let name = model.joints()[0].name.clone();
    let limit = dynident_excitation::limits::JointLimit { joint: name, speed: Some(2.0), ..Default::default() };
    let limits = dynident_excitation::limits::Limits { joints: vec![limit], ..Default::default() };
    let set = LimitSet::new(&limits, &model).unwrap();
    // q̇ = 3 cos(t - 1.234): the maximum, 1.5 times the limit, is between the samples at 1 and 1.5 s.
    let family = Harmonics { joints: vec![(0.0, [[3.0, 1.0, -1.234], [0.0; 3], [0.0; 3]])] };
    let found = peaks(&set, &mut set.workspace(), &grid(3.0, 6), PeakSettings::default(), |times, out| {
        family.motion(times, out);
    });
    assert!((found[0].value - 0.5).abs() < 1e-12, "{found:?}");
    // The time of a flat maximum is accurate to the square root of rounding.
    assert!((found[0].at_s - 1.234).abs() < 1e-6, "{found:?}");
    assert!((found[0].sampled - (1.5 * 0.234_f64.cos() - 1.0)).abs() < 1e-12, "{found:?}");
}
