//! Invalid designs are rejected before any search, with a message that names the place.
use crate::common::{Job, repository};
use core::ops::ControlFlow;
use dynident::{Study, check_log, check_trajectory, design_study};
use std::path::Path;

fn text(design: &str) -> String {
    let joints = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]
        .map(|joint| format!("{{ joint = \"{joint}_joint\", acceleration = 10.0 }}"));
    format!(
        "[robot]\nfile = {:?}\n[design]\n{design}\n[design.defaults]\nfloor = false\nself_collision = false\n[design.limits]\njoints = [{}]\n",
        repository("robots/ur10.urdf").canonicalize().unwrap().display().to_string(),
        joints.join(", ")
    )
}

/// Error message when a study is read or designed.
fn refusal(folder: &Path, text: &str) -> String {
    let path = folder.join("study.toml");
    let study = match Study::parse(text, &path) {
        Ok(study) => study,
        Err(error) => return error.to_string(),
    };
    match design_study(&study, &path, &Job::options(1), |_| ControlFlow::Break(())) {
        Ok(_) => panic!("not refused:\n{text}"),
        Err(error) => error.to_string(),
    }
}

fn assert_named(folder: &Path, text: &str, names: &[&str]) {
    let message = refusal(folder, text);
    assert!(names.iter().all(|name| message.contains(name)), "{message}\nfor\n{text}");
}

#[test]
fn a_start_that_cannot_be_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (start, names) in [
        ("{ elbow_joint = 4.0 }", &["elbow_joint", "4", "position limits"][..]),
        ("{ elbow = 1.0 }", &["`elbow`", "wrist_3_joint"]),
        ("[0.0, 0.0]", &["start_posture has 2 entries", "6 joints"]),
        ("[0.0, -1.57, 9.0, 0.0, 0.0, 0.0]", &["elbow_joint", "9"]),
        ("{ elbow_joint = nan }", &["elbow_joint", "finite"]),
        ("\"home\"", &["positions by joint"]),
    ] {
        assert_named(folder.path(), &text(&format!("start_posture = {start}")), names);
    }
    // With the arm stretched out, gravity alone exceeds the limit of a weak shoulder: a complete posture is checked
    // against every limit.
    let weak = text("start_posture = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]")
        .replace("shoulder_lift_joint\",", "shoulder_lift_joint\", torque = 20.0,");
    assert_named(folder.path(), &weak, &["start_posture", "torque", "shoulder_lift_joint"]);
    let both = "start_posture = { elbow_joint = 1.0 }\nfamily = { kind = \"joined\", start = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], parts = [{ kind = \"fourier\" }] }";
    assert_named(folder.path(), &text(both), &["keep one"]);
}

#[test]
fn limits_that_contradict_and_durations_too_short_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (limit, names) in [
        ("position = [1.0, -1.0]", &["elbow_joint", "exchange"][..]),
        ("position = [0.5, 0.5]", &["elbow_joint", "lock"]),
        ("speed = 0.0", &["elbow_joint", "above 0"]),
        ("torque_margin = 1.0", &["torque margin", "elbow_joint"]),
    ] {
        let limited = text("").replace("elbow_joint\",", &format!("elbow_joint\", {limit},"));
        assert_named(folder.path(), &limited, names);
    }
    let slow =
        text("duration_s = 0.5").replace("elbow_joint\", acceleration = 10.0", "elbow_joint\", acceleration = 0.1");
    assert_named(folder.path(), &slow, &["0.5 s is too short", "elbow_joint"]);
}

#[test]
fn families_that_cannot_be_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (family, names) in [
        ("{ kind = \"joined\", parts = [] }", &["members"][..]),
        ("{ kind = \"joined\" }", &["parts"]),
        (
            "{ kind = \"joined\", parts = [{ kind = \"fourier\" }, { kind = \"fourier\" }], shares = [1.0] }",
            &["shares", "2"],
        ),
        ("{ kind = \"joined\", parts = [{ kind = \"fourier\" }, { kind = \"fourier\" }], move_s = 20.0 }", &["move_s"]),
        ("{ kind = \"joined\", parts = [{ kind = \"joined\", parts = [{ kind = \"fourier\" }] }] }", &["parts"]),
        ("{ kind = \"joined\", parts = [{ kind = \"fourier\", harmonic = 5 }] }", &["harmonic"]),
        ("{ kind = \"friction-ladder\", rungs = 100 }", &["ramps"]),
        ("{ kind = \"friction-ladder\", postures = 3 }", &["postures"]),
        ("{ kind = \"static-postures\", postures = 1 }", &["postures"]),
        ("{ kind = \"static-postures\", rest_part = 1.0 }", &["rest_part"]),
    ] {
        assert_named(folder.path(), &text(&format!("family = {family}")), names);
    }
}

/// Rows of a table of six joints at rest, modified by `change`.
fn table(header: &str, rows: usize, change: impl Fn(usize, &mut Vec<String>)) -> String {
    let columns = header.split(',').count();
    let mut text = format!("{header}\n");
    for row in 0..rows {
        let mut fields = vec!["0".to_owned(); columns];
        fields[0] = (row as f64 * 0.01).to_string();
        change(row, &mut fields);
        text += &(fields.join(",") + "\n");
    }
    text
}

