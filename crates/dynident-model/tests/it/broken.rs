//! Broken descriptions: each is rejected with file, line, column and the fix, and nothing panics.

use crate::common::{ARM, assert_truncations_are_refused, mutate, mutations};
use dynident_model::{
    ReadError, audit, has_xacro_macros, link_changes, load_robot, load_robot_with, read_dh, read_urdf, rewrite_urdf,
};
use dynident_testing::count;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

/// `file<TAB>line:column<TAB>part of the message`, verified manually for each file.
const EXPECTED: &str = include_str!("../broken.tsv");

/// Beginnings of the fix in a message.
const FIXES: [&str; 18] = [
    "; fix ",
    ": write ",
    ": add ",
    ": keep ",
    ": use ",
    ": give ",
    ": rename ",
    "; cut ",
    ": join ",
    ": expand ",
    ": save ",
    ": delete ",
    " delete ",
    ": name ",
    ": fill ",
    ": order ",
    "add the ",
    "fix the ",
];

#[test]
fn every_broken_file_is_refused_at_its_place_with_a_fix() {
    let mut expected: BTreeMap<&str, (&str, &str)> = EXPECTED
        .lines()
        .map(|line| {
            let mut cells = line.split('\t');
            let mut cell = || cells.next().unwrap_or_else(|| panic!("three cells in `{line}`"));
            (cell(), (cell(), cell()))
        })
        .collect();
    assert!(expected.len() >= 100);
    for entry in std::fs::read_dir(corpus()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let (place, fragment) = expected.remove(name).unwrap_or_else(|| panic!("{name} is not in broken.tsv"));
        // `load_robot` rejects the file as a whole; here the place of the first macro is tested.
        let message = if name.starts_with("xacro_") {
            let text = std::fs::read_to_string(&path).unwrap();
            format!("{}:{}", path.display(), read_urdf(&text).expect_err(name))
        } else {
            load_robot(&path).expect_err(name).to_string()
        };
        let start = format!("{}:{place}: ", path.display());
        assert!(message.starts_with(&start), "{message}\nshould start with {start}");
        assert!(message.contains(fragment), "{message}\nshould contain {fragment}");
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(FIXES.iter().any(|fix| message.contains(fix)), "{message}\nnames no fix");
    }
    assert!(expected.is_empty(), "not in the corpus: {expected:?}");
}

/// A file with macros is rejected with the program to run; `load_robot_with` takes its expanded text.
#[test]
fn a_file_with_macros_is_refused_or_expanded_by_the_caller() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.urdf");
    let start = r#"<robot name="planar_arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:a/>"#;
    std::fs::write(&path, start).unwrap();
    let message = load_robot(&path).unwrap_err().to_string();
    assert!(message.starts_with(&format!("{}: ", path.display())) && message.contains("`xacro robot"), "{message}");
    assert!(has_xacro_macros(&path).unwrap());
    let expanded = load_robot_with::<ReadError>(&path, |_| Ok(ARM.to_owned())).unwrap();
    assert_eq!((&*expanded.text, &expanded.path, expanded.model), (ARM, &path, read_urdf(ARM).unwrap().model));
    // An expanded file often keeps the declaration.
    let declared = ARM.replacen("<robot ", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" ", 1);
    std::fs::write(&path, declared).unwrap();
    assert!(!has_xacro_macros(&path).unwrap());
    load_robot_with::<ReadError>(&path, |_| panic!("nothing to expand")).unwrap();
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let missing = load_robot("no/such/robot.urdf").unwrap_err().to_string();
    assert!(
        missing.starts_with("no/such/robot.urdf: cannot be read: ") && missing.contains("check the path"),
        "{missing}"
    );
    let directory = load_robot(corpus()).unwrap_err().to_string();
    assert!(directory.starts_with(&format!("{}: cannot be read: ", corpus().display())), "{directory}");
}

fn repeated(count: usize, piece: impl Fn(usize) -> String) -> String {
    (0..count).map(piece).collect::<Vec<_>>().concat()
}

