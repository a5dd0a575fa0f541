//! MJCF: rules of the format, errors and notices. Torques of whole models are compared with MuJoCo in the tests of
//! `dynident-dynamics`.

use crate::common::{assert_truncations_are_refused, mutate, mutations};
use dynident_model::mjcf::MjcfLoss;
use dynident_model::{
    DescriptionFormat, JointKind, JointSpring, Mimic, audit, load_robot, read_mjcf, read_mjcf_with, rewrite_mjcf,
};
use dynident_testing::{count, repository};
use proptest::prelude::*;

/// A document around the contents of a body with one hinge.
fn with_body(contents: &str) -> String {
    format!("<mujoco><worldbody><body name=\"b\"><joint name=\"j\"/>{contents}</body></worldbody></mujoco>")
}

#[test]
fn faults_are_named_at_their_place() {
    let ball = with_body("<joint name=\"k\" type=\"ball\"/>");
    let cases: Vec<(String, &str)> = vec![
        ("<mujoco/>".into(), "1:1: the model has no joint"),
        ("<robot/>".into(), "1:1: the root element is <robot>, not <mujoco>"),
        ("<mujoco>\n<worldbody>".into(), "2:12: malformed XML: the document ends too early"),
        ("<!DOCTYPE a><mujoco/>".into(), "1:1: a document type declaration"),
        (ball, "1:52: joint `k` of type ball is not supported: write three hinges"),
        (with_body("<body><freejoint name=\"f\"/></body>"), "joint `f` of type free in a body inside another body is not"),
        (with_body("<body><joint type=\"free\"/></body>"), "joint without a name of type free in a body inside another"),
        (with_body("<joint name=\"j\"/>"), "joint `j` is defined a second time"),
        (with_body("<body name=\"b\"/>"), "body `b` is defined a second time"),
        (with_body("<joint axis=\"0 0 0\"/>"), "`axis` of <joint> gives no direction"),
        (with_body("<joint axis=\"1 0\"/>"), "`axis` of <joint> holds 2 numbers: write 3"),
        (with_body("<joint damping=\"nan\"/>"), "`damping` of <joint> holds `nan`, which is not finite"),
        (with_body("<joint pos=\"1,2,3\"/>"), "`pos` of <joint> holds `1,2,3`, which is not a number"),
        (with_body("<joint pos=\"1e10 0 0\"/>"), "too large for a robot"),
        (with_body("<joint armature=\"-1\"/>"), "`armature` of <joint> is negative"),
        (with_body("<joint class=\"light\"/>"), "class `light` is not defined"),
        (with_body("<joint type=\"screw\"/>"), "`type` of <joint> is `screw`: write hinge or slide"),
        (with_body("<body quat=\"0 0 0 0\"/>"), "`quat` of <body> gives no direction"),
        (with_body("<body quat=\"1 0 0 0\" euler=\"0 0 1\"/>"), "<body> has both `quat` and `euler`: keep one"),
        (with_body("<body xyaxes=\"1 0 0 2 0 0\"/>"), "`xyaxes` of <body> gives no direction"),
        (with_body("<inertial mass=\"1\"/>"), "<inertial> has no attribute `pos`"),
        (with_body("<inertial pos=\"0 0 0\"/>"), "<inertial> has no attribute `mass`"),
        (with_body("<inertial pos=\"0 0 0\" mass=\"-1\"/>"), "`mass` of <inertial> is negative"),
        (
            with_body("<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\" fullinertia=\"1 1 1 0 0 0\"/>"),
            "<inertial> has both `fullinertia` and `diaginertia`",
        ),
        (
            with_body("<inertial pos=\"0 0 0\" mass=\"1\" euler=\"1 0 0\" fullinertia=\"1 1 1 0 0 0\"/>"),
            "<inertial> has both `fullinertia` and `euler`",
        ),
        (
            with_body("<inertial pos=\"0 0 0\" mass=\"1\"/><inertial pos=\"0 0 0\" mass=\"1\"/>"),
            "body `b` has a second <inertial>",
        ),
        (with_body("<geom size=\"0\"/>"), "a geom of type `sphere` needs 1 positive numbers"),
        (with_body("<geom type=\"box\" size=\"1 1\"/>"), "a geom of type `box` needs 3 positive numbers"),
        (
            with_body("<geom type=\"capsule\" size=\"1\" fromto=\"0 0 0 0 0 1\" pos=\"0 0 0\"/>"),
            "<geom> has both `fromto` and `pos`",
        ),
        (with_body("<geom type=\"cone\" size=\"1\"/>"), "`type` of <geom> is `cone`"),
        (with_body("<replicate count=\"3\"/>"), "<replicate> is not supported: save the model from MuJoCo"),
        ("<mujoco><worldbody><inertial/></worldbody></mujoco>".into(), "the world has no inertia"),
        ("<mujoco><worldbody><joint/></worldbody></mujoco>".into(), "a joint of the world is not supported"),
        ("<mujoco><compiler angle=\"grad\"/></mujoco>".into(), "`angle` of <compiler> is `grad`: write degree or"),
        ("<mujoco><compiler eulerseq=\"xyw\"/></mujoco>".into(), "`eulerseq` of <compiler> is `xyw`: write three"),
        ("<mujoco><compiler coordinate=\"global\"/></mujoco>".into(), "coordinate=\"global\" is not supported: save"),
        ("<mujoco><default class=\"a\"/></mujoco>".into(), "`class` of <default> is `a`: write `main`, or none"),
        ("<mujoco><default><default/></default></mujoco>".into(), "<default> has no attribute `class`"),
        (
            "<mujoco><default><default class=\"a\"/><default class=\"a\"/></default></mujoco>".into(),
            "default class `a` is defined a second time",
        ),
        ("<mujoco><include file=\"a.xml\"/></mujoco>".into(), "the included `a.xml` cannot be read: files are included"),
        ("<mujoco><include/></mujoco>".into(), "<include> has no attribute `file`"),
        (
            with_body("").replace("</mujoco>", "<actuator><motor joint=\"k\"/></actuator></mujoco>"),
            "<motor> names joint `k`, which is not defined",
        ),
        (
            with_body("").replace("</mujoco>", "<equality><joint joint1=\"k\"/></equality></mujoco>"),
            "<joint> names joint `k`, which is not defined",
        ),
        (
            "<mujoco><compiler settotalmass=\"3\"/><worldbody><body name=\"b\"><joint/><geom type=\"mesh\" mesh=\"m\"/>\
             </body></worldbody></mujoco>"
                .into(),
            "`settotalmass` needs all masses, and that of body `b` follows from mesh `m`",
        ),
    ];
    for (text, fragment) in cases {
        let message = read_mjcf(&text).expect_err(&text).to_string();
        assert!(message.contains(fragment), "{text}\n{message}\nshould contain {fragment}");
        assert!(message.starts_with(|c: char| c.is_ascii_digit()), "{message}");
    }
}

