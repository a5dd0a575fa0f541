//! Robots with known parameters: noise-free logs give the truth, in every notation.
use crate::common::{Job, Motion, Random, Truth, assert_recovered, format, header, plain, repository, write_log};
use dynident::model::{Model, load_robot, read_dh, read_urdf};
use std::fmt::Write;
use std::path::Path;

/// Differences of order eight at 400 Hz and 0.65 Hz have a truncation error of 1e-15 and rounding of 1e-10; the
/// condition number is below 1000.
const NOISE_FREE: f64 = 1e-6;
const CLOCK: (f64, f64) = (400.0, 12.0);

fn ur10() -> String {
    repository("robots/ur10.urdf").display().to_string()
}

fn truth() -> Truth {
    Truth::near(&repository("robots/ur10.urdf"), 0.2, false)
}

fn one_log(folder: &Path, truth: &Truth) {
    write_log(&folder.join("log.csv"), truth, &Motion::new(6, 1), CLOCK, &header(6), plain);
}

#[test]
fn the_plain_case_and_the_parallel_filter() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    one_log(folder.path(), &truth);
    for filter in ["enabled = false", "factor = 1\ncutoff_hz = 30.0", "factor = 8", "factor = 5\nstop_band_db = 80.0"] {
        let text = format!(
            "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\n{}\n[parallel_filter]\n{filter}",
            ur10(),
            format(6)
        );
        let job = Job::new(folder.path(), &text);
        let found = job.identify();
        assert_eq!(found.result.method.status, "complete");
        assert_eq!(found.result.base_parameters.len(), 54);
        assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
    }
}

#[test]
fn every_estimator_drive_inertia_and_the_butterworth_filter() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth::near(&repository("robots/ur10.urdf"), 0.2, true);
    one_log(folder.path(), &truth);
    for method in ["ordinary", "weighted", "generalized", "huber", "tukey", "noise-weighted", "instrumental"] {
        // At a fortieth of the cut-off a zero-phase filter of order 4 has a gain of 1 within 1e-13.
        let text = format!(
            "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\ndrive.drive_inertia = true\nestimator.method = \"{method}\"\n\
             parallel_filter.factor = 4\n{}",
            ur10(),
            format(6)
                .replace("method = \"central-differences\", order = 8", "method = \"butterworth\", cutoff_hz = 26.0")
        );
        // Filter transients at the ends of the log are removed.
        let text = text.replace("[motion]", "[motion]\ntrim_s = 1.0");
        let job = Job::new(folder.path(), &text);
        assert_recovered(&job.identify(), &truth.base_values(&job.robot()), NOISE_FREE);
    }
}

#[test]
fn several_logs_and_a_held_out_one() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    for seed in 1..=3 {
        let path = folder.path().join(format!("log{seed}.csv"));
        write_log(&path, &truth, &Motion::new(6, seed), (400.0, 6.0), &header(6), plain);
    }
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log1.csv\" }}, {{ file = \"log2.csv\", rows = [100, 2300] }}, \
         {{ file = \"log3.csv\", role = \"validate\" }}]\nparallel_filter.factor = 4\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
    let held_out = &found.result.validation[0];
    // Only errors of the differences remain.
    assert!(held_out.model.relative_error_percent.unwrap() < 1e-4, "{:?}", held_out.model.relative_error_percent);
    assert!(held_out.raw.relative_error_percent.unwrap() < 1e-4);
    assert!(held_out.prior.as_ref().unwrap().relative_error_percent.unwrap() > 1.0);
}

#[test]
fn joints_in_another_order() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    let order = [3, 0, 5, 1, 4, 2];
    let permuted = |q: &[f64], tau: &[f64]| -> Vec<f64> {
        order.iter().map(|&j| q[j]).chain(order.iter().map(|&j| tau[j])).collect()
    };
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), CLOCK, &header(6), permuted);
    let names: Vec<&str> = order.iter().map(|&j| &truth.model.joints()[j].name[..]).collect();
    let text = format!(
        "robot = {{ file = {:?}, joints = {names:?} }}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter.factor = 4\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    assert_recovered(&job.identify(), &truth.base_values(&job.robot()), NOISE_FREE);
}

