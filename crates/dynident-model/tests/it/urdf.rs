//! The URDF reader: compared with totals from Pinocchio, and with values computed by hand.

use crate::common::{ARM, foreign_urdfs};
use dynident_model::{JointKind, LinkChange, Vec3, audit, load_robot, read_urdf, rewrite_urdf};

/// Degrees of freedom and mass of the moving bodies in kg, as read by Pinocchio 4.1.0 (`robots/README.md`).
const TOTALS: [(&str, usize, f64); 8] = [
    ("planar2r", 2, 3.5),
    ("ur10", 6, 28.7),
    ("panda", 9, 16.822),
    ("panda_arm7", 7, 16.822),
    ("iiwa14", 7, 25.61),
    ("g1_29dof", 29, 29.527),
    ("talos_reduced", 32, 76.734),
    ("talos_full_v2", 44, 77.973),
];

#[test]
fn totals_agree_with_pinocchio() {
    let directory = dynident_testing::repository("robots");
    for (name, dof, mass) in TOTALS {
        let robot = load_robot(directory.join(format!("{name}.urdf"))).unwrap();
        let total: f64 = robot.model.inertials().iter().map(dynident_model::InertialParameters::mass_kg).sum();
        // Pinocchio includes mimic joints.
        assert_eq!(robot.model.body_count(), dof, "{name}");
        // The totals are published with three decimals.
        assert!((total - mass).abs() <= 0.0005 + 1e-12, "{name}: {total} kg, not {mass}");
    }
}

#[test]
fn every_description_is_unchanged_by_an_empty_rewrite() {
    for path in foreign_urdfs() {
        let robot = load_robot(&path).unwrap();
        assert!(robot.model.dof() > 0, "{}", path.display());
        assert_eq!(rewrite_urdf(&robot.text, &[], &[]).unwrap(), robot.text, "{}", path.display());
        assert!(!audit(&robot.model).is_empty());
    }
}

#[test]
fn arm_is_read_completely() {
    let robot = read_urdf(ARM).unwrap();
    let model = &robot.model;
    assert!(robot.unread.is_empty(), "{:?}", robot.unread);
    let names: Vec<&str> = model.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["lift", "shoulder", "elbow"]);
    let kinds: Vec<JointKind> = model.joints().iter().map(|joint| joint.kind).collect();
    assert_eq!(kinds, [JointKind::Prismatic, JointKind::Revolute, JointKind::Continuous]);
    // The axis `0 0 2` is normalised; the elbow has no axis, and the default is x.
    assert_eq!(model.joints()[1].axis, Vec3([0.0, 0.0, 1.0]));
    assert_eq!(model.joints()[2].axis, Vec3([1.0, 0.0, 0.0]));
    assert_eq!(model.joints()[1].damping, Some(0.4));
    assert_eq!(model.joints()[0].damping, None);
    assert_eq!(model.joints()[0].limits.upper, Some(0.8));
    assert_eq!(model.joints()[2].limits.upper, None);
    // Tool and tip are fixed to the forearm; the tip is at 0.3 + 0.1 sin 0.5.
    let links = &model.bodies()[2].links;
    assert_eq!(links.iter().map(|link| link.name.as_str()).collect::<Vec<_>>(), ["fore", "tool", "tip"]);
    assert!(links[2].inertial.is_none());
    let tip = links[2].placement.translation;
    assert!((tip[0] - (0.3 + 0.1 * 0.5_f64.sin())).abs() < 1e-15 && (tip[2] - 0.1 * 0.5_f64.cos()).abs() < 1e-15);
    assert!((model.inertials()[2].mass_kg() - 2.1).abs() < 1e-15);
    // m r of fore and tool: 1.5 · 0.15 + 0.6 (0.3 + 0.04 sin 0.5).
    let moment = 1.5 * 0.15 + 0.6 * (0.3 + 0.04 * 0.5_f64.sin());
    assert!((model.inertials()[2].first_moment()[0] - moment).abs() < 1e-15);
}

#[test]
fn rotated_inertial_is_that_of_a_rotated_rod() {
    // A slender rod along x of the inertial frame, rotated by 0.7 about y: its direction is u = (cos, 0, -sin), and its
    // inertia about the centre of mass is J (1 - u uᵀ).
    let text = r#"<robot name="r"><link name="b"/><joint name="j" type="continuous"><parent link="b"/><child link="l"/></joint>
        <link name="l"><inertial><origin rpy="0 0.7 0"/><mass value="2"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.3"/></inertial></link></robot>"#;
    let inertia = read_urdf(text).unwrap().model.inertials()[0].inertia_at_origin();
    let u = [0.7_f64.cos(), 0.0, -(0.7_f64.sin())];
    for a in 0..3 {
        for b in 0..3 {
            let expected = 0.3 * (f64::from(u8::from(a == b)) - u[a] * u[b]);
            // Tolerance: a few roundings of numbers below one.
            assert!((inertia.0[a][b] - expected).abs() < 1e-15);
        }
    }
}

#[test]
fn branches_are_depth_first_in_document_order() {
    let text = r#"<robot name="r">
        <joint name="b1" type="continuous"><parent link="root"/><child link="b"/></joint>
        <joint name="a2" type="continuous"><parent link="a"/><child link="aa"/></joint>
        <joint name="a1" type="continuous"><parent link="root"/><child link="a"/></joint>
        <joint name="b2" type="prismatic"><parent link="b"/><child link="bb"/></joint>
        <link name="aa"/><link name="a"/><link name="root"/><link name="b"/><link name="bb"/></robot>"#;
    let model = read_urdf(text).unwrap().model;
    let names: Vec<&str> = model.joints().iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["b1", "b2", "a1", "a2"]);
    assert_eq!(model.joints().iter().map(|joint| joint.parent).collect::<Vec<_>>(), [None, Some(0), None, Some(2)]);
    assert_eq!(model.bodies_without_prior().len(), 4);
}