#[test]
fn included_files_are_expanded_and_named_in_faults() {
    let main = "<mujoco>\n  <include file=\"a.xml\"/>\n</mujoco>";
    let mut files = |name: &str| match name {
        "a.xml" => Ok("<mujocoinclude><worldbody>\n<include file=\"b.xml\"/></worldbody></mujocoinclude>".to_owned()),
        "b.xml" => Ok("<mujoco><body><joint name=\"j\"/></body><body><joint name=\"k\"/></body></mujoco>".to_owned()),
        _ => Err("no such file".to_owned()),
    };
    let model = read_mjcf_with(main, &mut files).unwrap().model;
    let names: Vec<&str> = model.joints().iter().map(|joint| &*joint.name).collect();
    assert_eq!(names, ["j", "k"]);

    let faulty = |name: &str| match name {
        "a.xml" => Ok("<mujoco>\n <worldbody> <body> <joint axis=\"x\"/> </body></worldbody></mujoco>".to_owned()),
        _ => Err("no such file".to_owned()),
    };
    let message = read_mjcf_with(main, faulty).unwrap_err().to_string();
    assert!(message.starts_with("2:3: in the included `a.xml`, 2:34: `axis` of <joint> holds `x`"), "{message}");
    let twice = |_: &str| Ok("<mujoco><include file=\"a.xml\"/></mujoco>".to_owned());
    let message = read_mjcf_with(main, twice).unwrap_err().to_string();
    assert!(message.contains("`a.xml` is included a second time"), "{message}");
    let message = load_robot(repository("golden/mjcf/common/rules_options.xml")).unwrap_err().to_string();
    assert!(message.contains("the root element is <mujocoinclude>"), "{message}");
}

