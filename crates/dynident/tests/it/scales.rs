//! Nothing depends on the size of the robot or on units: the same motion of a robot a thousand times as heavy gives the
//! same model, a thousand times as heavy.

use super::common::{Job, repository};
use core::fmt::Write;
use dynident::IdentificationOutcome;

/// The description with all masses and moments of inertia times `factor`.
fn heavier(urdf: &str, factor: f64) -> String {
    let keys = ["ixx=\"", "ixy=\"", "ixz=\"", "iyy=\"", "iyz=\"", "izz=\"", "<mass value=\""];
    keys.iter().fold(urdf.to_owned(), |text, key| {
        let mut parts = text.split(key);
        let mut scaled = parts.next().unwrap().to_owned();
        for part in parts {
            let (number, rest) = part.split_once('"').unwrap();
            write!(scaled, "{key}{:e}\"{rest}", factor * number.trim().parse::<f64>().unwrap()).unwrap();
        }
        scaled
    })
}

/// The README's example with masses and torques times `factor`.
fn example(factor: f64) -> IdentificationOutcome {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(repository("robots/ur10.urdf")).unwrap();
    let robot = folder.path().join("arm.urdf");
    std::fs::write(&robot, heavier(&urdf, factor)).unwrap();
    let study = std::fs::read_to_string(repository("examples/ur10_simulated.toml")).unwrap();
    let study = study
        .replace("../robots/ur10.urdf", &robot.display().to_string())
        .replace("columns = \"tau{1..6}_Nm\"", &format!("columns = \"tau{{1..6}}_Nm\", scale = {factor:e}"))
        .replace("ur10_simulated/", &format!("{}/", repository("examples/ur10_simulated").display()));
    Job::new(folder.path(), &study).identify()
}

/// Review of trust, section 1: the exported model went from 0.953 to 32.7 % on the robot a thousand times as heavy.
/// 1e-6 is what the solver's own tolerance leaves of a relative error.
#[test]
fn a_crane_and_a_watch_are_identified_alike() {
    let errors = |found: &IdentificationOutcome| {
        let held_out = &found.result.validation[0];
        let of = |report: &dynident::estimation::ValidationReport| report.relative_error_percent.unwrap();
        [of(&held_out.model), of(held_out.physical.as_ref().unwrap())]
    };
    let expected = errors(&example(1.0));
    for factor in [1.0e-3, 1.0e3] {
        let found = errors(&example(factor));
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found / expected - 1.0).abs() < 1e-6, "times {factor}: {found} for {expected}");
        }
    }
}
