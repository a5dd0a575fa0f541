//! `design`: the same scaled motion, number of steps, use of limits and forecast.

use super::{AS_IT_IS, Differences, Scale, binary_scales, binary_sizes};
use crate::common::{Job, repository};
use core::ops::ControlFlow;
use dynident::{DesignFile, DesignOutcome, design_study};

struct Search {
    family: &'static str,
    criterion: &'static str,
    /// Further keys of `[design]`.
    limits: fn(Scale) -> String,
}

fn designed(scale: Scale, Search { family, criterion, limits }: &Search) -> DesignFile {
    let folder = tempfile::tempdir().unwrap();
    let arm = std::fs::read_to_string(repository("robots/ur10.urdf")).unwrap();
    std::fs::write(folder.path().join("arm.urdf"), scale.urdf(&arm)).unwrap();
    let study = format!(
        r#"
        [robot]
        {}
        [drive]
        friction = "stated"
        [design]
        family = {family}
        criterion = "{criterion}"
        duration_s = {:e}
        search = {{ rate_hz = {:e}, starts = 2, rounds = 1, evaluations_per_start = 40, polish_evaluations = 60 }}
        {}
        "#,
        scale.robot("arm.urdf"),
        6.0 * scale.time,
        50.0 / scale.time,
        limits(scale),
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

/// Tolerance of computed figures. The motion is bit-identical: factors are powers of two, so the search takes the same
/// steps.
const TOLERANCE: f64 = 1e-6;

fn compare(scale: Scale, found: &DesignFile, expected: &DesignFile) -> Vec<String> {
    let mut differences = Differences::new(scale);
    differences.equal("evaluations", &found.evaluations, &expected.evaluations);
    differences.equal("feasible", &found.feasible, &expected.feasible);
    differences.equal("motion", &found.parameters, &expected.parameters);
    for (found, expected) in found.limits.iter().zip(&expected.limits) {
        differences.equal("limit", &(found.kind, words(&found.joint)), &(expected.kind, words(&expected.joint)));
        differences.compare(&expected.joint, found.worst_ratio, expected.worst_ratio, TOLERANCE);
    }
    // Information is an inverse square of parameters.
    let constant: f64 = expected.forecast.iter().map(|parameter| -2.0 * scale.of(&parameter.unit).ln()).sum();
    let log_det = |file: &DesignFile| file.log_det_weighted.unwrap();
    differences.compare("log det", log_det(found) - constant, log_det(expected), TOLERANCE * log_det(expected).abs());
    let condition = |file: &DesignFile| file.condition_number_scaled.unwrap();
    differences.compare("condition", condition(found), condition(expected), TOLERANCE * condition(expected));
    for (found, expected) in found.forecast.iter().zip(&expected.forecast) {
        let factor = scale.of(&expected.unit);
        let [found, expected] = [found, expected].map(|forecast| forecast.std.unwrap());
        differences.compare("forecast", found / factor, expected, TOLERANCE * expected);
    }
    for (found, expected) in found.worst_directions.iter().zip(&expected.worst_directions) {
        differences.compare("inflation", found.inflation, expected.inflation, TOLERANCE * expected.inflation);
    }
    let all_words = |file: &DesignFile| -> Vec<String> {
        [&file.diagnosis, &file.assumed, &file.not_checked, &file.notes]
            .into_iter()
            .flatten()
            .map(|s| words(s))
            .collect()
    };
    differences.equal("words", &all_words(found), &all_words(expected));
    differences.found
}

fn assert_all_alike(search: &Search, scales: &[Scale]) {
    let expected = designed(AS_IT_IS, search);
    let all = scales.iter().flat_map(|&scale| compare(scale, &designed(scale, search), &expected));
    let all: Vec<String> = all.collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// With all default assumptions: floor, self-collision, accelerations, torque noise. Time is not scaled, because the
/// coefficients of a Fourier series are velocities and its search would take other steps.
#[test]
fn a_crane_and_a_watch_move_alike() {
    let limits = |_| String::new();
    let search = Search { family: "{ kind = \"fourier\", harmonics = 3 }", criterion: "d-optimal", limits };
    assert_all_alike(&search, &binary_sizes());
}

/// Within stated workspace limits, with a worst-direction criterion.
#[test]
fn a_crane_and_a_watch_move_alike_in_a_cell() {
    let limits = |Scale { length, .. }: Scale| {
        let [low, radius, high, point] = [-0.2, 0.1, 1.5, 0.1].map(|metres| metres * length);
        format!(
            r#"
            defaults = {{ floor = false, self_collision = false }}
            [design.limits]
            floor = {{ height_m = {low:e}, points = [{{ link = "wrist_3_link", at_m = [0.0, {point:e}, 0.0] }}] }}
            column = {{ radius_m = {radius:e}, points = [{{ link = "wrist_3_link" }}] }}
            boxes = [{{ z_m = [{:e}, {high:e}], points = [{{ link = "wrist_2_link" }}] }}]
            "#,
            -high
        )
    };
    let search = Search { family: "{ kind = \"quintic\" }", criterion: "condition-number-scaled", limits };
    assert_all_alike(&search, &binary_scales());
}