#[test]
fn symmetric_effort_limits_are_read() {
    let text = r#"<mujoco><default><motor ctrlrange="-2 2"/></default><worldbody>
      <body><joint name="motor"/><joint name="joint" actuatorfrcrange="-5 5"/><joint name="one-sided"/>
        <joint name="servo"/><joint name="none"/><joint name="both"/><joint name="two"/></body></worldbody>
      <actuator>
        <motor joint="motor" gear="30"/> <motor joint="joint" gear="30"/>
        <general joint="one-sided" ctrlrange="0 3"/>
        <position joint="servo" ctrlrange="-1 1" forcerange="-7 7"/>
        <velocity joint="none" ctrlrange="-1 1" forcelimited="false" forcerange="-1 1"/>
        <motor joint="both" forcerange="-1.5 1.5"/>
        <motor joint="two" gear="-1"/> <motor joint="two" gear="2"/>
      </actuator></mujoco>"#;
    let robot = read_mjcf(text).unwrap();
    let efforts: Vec<Option<f64>> = robot.model.joints().iter().map(|joint| joint.limits.effort).collect();
    // The default of motors applies to all actuators: `general` overrides it, and a `velocity` actuator has no force
    // range.
    assert_eq!(efforts, [Some(60.0), Some(5.0), None, Some(7.0), None, Some(1.5), Some(6.0)]);
    assert!(
        matches!(&robot.notices[0].loss, MjcfLoss::OneSidedEffort { joint, high, .. } if joint == "`one-sided`" && *high == 3.0)
    );
    assert_eq!((robot.notices.len(), robot.notices[0].line), (1, 6));
}

/// A four-bar linkage: a crank of 1 m, a rod, and a rocker that is connected to the rod at `anchor`.
fn linkage(actuator: &str, anchor: &str) -> String {
    format!(
        r#"<mujoco><worldbody>
          <body name="crank"><joint name="drive" axis="0 1 0"/><geom size="0.1"/>
            <body name="rod" pos="0 0 1"><joint name="rod_joint" axis="0 1 0"/><geom size="0.1"/></body></body>
          <body name="rocker" pos="2 0 0"><joint name="rocker_joint" axis="0 1 0"/><geom size="0.1" pos="0 0 1"/></body>
        </worldbody>
        <equality><connect body1="rod" body2="rocker" anchor="{anchor}"/></equality>
        <actuator>{actuator}</actuator></mujoco>"#
    )
}

#[test]
fn parallelograms_are_closed_and_other_chains_give_notices() {
    let drive = r#"<motor joint="drive"/>"#;
    let robot = read_mjcf(&linkage(drive, "2 0 0")).unwrap();
    assert!(robot.notices.is_empty() && robot.model.dof() == 1, "{:?}", robot.notices);
    let followers: Vec<_> = robot.model.followers().map(|(_, joint)| joint.mimic.clone().unwrap()).collect();
    assert_eq!(followers, [Mimic::of("drive", -1.0, 0.0), Mimic::of("drive", 1.0, 0.0)]);
    let all = r#"<motor joint="drive"/><motor joint="rod_joint"/><motor joint="rocker_joint"/>"#;
    for (text, words) in [
        (linkage("", "2 0 0"), "no joint has an actuator; name the passive joints in [[robot.loop]]"),
        (linkage(all, "2 0 0"), "every joint of the chain has an actuator"),
        (linkage(drive, "2 0 0.3"), "not a parallelogram"),
        (linkage(drive, "2 0 0").replace("body2=\"rocker\"", "body2=\"rokcer\""), "unknown body `rokcer`"),
    ] {
        let robot = read_mjcf(&text).unwrap();
        let said: Vec<String> = robot.notices.iter().map(|notice| notice.loss.to_string()).collect();
        assert!(said.len() == 1 && said[0].contains(words) && robot.model.dof() == 3, "{words}: {said:?}");
    }
}

