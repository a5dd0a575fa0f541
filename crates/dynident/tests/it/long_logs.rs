//! A long log of an arm with known friction: selection uses an excerpt, the estimate uses all rows.
use crate::common::{Job, Random};
use dynident::IdentificationOutcome;
use dynident::dynamics::{Workspace, inverse_dynamics};
use dynident::model::load_robot;
use dynident::recording::MemoryLog;

const ARM: &str = r#"<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="3"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.15 0 0.02"/><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/></joint></robot>"#;

const STUDY: &str = r#"
[robot]
file = "arm.urdf"
[format]
time = { column = "t" }
position = { columns = "q{1..2}" }
torque = { columns = "tau{1..2}" }
[[log]]
file = "long.csv"
fraction = [0.0, 0.95]
[[log]]
file = "long.csv"
fraction = [0.95, 1.0]
role = "validate"
"#;

/// Sample rate, Hz, and number of samples: well above the size of an excerpt.
const RATE_HZ: f64 = 1000.0;
const ROWS: usize = 450_000;
/// Standard deviation of the torque noise, Nm.
const NOISE: f64 = 0.1;
/// Viscous friction of both joints, Nm s/rad.
const VISCOUS: [f64; 2] = [1.0, 0.8];
/// Coulomb friction, Nm, and the velocity at which the step reaches 76 %, rad/s.
const COULOMB: [f64; 2] = [2.0, 1.0];
const STEP: f64 = 0.02;
/// Stribeck friction of the elbow: amplitude, Nm, and velocity of its decay to 1/e, rad/s.
const STRIBECK: (f64, f64) = (1.5, 0.08);

fn job(folder: &std::path::Path) -> Job {
    let arm = folder.join("arm.urdf");
    std::fs::write(&arm, ARM).unwrap();
    let model = load_robot(&arm).unwrap().model;
    let (mut workspace, mut random) = (Workspace::new(&model), Random(3));
    let waves = [[0.9, 1.3, 0.2], [0.5, 0.37, 1.0], [0.7, 1.7, 2.0], [0.4, 0.53, 0.7]];
    let mut values = Vec::with_capacity(5 * ROWS);
    for k in 0..ROWS {
        let t = k as f64 / RATE_HZ;
        let joint = |from: usize| {
            waves[from..from + 2].iter().fold([0.0; 3], |[q, dq, ddq], [a, w, p]| {
                let (s, c) = (w * t + p).sin_cos();
                [q + a * s, dq + a * w * c, ddq - a * w * w * s]
            })
        };
        let [a, b] = [joint(0), joint(2)];
        let tau = inverse_dynamics(&model, &mut workspace, &[a[0], b[0]], &[a[1], b[1]], &[a[2], b[2]]);
        let near_rest = STRIBECK.0 * (-(b[1] / STRIBECK.1).powi(2)).exp();
        let shoulder = tau[0] + VISCOUS[0] * a[1] + COULOMB[0] * (a[1] / STEP).tanh();
        let elbow = tau[1] + VISCOUS[1] * b[1] + (COULOMB[1] + near_rest) * (b[1] / STEP).tanh();
        let (q1, q2) = (a[0] + 1.0e-5 * random.normal(), b[0] + 1.0e-5 * random.normal());
        values.extend([t, q1, q2, shoulder + NOISE * random.normal(), elbow + NOISE * random.normal()]);
    }
    let names = ["t", "q1", "q2", "tau1", "tau2"].map(str::to_owned).to_vec();
    let mut job = Job::new(folder, STUDY);
    let samples = MemoryLog::row_major("long", Some(names), 5, values).unwrap();
    job.study.log.iter_mut().for_each(|log| log.samples = Some(samples.clone()));
    job
}

fn value(found: &IdentificationOutcome, symbol: &str) -> (f64, f64) {
    let own = found.result.base_parameters.iter().find(|parameter| parameter.symbol == symbol);
    let all = || found.result.base_parameters.iter().map(|own| own.symbol.clone()).collect::<Vec<_>>().join(", ");
    own.map_or_else(|| panic!("no {symbol} among {}", all()), |own| (own.value, own.half_width_95))
}

