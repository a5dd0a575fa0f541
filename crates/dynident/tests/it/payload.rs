//! Payloads with a free arm and with a fixed arm, and messages about undetermined values.
use crate::common::{Job, Motion, Random, Truth, assert_recovered, format, header, plain, repository, write_log};
use dynident::identification::payload::Measured;
use dynident::model::{InertialParameters, Mat3, Vec3};
use dynident::validate;
use std::fmt::Write;
use std::path::Path;

/// As in the tests of noise-free logs without payload.
const NOISE_FREE: f64 = 1e-6;
const CLOCK: (f64, f64) = (400.0, 12.0);
const MASS_KG: f64 = 4.2;
const COM_M: [f64; 3] = [0.03, -0.05, 0.12];
const INERTIA: [f64; 6] = [0.021, 0.003, -0.002, 0.027, 0.001, 0.016];

fn box_at_link() -> InertialParameters {
    let [xx, xy, xz, yy, yz, zz] = INERTIA;
    let inertia = Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
    InertialParameters::from_centre_of_mass(MASS_KG, Vec3(COM_M), &inertia)
}

/// The same arm with the payload added to the body of a link.
fn loaded(truth: &Truth, link: &str) -> Truth {
    let mut inertials = truth.model.inertials().to_vec();
    for (body, inertial) in truth.model.bodies().iter().zip(&mut inertials) {
        if let Some(link) = body.links.iter().find(|l| l.name == link) {
            *inertial = inertial.plus(&box_at_link().expressed_in(&link.placement));
        }
    }
    Truth { model: truth.model.with_inertials(&inertials).unwrap(), ..truth.clone() }
}

fn noisy(sigma: f64, dof: usize, random: &mut Random) -> impl FnMut(&[f64], &[f64]) -> Vec<f64> {
    let mut error = vec![0.0; dof];
    move |q, tau| {
        let late = tau.iter().zip(&mut error).map(|(tau, error)| {
            *error = 0.8 * *error + 0.6 * sigma * random.normal();
            tau + *error
        });
        q.iter().copied().chain(late).collect()
    }
}

fn assert_measured(found: Option<Measured>, truth: f64, tolerance: f64) {
    let found = found.unwrap();
    assert!((found.value - truth).abs() <= tolerance, "{found:?} instead of {truth}");
}

const BOX: &str = "payload = [{ name = \"box\", link = \"tool0\" }]";

fn three_logs(folder: &Path, change: f64) -> Truth {
    let truth = Truth::near(&repository("robots/ur10.urdf"), change, false);
    let with_box = loaded(&truth, "tool0");
    write_log(&folder.join("empty.csv"), &truth, &Motion::new(6, 1), CLOCK, &header(6), plain);
    write_log(&folder.join("box.csv"), &with_box, &Motion::new(6, 2), CLOCK, &header(6), plain);
    write_log(&folder.join("test.csv"), &with_box, &Motion::new(6, 3), (400.0, 6.0), &header(6), plain);
    truth
}

fn ur10() -> String {
    repository("robots/ur10.urdf").display().to_string()
}