#[test]
fn linear_equalities_are_mimics_and_others_give_notices() {
    let text = r#"<mujoco><compiler angle="radian"/><worldbody>
      <body gravcomp="1"><joint name="a" ref="0.5"/><joint name="b" ref="-1"/><joint name="c" stiffness="3"/></body>
      </worldbody>
      <equality>
        <joint joint1="a" joint2="b" polycoef="0.25 -2"/>
        <joint joint1="c" joint2="b" polycoef="0 1 1"/>
        <connect body1="x" body2="y"/>
        <weld body1="x" active="false"/>
      </equality>
      <tendon><fixed name="t" stiffness="2"/><fixed name="u"/></tendon>
      <option viscosity="0.1"/></mujoco>"#;
    let robot = read_mjcf(text).unwrap();
    assert_eq!(robot.model.tree_joints()[2].spring, Some(JointSpring { stiffness: 3.0, reference: 0.0 }));
    // a - 0.5 = 0.25 - 2 (b + 1)
    let follower = Mimic::of("b", -2.0, -1.25);
    assert_eq!(robot.model.tree_joints()[0].mimic, Some(follower));
    assert!(robot.model.joints().iter().all(|joint| joint.mimic.is_none()));
    let mut said: Vec<&str> = robot.notices.iter().map(|notice| notice.loss.name()).collect();
    said.sort_unstable();
    assert_eq!(said, ["constraint", "coupling-polynomial", "gravity-compensation", "medium", "tendon"]);
}

/// A humanoid of one leg, or an arm on the world, with objects that float.
fn scene(base: &str, actuator: &str) -> String {
    format!(
        r#"<mujoco><compiler angle="radian"/><default><default class="floats"><joint type="free"/></default></default>
        <worldbody>
          <body name="cube"><freejoint name="cube_free"/><geom type="box" size="1 1 1"/></body>
          <body name="trunk" pos="0 0 1" euler="0.5 0 0">{base}<geom size="0.1"/>
            <body name="leg" pos="0 0 -0.2"><joint name="hip" axis="0 1 0"/><geom size="0.1" pos="0 0 -0.2"/></body></body>
          <body name="scissors"><frame><joint class="floats" name="scissors_free"/></frame>
            <geom type="mesh" mesh="absent"/>
            <body name="blade"><joint name="hinge"/><joint name="ball" type="ball"/><geom size="1"/></body></body>
        </worldbody>
        <equality>
          <joint joint1="hinge" polycoef="0 1"/> <weld body1="cube"/> <connect body1="cube" body2="blade" anchor="0 0 0"/>
        </equality>
        <actuator>{actuator}</actuator></mujoco>"#
    )
}

#[test]
fn floating_objects_are_left_out_and_floating_robots_are_fixed() {
    let losses = |text: &str| -> (Vec<String>, Vec<String>) {
        let robot = read_mjcf(text).unwrap();
        let names = robot.model.joints().iter().map(|joint| joint.name.clone()).collect();
        (names, robot.notices.iter().map(|notice| format!("{}: {}", notice.loss.name(), notice.loss)).collect())
    };
    let object =
        |name: &str| format!("free-object: body `{name}` has a free joint and no actuated joint: it is an object");
    let [cube, scissors] = ["cube", "scissors"].map(object);
    let motor = r#"<motor joint="hip"/><adhesion body="cube"/>"#;
    let (joints, notices) = losses(&scene("", motor));
    assert_eq!(joints, ["hip"]);
    assert!(notices.len() == 2 && notices[0].starts_with(&cube) && notices[1].starts_with(&scissors), "{notices:?}");
    for base in ["<freejoint/>", "<joint type=\"free\" name=\"root\"/>", "<joint class=\"floats\"/>"] {
        let (joints, notices) = losses(&scene(base, motor));
        assert_eq!(joints, ["hip"], "{base}");
        assert!(notices.len() == 3 && notices[1].contains("read as fixed to the world at `trunk`"), "{notices:?}");
        let floating = read_mjcf(&scene(base, motor)).unwrap().model;
        assert_eq!(floating, read_mjcf(&scene("", motor)).unwrap().model, "{base}");
    }
    // A tendon can move a joint, too.
    let tendon = scene("<freejoint/>", "<motor tendon=\"t\"/>").replace(
        "<equality>",
        "<tendon><fixed name=\"t\"><joint joint=\"hip\" coef=\"1\"/></fixed></tendon><equality>",
    );
    assert_eq!(losses(&tendon).0, ["hip"]);
    // Without actuators, every body with joints is a robot: the ball joint of the scissors is then refused.
    let error = read_mjcf(&scene("<freejoint/>", "")).unwrap_err().to_string();
    assert!(error.contains("`ball`"), "{error}");
    // Nothing remains of a scene of objects.
    let objects = "<mujoco><worldbody><body><freejoint/><geom size=\"1\"/></body></worldbody></mujoco>";
    assert!(read_mjcf(objects).unwrap_err().to_string().contains("no joint of type hinge or slide"));
}

