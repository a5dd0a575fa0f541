//! Writing into D-H tables, and D-H tables as URDF: the values read back are the written ones, and nothing else
//! changes.

use core::fmt::Write;
use dynident_model::{
    InertialParameters, JointChange, JointKind, JointLimits, LinkChange, Mat3, Model, Vec3, link_changes, read_dh,
    read_urdf, rewrite_dh, write_urdf,
};
use proptest::prelude::*;

/// A table with all syntaxes for the tables of a row, and comments.
const TABLE: &str = r#"# my arm
name = "arm"   # of the cell
convention = "standard"

[[joint]]
name = "a"
d_m = 0.3
alpha_deg = 90
# measured on a scale
inertial = { mass_kg = 3.0, com_m = [0.2, 0, 0], inertia_at_origin = [0.01, 0, 0, 0.14, 0, 0.14] }
dynamics = { damping = 0.5 } # by the maker

[[joint]]
name = "b"   # the elbow
a_m = 0.4
limits = { lower_deg = -120, upper_deg = 120, velocity_deg_s = 90, effort_nm = 50 }
[joint.inertial]
parameters = [1.0, 0, 0, 0, 0.1, 0, 0, 0.1, 0, 0.1]   # all ten

[[joint]]
name = "c"
kind = "prismatic"
sign = -1
"#;

fn inertial(mass: f64) -> InertialParameters {
    let inertia = Mat3([[0.02, 0.001, 0.002], [0.001, 0.03, -0.003], [0.002, -0.003, 0.025]]);
    InertialParameters::from_centre_of_mass(mass, Vec3([0.1, -0.2, 0.05]), &inertia)
}

/// Compares the inertials of two models; tolerance in kg, kg m, kg m².
fn assert_same_inertials(a: &Model, b: &[InertialParameters], tolerance: f64) {
    for (a, b) in a.inertials().iter().zip(b) {
        assert!(a.0.iter().zip(&b.0).all(|(a, b)| (a - b).abs() <= tolerance), "{a:?}\n{b:?}");
    }
}

#[test]
fn only_inertials_and_friction_change() {
    let model = read_dh(TABLE).unwrap();
    let new: Vec<InertialParameters> = [2.5, 1.25, 0.75].map(inertial).to_vec();
    let mut links = link_changes(&model, &new).unwrap();
    for change in &mut links {
        if let LinkChange::Set { note, .. } = change {
            *note = Some("measured: mass".to_owned());
        }
    }
    let joints = vec![
        JointChange {
            joint: "a".to_owned(),
            damping: Some(0.75),
            friction: Some(2.0),
            drive_inertia: None,
            stiffness: None,
        },
        JointChange { joint: "c".to_owned(), damping: None, friction: Some(1.5), drive_inertia: None, stiffness: None },
    ];
    let text = rewrite_dh(TABLE, &links, &joints).unwrap();
    let back = read_dh(&text).unwrap();
    // Tolerance: rounding error of transforms into the D-H frames and back.
    assert_same_inertials(&back, &new, 1e-14);
    let friction: Vec<_> = back.joints().iter().map(|joint| (joint.damping, joint.friction)).collect();
    assert_eq!(friction, [(Some(0.75), Some(2.0)), (None, None), (None, Some(1.5))]);
    for kept in [
        "# my arm\n",
        "name = \"arm\"   # of the cell\n",
        "# measured on a scale\n",
        "# by the maker\n",
        "name = \"b\"   # the elbow\n",
        "limits = { lower_deg = -120, upper_deg = 120, velocity_deg_s = 90, effort_nm = 50 }\n",
    ] {
        assert!(text.contains(kept), "{kept}\n{text}");
    }
    assert!(!text.contains("inertia_at_origin") && !text.contains("parameters"), "{text}");
    assert_eq!(text.matches("# identified: measured: mass\n").count(), 3, "{text}");
    // A second identification replaces the comments of the first.
    assert_eq!(rewrite_dh(&text, &links, &joints).unwrap(), text);
}

#[test]
fn rows_on_one_line_and_a_byte_order_mark_stay() {
    let table = "\u{feff}convention = \"modified\"\njoint = [{ name = \"a\" }, { name = \"b\", a_m = 0.3 }]\n";
    let model = read_dh(table).unwrap();
    let new = [inertial(2.0), InertialParameters([0.0, 0.1, 0.0, 0.0, 0.01, 0.0, 0.0, 0.02, 0.0, 0.02])];
    let text = rewrite_dh(table, &link_changes(&model, &new).unwrap(), &[]).unwrap();
    assert!(text.starts_with('\u{feff}') && text.contains("parameters"), "{text}");
    assert_same_inertials(&read_dh(&text).unwrap(), &new, 1e-15);
}

#[test]
fn unknown_parts_are_refused() {
    let link = LinkChange::Set { link: "d".to_owned(), inertial: inertial(1.0), note: None };
    assert!(rewrite_dh(TABLE, &[link], &[]).unwrap_err().to_string().contains("no link `d`"));
    let twice =
        [1.0, 2.0].map(|mass| LinkChange::Set { link: "a_link".to_owned(), inertial: inertial(mass), note: None });
    assert!(rewrite_dh(TABLE, &twice, &[]).unwrap_err().to_string().contains("two changes to link `a_link`"));
    let nan = InertialParameters([f64::NAN; 10]);
    let link = LinkChange::Set { link: "a_link".to_owned(), inertial: nan, note: None };
    assert!(rewrite_dh(TABLE, &[link], &[]).unwrap_err().to_string().contains("finite"));
    assert!(rewrite_dh("name = ", &[], &[]).unwrap_err().to_string().contains("1:"));
}

