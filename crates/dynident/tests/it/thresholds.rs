//! `[thresholds]` of a study: a key changes the decision behind it, and nothing else.
use crate::common::{Job, Motion, Random, Truth, header, plain, repository, write_log};

/// Noise relative to the torque, about 1 %: above the changed threshold and far below the default of 60 %.
const NOISE_NM: f64 = 0.3;

#[test]
fn a_threshold_of_problems_is_used_and_stored() {
    let (folder, arm) = (tempfile::tempdir().unwrap(), repository("robots/planar2r.urdf"));
    let (truth, mut random) = (Truth::near(&arm, 0.1, false), Random(5));
    for (file, seed) in [("a.csv", 1), ("b.csv", 2)] {
        let motion = Motion::new(2, seed);
        write_log(&folder.path().join(file), &truth, &motion, (250.0, 16.0), &header(2), |q, tau| {
            plain(q, &tau.iter().map(|tau| tau + NOISE_NM * random.normal()).collect::<Vec<f64>>())
        });
    }
    let identified = |thresholds: &str| {
        let text = format!(
            "robot.file = {:?}\ndrive.friction = \"stated\"\n\
             log = [{{ file = \"a.csv\" }}, {{ file = \"b.csv\", role = \"validate\" }}]\n{thresholds}\n\
             [format]\ntime = {{ column = \"t\" }}\nposition = {{ columns = \"q{{1..2}}\" }}\n\
             torque = {{ columns = \"tau{{1..2}}\" }}\n",
            arm.display().to_string()
        );
        Job::new(folder.path(), &text).identify().result
    };
    let usual = identified("");
    let strict = identified("thresholds.report.problems.max_unexplained_percent = 1e-3");
    let is_unexplained = |problem: &String| problem.contains("unexplained");
    assert!(!usual.problems.iter().any(is_unexplained), "{:?}", usual.problems);
    assert!(strict.problems.iter().any(is_unexplained), "{:?}", strict.problems);
    // The value is stored, and the estimate is the same.
    assert_eq!(strict.thresholds.problems.max_unexplained_percent, 1e-3);
    assert!(serde_json::to_value(&usual).unwrap().get("thresholds").is_none());
    let values = |result: &dynident::result::ResultFile| -> Vec<f64> {
        result.base_parameters.iter().map(|parameter| parameter.value).collect()
    };
    assert_eq!(values(&strict), values(&usual));
}