#[test]
fn locked_joints_and_a_tilted_base() {
    let folder = tempfile::tempdir().unwrap();
    let mut truth = truth();
    truth.model = truth.model.clone().with_base_orientation(0.3, -0.4, 0.2).unwrap();
    let locked = ("wrist_3_joint".to_owned(), 0.7);
    let five =
        Truth { model: truth.model.locked(std::slice::from_ref(&locked)).unwrap(), drive: truth.drive[..5].to_vec() };
    // The log is simulated with six joints, the last of which rests, so lumping is not involved.
    let mut workspace = dynident::dynamics::Workspace::new(&truth.model);
    let (motion, mut text) = (Motion::new(5, 1), format!("{}\n", header(5)));
    for k in 0..(CLOCK.0 * CLOCK.1) as usize {
        let t = k as f64 / CLOCK.0;
        let [mut q, mut dq, mut ddq] = motion.at(t);
        q.push(locked.1);
        dq.push(0.0);
        ddq.push(0.0);
        let tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        let row: Vec<String> = q[..5].iter().chain(&tau[..5]).map(f64::to_string).collect();
        writeln!(text, "{t},{}", row.join(",")).unwrap();
    }
    std::fs::write(folder.path().join("log.csv"), text).unwrap();
    // The default step width depends on the number of joints.
    let width = truth.coulomb_width(0);
    let text = format!(
        "robot = {{ file = {:?}, lock = {{ wrist_3_joint = 0.7 }}, base_rpy_rad = [0.3, -0.4, 0.2] }}\n\
         drive.friction = \"stated\"\ndrive.coulomb_width = {width:?}\n\
         log = [{{ file = \"log.csv\" }}]\nparallel_filter.factor = 4\n{}",
        ur10(),
        format(5)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    assert_recovered(&found, &five.base_values(&job.robot()), NOISE_FREE);
    let urdf = found.urdf.unwrap();
    assert!(urdf.contains("valid only with the joints locked that carry: wrist_3_link"), "{urdf}");
}

#[test]
fn a_denavit_hartenberg_table() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&description, 0.3, false);
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(2, 1), CLOCK, &header(2), plain);
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter.factor = 4\n{}",
        description.display().to_string(),
        format(2)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    assert_eq!(found.result.base_parameters.len(), 6 + 6);
    assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
    // The table with the new values, and a URDF of it: equal to the bodies of the result within rounding.
    let table = read_dh(found.table.as_ref().unwrap()).unwrap();
    let urdf = read_urdf(found.urdf.as_ref().unwrap()).unwrap().model;
    for model in [&table, &urdf] {
        for (body, expected) in model.inertials().iter().zip(&found.inertials) {
            assert!(body.0.iter().zip(&expected.0).all(|(a, b)| (a - b).abs() < 1e-12), "{body:?} {expected:?}");
        }
    }
    let friction = |model: &Model| -> Vec<_> { model.joints().iter().map(|j| (j.damping, j.friction)).collect() };
    assert!(friction(&table) == friction(&urdf) && table.joints()[0].damping.is_some());
    assert!(found.table.unwrap().starts_with("# dynident ") && found.urdf.unwrap().contains("<!-- gravity"));
}

#[test]
fn motor_side_in_degrees_with_gears_currents_and_a_coupled_wrist() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    let (gear, gain) = ([101.0, 101.0, 101.0, -54.0, 54.0, 54.0], [0.13, 0.12, 0.1, 0.09, 0.08, 0.07]);
    // Motor velocities M q': the last motor also turns with joint 5. Power is invariant, so joint torques are Mᵀ times
    // motor torques.
    let motor_side = |q: &[f64], tau: &[f64]| -> Vec<f64> {
        let mut angle: Vec<f64> = (0..6).map(|j| gear[j] * q[j]).collect();
        angle[5] += 20.0 * q[4];
        let mut motor: Vec<f64> = (0..6).map(|j| tau[j] / gear[j]).collect();
        motor[4] = (tau[4] - 20.0 * motor[5]) / gear[4];
        angle.iter().map(|a| a.to_degrees()).chain((0..6).map(|j| motor[j] / gain[j])).collect()
    };
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), CLOCK, &header(6), motor_side);
    let matrix = |transposed: bool| -> String {
        let rows = (0..6).map(|i| {
            let row = (0..6).map(|j| match (i, j) {
                (i, j) if i == j => gear[i],
                (5, 4) if !transposed => 20.0,
                (4, 5) if transposed => 20.0,
                _ => 0.0,
            });
            format!("{:?}", row.collect::<Vec<f64>>())
        });
        format!("[{}]", rows.collect::<Vec<_>>().join(","))
    };
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter.factor = 4\n{}\n",
        ur10(),
        format(6)
            .replace("\"q{1..6}\" }", &format!("\"q{{1..6}}\", unit = \"deg\", inverse_matrix = {} }}", matrix(false)))
            .replace(
                "\"tau{1..6}\" }",
                &format!("\"tau{{1..6}}\", unit = \"A\", scale = {gain:?}, matrix = {} }}", matrix(true))
            )
    );
    let job = Job::new(folder.path(), &text);
    assert_recovered(&job.identify(), &truth.base_values(&job.robot()), NOISE_FREE);
}

