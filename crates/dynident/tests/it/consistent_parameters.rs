//! Physically consistent fits through a study: constraints on bodies, contradictions, the sign of the torque; essential
//! parameters and the torque band.
use crate::common::{Job, Motion, Random, Truth, format, header, plain, recordings, repository, write_log};
use dynident::model::load_robot;
use dynident::{IdentificationOutcome, RunOptions, Silent, Study, identify};
use std::path::Path;

fn study(robot: &Path, further: &str) -> String {
    format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\n{}\n{further}",
        robot.display().to_string(),
        format(2)
    )
}

fn arm() -> std::path::PathBuf {
    repository("robots/planar2r.urdf")
}

fn one_log(folder: &Path) {
    let truth = Truth::near(&arm(), 0.0, false);
    write_log(&folder.join("log.csv"), &truth, &Motion::new(2, 1), (200.0, 10.0), &header(2), plain);
}

#[test]
fn what_is_known_of_bodies_holds() {
    let folder = tempfile::tempdir().unwrap();
    one_log(folder.path());
    let found = |further: &str| Job::new(folder.path(), &study(&arm(), further)).identify();
    // Base parameters do not determine the second mass (nominal 1.5 kg), so all of these are possible.
    let free = found("");
    let mass = |found: &IdentificationOutcome, body: usize| found.result.bodies[body].mass_kg;
    for prior in ["entropic", "constant-pullback", "euclidean"] {
        let known = found(&format!(
            "[estimator.physical]\nprior = {prior:?}\nprior_weight = 0.1\nmargin = 1e-3\ntotal_mass_kg = [4.5, 5.0]\n\
             [estimator.physical.bodies.link2]\nmass_kg = [2.0, 2.5]\ncom_box_m = [[0.05, -0.1, -0.1], [0.3, 0.1, 0.1]]\n\
             inside = {{ centre_m = [0.2, 0.0, 0.0], semi_axes_m = [0.5, 0.3, 0.3] }}"
        ));
        let fit = known.result.physical.fit.as_ref();
        let fit = fit.unwrap_or_else(|| panic!("{prior}: {:?}", known.result.physical.failure));
        assert_eq!(fit.status, "solved", "{prior}");
        let total = mass(&known, 0) + mass(&known, 1);
        assert!((2.0 - 1e-9..=2.5 + 1e-9).contains(&mass(&known, 1)), "{prior}: {}", mass(&known, 1));
        assert!((4.5 - 1e-9..=5.0 + 1e-9).contains(&total), "{prior}: {total}");
        let com = known.result.bodies[1].com_m.unwrap();
        assert!((0.05 - 1e-9..=0.3 + 1e-9).contains(&com[0]), "{prior}: {com:?}");
        // Identifiable values are unchanged: the torque has no noise, so only the floor of the fit, 1e-4 of the torque,
        // is lost.
        let (a, b) = (&known.result.base_parameters, &free.result.base_parameters);
        for (a, b) in a.iter().zip(b) {
            let (a, b) = (a.physical.unwrap(), b.physical.unwrap());
            assert!((a - b).abs() < 1e-2 * b.abs().max(0.1), "{prior}: {a} and {b}");
        }
        assert!(known.urdf.is_some());
    }
    let held = found("[estimator.physical.laws]\nfv1 = [3.5, 4.0]");
    let viscous = held.result.joints[0].terms.iter().find(|term| term.symbol == "fv1").unwrap();
    assert!((3.5 - 1e-9..=4.0 + 1e-9).contains(&viscous.value), "{viscous:?}");
    assert!(held.result.physical.fit.as_ref().unwrap().active.iter().any(|name| name.contains("fv1")));
}