#[test]
fn misspelt_elements_are_reported() {
    let text = ARM.replace("<mass value=\"6.5\"/>", "<mass value=\"6.5\"/><inertai/>");
    let unread = read_urdf(&text).unwrap().unread;
    assert_eq!(unread.len(), 1);
    assert_eq!((unread[0].element.as_str(), unread[0].parent.as_str(), unread[0].line), ("inertai", "inertial", 15));
}

fn chain(links: usize, kind: &str) -> String {
    let link = |i: usize| {
        let before = i - 1;
        format!(
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"{kind}\"><parent link=\"l{before}\"/><child link=\"l{i}\"/></joint>"
        )
    };
    let chain: Vec<String> = (1..links).map(link).collect();
    format!("<robot name=\"chain\"><link name=\"l0\"/>{}</robot>", chain.concat())
}

#[test]
fn a_hundred_thousand_links_neither_crash_nor_hang() {
    let error = read_urdf(&chain(100_000, "revolute")).unwrap_err();
    assert!(error.to_string().contains("more than 1000 moving joints"), "{error}");
    // The same number of fixed links is accepted.
    let moving = "</robot>";
    let tail = "<link name=\"end\"/><joint name=\"last\" type=\"continuous\"><parent link=\"l99999\"/><child link=\"end\"/></joint></robot>";
    let model = read_urdf(&chain(100_000, "fixed").replace(moving, tail)).unwrap().model;
    assert_eq!((model.dof(), model.base().links.len()), (1, 100_000));
}

#[test]
fn elements_nested_a_hundred_thousand_deep_are_read_without_recursion() {
    let depth = 100_000;
    let text = format!("<robot name=\"r\">{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth));
    assert!(read_urdf(&text).is_err());
}

#[test]
fn a_byte_order_mark_and_carriage_returns_do_not_matter() {
    let text = format!("\u{feff}{}", ARM.replace('\n', "\r\n"));
    assert_eq!(read_urdf(&text).unwrap().model, read_urdf(ARM).unwrap().model);
}

#[test]
fn a_quaternion_turns_as_its_angles_do() {
    // 0.6 about z, then π - 0.2 about x, as rpy and as the product of two half-angle quaternions. The printed
    // quaternion is not normalised, as from some exporters.
    let (a, b) = (0.3_f64, 0.5 * (core::f64::consts::PI - 0.2));
    let (z, x) = ([a.sin(), a.cos()], [b.sin(), b.cos()]);
    let quaternion = [z[1] * x[0], z[0] * x[0], z[0] * x[1], z[1] * x[1]].map(|c| 1.01 * c);
    let words = quaternion.map(|c| format!("{c:?}")).join(" ");
    let angles = format!("rpy=\"{:?} 0 {:?}\"", 2.0 * b, 2.0 * a);
    for (place, body) in
        [(r#"<origin xyz="0.2 0 0.01""#, "the inertial"), (r#"<origin xyz="0 0 0.04""#, "a link fixed to the joint's")]
    {
        assert_eq!(ARM.matches(place).count(), 1, "{body}");
        let by_angles = read_urdf(&ARM.replace(place, &format!("{place} {angles}"))).unwrap().model;
        let by_quaternion = read_urdf(&ARM.replace(place, &format!("{place} quat_xyzw=\"{words}\""))).unwrap().model;
        assert_ne!(by_angles, read_urdf(ARM).unwrap().model, "{body}");
        for (one, other) in by_angles.inertials().iter().zip(by_quaternion.inertials()) {
            for (one, other) in one.0.iter().zip(&other.0) {
                // About twenty roundings of numbers below one.
                assert!((one - other).abs() < 1e-14, "{body}: {one} {other}");
            }
        }
    }
}

#[test]
fn undeclared_prefixes_and_lost_mimics_are_read_with_a_warning() {
    let regular = read_urdf(ARM).unwrap();
    assert!(regular.irregularities.is_empty());
    let text = ARM
        .replace("<link name=\"tip\"/>", "<link name=\"tip\"/>\n  <gazebo:plugin drake:kind='a:b'/>")
        .replace(r#"velocity="0.5" effort="600"/>"#, r#"velocity="0.5" effort="600"/><mimic joint="ghost"/>"#);
    let robot = read_urdf(&text).unwrap();
    let found: Vec<String> = robot.irregularities.iter().map(|one| format!("{one:?}")).collect();
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found[0].contains("UndeclaredPrefix") && found[0].contains("gazebo"), "{found:?}");
    assert!(found[1].contains("drake"), "{found:?}");
    assert!(found[2].contains("UnknownMimic") && found[2].contains("ghost"), "{found:?}");
    assert_eq!(robot.model.inertials(), regular.model.inertials());
    // The written file keeps the original names.
    assert_eq!(rewrite_urdf(&text, &[], &[]).unwrap(), text);
    let removed = rewrite_urdf(&text, &[LinkChange::Remove { link: "tool".to_owned() }], &[]).unwrap();
    assert!(removed.contains("<gazebo:plugin drake:kind='a:b'/>") && removed.len() < text.len());
    // An undeclared prefix before a name of URDF makes a different name.
    let other = ARM.replace("<link name=\"tip\"/>", "<link name=\"tip\"/><x:link name=\"tip\"/>");
    assert_eq!(read_urdf(&other).unwrap().model, regular.model);
}
