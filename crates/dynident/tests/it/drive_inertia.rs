//! Test for drive inertia, on simulated arms with and without it.
use crate::common::{Job, Motion, Random, Truth, format, header, repository, write_log};
use dynident::model::terms::TorqueTerm;
use dynident::result::ResultFile;
use dynident::validate;
use dynident_identification::{Execution, Logs, choose_drive_inertia};
use std::path::Path;

/// Standard deviation of torque noise, Nm, and position noise, rad.
const NOISE: (f64, f64) = (0.2, 1.0e-5);
/// Number of logs of each kind.
const SEEDS: u64 = 20;

fn write_noisy(path: &Path, truth: &Truth, seed: u64) {
    let (mut random, dof) = (Random(1000 + seed), truth.drive.len());
    let noisy = |q: &[f64], tau: &[f64]| {
        let q = q.iter().map(|q| q + NOISE.1 * random.normal()).collect::<Vec<_>>();
        [q, tau.iter().map(|tau| tau + NOISE.0 * random.normal()).collect()].concat()
    };
    write_log(path, truth, &Motion::new(dof, seed), (100.0, 20.0), &header(dof), noisy);
}

fn job(folder: &Path, description: &Path, dof: usize, drive: &str) -> Job {
    let columns = format(dof).split("[format]").nth(1).map(|columns| format!("[format]{columns}")).unwrap();
    let description = description.display().to_string();
    let text = format!("robot.file = {description:?}\nlog = [{{ file = \"log.csv\" }}]\n{drive}\n{columns}");
    Job::new(folder, &text)
}

/// Test statistic of a study, and the number of tested drives.
fn tested(job: &Job) -> (f64, usize) {
    let robot = job.robot();
    let folders = dynident::Folders::new(&job.study, &job.path, None);
    let task = job.study.task(&job.path, &robot, &folders).unwrap();
    let alone = Execution::default();
    let logs = Logs::new(robot.model(), &task.recordings, task.settings.row_settings(), &[0], None, alone).unwrap();
    let (found, choice) = choose_drive_inertia(&logs, &task.settings, &task.robot, &[0], &[]).unwrap();
    let choice = choice.unwrap();
    assert_eq!(found.terms().iter().any(TorqueTerm::is_drive_inertia), choice.seen);
    assert_eq!(choice.seen, choice.standard_deviations.unwrap() >= choice.needed);
    (choice.standard_deviations.unwrap(), choice.drives.len())
}

/// Existing drive inertia is found; without it the statistic is standard normal. Of 40 values one exceeds 3 with a
/// probability of 5 %, so the seeds are fixed.
#[test]
fn drives_are_found_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let mut figures = Vec::new();
    for seed in 0..dynident_testing::count(SEEDS as usize, 400) as u64 {
        for (robot, apart) in [("robots/ur10.urdf", 4), ("robots/planar2r.urdf", 1)] {
            let description = repository(robot);
            for has_drives in [true, false] {
                let truth = Truth::near(&description, 0.1, has_drives);
                write_noisy(&folder.path().join("log.csv"), &truth, 1 + seed);
                let job = job(folder.path(), &description, truth.drive.len(), "");
                let (figure, drives) = tested(&job);
                // The inertia of the first axes' drives is regrouped with that of their links.
                assert_eq!(drives, apart, "{robot}");
                assert_eq!(figure >= 3.0, has_drives, "{robot}, seed {seed}: {figure}");
                if !has_drives {
                    figures.push(figure);
                }
            }
        }
    }
    // Mean and mean square of standard normal values: within four standard deviations. Error bars are conservative, so
    // the square may be smaller.
    let count = figures.len() as f64;
    let mean = figures.iter().sum::<f64>() / count;
    let square = figures.iter().map(|figure| figure * figure).sum::<f64>() / count;
    assert!(mean.abs() < 4.0 / count.sqrt(), "{mean}: {figures:?}");
    assert!(square < 1.0 + 4.0 * (2.0 / count).sqrt(), "{square}: {figures:?}");
}