#[test]
fn a_total_mass_includes_the_objects_of_the_scene() {
    let text = |object: &str| {
        format!(
            r#"<mujoco><compiler settotalmass="10"/><worldbody>
            <body name="b"><joint name="j"/><geom size="1" mass="3"/></body>
            <body name="o">{object}<geom size="1" mass="1"/><body><geom size="1" mass="1"/></body></body>
            </worldbody><actuator><motor joint="j"/></actuator></mujoco>"#
        )
    };
    for object in ["<freejoint/>", ""] {
        let model = read_mjcf(&text(object)).unwrap().model;
        assert!((model.inertials()[0].mass_kg() - 6.0).abs() < 1e-14, "{object}");
    }
}

#[test]
fn mesh_files_are_read_only_if_a_mass_depends_on_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(repository("golden/mjcf/meshes/prism.stl"), folder.path().join("prism.stl")).unwrap();
    let text = |contents: &str| {
        with_body(contents).replace(
            "<worldbody>",
            r#"<compiler meshdir="at/../" strippath="true"/>
            <asset><mesh file="x/prism.stl"/><mesh name="absent" file="absent.stl"/></asset><worldbody>"#,
        )
    };
    std::fs::create_dir(folder.path().join("at")).unwrap();
    let read = |contents: &str| {
        let path = folder.path().join("robot.xml");
        std::fs::write(&path, text(contents)).unwrap();
        load_robot(&path).unwrap()
    };
    let known = read("<geom type=\"mesh\" mesh=\"prism\"/>");
    assert!(known.notices.is_empty() && known.model.inertials()[0].mass_kg() > 1.0, "{:?}", known.notices);
    for (contents, words) in [
        (
            "<geom type=\"mesh\" mesh=\"absent\"/>",
            "follows from mesh `absent`: mesh `at/../absent.stl` is missing (searched",
        ),
        ("<geom type=\"mesh\" mesh=\"no\"/>", "follows from mesh `no`: no mesh `no` under <asset>"),
    ] {
        let unknown = read(contents);
        let said: Vec<String> = unknown.notices.iter().map(|notice| notice.loss.to_string()).collect();
        assert!(said.len() == 1 && said[0].contains(words), "{said:?}");
        assert!(unknown.model.bodies()[0].links[0].inertial.is_none());
        // Not needed: the body has an inertial.
        let given = format!("{contents}<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>");
        assert!(read(&given).notices.is_empty());
    }
    // The body that carries a fixed mesh gets the mass of both, also where the original is rewritten.
    let robot =
        read("<geom size=\"0.1\"/><body name=\"tip\" pos=\"1 0 0\"><geom type=\"mesh\" mesh=\"prism\"/></body>");
    let changes = dynident_model::link_changes(&robot.model, robot.model.inertials()).unwrap();
    let mut include = |_: &str| Err(String::new());
    let written = rewrite_mjcf(&robot.text, &mut include, &changes, &[]).unwrap();
    let again = read_mjcf(&written).unwrap();
    let (one, other) = (&again.model.inertials()[0].0, &robot.model.inertials()[0].0);
    assert!(again.notices.is_empty() && (0..10).all(|k| (one[k] - other[k]).abs() < 1e-12), "{written}");
}

#[test]
fn mesh_mass_is_unknown_with_a_notice() {
    let text =
        with_body("<geom type=\"mesh\" mesh=\"m\"/><geom size=\"1\"/><body name=\"tip\"><geom size=\"0.1\"/></body>");
    let robot = read_mjcf(&text).unwrap();
    let body = &robot.model.bodies()[0];
    assert!(body.links[0].inertial.is_none() && body.links[1].inertial.is_some());
    assert!(matches!(&robot.notices[0].loss, MjcfLoss::UnknownMass { body, .. } if body == "b"));
    // Massless, of an excluded group, or in addition to an <inertial>: the mass is known.
    for geom in ["mass=\"0\"", "density=\"0\"", "group=\"7\""] {
        let text = with_body(&format!("<geom type=\"mesh\" mesh=\"m\" {geom}/><geom size=\"1\"/>"));
        let robot = read_mjcf(&text).unwrap();
        assert!(robot.notices.is_empty() && robot.model.inertials()[0].mass_kg() > 4000.0, "{geom}");
    }
    let text = with_body("<geom type=\"mesh\" mesh=\"m\"/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>");
    assert!(read_mjcf(&text).unwrap().notices.is_empty());
}

