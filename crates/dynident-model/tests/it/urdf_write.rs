//! Writing into a URDF: the new values can be read, and all other bytes stay.

use crate::common::{ARM, assert_same_inertials, foreign_urdfs};
use dynident_model::{
    InertialParameters, JointChange, LinkChange, Mat3, Vec3, link_changes, load_robot, read_urdf, rewrite_urdf,
};
use proptest::prelude::*;

/// Physically consistent bodies of a few point masses.
fn bodies(seed: u64, count: usize) -> Vec<InertialParameters> {
    // A linear congruential generator (Knuth's MMIX constants) is sufficient here.
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..count)
        .map(|_| {
            (0..5).fold(InertialParameters::ZERO, |sum, _| {
                let p = Vec3([uniform() - 0.5, uniform() - 0.5, uniform() - 0.5]);
                sum.plus(&InertialParameters::from_centre_of_mass(0.1 + uniform(), p, &Mat3::ZERO))
            })
        })
        .collect()
}

/// The text without `<inertial>...</inertial>`, `<dynamics .../>` and white space, with `<x></x>` as `<x/>`, which must
/// not change. It is computed by string search, independent of the writer's XML tree.
fn skeleton(text: &str) -> String {
    let mut rest = text.to_owned();
    for (open, close) in [("<inertial>", "</inertial>"), ("<inertial ", "</inertial>"), ("<dynamics ", "/>")] {
        while let Some(start) = rest.find(open) {
            let end = start + rest[start..].find(close).expect("closed") + close.len();
            rest.replace_range(start..end, "");
        }
    }
    let mut bare: String = rest.split_whitespace().collect();
    for element in ["link", "joint"] {
        bare = bare.replace(&format!("></{element}>"), "/>");
    }
    bare
}

#[test]
fn identified_bodies_are_read_back_and_nothing_else_changes() {
    let mut texts = vec![ARM.to_owned(), ARM.replace('\n', "\r\n"), format!("\u{feff}{ARM}")];
    texts.extend(foreign_urdfs().iter().map(|path| load_robot(path).unwrap().text));
    for (seed, text) in texts.iter().enumerate() {
        let model = read_urdf(text).unwrap().model;
        let new = bodies(seed as u64, model.body_count());
        let joints: Vec<JointChange> = model
            .tree_joints()
            .iter()
            .map(|joint| JointChange {
                joint: joint.name.clone(),
                damping: Some(0.125),
                friction: Some(1.0 / 3.0),
                drive_inertia: None,
                stiffness: None,
            })
            .collect();
        let written = rewrite_urdf(text, &link_changes(&model, &new).unwrap(), &joints).unwrap();
        let again = read_urdf(&written).unwrap().model;
        assert_same_inertials(&again, &new, "");
        for (old, new) in model.tree_joints().iter().zip(again.tree_joints()) {
            assert_eq!((new.damping, new.friction), (Some(0.125), Some(1.0 / 3.0)));
            assert_eq!((&old.placement, old.axis, old.limits), (&new.placement, new.axis, new.limits));
        }
        assert_eq!(skeleton(&written), skeleton(text));
        assert_eq!(written.contains("\r\n"), text.contains("\r\n"));
        assert_eq!(written.matches('\r').count(), if text.contains('\r') { written.matches('\n').count() } else { 0 });
    }
}

#[test]
fn only_the_touched_elements_differ() {
    let set = LinkChange::Set {
        link: "upper".to_owned(),
        inertial: InertialParameters::from_centre_of_mass(2.0, Vec3([0.25, 0.0, 0.0]), &Mat3::IDENTITY.scale(0.5)),
        note: Some("from a log --- and\tmore".to_owned()),
    };
    let friction = JointChange {
        joint: "lift".to_owned(),
        damping: Some(7.0),
        friction: None,
        drive_inertia: None,
        stiffness: None,
    };
    let written = rewrite_urdf(ARM, &[set, LinkChange::Remove { link: "tool".to_owned() }], &[friction]).unwrap();
    let expected = ARM
        .replace(
            r#"<inertial>
      <origin xyz="0.2 0 0.01"/>
      <mass value="3.25"/>
      <inertia ixx="0.006" ixy="0.0" ixz="0.0003" iyy="0.05" iyz="0" izz="0.051"/>
    </inertial>"#,
            r#"<inertial>
      <!-- from a log - - - and\u0009more -->
      <origin xyz="0.25 0.0 0.0" rpy="0 0 0"/>
      <mass value="2.0"/>
      <inertia ixx="0.5" ixy="0.0" ixz="0.0" iyy="0.5" iyz="0.0" izz="0.5"/>
    </inertial>"#,
        )
        .replace(
            r#"
    <inertial>
      <origin xyz="0 0 0.04"/>
      <mass value="0.6"/>
      <inertia ixx="0.0008" ixy="0" ixz="0" iyy="0.0008" iyz="0" izz="0.0004"/>
    </inertial>"#,
            "",
        )
        .replace(
            r#"velocity="0.5" effort="600"/>"#,
            "velocity=\"0.5\" effort=\"600\"/>\n    <dynamics damping=\"7.0\"/>",
        );
    assert_eq!(written, expected);
}

