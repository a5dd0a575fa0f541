//! `design`: the same motion, scaled, found in as many steps, with the same use of every limit and the same forecast.

use super::{AS_IT_IS, Differences, Scale, binary_scales};
use crate::common::{Job, repository};
use core::ops::ControlFlow;
use dynident::{DesignFile, DesignOutcome, design_study};

/// A short search for the UR10 with everything on that is assumed where a study is silent: floor, self-collision,
/// accelerations, torque noise. `more` are further keys of `[design]`.
fn designed(scale: Scale, (family, criterion, more): (&str, &str, &str)) -> DesignFile {
    let folder = tempfile::tempdir().unwrap();
    let arm = std::fs::read_to_string(repository("robots/ur10.urdf")).unwrap();
    std::fs::write(folder.path().join("arm.urdf"), scale.urdf(&arm)).unwrap();
    let Scale { time, .. } = scale;
    let study = format!(
        r#"
        robot = {{ {} }}
        drive = {{ friction = "stated", coulomb_width = {:e} }}
        [design]
        family = {{ kind = {family} }}
        criterion = "{criterion}"
        duration_s = {:e}
        {more}
        [design.search]
        rate_hz = {:e}
        starts = 2
        rounds = 1
        evaluations_per_start = 40
        polish_evaluations = 60
        "#,
        scale.robot("arm.urdf").replace('\n', ", "),
        0.02 / time,
        6.0 * time,
        50.0 / time,
    );
    let job = Job::new(folder.path(), &study);
    let outcome: DesignOutcome =
        design_study(&job.study, &job.path, &Job::options(2), |_| ControlFlow::Continue(())).unwrap();
    outcome.file
}

/// A sentence without its numbers, which may be lengths.
fn words(sentence: &str) -> String {
    sentence.chars().filter(|c| !c.is_ascii_digit() && !".-e".contains(*c)).collect()
}

/// 1e-6 of a motion: some hundred steps of a search multiply the rounding of its own criterion, a logarithm whose
/// constant the units make.
const TOLERANCE: f64 = 1e-6;

fn compare(scale: Scale, found: &DesignFile, expected: &DesignFile) -> Vec<String> {
    let mut differences = Differences::new(scale);
    differences.equal("evaluations", &found.evaluations, &expected.evaluations);
    differences.equal("feasible", &found.feasible, &expected.feasible);
    let size = expected.parameters.iter().fold(0.0_f64, |size, parameter| size.max(parameter.abs()));
    for (found, expected) in found.parameters.iter().zip(&expected.parameters) {
        differences.compare("parameter of the motion", (*found, *expected), TOLERANCE * size);
    }
    for (found, expected) in found.limits.iter().zip(&expected.limits) {
        differences.equal("limit", &(found.kind, &found.joint), &(expected.kind, &expected.joint));
        differences.compare(&expected.joint, (found.worst_ratio, expected.worst_ratio), TOLERANCE);
    }
    // An information is an inverse square of parameters.
    let constant: f64 = expected.forecast.iter().map(|parameter| -2.0 * scale.of(&parameter.unit).ln()).sum();
    let log_det = |file: &DesignFile| file.log_det_weighted.unwrap();
    differences.compare("log det", (log_det(found) - constant, log_det(expected)), TOLERANCE * log_det(expected).abs());
    let condition = |file: &DesignFile| file.condition_number_scaled.unwrap();
    differences.compare("condition", (condition(found), condition(expected)), TOLERANCE * condition(expected));
    for (found, expected) in found.forecast.iter().zip(&expected.forecast) {
        let factor = scale.of(&expected.unit);
        let [found, expected] = [found, expected].map(|forecast| forecast.std.unwrap());
        differences.compare("forecast", (found / factor, expected), TOLERANCE * expected);
    }
    for (found, expected) in found.worst_directions.iter().zip(&expected.worst_directions) {
        differences.compare("inflation", (found.inflation, expected.inflation), TOLERANCE * expected.inflation);
    }
    let all_words = |file: &DesignFile| -> Vec<String> {
        [&file.diagnosis, &file.assumed, &file.not_checked, &file.notes].into_iter().flatten().map(|s| words(s)).collect()
    };
    differences.equal("words", &all_words(found), &all_words(expected));
    differences.found
}

fn all_alike(setting: (&str, &str, &str)) {
    let expected = designed(AS_IT_IS, setting);
    let found = binary_scales().into_iter().flat_map(|scale| compare(scale, &designed(scale, setting), &expected));
    let all: Vec<String> = found.collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn a_crane_and_a_watch_move_alike() {
    all_alike(("\"fourier\", harmonics = 3", "d-optimal", ""));
}
