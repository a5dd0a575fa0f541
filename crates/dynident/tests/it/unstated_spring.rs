//! A spring that the study does not state: named by `check` with a table that explains it.

use crate::common::{Job, Motion, Truth, format, header, repository, write_log};
use dynident::check;
use dynident::result::CheckFinding;
use std::path::Path;

/// Logs of a UR10 whose elbow has a hardening counterbalance of `stiffness` Nm/rad³; the last one is for the test.
fn logs(folder: &Path, stiffness: f64) {
    let truth = Truth::near(&repository("robots/ur10.urdf"), 0.2, false);
    for number in 0..3 {
        let motion = Motion::new(6, 11 + number);
        let path = folder.join(format!("log{number}.csv"));
        write_log(&path, &truth, &motion, (200.0, 20.0), &header(6), |q, tau| {
            let mut tau = tau.to_vec();
            tau[2] += stiffness * q[2].powi(3);
            [q, &tau].concat()
        });
    }
}

fn study(folder: &Path, more: &str) -> Job {
    let robot = repository("robots/ur10.urdf");
    let logs = "log = [{ file = \"log0.csv\" }, { file = \"log1.csv\" }, { file = \"log2.csv\", role = \"validate\" }]";
    Job::new(folder, &format!("robot.file = '{}'\n{logs}\n{}\n{more}", robot.display(), format(6)))
}

fn springs(job: &Job) -> Vec<CheckFinding> {
    let found = check(&job.study, &job.path, &Job::options(1)).unwrap().check.findings;
    found.into_iter().filter(|finding| finding.code == "check-position-torque").collect()
}

#[test]
fn the_printed_table_explains_the_spring() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path(), 40.0);
    let without = study(folder.path(), "");
    let found = springs(&without);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].what.contains("elbow"), "{}", found[0].what);
    // Written literally, the table repairs the study.
    let lines: Vec<&str> = found[0].write.iter().map(|change| &change.line[..]).collect();
    let with = study(folder.path(), &format!("[[torque]]\n{}", lines.join("\n")));
    assert!(springs(&with).is_empty());
    let error = |job: &Job| {
        let result = job.identify().result;
        let warned = result.logs[0].model_findings.iter().any(|finding| finding.code == "fit-position-torque");
        (result.validation[0].model.joints[2].relative_error_percent.unwrap(), warned)
    };
    let ((before, is_warned), (after, is_still_warned)) = (error(&without), error(&with));
    assert!(is_warned && !is_still_warned);
    // A table of twelve points over the range leaves a twelfth of its change in a bin: at most a quarter.
    assert!(after < 0.25 * before, "{after} of {before}");
}

#[test]
fn no_spring_is_found_without_one() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path(), 0.0);
    assert!(springs(&study(folder.path(), "")).is_empty());
}
