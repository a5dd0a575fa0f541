//! Feasible motions respect torque of friction and drives, turns of continuous joints and the envelope of an iteration,
//! and a search can be stopped.

use crate::common::Job;
use core::f64::consts::PI;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::excitation::limits::LimitKind;
use dynident::iteration::{Robot, SimulatedRobot};
use dynident::model::load_robot;
use dynident::model::terms::{Coulomb, CoulombShape, DriveInertia, TorqueTerm, Viscous};
use dynident::simulation::{LoopSettings, Plant};
use dynident::{
    DesignOutcome, IterationWatch, RunOptions, Silent, Study, check_trajectory, design_study, iterate_with_robot,
};
use std::path::Path;

/// A small search, sufficient for these tests.
const SEARCH: &str = "[design.search]\nstarts = 1\nrounds = 0\nevaluations_per_start = 200\npolish_evaluations = 200\nsearch_samples = 64\n";

fn two_joints(kind: &str, limit: &str, dynamics: &str) -> String {
    let link = |name: &str| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="0.2 0 0.02"/><mass value="1.5"/>
            <inertia ixx="0.004" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
        )
    };
    format!(
        r#"<robot name="two"><link name="base"/>{}{}
        <joint name="first" type="{kind}"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
          <limit {limit}/><dynamics {dynamics}/></joint>
        <joint name="second" type="revolute"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
          <origin xyz="0.4 0 0"/><limit lower="-2" upper="2" velocity="3" effort="30"/></joint></robot>"#,
        link("upper"),
        link("fore")
    )
}

fn designed(folder: &Path, robot: &str, design: &str) -> DesignOutcome {
    std::fs::write(folder.join("robot.urdf"), robot).unwrap();
    let text = format!(
        "[robot]\nfile = \"robot.urdf\"\n[design]\n{design}\n{SEARCH}[design.defaults]\nfloor = false\nself_collision = false\n"
    );
    let path = folder.join("study.toml");
    let study = Study::parse(&text, &path).unwrap();
    design_study(&study, &path, &Job::options(2), |_| ControlFlow::Continue(())).unwrap()
}

