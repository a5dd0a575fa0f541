//! Results that were edited or damaged after they were written (finding A4).

use super::common::{CommandOutcome, broken, run_in};
use serde_json::{Value, json};
use std::path::Path;

type Edit<'a> = &'a dyn Fn(&mut Value);

const STUDY: &str = "[robot]\nfile = \"arm.urdf\"\n[format]\ntime = { column = \"t\" }\nposition = { columns = \"q{1..2}\" }\n\
    torque = { columns = \"tau{1..2}\" }\n[drive]\nfriction = \"stated\"\n[[log]]\nfile = \"log.csv\"\n";

fn identified() -> (tempfile::TempDir, Value) {
    let folder = tempfile::tempdir().unwrap();
    for name in ["arm.urdf", "log.csv"] {
        std::fs::copy(broken().join(name), folder.path().join(name)).unwrap();
    }
    std::fs::write(folder.path().join("s.toml"), STUDY).unwrap();
    let found = run_in(folder.path(), &["identify", "s.toml", "--out", "r"]);
    assert!(found.status < 2, "{}", found.stderr);
    let text = std::fs::read(folder.path().join("r/result.json")).unwrap();
    let result = serde_json::from_slice(&text).unwrap();
    (folder, result)
}

fn write(at: &Path, result: &Value) {
    std::fs::write(at.join("r.json"), result.to_string()).unwrap();
}

fn export(at: &Path, more: &[&str]) -> CommandOutcome {
    run_in(at, &[&["export", "r.json", "--study", "s.toml", "--to"], more].concat())
}

fn refused(outcome: &CommandOutcome, says: &[&str]) {
    assert_eq!((outcome.status, outcome.stdout.as_str()), (2, ""), "{}", outcome.stderr);
    assert!(says.iter().all(|words| outcome.stderr.contains(words)), "{}", outcome.stderr);
}

#[test]
fn an_edited_result_is_used_only_by_who_asks_for_it() {
    let (folder, result) = identified();
    let at = folder.path();
    // Another layout, and other times, are the same content.
    let mut same = result.clone();
    same["timings_s"]["total"] = json!(77.0);
    write(at, &same);
    assert_eq!(export(at, &["json"]).status, 0);
    let mut edited = result.clone();
    edited["name"] = json!("another");
    write(at, &edited);
    refused(&export(at, &["json"]), &["r.json", "edited or damaged", "identify again", "--accept-edited"]);
    refused(&run_in(at, &["validate", "r.json", "--study", "s.toml"]), &["edited or damaged"]);
    assert_eq!(export(at, &["json", "--accept-edited"]).status, 0);
    assert!(run_in(at, &["validate", "r.json", "--study", "s.toml", "--accept-edited"]).status < 2);
    refused(&run_in(at, &["reduce", "s.toml", "--like", "r.json", "--out", "f.bin"]), &["edited or damaged"]);
    // A file of an earlier version, without a hash.
    edited["provenance"].as_object_mut().unwrap().remove("content_sha256").unwrap();
    write(at, &edited);
    assert_eq!(export(at, &["json"]).status, 0);
}

#[test]
fn numbers_of_no_robot_are_refused_whoever_wrote_them() {
    let (folder, result) = identified();
    let at = folder.path();
    assert_eq!(result["physical"]["consistent"], json!(true));
    let changes: [(Edit<'_>, &[&str]); 7] = [
        (
            &|value| {
                value["bodies"][0]["mass_kg"] = json!(-5.0);
                value["bodies"][0]["parameters"][0] = json!(-5.0);
            },
            &["bodies[0]"],
        ),
        (&|value| value["bodies"][0]["mass_kg"] = json!(-5.0), &["bodies[0]", "mass_kg does not match"]),
        (
            &|value| (0..10).for_each(|k| value["bodies"][0]["parameters"][k] = json!(1e308)),
            &["bodies[0]", "1e308", "too large"],
        ),
        (
            &|value| {
                for parameter in value["base_parameters"].as_array_mut().unwrap() {
                    (parameter["value"], parameter["physical"]) = (json!(1e308), json!(1e308));
                }
            },
            &["base_parameters[0].value", "too large"],
        ),
        (&|value| value["joints"][0]["laws"][0]["value"] = json!(1e300), &["joints[0]", "too large"]),
        (
            &|value| {
                let terms = value["joints"][0]["laws"].as_array_mut().unwrap();
                for term in terms {
                    term["value"] = json!(-1.0);
                }
            },
            &["not physically consistent"],
        ),
        (
            &|value| drop(value["base_parameter_covariance"].as_array_mut().unwrap().pop()),
            &["base_parameter_covariance", "rows"],
        ),
    ];
    for (change, says) in changes {
        let mut edited = result.clone();
        change(&mut edited);
        write(at, &edited);
        refused(&export(at, &["urdf"]), &["edited or damaged"]);
        for form in ["urdf", "c", "mjcf", "json", "python"] {
            let says = [says, &["r.json", "identify again"]].concat();
            refused(&export(at, &[form, "--accept-edited"]), &says);
        }
    }
}
