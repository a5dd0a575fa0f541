//! SDF: errors with place and fix, and notices. Dynamics are compared with Drake in dynident-dynamics.

use crate::common::{assert_truncations_are_refused, mutate, mutations};
use dynident_model::{AuditLevel, DescriptionFormat, JointSpring, SdfLoss, audit, load_robot, read_sdf, write_urdf};
use dynident_testing::{count, repository};
use proptest::prelude::*;

/// A pendulum with contents of its moving link (`link`), its joint (`joint`) and the model (`more`).
fn pendulum(link: &str, joint: &str, more: &str) -> String {
    format!(
        r#"<sdf version="1.9"><model name="p">
<link name="base"/><joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="rod">{link}</link>
<joint name="swing" type="revolute"><parent>base</parent><child>rod</child>{joint}</joint>
{more}</model></sdf>"#
    )
}

const INERTIAL: &str = "<inertial><pose>0 0 -0.5 0 0 0</pose><mass>2</mass></inertial>";
const AXIS: &str = "<axis><xyz>0 1 0</xyz></axis>";

#[test]
fn faults_name_the_place_and_the_fix() {
    let whole = pendulum(INERTIAL, AXIS, "");
    assert_eq!(read_sdf(&whole).unwrap().model.dof(), 1);
    let changed = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replacen(from, to, 1)
    };
    let cases = [
        ("<sdf", "1:1: malformed XML"),
        ("<!DOCTYPE sdf><sdf version=\"1.9\"/>", "document type declaration"),
        ("<robot name=\"r\"/>", "1:1: the root element is <robot>, not <sdf>"),
        ("<sdf version=\"new\"/>", "`version` of <sdf> is `new`"),
        ("<sdf/>", "<sdf> has no attribute `version`"),
        ("<sdf version=\"1.9\"/>", "no <model> here"),
        ("<sdf version=\"1.9\"><world name=\"w\"><include><uri>a</uri></include></world></sdf>", "gz sdf -p"),
        ("<sdf version=\"1.9\"><model name=\"a\"/><model name=\"b\"/></sdf>", "several models"),
        ("<sdf version=\"1.9\"><model name=\"a\"/></sdf>", "<model> has no element `link`"),
        ("<sdf version=\"1.9\"><model name=\"a\"><link name=\"l\"/></model></sdf>", "no joint of type"),
        (&changed("type=\"revolute\"", "type=\"ball\""), "4:1: joint `swing` of type ball is not supported: write it"),
        (&changed("type=\"revolute\"", "type=\"screw\""), "write it as revolute, continuous, prismatic or fixed"),
        (&changed("<child>rod", "<child>rot"), "the pose of `swing` refers to `rot`, but there is no link"),
        (&changed("<parent>base", "<parent>bas"), "<parent> of joint `swing` refers to `bas`"),
        (&changed("<parent>base", "<parent>rod"), "joint `swing` joins `rod` with itself"),
        (&changed("<parent>base</parent>", ""), "<joint> has no element `parent`"),
        (&changed("<parent>base</parent><child>rod", "<parent>rod</parent><child>world"), "exchange <parent>"),
        (&changed("0 1 0", "0 0 0"), "the axis of joint `swing` has no direction"),
        (&changed("0 1 0", "0 1"), "<xyz> holds 2 numbers: write 3"),
        (&changed("<mass>2", "<mass>two"), "<mass> holds `two`, which is not a number"),
        (&changed("<mass>2", "<mass>-2"), "the mass of link `rod` is negative"),
        (&changed("<mass>2", "<mass>1e12"), "too large for a robot"),
        (&changed("0 0 -0.5 0 0 0", "0 0 -0.5"), "<pose> holds 3 numbers: write 6"),
        (&changed("<pose>", "<pose rotation_format=\"euler\">"), "write euler_rpy or quat_xyzw"),
        (&changed("name=\"rod\"", "name=\"base\""), "`base` is defined a second time"),
        (&pendulum(INERTIAL, AXIS, "<link name=\"loose\"/>"), "links `world` and `loose` both have no parent joint"),
        (
            &pendulum(
                INERTIAL,
                AXIS,
                "<joint name=\"b\" type=\"fixed\"><parent>base</parent><child>rod</child></joint>",
            ),
            "link `rod` is the child of joints `swing` and `b`",
        ),
        (
            &pendulum("<pose relative_to=\"f\"/>", AXIS, "<frame name=\"f\" attached_to=\"rod\"/>"),
            "refers back to itself",
        ),
        (&pendulum("<pose relative_to=\"f\"/>", AXIS, ""), "the pose of `rod` refers to `f`"),
        (
            &pendulum(INERTIAL, "<axis><xyz expressed_in=\"f\">0 1 0</xyz></axis>", ""),
            "the axis of joint `swing` refers",
        ),
        (&pendulum(INERTIAL, "", ""), "<joint> has no element `axis`"),
    ];
    for (text, expected) in cases {
        let message = read_sdf(text).map(|_| "read").unwrap_err().to_string();
        assert!(message.contains(expected), "{message}\nin place of\n{expected}");
    }
    let deep = (0..30).fold(String::new(), |inner, k| format!("<model name=\"m{k}\">{inner}</model>"));
    let message = read_sdf(&format!("<sdf version=\"1.9\">{deep}</sdf>")).unwrap_err().to_string();
    assert!(message.contains("nested more than"), "{message}");
    let loop_of_two = r#"<sdf version="1.9"><model name="m"><link name="a"/><link name="b"/>
