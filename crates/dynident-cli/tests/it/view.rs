//! Pages of a robot with its motions.

use crate::common::{broken, repository, run_in};
use crate::contract::json;
use serde_json::Value;
use std::path::Path;

fn view(folder: &Path, arguments: &[&str]) -> crate::common::CommandOutcome {
    run_in(folder, &[&["view"], arguments].concat())
}

/// Data of the scene in a page.
fn scene(page: &Path) -> Value {
    let text = std::fs::read_to_string(page).unwrap();
    assert!(text.contains("OGL 1.0.11") && text.len() < 3_000_000);
    let data = text.split_once("data-scene=\"").unwrap().1.split_once('>').unwrap().1;
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn robots_of_every_format_have_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("view.html");
    for (robot, joints, bodies) in [
        ("examples/robots/paper_2r.toml", 2, 3),
        ("examples/robots/palletizer.urdf", 8, 0),
        ("golden/mjcf/robosuite_panda.xml", 7, 8),
        ("golden/sdf/urdf_ur5.sdf", 6, 7),
    ] {
        let ran = view(folder.path(), &[&repository(robot).display().to_string()]);
        assert_eq!((ran.status, &ran.stderr[..]), (0, ""), "{robot}");
        assert!(ran.stdout.contains("wrote view.html"), "{}", ran.stdout);
        let scene = scene(&page);
        assert_eq!(scene["joints"].as_array().unwrap().len(), joints, "{robot}");
        let found = scene["bodies"].as_array().unwrap();
        assert!(bodies == 0 || found.len() == bodies, "{robot}: {} bodies", found.len());
        assert!(found.iter().any(|body| !body["triangles"].as_array().unwrap().is_empty()), "{robot}");
    }
}

#[test]
fn a_study_plays_its_logs_and_trajectories() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("move.csv");
    let rows = (0..50).map(|k| format!("{},{},{}\n", 0.1 * f64::from(k), 0.01 * f64::from(k), 0.0));
    std::fs::write(&table, format!("t_s,q1,q2\n{}", rows.collect::<String>())).unwrap();
    let (study, table) = (broken().join("good.toml").display().to_string(), table.display().to_string());
    let ran = view(folder.path(), &[&study, &table, "--out", "own.html", "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert_eq!(json(&ran.stdout)["schema"], "dynident/view/1");
    let scene = scene(&folder.path().join("own.html"));
    let motions = scene["motions"].as_array().unwrap();
    assert!(motions.len() > 1, "{} motions", motions.len());
    assert_eq!(motions[0]["t"].as_array().unwrap().len(), 50);
}

#[test]
fn what_cannot_be_shown_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("examples/robots/paper_2r.toml").display().to_string();
    std::fs::write(folder.path().join("only.csv"), "t_s,q1\n0,0\n1,1\n").unwrap();
    for (arguments, reason) in [
        (vec!["only.csv"], "without a robot"),
        (vec![&robot[..], &robot], "give one robot"),
        (vec![&robot[..], "only.csv"], "only.csv:1"),
        (vec!["missing.urdf"], "missing.urdf"),
    ] {
        let ran = view(folder.path(), &arguments);
        assert!(ran.status == 2 && ran.stderr.contains(reason), "{arguments:?}: {}", ran.stderr);
        assert!(!folder.path().join("view.html").exists());
    }
    let ran = view(folder.path(), &[&robot, "--out", &robot]);
    assert!(ran.status == 2 && ran.stderr.contains("input"), "{}", ran.stderr);
}
