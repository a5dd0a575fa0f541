//! Robust, instrumental and generalised least squares compared with statsmodels (golden/statsmodels_robust.py).

use dynident_estimation::{
    CovarianceMethod, CrossProblem, EstimateStatus, EstimationError, HausmanSettings, HausmanVerdict,
    InstrumentalSettings, InstrumentedProblem, LinearProblem, RobustSettings, RowBlock, RowWeight, SegmentSettings,
    SegmentedFactor, WeightedSettings, generalized_least_squares, hausman_test, instrumental_variables,
    robust_least_squares, student_half_width,
};
use serde_json::Value;

/// Double precision on well-conditioned rows (below 1e3 raw): the oracle's XᵀX loses at most 1e-10; its last iteration
/// changes by 1e-13.
const RELATIVE: f64 = 1.0e-9;

fn golden() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../golden/statsmodels_robust.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn columns(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().flat_map(numbers).collect()
}

fn segments(golden: &Value) -> SegmentSettings {
    SegmentSettings { max_segments: 64, first_length_rows: golden["segment_rows"].as_u64().unwrap() as usize }
}

fn close(what: &str, found: f64, expected: f64, scale: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * scale, "{what}: found {found:e}, expected {expected:e}");
}

fn close_all(what: &str, found: &[f64], expected: &[f64], relative: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        close(&format!("{what}[{i}]"), *found, *expected, expected.abs(), relative);
    }
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|c| format!("theta{c}")).collect()
}

#[test]
fn robust_estimates_agree_with_statsmodels() {
    let golden = golden();
    let data = &golden["robust"];
    let (mut panel, tau) = (columns(&data["w_by_column"]), numbers(&data["tau"]));
    panel.extend(&tau);
    let mut rows = SegmentedFactor::new(3, segments(&golden)).unwrap();
    rows.absorb(&panel, tau.len()).unwrap();
    let mut problem = LinearProblem::new(names(3), vec!["joint1".into()]);
    problem.add("log", 0, vec![0, 1, 2], rows).unwrap();
    for (name, weight) in [("huber", RowWeight::huber()), ("tukey", RowWeight::tukey())] {
        let settings = RobustSettings { weight, tolerance: 1.0e-12, max_passes: 500, ..Default::default() };
        let found = robust_least_squares::<EstimationError>(&problem, &settings, |visit| {
            visit(&RowBlock { log: 0, joint: 0, rows: tau.len(), panel: &panel })
        })
        .unwrap();
        // The oracle stops when its coefficients change by 1e-13 and converges linearly with a factor well below 0.9,
        // so it is accurate to 1e-12.
        close_all(name, &found.estimate.values, &numbers(&data[name]["values"]), RELATIVE);
        close_all("scale", &found.estimate.joint_sigma, &[data[name]["scale"].as_f64().unwrap()], RELATIVE);
        let widths = found.estimate.std.iter().zip(&found.estimate.std_degrees_of_freedom);
        let widths: Vec<f64> =
            widths.map(|(std, degrees_of_freedom)| student_half_width(0.95, *degrees_of_freedom) * std).collect();
        close_all("half width", &found.estimate.half_width_95, &widths, RELATIVE);
        // Twelve of 240 rows are outliers.
        assert!((0.03..0.08).contains(&found.outlier_share[0]), "{:?}", found.outlier_share);
    }
}

fn instrumented(golden: &Value) -> InstrumentedProblem {
    let data = &golden["instrumental"];
    let mut panel = columns(&data["z_by_column"]);
    panel.extend(columns(&data["w_by_column"]));
    let tau = numbers(&data["tau"]);
    panel.extend(&tau);
    let mut rows = SegmentedFactor::new(6, segments(golden)).unwrap();
    rows.absorb(&panel, tau.len()).unwrap();
    let mut problem = InstrumentedProblem::new(names(3), vec!["joint1".into()]);
    problem.add("log", 0, &[0, 1, 2], rows).unwrap();
    problem
}