/// A joint stays `revolute` in the URDF: readers such as Pinocchio describe a `continuous` joint by two numbers.
#[test]
fn unknown_limits_are_wide_and_stay_unknown() {
    let table = "convention = \"modified\"\n[[joint]]\nname = \"a\"\n[[joint]]\nname = \"b\"\nlimits = { lower_rad = -2, upper_rad = 1 }\n\
                 [[joint]]\nname = \"c\"\nkind = \"prismatic\"\nlimits = { lower_m = 0.1 }\n[[joint]]\nname = \"d\"\nkind = \"continuous\"\n";
    let model = read_dh(table).unwrap();
    let text = write_urdf(&model);
    let kinds: Vec<&str> = text
        .split(" type=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .filter(|kind| *kind != "fixed")
        .collect();
    assert_eq!(kinds, ["revolute", "revolute", "prismatic", "continuous"], "{text}");
    let limits: Vec<&str> = text.lines().filter(|line| line.contains("<limit ")).map(str::trim).collect();
    assert_eq!(
        limits,
        [
            r#"<limit lower="-1000.0" upper="1000.0" velocity="0.0" effort="0.0"/>"#,
            r#"<limit lower="-2.0" upper="1.0" velocity="0.0" effort="0.0"/>"#,
            r#"<limit lower="0.1" upper="1000.0" velocity="0.0" effort="0.0"/>"#,
        ]
    );
    assert_eq!(text.matches("lower not known").count() + text.matches("upper not known").count(), 3, "{text}");
    let back = read_urdf(&text).unwrap().model;
    for (joint, again) in model.joints().iter().zip(back.joints()) {
        assert_eq!(
            (joint.kind, joint.limits.lower, joint.limits.upper),
            (again.kind, again.limits.lower, again.limits.upper)
        );
    }
    // Limits from elsewhere replace only unknown ones.
    let more = |_: &str| JointLimits { lower: Some(-3.0), upper: Some(3.0), velocity: Some(2.0), effort: None };
    let limited = model.with_missing_limits(more);
    let of: Vec<_> = limited.joints().iter().map(|joint| (joint.limits.lower, joint.limits.upper)).collect();
    assert_eq!(of, [(Some(-3.0), Some(3.0)), (Some(-2.0), Some(1.0)), (Some(0.1), Some(3.0)), (None, None)]);
    assert!(limited.joints().iter().all(|joint| joint.limits.velocity == Some(2.0)));
}

#[test]
fn hostile_names_stay_inside_their_attributes() {
    let table = "name = \"<a & \\\"b\\\">\"\nconvention = \"modified\"\n[[joint]]\nname = \"j<&>\\\"'\"\n";
    let model = read_dh(table).unwrap();
    let back = read_urdf(&write_urdf(&model)).unwrap().model;
    assert_eq!((back.name(), &back.joints()[0].name), (model.name(), &model.joints()[0].name));
}

proptest! {
    /// A D-H table written as URDF and read again: same motion and same bodies.
    #[test]
    fn urdf_of_a_table_is_the_same_robot(
        rows in prop::collection::vec((-1.0..1.0_f64, -3.2..3.2_f64, -1.0..1.0_f64, -3.2..3.2_f64, 0..3_usize), 1..6),
        standard in any::<bool>(),
        q in prop::collection::vec(-3.0..3.0_f64, 6),
    ) {
        let mut table = format!("convention = \"{}\"\n[base]\nrpy_deg = [90, 0, 45]\n", if standard { "standard" } else { "modified" });
        for (i, (a, alpha, d, theta, kind)) in rows.iter().enumerate() {
            let limits = ["lower_rad = -2, upper_rad = 2, effort_nm = 3", "velocity_rad_s = 4", "lower_m = -1, upper_m = 1"][*kind];
            let _ = write!(
                table,
                "[[joint]]\nname = \"j{i}\"\nkind = \"{}\"\na_m = {a:?}\nalpha_rad = {alpha:?}\nd_m = {d:?}\ntheta_rad = {theta:?}\n\
                 limits = {{ {limits} }}\ndynamics = {{ damping = 0.1 }}\ninertial = {{ mass_kg = 1.5, com_m = [0.1, 0.2, -0.3], \
                 inertia_at_com = [0.02, 0.001, 0.002, 0.03, -0.003, 0.025] }}\n",
                ["revolute", "continuous", "prismatic"][*kind]
            );
        }
        let model = read_dh(&table).unwrap();
        let text = write_urdf(&model);
        let back = read_urdf(&text).unwrap().model;
        // Angles computed from a rotation lose half of the digits only near a pitch of 90°; 1e-12 m.
        for (joint, (a, b)) in model.joints().iter().zip(back.joints()).enumerate() {
            prop_assert_eq!(&a.name, &b.name);
            prop_assert_eq!((a.kind, a.damping, a.parent), (b.kind, b.damping, b.parent));
            let (mine, theirs) = (a.transform(q[joint]), b.transform(q[joint]));
            let rotation = mine.rotation - theirs.rotation;
            prop_assert!(rotation.0.iter().flatten().all(|x| x.abs() < 1e-12), "{:?}", rotation);
            let shift = mine.translation - theirs.translation;
            prop_assert!(shift.norm() < 1e-12);
            if a.kind == JointKind::Revolute {
                prop_assert_eq!((a.limits.lower, a.limits.upper, a.limits.effort), (b.limits.lower, b.limits.upper, b.limits.effort));
            }
        }
        assert_same_inertials(&back, model.inertials(), 1e-14);
    }
}