/// Friction of the first joint may take 28 of its 34 Nm. The torque of the design, computed here by Newton-Euler plus
/// friction, stays below the limit.
#[test]
fn friction_of_the_description_is_part_of_the_torque_limit() {
    let folder = tempfile::tempdir().unwrap();
    let robot =
        two_joints("revolute", r#"lower="-2.5" upper="2.5" velocity="2" effort="34""#, r#"damping="10" friction="8""#);
    let outcome = designed(folder.path(), &robot, "duration_s = 6.0\ntorque_std_nm = 1.0");
    assert!(outcome.file.feasible, "{:?}", outcome.file.diagnosis);
    let model = load_robot(folder.path().join("robot.urdf")).unwrap().model;
    let (times, motion) = outcome.sampled(10_000.0);
    let mut workspace = Workspace::new(&model);
    let (mut with_friction, mut rigid_alone) = (0.0_f64, 0.0_f64);
    for sample in 0..times.len() {
        let state = |of: &[f64]| [of[sample], of[times.len() + sample]];
        let dq = state(&motion.dq);
        let rigid = inverse_dynamics(&model, &mut workspace, &state(&motion.q), &dq, &state(&motion.ddq))[0];
        rigid_alone = rigid_alone.max(rigid.abs());
        with_friction = with_friction.max((rigid + 10.0 * dq[0] + 8.0 * dq[0].signum()).abs());
    }
    assert!(with_friction <= 34.0 * (1.0 + 1e-6), "{with_friction}");
    let report = |file: &dynident::result::DesignFile, joint: &str| {
        file.limits.iter().find(|own| own.kind == LimitKind::Torque && own.joint == joint).unwrap().worst_ratio
    };
    // The file contains the same; at rest, with undetermined friction, the worse case.
    let used = report(&outcome.file, "first");
    assert!(used * 34.0 >= with_friction - 1e-6 && used <= 1.0 + 1e-6, "{used} {with_friction}");
    assert!(with_friction > 1.3 * rigid_alone && used > 0.9, "it binds: {with_friction} {rigid_alone} {used}");
    // The second joint has no friction, and neither joint has drive inertia.
    let included = outcome.file.notes.iter().find(|note| note.contains("torque limits include")).unwrap();
    assert!(included.contains("coulomb torque of first") && included.contains("viscous torque of first"), "{included}");
    let left = |joint: &str| format!("{joint} {:.0} %", 100.0 * (1.0 - report(&outcome.file, joint)).max(0.0));
    let of = |what: &str| outcome.file.not_checked.iter().find(|line| line.contains(what)).unwrap().clone();
    let (friction, inertia) = (of("torque of friction"), of("torque of drive inertia"));
    assert!(!friction.contains("first") && friction.contains(&left("second")), "{friction}");
    assert!(inertia.contains(&left("first")) && inertia.contains(&left("second")), "{inertia}");
    // The same motion is infeasible with doubled friction.
    let stronger = robot.replace(r#"damping="10""#, r#"damping="20""#);
    std::fs::write(folder.path().join("robot.urdf"), stronger).unwrap();
    let (times, motion) = outcome.sampled(500.0);
    let mut rows = vec!["t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned()];
    rows.extend((0..times.len()).map(|k| {
        let at = |of: &[f64]| format!("{},{}", of[k], of[times.len() + k]);
        format!("{},{},{},{}", times[k], at(&motion.q), at(&motion.dq), at(&motion.ddq))
    }));
    let table = folder.path().join("motion.csv");
    std::fs::write(&table, rows.join("\n") + "\n").unwrap();
    let path = folder.path().join("study.toml");
    let study = Study::parse("[robot]\nfile = \"robot.urdf\"\n[design.defaults]\nfloor = false\n", &path).unwrap();
    let checked = check_trajectory(&study, &path, &table, &Job::options(1)).unwrap();
    assert!(!checked.file.feasible && report(&checked.file, "first") > 1.2);
}

fn still(posture: &str) -> String {
    let rows = ["0", "0.01", "0.02"].map(|t| format!("{t},{posture},0,0,0,0\n"));
    format!("t_s,q1,q2,dq1,dq2,ddq1,ddq2\n{}", rows.concat())
}

/// A declared torque is part of the limit; one without a value is reported.
#[test]
fn declared_torques_are_part_of_the_torque_limit() {
    let folder = tempfile::tempdir().unwrap();
    let robot = two_joints("revolute", r#"lower="-2.5" upper="2.5" velocity="2" effort="34""#, "");
    std::fs::write(folder.path().join("robot.urdf"), robot).unwrap();
    std::fs::write(folder.path().join("still.csv"), still("1.0,0")).unwrap();
    let used = |torque: &str| {
        let text = format!(
            "[robot]\nfile = \"robot.urdf\"\n[design.defaults]\nfloor = false\nself_collision = false\n[[torque]]\nname = \"k\"\njoint = \"first\"\nexpression = \"q - 0.5\"\n{torque}\n"
        );
        let path = folder.path().join("study.toml");
        let study = Study::parse(&text, &path).unwrap();
        let file = check_trajectory(&study, &path, &folder.path().join("still.csv"), &Job::options(1)).unwrap().file;
        let own = file.limits.iter().find(|own| own.kind == LimitKind::Torque && own.joint == "first").unwrap();
        (own.worst_ratio * 34.0, file.not_checked.iter().any(|line| line.contains("without a known value: k")))
    };
    let (without, is_named) = used("");
    let (with, is_named_still) = used("nominal = -20.0");
    // Gravity pulls the arm towards positive angles: the spring of -20 (q - 0.5) = -10 Nm adds to it.
    assert!((with - without - 10.0).abs() < 1e-6, "{with} {without}");
    assert!(is_named && !is_named_still);
}

/// The torque limit includes a known payload.
#[test]
fn a_payload_is_part_of_the_torque_limit() {
    let folder = tempfile::tempdir().unwrap();
    let robot = two_joints("revolute", r#"lower="-2.5" upper="2.5" velocity="2" effort="34""#, "");
    std::fs::write(folder.path().join("robot.urdf"), robot).unwrap();
    std::fs::write(folder.path().join("still.csv"), still("0,0")).unwrap();
    let path = folder.path().join("study.toml");
    let checked = |design: &str, load: &str| {
        let text = format!(
            "[robot]\nfile = \"robot.urdf\"\n[design]\n{design}\ndefaults = {{ floor = false, self_collision = false }}\n[[payload]]\nname = \"weight\"\nlink = \"fore\"\n{load}\n"
        );
        let study = Study::parse(&text, &path).unwrap();
        check_trajectory(&study, &path, &folder.path().join("still.csv"), &Job::options(1))
    };
    let known = "mass_kg = 1.2\ncom_m = [0.3, 0.0, 0.0]";
    let used = |design: &str| {
        let file = checked(design, known).unwrap().file;
        file.limits.iter().find(|own| own.kind == LimitKind::Torque && own.joint == "first").unwrap().worst_ratio * 34.0
    };
    // 1.2 kg on a stretched arm of 0.4 + 0.3 m.
    let more = used("payload = \"weight\"") - used("");
    assert!((more - 1.2 * 9.81 * 0.7).abs() < 1e-9, "{more}");
    let error = checked("payload = \"other\"", known).unwrap_err().to_string();
    assert!(error.contains("other") && error.contains("weight"), "{error}");
    let error = checked("payload = \"weight\"", "mass_kg = 1.2").unwrap_err().to_string();
    assert!(error.contains("com_m"), "{error}");
}

/// With 3 rad/s for 30 s a continuous joint could turn many times.
#[test]
fn a_joint_without_stops_stays_within_a_turn_of_its_start() {
    let folder = tempfile::tempdir().unwrap();
    let robot = two_joints("continuous", r#"velocity="3" effort="100""#, "");
    for (start, about) in [("", 0.0), ("start_posture = { first = 20.0 }", 20.0)] {
        let design = format!("duration_s = 30.0\ntorque_std_nm = 1.0\n{start}");
        let outcome = designed(folder.path(), &robot, &design);
        let (times, motion) = outcome.sampled(100.0);
        let first = &motion.q[..times.len()];
        assert!((first[0] - about).abs() <= PI, "{}", first[0]);
        assert!(first.iter().all(|q| (q - first[0]).abs() <= 2.0 * PI + 1e-6));
        assert!(outcome.file.feasible && outcome.file.assumed.iter().any(|line| line.contains("continuous_turns")));
        assert!(!outcome.file.stopped && (start.is_empty() || first[0] == 20.0));
    }
    // The key disables the assumption, and this is listed.
    let design = "duration_s = 6.0\ntorque_std_nm = 1.0\ndefaults.continuous_turns = 0.0";
    std::fs::write(folder.path().join("robot.urdf"), robot).unwrap();
    let text = format!("[robot]\nfile = \"robot.urdf\"\n[design]\n{design}\n");
    let path = folder.path().join("study.toml");
    let study = Study::parse(&text, &path).unwrap();
    let ended = design_study(&study, &path, &Job::options(1), |_| ControlFlow::Break(())).unwrap();
    assert!(ended.file.not_checked.iter().any(|line| line.contains("position of first")), "{:?}", ended.file);
}

/// A stop request ends every part of the design; the check is then coarser.
#[test]
fn a_design_ends_in_every_part_of_it() {
    let folder = tempfile::tempdir().unwrap();
    // Friction alone exceeds the drives' torque, so limit changes are searched.
    let robot = two_joints("revolute", r#"lower="-2.5" upper="2.5" velocity="2" effort="0.5""#, r#"friction="1""#);
    std::fs::write(folder.path().join("robot.urdf"), robot).unwrap();
    let search = SEARCH.replace("starts = 1", "starts = 2");
    let text = format!("[robot]\nfile = \"robot.urdf\"\n[design]\nduration_s = 4.0\ntorque_std_nm = 1.0\n{search}");
    let path = folder.path().join("study.toml");
    let study = Study::parse(&text, &path).unwrap();
    for round in ["starts", "search", "polish", "restoration", "check", "changes of limits"] {
        let (ended, asked) = (AtomicBool::new(false), AtomicUsize::new(0));
        let outcome = design_study(&study, &path, &Job::options(1), |progress| {
            if ended.load(Ordering::SeqCst) {
                asked.fetch_add(1, Ordering::SeqCst);
            }
            ended.fetch_or(progress.round == round, Ordering::SeqCst);
            if ended.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
        .unwrap();
        assert!(ended.load(Ordering::SeqCst), "{round} was never reached");
        assert!(outcome.file.stopped, "{round}: design.json does not record that it was stopped");
        assert!(asked.load(Ordering::SeqCst) <= 20, "{round}: {asked:?}");
        let whole_hz = outcome.robot.model().characteristic_scale().round_hertz(10_000.0);
        let rate_hz = if round == "changes of limits" { whole_hz } else { 0.1 * whole_hz };
        assert!((outcome.file.check_rate_hz - rate_hz).abs() < 1e-6, "{round}: {}", outcome.file.check_rate_hz);
        assert!(
            !outcome.file.feasible && !outcome.file.diagnosis.is_empty(),
            "{round}: {} {:?}",
            outcome.file.feasible,
            outcome.file.diagnosis
        );
        assert!(!outcome.file.diagnosis.iter().any(|line| line.contains("not finite")), "{:?}", outcome.file.diagnosis);
    }
}

fn three_joints() -> String {
    let link = |name: &str, mass: f64| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="0.01 0.02 0.2"/><mass value="{mass}"/>
            <inertia ixx="0.04" iyy="0.04" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
        )
    };
    let joint = |name: &str, [parent, child]: [&str; 2], axis: &str, z: f64| {
        format!(
            r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>
            <origin xyz="0 0 {z}"/><limit lower="-2.6" upper="2.6" velocity="2.5" effort="80"/></joint>"#
        )
    };
    [
        r#"<robot name="three"><link name="base"/>"#.to_owned(),
        link("l1", 4.0),
        link("l2", 3.0),
        link("l3", 2.0),
        joint("a1", ["base", "l1"], "0 0 1", 0.1),
        joint("a2", ["l1", "l2"], "0 1 0", 0.2),
        joint("a3", ["l2", "l3"], "0 1 0", 0.5),
        "</robot>".to_owned(),
    ]
    .concat()
}

/// Positions of the tool (0.4 m along the last link) and the last joint, by separate formulas.
fn places([a1, a2, a3]: [f64; 3]) -> [[f64; 3]; 2] {
    let at = |reach: f64, z: f64| [reach * a1.cos(), reach * a1.sin(), z];
    let (elbow, z) = (0.5 * a2.sin(), 0.3 + 0.5 * a2.cos());
    [at(elbow, z), at(elbow + 0.4 * (a2 + a3).sin(), z + 0.4 * (a2 + a3).cos())]
}

const LOWER: [f64; 3] = [-0.7, -0.7, 0.2];
const UPPER: [f64; 3] = [0.7, 0.7, 1.0];

/// The first, further and held-out motions respect the workspace of the envelope.
#[test]
fn no_motion_of_an_iteration_leaves_its_envelope() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("robot.urdf"), three_joints()).unwrap();
    let text = format!(
        r#"[robot]
file = "robot.urdf"
[drive]
drive_inertia = true
offset = false
[design]
family = {{ kind = "fourier", harmonics = 3 }}
duration_s = 5.0
{SEARCH}[design.limits]
joints = [
 {{ joint = "a1", speed = 2.0, acceleration = 6.0 }},
 {{ joint = "a2", speed = 2.0, acceleration = 6.0 }},
 {{ joint = "a3", speed = 2.5, acceleration = 8.0 }},
]
[design.defaults]
floor = false
self_collision = false
[iteration]
rate_hz = 250.0
bandwidth_hz = 4.0
max_runs = 2
home = [0.0, 1.2, -1.2]
approach_speed = 0.4
held_out = {{ every = 1 }}
motion = "redesign"
parallel_filter = {{ factor = 4, cutoff_hz = 8.0 }}
[iteration.envelope]
tracking_error = 0.2
speed = 2.3
torque = 70.0
workspace = {{ lower = {LOWER:?}, upper = {UPPER:?}, tool = [0.0, 0.0, 0.4] }}
[iteration.rehearsal]
delay_s = 0.004
robots = 2
uncertainty_percent = 15.0
postures = 50
"#
    );
    let path = folder.path().join("study.toml");
    let study = Study::parse(&text, &path).unwrap();
    let mut hear = |_: &_, _: &[_]| {};
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let model = load_robot(folder.path().join("robot.urdf")).unwrap().model;
    let mut robot = |_: &[String]| -> Box<dyn Robot> {
        let terms: Vec<TorqueTerm> = (0..3)
            .flat_map(|joint| {
                let shape = CoulombShape::Smooth { width: 0.02 };
                [
                    TorqueTerm::DriveInertia(DriveInertia { joint }),
                    TorqueTerm::Viscous(Viscous { joint }),
                    TorqueTerm::Coulomb(Coulomb { joint, shape }),
                ]
            })
            .collect();
        let plant = Plant::new(&model, &terms, &[0.25, 1.0, 2.0].repeat(3)).unwrap();
        Box::new(SimulatedRobot::new(plant, LoopSettings::default()).unwrap())
    };
    let out = folder.path().join("out");
    let file = iterate_with_robot(&study, &path, &out, false, &options, &mut watch, &mut robot).unwrap();
    assert!(file.status != "refused", "{}", file.reason);
    assert_eq!(file.runs.len(), 2, "{}", file.reason);
    let kept: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("trajectory.json")).unwrap()).unwrap();
    let mut nearest = f64::INFINITY;
    for motion in [&kept["trajectories"][0], &kept["held_out"]] {
        let samples = motion["samples"].as_u64().unwrap() as usize;
        let q: Vec<f64> = motion["q"].as_array().unwrap().iter().map(|q| q.as_f64().unwrap()).collect();
        for sample in 0..samples {
            for place in places([q[sample], q[samples + sample], q[2 * samples + sample]]) {
                for axis in 0..3 {
                    nearest = nearest.min(place[axis] - LOWER[axis]).min(UPPER[axis] - place[axis]);
                }
            }
        }
    }
    // A tenth of the tracking error, 0.02 rad, on an arm of 0.9 m leaves some mm to cm; the motion uses the rest of the
    // box.
    assert!(nearest > 2e-3 && nearest < 0.1, "{nearest}");
}