#[test]
fn instrumental_variables_agree_with_statsmodels() {
    let golden = golden();
    let expected = &golden["instrumental"];
    let problem = instrumented(&golden);
    let settings =
        InstrumentalSettings { covariance: CovarianceMethod::Segments, tolerance: 1.0e-12, ..Default::default() };
    let found = instrumental_variables(&problem, &settings).unwrap();
    close_all("values", &found.estimate.values, &numbers(&expected["values"]), RELATIVE);
    close_all("sigma", &found.estimate.joint_sigma, &[expected["sigma"].as_f64().unwrap()], RELATIVE);
    for (i, row) in expected["covariance_segments"].as_array().unwrap().iter().enumerate() {
        for (j, value) in numbers(row).into_iter().enumerate() {
            let scale = found.estimate.std[i] * found.estimate.std[j];
            close("covariance", found.estimate.covariance[(i, j)], value, scale, RELATIVE);
        }
    }
    assert_eq!(found.instruments.noisy_columns, ["theta0", "theta1"]);
    close_all(
        "weakest F",
        &[found.instruments.weakest_f.unwrap()],
        &[expected["weakest_f"].as_f64().unwrap()],
        RELATIVE,
    );
    assert!(found.estimate.status == EstimateStatus::Complete && !found.instruments.weak);
    let white = HausmanSettings { covariance: CovarianceMethod::White, ..Default::default() };
    let test = hausman_test(&problem, &found, &white).unwrap();
    close_all("F", &[test.f.unwrap()], &[expected["hausman_f"].as_f64().unwrap()], RELATIVE);
    // The logarithm of this tail is about 250, so a relative error of F is multiplied by that.
    close_all("p", &[test.p_value.unwrap()], &[expected["hausman_p"].as_f64().unwrap()], 1.0e-6);
    assert_eq!(test.degrees_of_freedom, [2.0, 295.0]);
    let test = hausman_test(&problem, &found, &HausmanSettings::default()).unwrap();
    assert_eq!(test.verdict, HausmanVerdict::RejectLeastSquares);
    assert_eq!(test.degrees_of_freedom, [2.0, 13.0]);
}

#[test]
fn generalized_least_squares_agrees_with_statsmodels() {
    let golden = golden();
    let data = &golden["generalized"];
    let lists: Vec<Vec<usize>> = data["joint_columns"]
        .as_array()
        .unwrap()
        .iter()
        .map(|list| numbers(list).into_iter().map(|c| c as usize).collect())
        .collect();
    let mut problem = CrossProblem::new(names(3), vec!["a".into(), "b".into()], lists).unwrap();
    let mut panel = Vec::new();
    let mut rows = 0;
    for joint in data["joints"].as_array().unwrap() {
        panel.extend(columns(&joint["w_by_column"]));
        panel.extend(numbers(&joint["tau"]));
        rows = numbers(&joint["tau"]).len();
    }
    let mut factor = SegmentedFactor::new(problem.width(), segments(&golden)).unwrap();
    factor.absorb(&panel, rows).unwrap();
    problem.add("log", factor).unwrap();
    let settings = WeightedSettings { tolerance: 1.0e-12, ..Default::default() };
    let found = generalized_least_squares(&problem, &settings).unwrap();
    close_all("values", &found.estimate.values, &numbers(&data["values"]), RELATIVE);
    let omega = columns(&data["omega"]);
    for (k, value) in omega.iter().enumerate() {
        close("omega", found.noise_covariance[(k / 2, k % 2)], *value, value.abs(), RELATIVE);
    }
    for (i, row) in data["covariance_unscaled"].as_array().unwrap().iter().enumerate() {
        let white = &found.estimate.covariance_white;
        for (j, value) in numbers(row).into_iter().enumerate() {
            close("white", white[(i, j)], value, (white[(i, i)] * white[(j, j)]).sqrt(), RELATIVE);
        }
    }
    assert_eq!(found.estimate.clusters, 10);
}
