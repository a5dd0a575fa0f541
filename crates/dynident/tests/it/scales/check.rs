//! `check`: equal hypotheses and findings at every scale.

use super::{AS_IT_IS, Differences, STATED, Scale, example, scales};
use dynident::result::StudyCheck;
use dynident::{RunOptions, Silent, check};

fn examined(scale: Scale) -> StudyCheck {
    let (_folder, job) = example(scale, STATED);
    let options = RunOptions { data: None, threads: 2, progress: &Silent };
    check(&job.study, &job.path, &options).unwrap().check
}

/// The score agrees within 0.01, the accuracy of comparisons between hypotheses.
#[test]
fn a_crane_and_a_watch_are_examined_alike() {
    let expected = examined(AS_IT_IS);
    let mut all = Vec::new();
    for scale in scales() {
        let found = examined(scale);
        let mut differences = Differences::new(scale);
        let score = |check: &StudyCheck| check.as_written.as_ref().unwrap().score;
        differences.compare("score", score(&found), score(&expected), 1e-2 * score(&expected).abs());
        differences.equal("findings", &found.findings, &expected.findings);
        all.extend(differences.found);
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}