/// Friction, its constants and all parameters have the true values, from all rows, for any number of threads.
#[test]
fn a_long_log_is_chosen_from_by_an_excerpt_and_fitted_by_all_rows() {
    let folder = tempfile::tempdir().unwrap();
    let job = job(folder.path());
    let [one, two] = [1, 2].map(|threads| dynident::identify(&job.study, &job.path, &Job::options(threads)).unwrap());
    let text = |found: &IdentificationOutcome| {
        let mut value = serde_json::to_value(&found.result).unwrap();
        value.as_object_mut().unwrap().remove("timings_s").unwrap();
        value.to_string()
    };
    assert_eq!(text(&one), text(&two));

    let [shoulder, elbow] = &one.result.friction_choice[..] else { panic!("two joints") };
    assert_eq!(shoulder.chosen, "viscous + coulomb", "{shoulder:?}");
    // At the motion's own rate the elbow's friction is hard to distinguish from a plain step, but its additional part
    // is found.
    assert_ne!(elbow.chosen, "viscous + coulomb", "{elbow:?}");
    // All rows are used: at the filtered rate there are more than an excerpt of 200,000 rows would give.
    let log = &one.result.logs[0];
    let rows = (0.95 * ROWS as f64).round();
    assert_eq!(log.import.rows, rows as u64);
    assert!(log.filtered_rows as f64 > 0.9 * rows / RATE_HZ * log.filtered_rate_hz, "{}", log.filtered_rows);

    // Within twice the 95 % error bars, which chance exceeds in 1 of 10,000 cases, or 0.001 for the shape of the step.
    for (symbol, truth) in [("fv1", VISCOUS[0]), ("fc1", COULOMB[0])] {
        let (found, bar) = value(&one, symbol);
        assert!((found - truth).abs() < 2.0 * bar.max(1.0e-3 * truth), "{symbol}: {found} +- {bar}, {truth}");
    }
    // White noise behind the low-pass at 0.7 of a cut-off of at most 10 Hz has 0.12 of its standard deviation; the same
    // amount is allowed for inexact friction.
    let error = one.result.validation[0].model.rmse_nm;
    assert!(error < 2.0 * 0.12 * NOISE, "{error}");
}

/// More logs than the samples used for the examination: only every n-th log contributes one.
#[test]
fn hundreds_of_short_logs_are_one_identification() {
    /// Number of logs, each 2 s at 100 Hz of another part of the motion.
    const LOGS: usize = 305;
    const ROWS_OF_EACH: usize = 200;
    let folder = tempfile::tempdir().unwrap();
    let arm = folder.path().join("arm.urdf");
    std::fs::write(&arm, ARM).unwrap();
    let model = load_robot(&arm).unwrap().model;
    let (mut workspace, mut random) = (Workspace::new(&model), Random(5));
    let names = ["t", "q1", "q2", "tau1", "tau2"].map(str::to_owned).to_vec();
    let robot = STUDY.split("[[log]]").next().unwrap();
    let drive = "[drive]\nviscous = true\ncoulomb = \"none\"\noffset = false\n";
    let logs: Vec<String> = (0..LOGS).map(|place| format!("[[log]]\nfile = \"{place}.csv\"\n")).collect();
    let text = format!("{robot}{drive}{}", logs.concat());
    let mut job = Job::new(folder.path(), &text);
    for (place, log) in job.study.log.iter_mut().enumerate() {
        let mut values = Vec::with_capacity(5 * ROWS_OF_EACH);
        for k in 0..ROWS_OF_EACH {
            let (own, t) = (k as f64 / 100.0, 1.7 * place as f64 + k as f64 / 100.0);
            let wave = |a: f64, w: f64| {
                let (s, c) = (w * t).sin_cos();
                [a * s, a * w * c, -a * w * w * s]
            };
            let (a, b) = (wave(0.8, 3.1), wave(0.7, 4.3));
            let tau = inverse_dynamics(&model, &mut workspace, &[a[0], b[0]], &[a[1], b[1]], &[a[2], b[2]]);
            let noise = |random: &mut Random| 0.02 * random.normal();
            let shoulder = tau[0] + VISCOUS[0] * a[1] + noise(&mut random);
            let elbow = tau[1] + VISCOUS[1] * b[1] + noise(&mut random);
            values.extend([own, a[0], b[0], shoulder, elbow]);
        }
        log.samples = Some(MemoryLog::row_major(&place.to_string(), Some(names.clone()), 5, values).unwrap());
    }
    let found = dynident::identify(&job.study, &job.path, &Job::options(2)).unwrap();
    for (symbol, truth) in [("fv1", VISCOUS[0]), ("fv2", VISCOUS[1])] {
        let (found, bar) = value(&found, symbol);
        assert!((found - truth).abs() < 2.0 * bar.max(1.0e-3 * truth), "{symbol}: {found} +- {bar}, {truth}");
    }
}