#[test]
fn an_inertial_is_inserted_where_there_was_none() {
    let inertial = InertialParameters::from_centre_of_mass(1.0, Vec3::ZERO, &Mat3::IDENTITY.scale(0.5));
    let change = |link: &str| [LinkChange::Set { link: link.to_owned(), inertial, note: None }];
    let element = r#"<origin xyz="0.0 0.0 0.0" rpy="0 0 0"/>|<mass value="1.0"/>|<inertia ixx="0.5" ixy="0.0" ixz="0.0" iyy="0.5" iyz="0.0" izz="0.5"/>"#;
    let written = rewrite_urdf(ARM, &change("tip"), &[]).unwrap();
    let lines = element.replace('|', "\n      ");
    let expected = format!("<link name=\"tip\">\n    <inertial>\n      {lines}\n    </inertial>\n  </link>");
    assert_eq!(written, ARM.replace(r#"<link name="tip"/>"#, &expected));

    // One-line files stay on one line; quotes may contain a `>`.
    let one = r#"<robot name='r'><link name='b>'/><link name="l"></link><joint name='j' type='continuous'><parent link='b>'/><child link='l'/></joint></robot>"#;
    let flat = element.replace('|', "");
    let written = rewrite_urdf(one, &change("l"), &[]).unwrap();
    assert_eq!(written, one.replace("</link>", &format!("<inertial>{flat}</inertial></link>")));
    let written = rewrite_urdf(one, &change("b>"), &[]).unwrap();
    assert_eq!(written, one.replace("'b>'/><link", &format!("'b>'><inertial>{flat}</inertial></link><link")));
}

#[test]
fn friction_keeps_other_attributes() {
    let text =
        ARM.replace(r#"<dynamics damping="0.4" friction="1.1"/>"#, "<dynamics  friction = '1.1' spring=\"2\" />");
    let change = JointChange {
        joint: "shoulder".to_owned(),
        damping: Some(0.5),
        friction: Some(-0.0),
        drive_inertia: None,
        stiffness: None,
    };
    let written = rewrite_urdf(&text, &[], &[change]).unwrap();
    let expected = text.replace("<dynamics  friction = '1.1'", "<dynamics damping=\"0.5\"  friction = '-0.0'");
    assert_eq!(written, expected);
}

#[test]
fn unrepresentable_inertials_are_refused() {
    let change = |link: &str, parameters: [f64; 10]| {
        let inertial = InertialParameters(parameters);
        rewrite_urdf(ARM, &[LinkChange::Set { link: link.to_owned(), inertial, note: None }], &[])
    };
    let massless = [0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert!(change("upper", massless).unwrap_err().to_string().contains("no mass"));
    assert!(change("upper", [f64::NAN; 10]).unwrap_err().to_string().contains("finite"));
    assert!(change("nobody", [1.0; 10]).unwrap_err().to_string().contains("no link `nobody`"));
    assert!(read_urdf(&change("upper", [0.0; 10]).unwrap()).unwrap().model.inertials()[1].mass_kg() == 0.0);
    let twice = JointChange {
        joint: "lift".to_owned(),
        damping: Some(1.0),
        friction: None,
        drive_inertia: None,
        stiffness: None,
    };
    assert!(rewrite_urdf(ARM, &[], &[twice.clone(), twice]).unwrap_err().to_string().contains("two changes"));
    assert!(link_changes(&read_urdf(ARM).unwrap().model, &[]).is_err());
}

/// Found by mutated descriptions: a tool at a distance of 65 km gives moments that exceed the limit.
#[test]
fn unreadable_values_are_refused() {
    let model = read_urdf(&ARM.replace("<origin xyz=\"0.3 0 0\"", "<origin xyz=\"65536 0 0\"")).unwrap().model;
    let error = rewrite_urdf(ARM, &link_changes(&model, model.inertials()).unwrap(), &[]).unwrap_err();
    assert!(error.to_string().contains("more than the limit of 1e9"), "{error}");
}

#[test]
fn the_lumped_links_are_named_in_a_comment() {
    let model = read_urdf(ARM).unwrap().model;
    let written = rewrite_urdf(ARM, &link_changes(&model, model.inertials()).unwrap(), &[]).unwrap();
    assert!(written.contains("whose inertials were removed: tool; includes fixed links that had no inertial: tip"));
    assert_same_inertials(&read_urdf(&written).unwrap().model, model.inertials(), "");
    // Writing again replaces the comment.
    let model = read_urdf(&written).unwrap().model;
    let again = rewrite_urdf(&written, &link_changes(&model, model.inertials()).unwrap(), &[]).unwrap();
    assert_eq!(again.matches("<!--").count(), written.matches("<!--").count());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Unusual spacing between elements survives an empty rewrite; a full rewrite keeps the skeleton.
    #[test]
    fn odd_spacing_survives(gaps in prop::collection::vec("[ \t\r\n]{0,3}(<!-- [a-z ]* -->)?[ \n]{0,2}", 80), seed in 0_u64..1000) {
        let mut gap = gaps.iter();
        let text: String = ARM.lines().flat_map(|line| [line.trim(), gap.next().map_or("", |gap| gap.as_str())]).collect();
        let model = read_urdf(&text).unwrap().model;
        prop_assert_eq!(&rewrite_urdf(&text, &[], &[]).unwrap(), &text);
        let new = bodies(seed, model.dof());
        let written = rewrite_urdf(&text, &link_changes(&model, &new).unwrap(), &[]).unwrap();
        assert_same_inertials(&read_urdf(&written).unwrap().model, &new, "");
        prop_assert_eq!(skeleton(&written), skeleton(&text));
    }
}