#[test]
fn several_joints_form_a_chain_and_misspelt_words_give_notices() {
    let text = r#"<mujoco model="m"><worldbody><body name="b"><joint name="x" type="slide" axis="1 0 0"/><joint rang="0 1"/>
      <joint range="-90 90"/><geom size="1"/></body></worldbody></mujoco>"#;
    let robot = read_mjcf(text).unwrap();
    let model = &robot.model;
    let names: Vec<&str> = model.joints().iter().map(|joint| &*joint.name).collect();
    assert_eq!(names, ["x", "b_joint", "b_joint3"]);
    let kinds: Vec<JointKind> = model.joints().iter().map(|joint| joint.kind).collect();
    assert_eq!(kinds, [JointKind::Prismatic, JointKind::Continuous, JointKind::Revolute]);
    let bodies: Vec<(&str, f64)> =
        model.bodies().iter().map(|body| (body.name(), body.prior().unwrap().mass_kg())).collect();
    assert_eq!((bodies[0], bodies[1], bodies[2].0), (("b/x", 0.0), ("b/b_joint", 0.0), "b"));
    let said: Vec<String> = robot.notices.iter().map(|notice| notice.loss.to_string()).collect();
    assert_eq!(said, ["`rang` of <joint> was not read: misspelt?"]);
}

#[test]
fn files_are_recognised_by_their_content() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["arm.xml", "arm.urdf", "arm.mjcf", "arm"] {
        let path = folder.path().join(name);
        std::fs::write(&path, with_body("<geom size=\"1\"/>")).unwrap();
        assert_eq!(load_robot(&path).unwrap().format, DescriptionFormat::Mjcf, "{name}");
    }
    // Files are searched relative to the document, not to the working directory.
    std::fs::write(folder.path().join("main.xml"), "<mujoco><include file=\"arm.xml\"/></mujoco>").unwrap();
    assert_eq!(load_robot(folder.path().join("main.xml")).unwrap().model.dof(), 1);
    std::fs::write(folder.path().join("main.xml"), "<mujoco><include file=\"none.xml\"/></mujoco>").unwrap();
    let message = load_robot(folder.path().join("main.xml")).unwrap_err().to_string();
    assert!(message.contains("main.xml:1:9: the included `none.xml` cannot be read"), "{message}");
    std::fs::write(folder.path().join("main.xml"), "<mujoco><include file=\".\"/></mujoco>").unwrap();
    let message = load_robot(folder.path().join("main.xml")).unwrap_err().to_string();
    assert!(message.contains("the included `.` cannot be read: is a directory"), "{message}");
}

const FILES: [&str; 4] = ["rules_orientations", "rules_joints", "rules_masses", "dm_control_finger"];

fn text_of(name: &str) -> String {
    std::fs::read_to_string(repository(&format!("golden/mjcf/{name}.xml"))).unwrap()
}

fn included(file: &str) -> Result<String, String> {
    std::fs::read_to_string(repository("golden/mjcf").join(file)).map_err(|error| error.to_string())
}

#[test]
fn every_truncation_is_refused() {
    for name in FILES {
        assert_truncations_are_refused(&text_of(name), |text| read_mjcf_with(text, included).is_err());
    }
}

const PIECES: [&str; 14] = [
    "1e308",
    "-",
    "nan",
    "0",
    "\"",
    "<",
    "</body>",
    "name=\"b\"",
    "<frame>",
    "<joint/>",
    "é",
    "<inertial/>",
    " ",
    "class=\"main\" ",
];

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(count(1000, 20_000) as u32) })]

    /// If a mutated file can be read, it is finite, can be audited, and can be rewritten without a change, except that
    /// invisible characters are written as references.
    #[test]
    fn a_mutated_mjcf_never_panics(
        file in 0..FILES.len(),
        mutations in mutations(),
    ) {
        let text = mutate(&text_of(FILES[file]), &mutations, &PIECES);
        if let Ok(robot) = read_mjcf_with(&text, included) {
            let model = &robot.model;
            prop_assert!(model.parameter_vector().iter().all(|x| x.is_finite()));
            audit(model);
            let visible = dynident_text::xml::document(&text);
            prop_assert_eq!(&rewrite_mjcf(&text, &mut included, &[], &[]).unwrap(), &visible);
            let changes = dynident_model::link_changes(model, model.inertials()).unwrap();
            if let Ok(written) = rewrite_mjcf(&text, &mut included, &changes, &[]) {
                let again = read_mjcf_with(&written, included).unwrap().model;
                prop_assert_eq!(again.joints(), model.joints());
            }
        }
    }
}
