//! Broken studies and state tables: exit status 2 within the time limit, and a message with the location.
use crate::common::{broken, run_in};
use std::time::{Duration, Instant};

fn table(name: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(broken().join(name)).unwrap();
    text.lines().map(|line| line.split('\t').map(str::to_owned).collect()).collect()
}

const LIMIT: Duration = Duration::from_secs(10);

fn check(file: &str, arguments: &[&str], expected: &str) -> Option<String> {
    let start = Instant::now();
    let ran = run_in(&broken(), arguments);
    let took = start.elapsed();
    let good = ran.status == 2
        && ran.stderr.starts_with("error: ")
        && ran.stderr.contains(expected)
        && ran.stderr.contains(file)
        && !ran.stderr.contains("panicked")
        && took < LIMIT;
    (!good).then(|| format!("{file}: status {}, {took:?}, wanted `{expected}`\n{}", ran.status, ran.stderr))
}

#[test]
fn every_broken_study_is_refused_with_its_place() {
    let out = tempfile::tempdir().unwrap();
    let out = out.path().join("result");
    let studies = table("studies.tsv");
    assert!(studies.len() >= 100, "{} studies", studies.len());
    let listed: Vec<&String> = studies.iter().map(|line| &line[0]).collect();
    for entry in std::fs::read_dir(broken()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let known = path.extension().is_none_or(|extension| extension != "toml")
            || name == "good.toml"
            || listed.contains(&&name);
        assert!(known, "{name} is not in studies.tsv");
    }
    let failed: Vec<String> = studies
        .iter()
        .filter_map(|line| check(&line[0], &["identify", &line[0], "--out", out.to_str().unwrap()], &line[1]))
        .collect();
    assert!(failed.is_empty(), "{} failed:\n{}", failed.len(), failed.join("\n"));
    assert!(!out.exists(), "a refused study left something behind");
}

/// A name, an expression or a key of 200,000 characters is shortened in messages.
#[test]
fn messages_quote_no_long_text() {
    let folder = tempfile::tempdir().unwrap();
    let good = std::fs::read_to_string(broken().join("good.toml")).unwrap();
    for file in ["arm.urdf", "log.csv"] {
        if broken().join(file).exists() {
            std::fs::copy(broken().join(file), folder.path().join(file)).unwrap();
        }
    }
    let (long, deep) = ("x".repeat(200_000), "(".repeat(200_000));
    let torque = |name: &str, joint: &str, expression: &str| {
        format!("{good}\n[[torque]]\nname = \"{name}\"\njoint = \"{joint}\"\nexpression = \"{expression}\"\n")
    };
    let studies = [
        torque("g", "j1", &format!("{deep}q{}", deep.replace('(', ")"))),
        torque("g", "j1", &deep),
        torque("g", "j1", &long),
        torque(&long, "j1", "q"),
        torque("g", &long, "q"),
        format!("{long} = 1\n{good}"),
        format!("name = \"{long}\" b\n{good}"),
        format!("name = \"{long}\"\nname = \"a\"\n{good}"),
    ];
    let path = folder.path().join("long.toml");
    for (number, study) in studies.iter().enumerate() {
        std::fs::write(&path, study).unwrap();
        let ran = run_in(folder.path(), &["identify", "long.toml", "--out", "result"]);
        assert_eq!(ran.status, 2, "{number}");
        assert!(ran.stderr.len() < 2000, "{number}: {} bytes, {}", ran.stderr.len(), &ran.stderr[..300]);
    }
}

#[test]
fn the_study_that_they_were_made_from_is_good() {
    let out = tempfile::tempdir().unwrap();
    let ran = run_in(&broken(), &["identify", "good.toml", "--out", out.path().to_str().unwrap()]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
}

#[test]
fn every_broken_table_of_states_is_refused_with_its_place() {
    let failed: Vec<String> = table("states.tsv")
        .iter()
        .filter_map(|line| {
            check(&line[0], &["evaluate", "arm.urdf", "--states", &line[0], "--quantity", &line[1]], &line[2])
        })
        .collect();
    assert!(failed.is_empty(), "{} failed:\n{}", failed.len(), failed.join("\n"));
}