#[test]
fn a_reversed_sign_is_found_and_fixed() {
    let folder = tempfile::tempdir().unwrap();
    let mut truth = Truth::near(&repository("robots/ur10.urdf"), 0.05, false);
    // Little friction, so that the nominal torque resembles the log's.
    truth.drive.iter_mut().flatten().for_each(|value| *value *= 0.1);
    let reversed = |q: &[f64], tau: &[f64]| -> Vec<f64> { q.iter().copied().chain(tau.iter().map(|t| -t)).collect() };
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), CLOCK, &header(6), reversed);
    let as_logged = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\n{}",
        ur10(),
        format(6)
    );
    let fixed = as_logged.replace("\"tau{1..6}\" }", "\"tau{1..6}\", sign = -1 }");
    for (text, reversed) in [(&as_logged, true), (&fixed, false)] {
        let job = Job::new(folder.path(), text);
        let found = job.identify();
        let findings = &found.result.problems;
        let seen = findings.iter().any(|f| f.contains("opposite sign") && f.contains("sign = -1"));
        assert_eq!(seen, reversed, "{findings:?}");
        if !reversed {
            assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
        }
    }
}

#[test]
fn noise_widens_the_error_bars_by_as_much_as_it_moves_the_values() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    let sigma = [3.0, 4.0, 2.0, 0.5, 0.4, 0.3];
    let mut random = Random(11);
    for seed in 1..=3 {
        let mut noisy = |q: &[f64], tau: &[f64]| -> Vec<f64> {
            q.iter().copied().chain((0..6).map(|j| tau[j] + sigma[j] * random.normal())).collect()
        };
        let path = folder.path().join(format!("log{seed}.csv"));
        write_log(&path, &truth, &Motion::new(6, seed), (200.0, 20.0), &header(6), &mut noisy);
    }
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\nlog = [{{ file = \"log1.csv\" }}, {{ file = \"log2.csv\" }}, {{ file = \"log3.csv\", role = \"validate\" }}]\n\
         parallel_filter.enabled = false\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    let truth = truth.base_values(&job.robot());
    let scores: Vec<f64> =
        found.result.base_parameters.iter().zip(&truth).map(|(p, truth)| (p.value - truth) / p.std).collect();
    // 54 scores from segments (a t distribution with tens of degrees of freedom): none beyond 6. The mean square is one
    // on average; its standard deviation is sqrt(2/54) = 0.2 for independent scores and larger for these correlated
    // ones: 0.4 to 2.
    let mean_square = scores.iter().map(|z| z * z).sum::<f64>() / scores.len() as f64;
    assert!(scores.iter().all(|z| z.abs() < 6.0), "{scores:?}");
    assert!((0.4..2.0).contains(&mean_square), "{mean_square} {scores:?}");
    // The held-out residual is the noise: 4000 samples give 1.1 %; five of these.
    for (joint, sigma) in found.result.validation[0].model.joints.iter().zip(sigma) {
        assert!((joint.rmse_nm / sigma - 1.0).abs() < 0.055, "{} {} for {sigma}", joint.name, joint.rmse_nm);
    }
}

#[test]
fn the_description_in_the_study_may_know_no_inertials() {
    let folder = tempfile::tempdir().unwrap();
    let truth = truth();
    one_log(folder.path(), &truth);
    let original = load_robot(repository("robots/ur10.urdf")).unwrap().text;
    let mut bare = String::new();
    let mut rest = &original[..];
    while let Some(from) = rest.find("<inertial>") {
        bare += &rest[..from];
        rest = &rest[from + rest[from..].find("</inertial>").unwrap() + "</inertial>".len()..];
    }
    bare += rest;
    std::fs::write(folder.path().join("bare.urdf"), bare).unwrap();
    let text = format!(
        "robot.file = \"bare.urdf\"\ndrive.friction = \"stated\"\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter.factor = 4\n{}",
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
    assert!(found.result.base_parameters.iter().all(|p| p.prior.is_none()));
}
