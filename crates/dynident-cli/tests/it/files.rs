//! Files, terminals and devices: inputs are kept, control characters do not reach the terminal, and write errors are
//! reported.
use crate::common::{broken, command, repository, run_in};
use serde_json::Value;
use std::path::Path;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["arm.urdf", "log.csv", "good.toml"] {
        std::fs::copy(broken().join(name), folder.path().join(name)).unwrap();
    }
    let states = "q1,q2,dq1,dq2,ddq1,ddq2\n0.1,0.2,0.3,0.4,0.5,0.6\n";
    std::fs::write(folder.path().join("states.csv"), states).unwrap();
    folder
}

fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().is_file())
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn no_output_takes_the_place_of_an_input() {
    let folder = folder();
    let at = folder.path();
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    let good = std::fs::read_to_string(at.join("good.toml")).unwrap();
    // Logs, results and trajectories with the names of output files.
    for name in ["report.html", "log2.csv"] {
        std::fs::copy(at.join("log.csv"), at.join(name)).unwrap();
    }
    write("log_is_report.toml", &good.replace("log.csv", "report.html"));
    write("design.json", "{}");
    write("prior.toml", &format!("{good}\n[design]\nprior = {{ result = \"design.json\" }}\n"));
    write("waypoints.csv", "t_s,q1,q2\n0,0,0\n1,1,1\n");
    write("truth.json", "t_s,q1,q2,dq1,dq2,ddq1,ddq2\n0,0,0,0,0,0,0\n");
    let iterated = "\n[iteration]\ntrajectory = \"truth.json\"\n";
    write("simulated.toml", &format!("{good}{iterated}"));
    std::fs::create_dir(at.join("runs")).unwrap();
    std::fs::copy(at.join("truth.json"), at.join("runs/motion.csv")).unwrap();
    write("iterated.toml", &format!("{good}{}", iterated.replace("truth.json", "runs/motion.csv")));
    let before = contents(at);
    let evaluate = |out: &'static str| {
        vec!["evaluate", "arm.urdf", "--states", "states.csv", "--quantity", "gravity", "--out", out]
    };
    let mut cases = vec![
        (evaluate("arm.urdf"), "arm.urdf"),
        (evaluate("states.csv"), "states.csv"),
        (evaluate("./runs/../states.csv"), "states.csv"),
        (vec!["identify", "log_is_report.toml", "--out", "."], "report.html"),
        (vec!["design", "prior.toml", "--out", "."], "design.json"),
        (vec!["design", "good.toml", "--check", "waypoints.csv", "--to", "waypoints", "--out", "."], "waypoints.csv"),
        (vec!["simulate", "simulated.toml", "--out", "."], "truth.json"),
        (vec!["iterate", "iterated.toml", "--out", "."], "motion.csv"),
        (vec!["inspect", "arm.urdf", "--fix", "arm.urdf"], "arm.urdf"),
    ];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("arm.urdf", at.join("link.urdf")).unwrap();
        cases.push((evaluate("link.urdf"), "arm.urdf"));
        cases.push((vec!["inspect", "link.urdf", "--fix", "arm.urdf"], "link.urdf"));
    }
    for (arguments, input) in cases {
        let ran = run_in(at, &arguments);
        assert_eq!(ran.status, 2, "{arguments:?}: {}", ran.stderr);
        assert!(ran.stderr.contains("would overwrite") && ran.stderr.contains(input), "{arguments:?}: {}", ran.stderr);
    }
    let after: Vec<_> = contents(at).into_iter().filter(|(name, _)| name != "link.urdf").collect();
    assert!(before == after);
    assert!(at.join("runs/motion.csv").is_file());
}