#[test]
fn a_task_that_is_none_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let study = text("criterion = { kind = \"prediction\", trajectory = \"task.csv\" }");
    assert_named(folder.path(), &study, &["task.csv", "folders"]);
    let positions = "t_s,q1,q2,q3,q4,q5,q6";
    let whole = format!("{positions},dq1,dq2,dq3,dq4,dq5,dq6,ddq1,ddq2,ddq3,ddq4,ddq5,ddq6");
    let none = |_: usize, _: &mut Vec<String>| ();
    for (contents, names) in [
        (table("t_s,q1,q2,q3,q4,q5,q6,q7", 50, none), &["task.csv:1", "`q7`", "6 joints", "elbow_joint"][..]),
        (table("t_s,q1,q2,q3", 50, none), &["task.csv:1", "no column `q4`"]),
        (table("time,q1", 50, none), &["no column `t_s`"]),
        (table("t_s,elbow_joint,wrist_1_joint", 50, none), &["no column `shoulder_pan_joint`"]),
        (table(positions, 1, none), &["task.csv", "two or more"]),
        (
            table(positions, 50, |row, fields| {
                if row == 3 {
                    fields[2] = "NaN".to_owned();
                }
            }),
            &["task.csv:5", "`q2`", "finite"],
        ),
        (
            table(positions, 50, |row, fields| {
                if row == 3 {
                    fields.truncate(4);
                }
            }),
            &["task.csv:5", "`q4`"],
        ),
        (
            table(positions, 50, |row, fields| {
                if row == 3 {
                    fields[0] = "0".to_owned();
                }
            }),
            &["task.csv:5", "increase"],
        ),
        (
            table(positions, 50, |row, fields| {
                if row == 49 {
                    fields[0] = "9".to_owned();
                }
            }),
            &["even"],
        ),
        (
            table(&whole, 50, |row, fields| fields[1] = (row as f64 * 0.05).to_string()),
            &["task.csv:3", "dq1", "shoulder_pan_joint", "units"],
        ),
    ] {
        std::fs::write(folder.path().join("task.csv"), contents).unwrap();
        assert_named(folder.path(), &study, names);
    }
    for (criterion, names) in [
        ("{ kind = \"prediction\" }", &["trajectory"][..]),
        ("{ kind = \"predictions\", trajectory = \"task.csv\" }", &["prediction"]),
        ("\"best\"", &["best", "d-optimal"]),
        ("3", &["expected a name, or a table with a `kind`"]),
    ] {
        assert_named(folder.path(), &text(&format!("criterion = {criterion}")), names);
    }
}

#[test]
fn a_prior_that_does_not_fit_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let study = text("prior = { result = \"result.json\" }");
    assert_named(folder.path(), &study, &["result.json", "folders"]);
    let parameter = |symbol: &str| serde_json::json!({ "symbol": symbol, "expression": symbol, "unit": "kg", "value": 1.0, "std": 0.1, "std_white": 0.1, "excited": true });
    let result = |parameters: &[&str]| {
        serde_json::json!({
            "schema": "dynident/result/1",
            "base_parameters": parameters.iter().map(|symbol| parameter(symbol)).collect::<Vec<_>>(),
        })
    };
    for (contents, names) in [
        ("{}".to_owned(), &["result.json", "line 1"][..]),
        ("{\"schema\": \"dynident/result/9\", \"base_parameters\": []}".to_owned(), &["dynident/result/9"]),
        (result(&["Izz1", "Izz9"]).to_string(), &["result.json", "Izz9", "same robot"]),
        (result(&["Izz1"]).to_string(), &["result.json", "missing or duplicate", "same robot"]),
    ] {
        std::fs::write(folder.path().join("result.json"), contents).unwrap();
        assert_named(folder.path(), &study, names);
    }
    assert_named(folder.path(), &text("prior = { cad_std_percent = 0.0 }"), &["prior.cad_std_percent = 0"]);
    assert_named(folder.path(), &text("prior = { cad = 3.0 }"), &["cad"]);
    let of_regressor = text("criterion = \"condition-number\"\nprior = { cad_std_percent = 30.0 }");
    assert_named(folder.path(), &of_regressor, &["condition number", "d-optimal"]);
}

#[test]
fn a_trajectory_or_log_that_is_none_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.toml");
    let study = Study::parse(&text(""), &path).unwrap();
    let error = check_trajectory(&study, &path, &folder.path().join("none.csv"), &Job::options(1)).unwrap_err();
    assert!(error.to_string().contains("none.csv"), "{error}");
    let error = check_log(&study, &path, "first", &Job::options(1)).unwrap_err();
    assert!(error.to_string().contains("no [[log]]"), "{error}");
    let logged = text("")
        + "[format]\ntime = { column = \"t\" }\nposition = { columns = \"q{1..6}\" }\ntorque = { columns = \"tau{1..6}\" }\n[[log]]\nfile = \"a.csv\"\nname = \"twin\"\n[[log]]\nfile = \"b.csv\"\nname = \"twin\"\n";
    let study = Study::parse(&logged, &path).unwrap();
    for (name, named) in
        [("third", "unknown log `third`"), ("twin", "2 logs have the name"), ("a.csv", "a.csv is in none")]
    {
        let error = check_log(&study, &path, name, &Job::options(1)).unwrap_err();
        assert!(error.to_string().contains(named), "{error}");
    }
}