#[test]
fn contradictions_name_link_and_constraint() {
    let folder = tempfile::tempdir().unwrap();
    one_log(folder.path());
    let failure = |further: &str| {
        let found = Job::new(folder.path(), &study(&arm(), further)).identify();
        // The estimate exists, but not the URDF.
        assert!(found.urdf.is_none() && found.estimate.values.iter().all(|value| value.is_finite()));
        let reason = found.result.physical.failure.unwrap();
        assert!(found.result.no_urdf.unwrap().contains(&reason));
        reason
    };
    let reason = failure(
        "[estimator.physical.bodies.link2]\ncom_box_m = [[1.0, -0.1, -0.1], [1.2, 0.1, 0.1]]\n\
         inside = { centre_m = [0.0, 0.0, 0.0], semi_axes_m = [0.2, 0.2, 0.2] }",
    );
    assert!(reason.contains("link2: centre of mass along x") && reason.contains("link2: all mass inside"), "{reason}");
    let reason = failure("[estimator.physical]\ntotal_mass_kg = [1.0, 2.0]\nbodies.link1.mass_kg = [5.0, 6.0]");
    assert!(reason.contains("total mass 1 to 2 kg") && reason.contains("5 to"), "{reason}");
    let reason = failure("[estimator.physical.bodies.link2]\nmass_kg = [3.0, 2.0]");
    assert!(reason.contains("link2: mass") && reason.contains("3 to 2"), "{reason}");
    let reason =
        failure("[estimator.physical.bodies.link2]\nprior = [1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1, 0.0, 0.9]");
    assert!(reason.contains("body link2: its prior is not physically consistent"), "{reason}");
    let reason =
        failure("[estimator.physical.bodies.link1]\nknown = [1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1, 0.0, 0.9]");
    assert!(reason.contains("body link1") && reason.contains("known"), "{reason}");
}

#[test]
fn names_and_numbers_are_checked_before_any_log_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str| {
        let job = Job::new(folder.path(), text);
        identify(&job.study, &job.path, &Job::options(1)).unwrap_err().to_string()
    };
    let message = refused(&study(&arm(), "[estimator.physical.bodies.link3]\nmass_kg = [1.0, 2.0]"));
    assert!(message.contains("bodies.link3") && message.contains("link1, link2"), "{message}");
    let message = refused(&study(&arm(), "[estimator.physical.laws]\nfx9 = [1.0, 2.0]"));
    assert!(message.contains("laws.fx9"), "{message}");
    let ur10 = study(&repository("robots/ur10.urdf"), "[estimator.physical.bodies.tool0]\nmass_kg = [1.0, 2.0]");
    let message = refused(&ur10);
    assert!(message.contains("bodies.tool0") && message.contains("write bodies.wrist_3_link"), "{message}");

    let unread = |further: &str| Job::new_error(folder.path(), &study(&arm(), further));
    let message = unread("[estimator.physical]\nmargin = 0.9");
    assert!(message.contains("[estimator.physical]") && message.contains("margin = 0.9"), "{message}");
    let message = unread("[estimator.physical]\nprior = \"entropy\"");
    assert!(message.contains("entropic"), "{message}");
    let message = unread("[estimator.physical]\nbodies.link1.mass = [1.0, 2.0]");
    assert!(message.contains("mass_kg"), "{message}");
    let message = unread("[estimator.physical]\nbodies.link1.mass_kg = [1.0, 2.0, 3.0]");
    assert!(message.contains("3 values where 2"), "{message}");
}

#[test]
fn a_description_that_is_no_body_is_named() {
    let folder = tempfile::tempdir().unwrap();
    one_log(folder.path());
    let text = std::fs::read_to_string(arm()).unwrap();
    let odd = text.replace("iyy=\"0.02075\" iyz=\"0\" izz=\"0.02075\"", "iyy=\"0.02075\" iyz=\"0\" izz=\"0.9\"");
    assert_ne!(text, odd);
    std::fs::write(folder.path().join("odd.urdf"), odd).unwrap();
    let found = Job::new(folder.path(), &study(Path::new("odd.urdf"), "")).identify();
    let named = &found.result.physical.impossible_priors;
    assert!(named.len() == 1 && named[0].contains("link2"), "{named:?}");
    // The stated prior replaces it.
    let own = "[estimator.physical.bodies.link2]\nprior = [1.5, 0.3, 0.0, 0.0, 0.002, 0.0, 0.0, 0.081, 0.0, 0.081]";
    let found = Job::new(folder.path(), &study(Path::new("odd.urdf"), own)).identify();
    assert!(found.result.physical.impossible_priors.is_empty() && found.urdf.is_some());
}

fn bare(path: &Path) -> String {
    let original = load_robot(path).unwrap().text;
    let (mut bare, mut rest) = (String::new(), &original[..]);
    while let Some(from) = rest.find("<inertial>") {
        bare += &rest[..from];
        rest = &rest[from + rest[from..].find("</inertial>").unwrap() + "</inertial>".len()..];
    }
    bare + rest
}

fn called_reversed(found: &IdentificationOutcome) -> bool {
    let sign = found.result.physical.sign.unwrap();
    let said = found.result.problems.iter().any(|problem| problem.contains("opposite sign"));
    assert_eq!(said, sign.is_reversed(), "{sign:?}");
    said
}

