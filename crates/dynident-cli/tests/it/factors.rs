//! Logs reduced to factors, merged, and identified: the same model as from the logs.
use crate::common::{broken, run_in};
use crate::contract::{honest_log, json};
use serde_json::Value;
use std::path::Path;

/// A study of the fixture's arm with the logs `a` and `b`, and no automatic choices.
pub(crate) fn study(folder: &Path) -> String {
    honest_log(folder);
    let log = folder.join("honest.csv").display().to_string();
    let text = std::fs::read_to_string(broken().join("good.toml")).unwrap();
    let (before, after) = text.split_once("[[log]]").unwrap();
    let rest = after.lines().skip_while(|line| line.starts_with("file") || line.is_empty());
    let rest = rest.collect::<Vec<_>>().join("\n");
    let stated = format!(
        "{before}\n{rest}\n\
         [drive]\nfriction = \"stated\"\ndrive_inertia = false\ncoulomb = \"smooth\"\n\n\
         [motion]\ntorque_lag_s = 0.0\ndifferentiator = {{ method = \"butterworth\", cutoff_hz = 10.0 }}\n\n\
         [estimator]\nmethod = \"weighted\"\n\n\
         [[log]]\nname = \"a\"\nfile = {log:?}\nrows = [0, 800]\n\n\
         [[log]]\nname = \"b\"\nfile = {log:?}\nrows = [800, 1500]\n"
    );
    let path = folder.join("stated.toml");
    let arm = broken().join("arm.urdf").display().to_string();
    std::fs::write(&path, stated.replace("file = \"arm.urdf\"", &format!("file = {arm:?}"))).unwrap();
    path.display().to_string()
}

/// Runs the command in `folder`, which must end with `status`; returns its standard output.
fn ran(folder: &Path, status: i32, arguments: &[&str]) -> String {
    let outcome = run_in(folder, arguments);
    assert_eq!(outcome.status, status, "{arguments:?}: {}", outcome.stderr);
    if status == 2 { outcome.stderr } else { outcome.stdout }
}

fn result(folder: &Path) -> Value {
    json(&std::fs::read_to_string(folder.join("result.json")).unwrap())
}

#[test]
fn factors_give_the_model_that_the_logs_give() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let study = study(folder);
    // With the same number of segments and order of logs as in the fit, the results are bit-identical.
    let reduce = |log: &str, further: &[&str]| {
        let file = format!("{log}.factors");
        ran(folder, 0, &[&["reduce", &study, "--log", log, "--segments", "64", "--out", &file], further].concat())
    };
    let said = json(&reduce("b", &["--json", "--arm", "second", "--recorded-at", "2026-01-05"]));
    assert_eq!(said["schema"], "dynident/factors/1");
    assert_eq!(said["logs"][0]["name"], "b");
    assert_eq!(said["logs"][0]["recorded_at"], "2026-01-05T00:00:00Z");
    assert_eq!(said["bytes"], std::fs::metadata(folder.join("b.factors")).unwrap().len());
    assert!(reduce("a", &["--arm", "first"]).contains("1 log of "));
    assert_eq!(reduce("a", &["--arm", "first", "--quiet"]), "");

    ran(folder, 0, &["merge", "a.factors", "b.factors", "--out", "ab.factors"]);
    let other_way = json(&ran(folder, 0, &["merge", "b.factors", "ab.factors", "--out", "ba.factors", "--json"]));
    assert_eq!(other_way["logs"].as_array().unwrap().len(), 2);
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert_eq!(bytes("ab.factors"), bytes("ba.factors"));

    let status = |arguments: &[&str]| run_in(folder, arguments).status;
    let of_logs = status(&["identify", &study, "--out", "logs", "--quiet"]);
    assert!(of_logs == 0 || of_logs == 1);
    for (name, files) in [("merged", &["ab.factors"][..]), ("parts", &["b.factors", "a.factors"])] {
        status(&[&["identify", "--out", name, "--quiet", "--factors"], files].concat());
        let (found, expected) = (result(&folder.join(name)), result(&folder.join("logs")));
        assert_eq!(found["base_parameters"], expected["base_parameters"], "{name}");
        assert_eq!(found["bodies"], expected["bodies"], "{name}");
        let command = format!("dynident identify --factors {}", files.join(" "));
        assert_eq!(found["provenance"]["command"], Value::String(command));
    }
    // One robot alone equals the fit to its log alone.
    status(&["identify", "--out", "second", "--quiet", "--factors", "ab.factors", "--arm", "second"]);
    status(&["identify", "--out", "b", "--quiet", "--factors", "b.factors"]);
    assert_eq!(result(&folder.join("second"))["base_parameters"], result(&folder.join("b"))["base_parameters"]);
    // With --like, the cut-off of a model replaces the open one of the study.
    let open = std::fs::read_to_string(&study).unwrap().replace(", cutoff_hz = 10.0", "");
    std::fs::write(folder.join("open.toml"), open).unwrap();
    let left_open = ["reduce", "open.toml", "--log", "b", "--segments", "64", "--out", "like.factors"];
    assert!(ran(folder, 2, &left_open).contains("cut-off is estimated from the logs"));
    ran(folder, 0, &[&left_open[..], &["--like", "logs/result.json"]].concat());
    status(&["identify", "--out", "like", "--quiet", "--factors", "like.factors"]);
    assert_eq!(result(&folder.join("like"))["base_parameters"], result(&folder.join("b"))["base_parameters"]);
}

#[test]
fn what_is_no_factors_and_what_does_not_go_together_has_status_2() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let study = study(folder);
    let says = |words: &str, arguments: &[&str]| {
        let said = ran(folder, 2, arguments);
        assert!(said.contains(words) && !said.contains("panicked"), "{arguments:?}: {said}");
    };
    ran(folder, 0, &["reduce", &study, "--out", "all.factors"]);
    says("no log `c`; its logs are a, b", &["reduce", &study, "--log", "c", "--out", "c.factors"]);
    says("give 2026-01-05", &["reduce", &study, "--out", "c.factors", "--recorded-at", "monday"]);
    says("--out", &["reduce", &study]);
    says("stated.toml", &["reduce", &study, "--out", "stated.toml"]);
    says("not a factor file", &["merge", "honest.csv", "--out", "c.factors"]);
    says("gone.factors", &["merge", "gone.factors", "--out", "c.factors"]);
    says("all.factors", &["merge", "all.factors", "--out", "all.factors"]);
    says("cannot be used with", &["identify", &study, "--factors", "all.factors", "--out", "c"]);
    says("required", &["identify", "--out", "c"]);
    says("--arm third: no log", &["identify", "--factors", "all.factors", "--arm", "third", "--out", "c"]);
    let mut harmed = std::fs::read(folder.join("all.factors")).unwrap();
    let middle = harmed.len() / 2;
    harmed[middle] ^= 1;
    std::fs::write(folder.join("harmed.factors"), harmed).unwrap();
    says("hash", &["identify", "--factors", "harmed.factors", "--out", "c"]);
    let other = std::fs::read_to_string(&study).unwrap().replace("cutoff_hz = 10.0", "cutoff_hz = 9.0");
    std::fs::write(folder.join("other.toml"), other).unwrap();
    ran(folder, 0, &["reduce", "other.toml", "--out", "other.factors"]);
    says("[motion] differ", &["merge", "all.factors", "other.factors", "--out", "c.factors"]);
    assert!(!folder.join("c.factors").exists() && !folder.join("c").exists());
}
