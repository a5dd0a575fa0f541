//! Intervals over all physically consistent robots contain the truth of a simulated arm.
use crate::common::repository;
use dynident::estimation::consistent::IntervalEnd;
use dynident::{RunOptions, Silent, Study, identify};
use std::collections::BTreeMap;

fn truth() -> BTreeMap<String, f64> {
    let text = std::fs::read_to_string(repository("examples/ur10_simulated/truth.json")).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    let parameters = file["parameters"].as_array().unwrap();
    parameters.iter().map(|p| (p["symbol"].as_str().unwrap().to_owned(), p["value"].as_f64().unwrap())).collect()
}

#[test]
fn they_hold_the_truth_and_nothing_inconsistent() {
    let path = repository("examples/ur10_simulated.toml");
    let mut study = Study::load(&path).unwrap();
    study.estimator.intervals = true;
    // The width of the simulated friction step: with a wrong model the intervals need not contain the truth.
    study.drive.coulomb_width = Some(0.01);
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    let found = identify(&study, &path, &options).unwrap().result;
    let intervals = found.possible_intervals.clone().unwrap();
    let truth = truth();
    let mut missed = Vec::new();
    for interval in &intervals {
        let holds = |value: f64| {
            interval.lower.is_none_or(|lower| lower <= value) && interval.upper.is_none_or(|upper| value <= upper)
        };
        assert!(holds(interval.value), "{interval:?}");
        if !holds(truth[&interval.symbol]) {
            missed.push(&interval.symbol);
        }
        let positive = ["m", "Ixx", "Iyy", "Izz", "fv", "fc", "Ia"].iter().any(|kind| {
            interval.symbol.strip_prefix(kind).is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit()))
        });
        if positive {
            assert!(interval.lower.unwrap() > -1e-9, "{interval:?}");
        }
        assert!(interval.held_by.iter().all(|end| *end != IntervalEnd::Unsettled), "{interval:?}");
    }
    // 84 parameters, of which 5 % are expected outside; more than ten would have a probability of 0.001 for independent
    // parameters.
    assert!(missed.len() <= 10, "{missed:?}");
    // Rotation about a vertical axis does not determine the mass of the first link.
    let first_mass = intervals.iter().find(|interval| interval.symbol == "m1").unwrap();
    assert_eq!(first_mass.held_by[1], IntervalEnd::Open, "{first_mass:?}");
    // Physical consistency can only shrink the interval of a base parameter.
    let friction = intervals.iter().find(|interval| interval.symbol == "fv3").unwrap();
    let usual = found.base_parameters.iter().find(|parameter| parameter.symbol == "fv3").unwrap();
    let width = friction.upper.unwrap() - friction.lower.unwrap();
    assert!((0.5..1.1).contains(&(width / (2.0 * usual.half_width_95))), "{friction:?} {usual:?}");
}