#[test]
fn nothing_from_outside_steers_the_terminal() {
    let folder = folder();
    let at = folder.path();
    // XML cannot contain the escape character, but the one-character forms of its sequences.
    let robot = std::fs::read_to_string(at.join("arm.urdf")).unwrap();
    let robot =
        robot.replace("shoulder", "s\u{9b}31m\u{202e}houlder").replace("name=\"arm\"", "name=\"\u{9d}0;title\u{9c}\"");
    std::fs::write(at.join("arm.urdf"), robot).unwrap();
    let steers = |text: &str| text.chars().any(|c| c.is_control() && c != '\n' || c == '\u{202e}');
    for arguments in [
        &["inspect", "arm.urdf"][..],
        &["inspect", "arm.urdf", "--json"],
        &["identify", "good.toml", "--out", "out"],
        &["inspect", "no\u{1b}[2Jfile.urdf"],
        &["inspect", "arm.urdf", "--no\u{1b}[2Joption"],
        &["\u{1b}[31m"],
        &["evaluate", "arm.urdf", "--states", "states.csv", "--quantity", "\u{1b}[31m"],
    ] {
        let ran = run_in(at, arguments);
        assert!(!steers(&ran.stdout) && !steers(&ran.stderr), "{arguments:?}: {:?} {:?}", ran.stdout, ran.stderr);
    }
    let ran = run_in(at, &["inspect", "arm.urdf", "--json"]);
    let file: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(file["joints"][0]["name"], "s\u{9b}31m\u{202e}houlder");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_an_error() {
    let folder = folder();
    let robot = repository("robots/ur10.urdf").display().to_string();
    for arguments in [
        &["inspect", &robot, "--json"][..],
        &["inspect", &robot],
        &["--help"],
        &["--version"],
        &["evaluate", "arm.urdf", "--states", "states.csv", "--quantity", "gravity"],
        &["evaluate", "arm.urdf", "--states", "states.csv", "--quantity", "gravity", "--json"],
    ] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = command(folder.path(), arguments).stdout(full).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains("standard output") && stderr.contains("cannot be written"), "{arguments:?}: {stderr}");
    }
}

#[test]
fn a_log_is_not_taken_for_a_robot() {
    let folder = folder();
    let ran = run_in(folder.path(), &["inspect", "log.csv"]);
    assert_eq!(ran.status, 2);
    assert!(ran.stderr.contains("a recording or a table of numbers, not a robot description"), "{}", ran.stderr);
    let ran = run_in(folder.path(), &["inspect", "good.toml"]);
    assert!(ran.status == 2 && ran.stderr.contains("a study, not a robot description"), "{}", ran.stderr);
}

/// Reversed signs are reported, and the corrected copy equals the original byte for byte.
#[test]
fn a_slip_is_named_and_undone_in_a_copy() {
    let folder = tempfile::tempdir().unwrap();
    let original = std::fs::read_to_string(repository("robots/iiwa14.urdf")).unwrap();
    let mut wrong = original.clone();
    for name in ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"] {
        for digit in 1..=9 {
            wrong = wrong.replace(&format!("{name}=\"0.{digit}"), &format!("{name}=\"-0.{digit}"));
            wrong = wrong.replace(&format!("{name}=\"0.0{digit}"), &format!("{name}=\"-0.0{digit}"));
            wrong = wrong.replace(&format!("{name}=\"0.00{digit}"), &format!("{name}=\"-0.00{digit}"));
        }
    }
    assert_ne!(wrong, original);
    std::fs::write(folder.path().join("wrong.urdf"), &wrong).unwrap();
    let ran = run_in(folder.path(), &["inspect", "wrong.urdf", "--json"]);
    assert_eq!(ran.status, 1, "{}", ran.stderr);
    let file: Value = serde_json::from_str(&ran.stdout).unwrap();
    let slip = &file["slips"][0];
    assert_eq!(slip["slip"], "negated-moments", "{}", file["slips"]);
    assert!(
        slip["corrections"].as_array().unwrap().len() >= 24 && slip["evidence"].as_str().unwrap().contains("become")
    );
    let ran = run_in(folder.path(), &["inspect", "wrong.urdf", "--fix", "mended.urdf"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(
        ran.stdout.contains("SLIP (negated-moments)")
            && ran.stderr.contains("suspected export errors: 1 before, 0 now"),
        "{}",
        ran.stderr
    );
    assert_eq!(std::fs::read_to_string(folder.path().join("mended.urdf")).unwrap(), original);
    // A correct file has nothing to fix, and a wrong total mass is not a mistake of one number.
    let robot = repository("robots/iiwa14.urdf").display().to_string();
    let ran = run_in(folder.path(), &["inspect", &robot, "--fix", "none.urdf"]);
    assert!(ran.status == 0 && !folder.path().join("none.urdf").exists(), "{}", ran.stderr);
    let ran = run_in(folder.path(), &["inspect", &robot, "--total-mass", "20"]);
    assert!(ran.status == 1 && ran.stdout.contains("SLIP (total-mass)"), "{}", ran.stdout);
}