#[test]
fn arm_and_payload_from_an_empty_and_a_loaded_log() {
    let folder = tempfile::tempdir().unwrap();
    let truth = three_logs(folder.path(), 0.0);
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\n{BOX}\nparallel_filter.factor = 4\nlog = [{{ file = \"empty.csv\" }}, {{ file = \"box.csv\", payload = \"box\" }}, \
         {{ file = \"test.csv\", payload = \"box\", role = \"validate\" }}]\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
    let payload = &found.result.payloads[0];
    assert_eq!((payload.parameters.len(), payload.not_identified.len(), payload.logs.len()), (10, 0, 1));
    assert_measured(payload.mass_kg, MASS_KG, NOISE_FREE * MASS_KG);
    for k in 0..3 {
        assert_measured(payload.com_m[k], COM_M[k], NOISE_FREE);
    }
    for k in 0..6 {
        // Differences of inertias about the flange of 0.1 kg m².
        assert_measured(payload.inertia_at_com_kgm2[k], INERTIA[k], 10.0 * NOISE_FREE);
    }
    let possible = payload.possible.as_ref().unwrap();
    assert!((possible.mass_kg - MASS_KG).abs() < 1e-2 && !possible.on_the_boundary, "{possible:?}");
    // The held-out log carries the payload too, and the consistent arm is listed.
    let held_out = &found.result.validation[0];
    assert!(held_out.model.relative_error_percent.unwrap() < 1e-4, "{:?}", held_out.model.relative_error_percent);
    assert!(held_out.physical.as_ref().unwrap().relative_error_percent.unwrap() < 0.1);
    // `validate` gives the same figures.
    let stored = folder.path().join("result.json");
    std::fs::write(&stored, serde_json::to_string(&found.result).unwrap()).unwrap();
    let tested = validate(&stored, &job.study, &job.path, &Job::options(1)).unwrap();
    assert!(tested.validation[0].model.relative_error_percent.unwrap() < 1e-4);
}

#[test]
fn a_known_payload_is_taken_off_and_a_second_one_found_with_the_arm_held() {
    let folder = tempfile::tempdir().unwrap();
    let truth = three_logs(folder.path(), 0.2);
    let known = format!(
        "payload = [{{ name = \"box\", link = \"tool0\", mass_kg = {MASS_KG}, com_m = {COM_M:?}, inertia_at_com_kgm2 = {INERTIA:?} }}]"
    );
    // The arm from a log with the known payload.
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\n{known}\nparallel_filter.factor = 4\nlog = [{{ file = \"box.csv\", payload = \"box\" }}]\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let arm = job.identify();
    assert_recovered(&arm, &truth.base_values(&job.robot()), NOISE_FREE);
    assert!(arm.result.payloads.is_empty());
    std::fs::write(folder.path().join("arm.json"), serde_json::to_string(&arm.result).unwrap()).unwrap();
    for refit in ["nothing", "offset", "friction"] {
        let text = format!(
            "robot.file = {:?}\n{BOX}\narm = {{ result = \"arm.json\", refit = {refit:?} }}\nparallel_filter.factor = 4\n\
             log = [{{ file = \"test.csv\", payload = \"box\" }}]\n{}",
            ur10(),
            format(6)
        );
        let found = Job::new(folder.path(), &text).identify();
        let payload = &found.result.payloads[0];
        assert_measured(payload.mass_kg, MASS_KG, 1e-5);
        for k in 0..3 {
            assert_measured(payload.com_m[k], COM_M[k], 1e-5);
        }
        assert!(found.urdf.is_none() && found.result.no_urdf.as_ref().unwrap().contains("arm is known"));
        assert_eq!(found.result.base_parameters[0].value, arm.result.base_parameters[0].value);
    }
    // Its friction is that of its result.
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"auto\"\n{BOX}\narm = {{ result = \"arm.json\" }}\n\
         log = [{{ file = \"test.csv\", payload = \"box\" }}]\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let refused = dynident::identify(&job.study, &job.path, &Job::options(1)).unwrap_err().to_string();
    assert!(refused.contains("refit"), "{refused}");
}

#[test]
fn intervals_hold_the_payload_with_the_arm_free_and_held() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&description, 0.3, false);
    let link = truth.model.bodies()[1].name().to_owned();
    let with_box = loaded(&truth, &link);
    let study = |logs: &str, more: &str| {
        format!(
            "robot.file = {:?}\ndrive.friction = \"stated\"\npayload = [{{ name = \"box\", link = {link:?} }}]\nparallel_filter.factor = 2\nestimator.physical = false\n\
             log = [{logs}]\n{more}\n{}",
            description.display().to_string(),
            format(2)
        )
    };
    let empty = "{ file = \"empty.csv\" }";
    let carrying = "{ file = \"box.csv\", payload = \"box\" }";
    let held = "arm = { result = \"arm.json\" }";
    let mut random = Random(17);
    let (mut inside, mut intervals) = ([0_usize; 2], 0_usize);
    for run in 0..40 {
        let clock = (100.0, 12.0);
        let file = |name: &str| folder.path().join(name);
        write_log(
            &file("empty.csv"),
            &truth,
            &Motion::new(2, 100 + run),
            clock,
            &header(2),
            noisy(0.5, 2, &mut random),
        );
        write_log(
            &file("box.csv"),
            &with_box,
            &Motion::new(2, 200 + run),
            clock,
            &header(2),
            noisy(0.5, 2, &mut random),
        );
        let free = Job::new(folder.path(), &study(&format!("{empty}, {carrying}"), "")).identify();
        let arm = Job::new(folder.path(), &study(empty, "")).identify();
        std::fs::write(file("arm.json"), serde_json::to_string(&arm.result).unwrap()).unwrap();
        let held = Job::new(folder.path(), &study(carrying, held)).identify();
        for (way, found) in [free, held].iter().enumerate() {
            let payload = &found.result.payloads[0];
            // A planar arm determines mass, first moments in its plane and the inertia about its axis; the axes of the
            // paper's arm are parallel.
            assert_eq!(payload.parameters.len(), 4, "{:?}", payload.parameters);
            assert_eq!(payload.not_identified.len(), 6);
            let expected = box_at_link().0;
            for (parameter, k) in payload.parameters.iter().zip([0, 1, 2, 9]) {
                inside[way] += usize::from((parameter.value - expected[k]).abs() <= parameter.half_width_95);
            }
        }
        intervals += 4;
    }
    // 160 intervals, of which four per run are correlated: 95 % within 3 %, twice that below. With a fixed arm they are
    // conservative.
    for inside in inside {
        let share = inside as f64 / intervals as f64;
        assert!((0.89..=1.0).contains(&share), "{share}");
    }
}

#[test]
fn offsets_differ_from_log_to_log() {
    let folder = tempfile::tempdir().unwrap();
    let mut truth = Truth::near(&repository("robots/ur10.urdf"), 0.2, false);
    let mean: Vec<f64> = truth.drive.iter().map(|drive| drive[3]).collect();
    let mut logs = String::new();
    for (number, (change, role)) in
        [(0.9, ""), (-0.3, ""), (-0.6, ""), (2.5, ", role = \"validate\"")].into_iter().enumerate()
    {
        truth.drive.iter_mut().zip(&mean).for_each(|(drive, mean)| drive[3] = mean + change);
        let file = format!("log{number}.csv");
        let motion = Motion::new(6, 1 + number as u64);
        write_log(&folder.path().join(&file), &truth, &motion, (400.0, 6.0), &header(6), plain);
        write!(logs, "{{ file = \"{file}\"{role} }},").unwrap();
    }
    truth.drive.iter_mut().zip(&mean).for_each(|(drive, mean)| drive[3] = *mean);
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\ndrive.offsets = \"per-log\"\nparallel_filter.factor = 4\nlog = [{logs}]\n{}",
        ur10(),
        format(6)
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    // The base parameters contain the mean.
    assert_recovered(&found, &truth.base_values(&job.robot()), NOISE_FREE);
    assert_eq!(found.result.offsets.len(), 18);
    for offsets in found.result.offsets.chunks(3) {
        for (offset, change) in offsets.iter().zip([0.9, -0.3, -0.6]) {
            assert!((offset.deviation_nm - change).abs() < 1e-5, "{offset:?}");
        }
    }
    // The first quarter of the held-out log determines its offsets, in a test of the stored result too.
    let stored =
        dynident::validate_result(&found.result, Path::new("result.json"), &job.study, &job.path, &Job::options(1))
            .unwrap();
    for test in [&found.result.validation[0], &stored.validation[0]] {
        let own = test.own_offsets.as_ref().unwrap();
        assert!((1.2..1.8).contains(&own.fitted_s[1]), "{:?}", own.fitted_s);
        for offset in &own.joints {
            assert!((offset.change_nm - 2.5).abs() < 1e-5, "{offset:?}");
        }
        assert!(test.model.relative_error_percent.unwrap() < 1e-4, "{:?}", test.model.relative_error_percent);
        let physical = test.physical.as_ref().unwrap();
        // The consistent set has a separate error. A tenth of the offset shows that the offset is removed.
        assert!(physical.rmse_nm < 0.25, "{physical:?}");
    }
}

#[test]
fn what_does_not_go_together_is_refused_with_the_fix() {
    let folder = tempfile::tempdir().unwrap();
    three_logs(folder.path(), 0.2);
    let refused = |more: &str, log: &str| {
        let text = format!("robot.file = {:?}\nlog = [{log}]\n{more}\n{}", ur10(), format(6));
        let path = folder.path().join("study.toml");
        std::fs::write(&path, &text).unwrap();
        match dynident::Study::load(&path) {
            Ok(study) => dynident::identify(&study, &path, &Job::options(1)).unwrap_err().to_string(),
            Err(error) => error.to_string(),
        }
    };
    let carrying = "{ file = \"box.csv\", payload = \"box\" }";
    for (more, log, words) in [
        ("", carrying, "add a [[payload]] with this name"),
        ("payload = [{ name = \"box\", link = \"hand\" }]", carrying, "wrist_3_link"),
        ("payload = [{ name = \"box\", link = \"tool0\", com_m = [0, 0, 0.1] }]", carrying, "mass_kg and com_m"),
        ("payload = [{ name = \"box\", link = \"tool0\", mass_kg = -2.0, com_m = [0, 0, 0] }]", carrying, "positive"),
        (&format!("{BOX}\nestimator.method = \"huber\""), carrying, "weighted"),
        (&format!("{BOX}\ndrive.laws = [{{ law = \"load\" }}]"), carrying, "bare arm"),
        (&format!("{BOX}\narm = {{ result = \"nothing.json\" }}"), carrying, "nothing.json"),
        (
            BOX,
            "{ file = \"empty.csv\" }, { file = \"box.csv\", payload = \"box\", role = \"validate\" }",
            "no training log contains it",
        ),
    ] {
        let said = refused(more, log);
        assert!(said.contains(words), "{said}");
    }
    // A payload that is in all logs cannot be distinguished from the arm; this is a finding, not an error.
    let text = format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\n{BOX}\nparallel_filter.factor = 4\nlog = [{carrying}]\n{}",
        ur10(),
        format(6)
    );
    let result = Job::new(folder.path(), &text).identify().result;
    assert!(result.payloads[0].mass_kg.is_none());
    assert!(result.payloads[0].not_identified.iter().all(|words| words.contains("do not separate it from the arm")));
}

fn with_box(payload: &str, more: &str) -> String {
    format!(
        "robot.file = {:?}\ndrive.friction = \"stated\"\npayload = [{{ name = \"box\", link = \"tool0\"{payload} }}]\nparallel_filter.factor = 4\n\
         log = [{{ file = \"empty.csv\" }}, {{ file = \"box.csv\", payload = \"box\" }}]\n{more}\n{}",
        ur10(),
        format(6)
    )
}

#[test]
fn a_mass_from_a_balance_leaves_the_centre_to_be_found() {
    let folder = tempfile::tempdir().unwrap();
    let truth = three_logs(folder.path(), 0.2);
    let of_mass = format!(", mass_kg = {MASS_KG}");
    for gains in ["", "drive.gains = \"unknown\""] {
        let job = Job::new(folder.path(), &with_box(&of_mass, gains));
        let found = job.identify();
        // With gains there is one more iteration.
        let tolerance = if gains.is_empty() { NOISE_FREE } else { 10.0 * NOISE_FREE };
        assert_recovered(&found, &truth.base_values(&job.robot()), tolerance);
        let payload = &found.result.payloads[0];
        assert_eq!((payload.parameters.len(), payload.not_identified.len()), (9, 0), "{:?}", payload.not_identified);
        assert_eq!(payload.mass_kg.map(|mass| (mass.value, mass.half_width_95)), Some((MASS_KG, 0.0)));
        for k in 0..3 {
            assert_measured(payload.com_m[k], COM_M[k], tolerance);
        }
        for k in 0..6 {
            assert_measured(payload.inertia_at_com_kgm2[k], INERTIA[k], 10.0 * tolerance);
        }
        let possible = payload.possible.as_ref().unwrap();
        assert!((possible.mass_kg / MASS_KG - 1.0).abs() <= 1.1e-4, "{possible:?}");
        for gain in found.result.drive_gains.iter().flatten() {
            assert!(gain.identified && (gain.gain - 1.0).abs() < tolerance, "{gain:?}");
        }
    }
}

#[test]
fn quoted_gains_that_are_off_stand_in_the_payloads_bar() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth::near(&repository("robots/ur10.urdf"), 0.0, false);
    // Stated divided by true gains, drawn with the stated standard deviation.
    let share = 0.1;
    let mut random = Random(8);
    let (mut inside, mut alone, mut figures) = (0, 0, 0);
    for run in 0..dynident_testing::count(2, 4) as u64 {
        let off: Vec<f64> = (0..6).map(|_| 1.0 + share * random.normal()).collect();
        for (file, truth, seed) in
            [("empty.csv", &truth, 1 + 2 * run), ("box.csv", &loaded(&truth, "tool0"), 2 + 2 * run)]
        {
            let row = |q: &[f64], tau: &[f64]| {
                let quoted = tau.iter().zip(&off).map(|(tau, off)| tau * off);
                q.iter().copied().chain(quoted).collect()
            };
            write_log(&folder.path().join(file), truth, &Motion::new(6, seed), (400.0, 6.0), &header(6), row);
        }
        let of = |more: &str| {
            let more = format!("estimator.physical = false\n{more}");
            Job::new(folder.path(), &with_box("", &more)).identify().result.payloads[0].clone()
        };
        let (exact, honest) = (of(""), of("drive.gain_std_percent = 10.0"));
        let of_payload = |payload: &dynident::identification::payload::PayloadResult| {
            let [x, y, z] = payload.com_m;
            [payload.mass_kg, x, y, z].map(Option::unwrap)
        };
        let truth = [MASS_KG, COM_M[0], COM_M[1], COM_M[2]];
        for ((exact, honest), truth) in of_payload(&exact).into_iter().zip(of_payload(&honest)).zip(truth) {
            assert!(exact.value == honest.value && exact.half_width_95 <= honest.half_width_95);
            figures += 1;
            inside += usize::from((honest.value - truth).abs() <= honest.half_width_95);
            alone += usize::from((exact.value - truth).abs() <= exact.half_width_95);
        }
        // Some percent of the mass, which affects six joints.
        let mass = honest.mass_kg.unwrap();
        assert!((0.02..0.3).contains(&(mass.half_width_95 / MASS_KG)), "{mass:?}");
    }
    // Of 16 intervals with 95 % more than two miss in 4 % of all cases, and the seed is fixed.
    assert!(inside >= figures - 2 && alone < inside, "{inside} and {alone} of {figures}");
}