#[test]
fn floods_of_nodes_attributes_and_tables_end_soon() {
    let nodes = format!("<robot name=\"r\">{}</robot>", "<a/>".repeat(2_000_001));
    assert!(read_urdf(&nodes).unwrap_err().to_string().contains("more than 2000000 nodes"));
    let attributes = repeated(500_000, |i| format!(" a{i}=\"\""));
    assert!(
        read_urdf(&format!("<robot name=\"r\"{attributes}/>")).unwrap_err().to_string().contains("too many attributes")
    );
    let namespaces = repeated(500_000, |i| format!("<a xmlns:n{i}=\"u{i}\">"));
    assert!(read_urdf(&format!("<robot>{namespaces}")).unwrap_err().to_string().contains("namespaces"));
    let unread = ARM.replace("<mass value=\"6.5\"/>", &format!("<mass value=\"6.5\"/>{}", "<x/>".repeat(100_000)));
    assert_eq!(read_urdf(&unread).unwrap().unread.len(), 20);
    let keys = format!("convention = \"modified\"\nx{} = 1\n", ".a".repeat(100_000));
    assert!(read_dh(&keys).is_err());
    let tables = repeated(2000, |i| format!("[{}]\n", vec!["a"; i + 1].join(".")));
    assert!(read_dh(&tables).is_err());
    let rows = repeated(5000, |i| format!("[[joint]]\nname = \"j{i}\"\n"));
    let message = read_dh(&format!("convention = \"modified\"\n{rows}")).unwrap_err().to_string();
    assert!(message.starts_with("2002:1: the table has more than 1000 joints"), "{message}");
}

#[cfg(unix)]
#[test]
fn an_endless_file_is_refused() {
    // An endless device is not a regular file.
    if Path::new("/dev/zero").exists() {
        let message = load_robot("/dev/zero").unwrap_err().to_string();
        assert!(message.starts_with("/dev/zero: ") && message.contains("a device, not a regular file"), "{message}");
    }
}

const TABLE: &str = r#"name = "two"
convention = "standard"
gravity_m_s2 = [0.0, -9.81, 0.0]
[base]
xyz_m = [0, 0, 0.3]
rpy_deg = [0, 90, 0]
[[joint]]
name = "a"
a_m = 0.4
alpha_deg = 90
limits = { lower_deg = -170, upper_deg = 170, velocity_deg_s = 120, effort_nm = 80 }
inertial = { mass_kg = 3.0, com_m = [0.2, 0, 0], inertia_at_com = [0.01, 0, 0, 0.04, 0, 0.04] }
[[joint]]
name = "b"
kind = "prismatic"
parent = "a_link"
sign = -1
inertial = { parameters = [1, 0, 0, 0.1, 0.02, 0, 0, 0.02, 0, 0.001] }
"#;

const PIECES: [&str; 12] =
    ["1e308", "-", "nan", "0", "\"", "<", "</link>", "name=\"base\"", "[[joint]]\n", "é", "\u{feff}", "}"];

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(count(500, 4000) as u32) })]

    /// If a mutated file can be read, it is finite, can be audited, and can be rewritten without a change.
    #[test]
    fn a_mutated_urdf_never_panics(mutations in mutations()) {
        let text = mutate(ARM, &mutations, &PIECES);
        if let Ok(robot) = read_urdf(&text) {
            prop_assert!(robot.model.parameter_vector().iter().all(|x| x.is_finite()));
            audit(&robot.model);
            // Invisible characters become references.
            prop_assert_eq!(rewrite_urdf(&text, &[], &[]).unwrap(), dynident_text::xml::document(&text));
            // The written URDF has the same joints.
            let model = &robot.model;
            let changes = link_changes(model, model.inertials()).unwrap();
            if let Ok(written) = rewrite_urdf(&text, &changes, &[]) {
                let again = read_urdf(&written).unwrap().model;
                prop_assert_eq!(again.joints(), model.joints());
            }
        }
    }

    #[test]
    fn a_mutated_table_never_panics(mutations in mutations()) {
        if let Ok(model) = read_dh(&mutate(TABLE, &mutations, &PIECES)) {
            prop_assert!(model.parameter_vector().iter().all(|x| x.is_finite()));
            audit(&model);
        }
    }
}

/// Every prefix of a valid file is rejected or read without a panic; an incomplete URDF is always rejected.
#[test]
fn every_truncation_is_survived() {
    assert_truncations_are_refused(ARM, |text| read_urdf(text).is_err());
    for end in 0..TABLE.len() {
        let _ = TABLE.get(..end).map(read_dh);
    }
    assert!(read_dh(TABLE).is_ok() && read_urdf(ARM).is_ok());
}