/// Slow motion with the presliding friction of Dahl, `dz/dt = 3 v (1 − z sgn(v)) / reach`, τ = 8 z. Viscous and Coulomb
/// friction do not contain it, so they hide the drive inertia; the selected friction does not.
#[test]
fn presliding_friction_does_not_hide_drives() {
    const COULOMB: f64 = 8.0;
    const REACH_RAD: f64 = 1.0e-3;
    let folder = tempfile::tempdir().unwrap();
    let description = repository("robots/ur10.urdf");
    for has_drives in [true, false] {
        let truth = Truth::near(&description, 0.1, has_drives);
        let (mut random, dof) = (Random(2), truth.drive.len());
        let mut before: Option<Vec<f64>> = None;
        let mut bristles = vec![0.0_f64; dof];
        let row = |q: &[f64], tau: &[f64]| {
            let last = before.replace(q.to_vec()).unwrap_or_else(|| q.to_vec());
            let torque = |joint: usize| {
                let step = q[joint] - last[joint];
                let bristle = &mut bristles[joint];
                *bristle = (*bristle + 3.0 * step / REACH_RAD * (1.0 - *bristle * step.signum())).clamp(-1.0, 1.0);
                tau[joint] + COULOMB * *bristle + 0.1 * NOISE.0 * random.normal()
            };
            let torques: Vec<f64> = (0..dof).map(torque).collect();
            [q.to_vec(), torques].concat()
        };
        let motion = Motion::within(&truth.model, 0.2, 1);
        write_log(&folder.path().join("log.csv"), &truth, &motion, (200.0, 30.0), &header(dof), row);
        let job = job(folder.path(), &description, dof, "");
        let (with_stated_friction, _) = tested(&job);
        assert!(with_stated_friction < 3.0, "{with_stated_friction}");
        let choice = job.identify().result.drive_inertia_choice.unwrap();
        assert_eq!(choice.seen, has_drives, "{choice:?}");
    }
}

/// Files and columns are sufficient: the model equals that with a stated key, also in validation and export.
#[test]
fn what_the_logs_say_is_what_a_key_would() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("robots/planar2r.urdf");
    for has_drives in [true, false] {
        let truth = Truth::near(&description, 0.1, has_drives);
        write_noisy(&folder.path().join("log.csv"), &truth, 3);
        let own = |drive: &str| job(folder.path(), &description, truth.drive.len(), &format!("drive = {{ {drive} }}"));
        let found = own("friction = \"stated\"").identify();
        let choice = found.result.drive_inertia_choice.clone().unwrap();
        assert_eq!(choice.seen, has_drives, "{choice:?}");
        let key = format!("friction = \"stated\", drive_inertia = {has_drives}");
        let stated = own(&key).identify();
        assert!(stated.result.drive_inertia_choice.is_none());
        let values = |result: &ResultFile| serde_json::to_value(&result.base_parameters).unwrap();
        assert_eq!(values(&found.result), values(&stated.result));
        // A stated key has priority over the logs.
        let against = own(&format!("friction = \"stated\", drive_inertia = {}", !has_drives)).identify();
        assert_ne!(against.result.base_parameters.len(), found.result.base_parameters.len());

        // A study without the key validates the finished model.
        let result = folder.path().join("result.json");
        std::fs::write(&result, serde_json::to_string(&found.result).unwrap()).unwrap();
        let job = own("friction = \"stated\"");
        let tested = validate(&result, &job.study, &job.path, &Job::options(1)).unwrap();
        let error = tested.validation[0].in_fit_band.as_ref().unwrap_or(&tested.validation[0].model);
        let own = found.result.training.relative_error_percent.unwrap();
        assert!((error.relative_error_percent.unwrap() - own).abs() < 1e-6 * own, "{error:?} {own}");
        assert!(found.report().unwrap().contains("Drive inertia: "));
    }
}

/// With one joint, drive and link inertia are not distinguishable.
#[test]
fn what_cannot_be_tested_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(repository("robots/planar2r.urdf")).unwrap();
    let path = folder.path().join("arm.urdf");
    std::fs::write(&path, text).unwrap();
    let truth = Truth::near(&path, 0.1, false);
    write_noisy(&folder.path().join("log.csv"), &truth, 3);
    let lock = &truth.model.joints()[1].name;
    let one = format!("robot.lock = {{ {lock} = 0.0 }}\ndrive.friction = \"stated\"");
    let study = job(folder.path(), &path, 1, &one).identify().result;
    let choice = study.drive_inertia_choice.unwrap();
    assert!(!choice.seen && choice.untested.as_ref().unwrap().contains("cannot tell"), "{choice:?}");
    assert!(choice.sentence().starts_with("not tested"));
}