<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>
<joint name="k" type="fixed"><parent>b</parent><child>a</child></joint></model></sdf>"#;
    // Each joint's pose is relative to its child, so only the tree shows the loop.
    assert!(read_sdf(loop_of_two).unwrap_err().to_string().contains("is its own ancestor"));
}

#[test]
fn unsupported_contents_give_notices() {
    let spring = "<axis><xyz>0 1 0</xyz><dynamics><spring_stiffness>3</spring_stiffness></dynamics></axis>";
    let robot = read_sdf(&pendulum("<gravity>0</gravity>", spring, "<include><uri>hand</uri></include>")).unwrap();
    let mut said: Vec<&str> = robot.notices.iter().map(|notice| notice.loss.name()).collect();
    said.sort_unstable();
    // Nothing has to be known of the base.
    assert_eq!(said, ["include", "unknown-mass", "weightless"]);
    let unknown = robot.notices.iter().find(|notice| matches!(notice.loss, SdfLoss::UnknownMass { .. })).unwrap();
    assert_eq!(unknown.line, 3);
    assert_eq!(robot.model.bodies_without_prior(), ["rod"]);
    // A spring is a torque term.
    assert_eq!(robot.model.joints()[0].spring, Some(JointSpring { stiffness: 3.0, reference: 0.0 }));
    let whole = read_sdf(&pendulum(INERTIAL, AXIS, "")).unwrap();
    assert!(whole.notices.is_empty(), "{:?}", whole.notices);
}

#[test]
fn models_without_moving_joints_are_left_out() {
    let whole = pendulum(INERTIAL, AXIS, "");
    let alone = read_sdf(&whole).unwrap();
    let ground = "<model name=\"ground\"><static>true</static><link name=\"plane\"/></model>";
    let table = "<model name=\"table\"><link name=\"top\"/><link name=\"leg\"/>\
                 <joint name=\"glue\" type=\"fixed\"><parent>top</parent><child>leg</child></joint></model>";
    let robot = whole.replace("<sdf version=\"1.9\">", "").replace("</sdf>", "");
    let world = |models: &str| format!("<sdf version=\"1.9\"><world name=\"w\">{models}</world></sdf>");
    for models in [format!("{ground}{robot}{table}"), format!("{robot}{table}{ground}")] {
        let read = read_sdf(&world(&models)).unwrap();
        assert_eq!(read.model.parameter_vector(), alone.model.parameter_vector());
        let mut said: Vec<String> = read.notices.iter().map(|notice| notice.loss.to_string()).collect();
        said.sort();
        assert!(said.len() == 2 && said[0].contains("model `ground`") && said[1].contains("model `table`"), "{said:?}");
        assert!(read.notices.iter().all(|notice| notice.loss.level() == AuditLevel::Info));
    }
    // Two models that move: either could be the robot.
    let second = robot.replace("name=\"p\"", "name=\"second\"");
    let message = read_sdf(&world(&format!("{ground}{robot}{second}"))).unwrap_err().to_string();
    assert!(message.contains("several models"), "{message}");
}

#[test]
fn an_sdf_is_known_by_its_root() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["model.sdf", "arm.urdf", "lab.world", "arm"] {
        let path = folder.path().join(name);
        std::fs::write(&path, pendulum(INERTIAL, AXIS, "")).unwrap();
        assert_eq!(load_robot(&path).unwrap().format, DescriptionFormat::Sdf, "{name}");
    }
    let path = folder.path().join("faulty.sdf");
    std::fs::write(&path, pendulum(INERTIAL, "", "")).unwrap();
    let message = load_robot(&path).unwrap_err().to_string();
    assert!(message.contains("faulty.sdf:4:1: <joint> has no element `axis`"), "{message}");
}

const FILES: [&str; 4] = ["rules_poses", "rules_nested", "rules_1_6", "drake_acrobot"];

fn text_of(name: &str) -> String {
    std::fs::read_to_string(repository(&format!("golden/sdf/{name}.sdf"))).unwrap()
}

#[test]
fn every_truncation_is_refused() {
    for name in FILES {
        assert_truncations_are_refused(&text_of(name), |text| read_sdf(text).is_err());
    }
}

const PIECES: [&str; 14] = [
    "1e308",
    "-",
    "inf",
    "0",
    "\"",
    "<",
    "</link>",
    "relative_to=\"slide\"",
    "<frame name=\"rail\"/>",
    "<pose/>",
    "é",
    "<mass>0</mass>",
    " ",
    "degrees=\"true\" ",
];

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(count(1000, 20_000) as u32) })]

    /// If a mutated file can be read, it is finite, can be audited, and can be written as a URDF.
    #[test]
    fn a_mutated_sdf_never_panics(
        file in 0..FILES.len(),
        mutations in mutations(),
    ) {
        let text = mutate(&text_of(FILES[file]), &mutations, &PIECES);
        if let Ok(robot) = read_sdf(&text) {
            prop_assert!(robot.model.parameter_vector().iter().all(|x| x.is_finite()));
            audit(&robot.model);
            prop_assert!(!write_urdf(&robot.model).is_empty());
        }
    }
}
