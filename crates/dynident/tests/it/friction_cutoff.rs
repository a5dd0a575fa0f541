//! Unmodelled friction is noise in the first prediction of the cut-off, which must not hide it.

use crate::common::{Job, Random};
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::model::{Model, read_urdf};
use std::path::Path;

const SCARA: &str = r#"<robot name="scara"><link name="base"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit effort="500" lower="-2.2" upper="2.2" velocity="4"/></joint>
<link name="l1"><inertial><origin xyz="0.17 0 0.02"/><mass value="8.5"/><inertia ixx="0.023" ixy="0" ixz="0" iyy="0.12" iyz="0" izz="0.129"/></inertial></link>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.35 0 0.05"/><axis xyz="0 0 1"/><limit effort="500" lower="-2.3" upper="2.3" velocity="4"/></joint>
<link name="l2"><inertial><origin xyz="0.12 0 0.08"/><mass value="6"/><inertia ixx="0.0184" ixy="0" ixz="0" iyy="0.0725" iyz="0" izz="0.0684"/></inertial></link>
<joint name="j3" type="prismatic"><parent link="l2"/><child link="l3"/><origin xyz="0.25 0 0"/><axis xyz="0 0 1"/><limit effort="500" lower="-0.2" upper="0.05" velocity="4"/></joint>
<link name="l3"><inertial><origin xyz="0 0 -0.05"/><mass value="1.2"/><inertia ixx="0.0161" ixy="0" ixz="0" iyy="0.0161" iyz="0" izz="0.00018"/></inertial></link>
<joint name="j4" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0 0 -0.2"/><axis xyz="0 0 1"/><limit effort="500" lower="-3" upper="3" velocity="4"/></joint>
<link name="l4"><inertial><origin xyz="0.03 0.01 -0.03"/><mass value="0.8"/><inertia ixx="0.00048" ixy="0" ixz="0" iyy="0.00091" iyz="0" izz="0.00091"/></inertial></link></robot>"#;

const DOF: usize = 4;
/// Viscous friction, Coulomb friction forward and backward, drive inertia of each joint.
const DRIVES: [[f64; 4]; DOF] =
    [[4.0, 3.5, 2.5, 0.9], [2.5, 2.3, 1.7, 0.4], [40.0, 14.0, 10.0, 8.0], [0.2, 0.35, 0.25, 0.02]];
/// Centre and amplitude of each joint's motion, rad (m).
const STROKE: [[f64; 2]; DOF] = [[0.0, 1.6], [0.0, 1.7], [-0.075, 0.08], [0.0, 2.0]];
const RATE_HZ: f64 = 1000.0;
const LENGTH_S: f64 = 15.0;
const HARMONICS: usize = 6;
const STEP: f64 = 0.01;

/// Six harmonics of 0.1 Hz with a random phase per seed; noise is 0.5 % of each joint's friction.
fn write_log(path: &Path, model: &Model, seed: u64) {
    let (mut workspace, mut random) = (Workspace::new(model), Random(seed));
    let waves: Vec<[[f64; 2]; HARMONICS]> =
        (0..DOF).map(|_| core::array::from_fn(|_| [random.normal(), 3.0 * random.next()])).collect();
    let mut text = "t,q1,q2,q3,q4,tau1,tau2,tau3,tau4\n".to_owned();
    for row in 0..(RATE_HZ * LENGTH_S) as usize {
        let t = row as f64 / RATE_HZ;
        let (mut motion, mut fields) = ([[0.0; DOF]; 3], vec![t.to_string()]);
        for (joint, waves) in waves.iter().enumerate() {
            let all: f64 = waves.iter().map(|[a, _]| a.abs()).sum();
            motion[0][joint] = STROKE[joint][0];
            for (k, [amplitude, phase]) in waves.iter().enumerate() {
                let w = core::f64::consts::TAU * 0.1 * (k + 1) as f64;
                let (s, c) = (w * t + phase).sin_cos();
                let amplitude = STROKE[joint][1] * amplitude / all;
                motion[0][joint] += amplitude * s;
                motion[1][joint] += amplitude * w * c;
                motion[2][joint] -= amplitude * w * w * s;
            }
            fields.push((motion[0][joint] + 1e-5 * random.normal()).to_string());
        }
        let [q, dq, ddq] = motion;
        let bodies = inverse_dynamics(model, &mut workspace, &q, &dq, &ddq).to_vec();
        for (joint, [viscous, forwards, backwards, drive]) in DRIVES.iter().enumerate() {
            let coulomb = if dq[joint] > 0.0 { forwards } else { backwards };
            let friction = viscous * dq[joint] + coulomb * (dq[joint] / STEP).tanh();
            let noise = 0.005 * forwards * random.normal();
            fields.push((bodies[joint] + drive * ddq[joint] + friction + noise).to_string());
        }
        text += &(fields.join(",") + "\n");
    }
    std::fs::write(path, text).unwrap();
}

/// At a cut-off of 2.4 Hz no joint shows asymmetric friction. On a similar SCARA the torque error on another motion was
/// 1.3 %, compared with 0.04 % at a manual cut-off of 14 Hz.
#[test]
fn friction_that_the_study_lacks_does_not_hide_itself() {
    let folder = tempfile::tempdir().unwrap();
    let model = read_urdf(SCARA).unwrap().model;
    std::fs::write(folder.path().join("arm.urdf"), SCARA).unwrap();
    write_log(&folder.path().join("train.csv"), &model, 1);
    write_log(&folder.path().join("test.csv"), &model, 2);
    let text = "log = [{ file = \"train.csv\" }, { file = \"test.csv\", role = \"validate\" }]\n[robot]\nfile = \"arm.urdf\"\n\
                [format]\ntime = { column = \"t\" }\nposition = { columns = \"q{1..4}\" }\ntorque = { columns = \"tau{1..4}\" }\n";
    let found = Job::new(folder.path(), text).identify().result;
    let chosen: Vec<&String> = found.friction_choice.iter().map(|joint| &joint.chosen).collect();
    // For the first two joints the offset explains nearly as much.
    assert!(chosen[2..].iter().all(|chosen| chosen.contains("asymmetric coulomb")), "{chosen:?}");
}