#[test]
fn physics_alone_tells_the_sign_of_the_torque() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth::near(&arm(), 0.1, false);
    std::fs::write(folder.path().join("bare.urdf"), bare(&arm())).unwrap();
    for sign in [1.0, -1.0] {
        let logged = |q: &[f64], tau: &[f64]| q.iter().copied().chain(tau.iter().map(|t| sign * t)).collect();
        write_log(&folder.path().join("log.csv"), &truth, &Motion::new(2, 1), (200.0, 10.0), &header(2), logged);
        for physical in ["true", "false"] {
            let text = study(Path::new("bare.urdf"), &format!("[estimator]\nphysical = {physical}"));
            let found = Job::new(folder.path(), &text).identify();
            assert!(found.result.logs[0].prior_agreement.is_none());
            assert_eq!(called_reversed(&found), sign < 0.0, "{:?}", found.result.physical.sign);
        }
    }
}

/// KUKA's FRI convention: the torque is that of the load on the drive. The log has little excitation, and the inertials
/// of the robot description are removed.
#[test]
fn the_lbr_med_torque_is_reversed_by_physics_alone() {
    let Some(data) = recordings() else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bare.urdf"), bare(&data.join("kuka_lbr_med7/med7dock.urdf"))).unwrap();
    let text = std::fs::read_to_string(repository("examples/lbr_med7.toml")).unwrap();
    let text = text.replace("kuka_lbr_med7/med7dock.urdf", "bare.urdf");
    let as_logged = text.replace(", sign = -1.0", "");
    assert_ne!(text, as_logged);
    for (text, reversed) in [(as_logged, true), (text, false)] {
        let path = folder.path().join("study.toml");
        let options = RunOptions { data: Some(data.clone()), threads: 2, progress: &Silent };
        let text = text.replace(
            "file = \"bare.urdf\"",
            &format!("file = {:?}", folder.path().join("bare.urdf").display().to_string()),
        );
        let found = identify(&Study::parse(&text, &path).unwrap(), &path, &options).unwrap();
        assert_eq!(called_reversed(&found), reversed, "{:?}", found.result.physical.sign);
    }
}

#[test]
fn essential_parameters_and_the_torques_band_through_a_study() {
    let folder = tempfile::tempdir().unwrap();
    let mut truth = Truth::near(&arm(), 0.05, false);
    // Parameters with a true value of zero.
    truth.drive.iter_mut().for_each(|drive| drive[3] = 0.0);
    let sigma = [0.4, 0.2];
    let mut random = Random(6);
    for (file, seed) in [("log.csv", 1), ("other.csv", 2)] {
        write_log(&folder.path().join(file), &truth, &Motion::new(2, seed), (200.0, 30.0), &header(2), |q, tau| {
            q.iter().copied().chain((0..2).map(|j| tau[j] + sigma[j] * random.normal())).collect()
        });
    }
    let text = study(
        &arm(),
        "[parallel_filter]\nenabled = false\n[estimator]\nessential = { ratio = 30.0, significance = 0.05 }",
    )
    .replace("[{ file = \"log.csv\" }]", "[{ file = \"log.csv\" }, { file = \"other.csv\", role = \"validate\" }]");
    let found = Job::new(folder.path(), &text).identify();
    let report = found.result.essential.as_ref().unwrap();
    assert_eq!(report.kept + report.dropped.len(), found.result.base_parameters.len());
    let dropped: Vec<&str> = report.dropped.iter().map(|dropped| &dropped.name[..]).collect();
    for symbol in ["off1", "off2"] {
        assert!(dropped.contains(&symbol), "{symbol} not among {dropped:?}");
    }
    for entry in &report.dropped {
        assert!(entry.p_value >= 0.05 && entry.f >= 0.0, "{entry:?}");
        let parameter = found.result.base_parameters.iter().find(|p| p.expression == entry.name).unwrap();
        assert!(parameter.value == 0.0 && parameter.std == 0.0, "{parameter:?}");
    }
    // 6000 rows: the standard deviation of the coverage is 0.28 %; the limit is four of these plus the uncertainty of
    // the noise.
    assert_eq!(found.result.torque_band.len(), 2);
    for (band, sigma) in found.result.torque_band.iter().zip(sigma) {
        assert!((band.coverage_percent - 95.0).abs() < 1.5, "{band:?}");
        assert!((band.half_width_nm / (1.96 * sigma) - 1.0).abs() < 0.1, "{band:?}");
        assert_eq!(band.log, "other");
    }
}
