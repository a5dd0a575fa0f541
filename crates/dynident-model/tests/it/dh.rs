//! D-H tables: forward kinematics compared with products of textbook matrices, inertials, trees, the paper's arm.

use dynident_model::{DhConvention, Model, Transform, Vec3, load_robot, read_dh, read_urdf};
use nalgebra::{Matrix4, Vector4};
use proptest::prelude::*;

/// One row: `a`, `alpha`, `d`, `theta`, prismatic, sign.
type Row = (f64, f64, f64, f64, bool, bool);

fn row() -> impl Strategy<Value = Row> {
    (-1.0..1.0, -3.2..3.2, -1.0..1.0, -3.2..3.2, any::<bool>(), any::<bool>())
}

fn table(convention: &str, rows: &[Row]) -> String {
    let head = format!("convention = \"{convention}\"\n[base]\nxyz_m = [0.1, -0.2, 0.3]\nrpy_rad = [0.4, 0.5, -0.6]\n");
    let joint = |(i, &(a, alpha, d, theta, slides, negative)): (usize, &Row)| {
        let kind = if slides { "prismatic" } else { "revolute" };
        let sign = if negative { -1 } else { 1 };
        format!(
            "[[joint]]\nname = \"j{i}\"\nkind = \"{kind}\"\na_m = {a:?}\nalpha_rad = {alpha:?}\nd_m = {d:?}\ntheta_rad = {theta:?}\n\
             sign = {sign}\ninertial = {{ mass_kg = 1.5, com_m = [0.1, 0.2, -0.3], \
             inertia_at_com = [0.02, 0.001, 0.002, 0.03, -0.003, 0.025] }}\n"
        )
    };
    let joints: Vec<String> = rows.iter().enumerate().map(joint).collect();
    head + &joints.concat()
}

fn rot_x(t: f64) -> Matrix4<f64> {
    let (s, c) = t.sin_cos();
    Matrix4::new(1., 0., 0., 0., 0., c, -s, 0., 0., s, c, 0., 0., 0., 0., 1.)
}
fn rot_y(t: f64) -> Matrix4<f64> {
    let (s, c) = t.sin_cos();
    Matrix4::new(c, 0., s, 0., 0., 1., 0., 0., -s, 0., c, 0., 0., 0., 0., 1.)
}
fn rot_z(t: f64) -> Matrix4<f64> {
    let (s, c) = t.sin_cos();
    Matrix4::new(c, -s, 0., 0., s, c, 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.)
}
fn shift(x: f64, y: f64, z: f64) -> Matrix4<f64> {
    Matrix4::new(1., 0., 0., x, 0., 1., 0., y, 0., 0., 1., z, 0., 0., 0., 1.)
}

/// Textbook matrix of one row at joint position `q`.
fn textbook(convention: &str, &(a, alpha, d, theta, slides, negative): &Row, q: f64) -> Matrix4<f64> {
    let q = if negative { -q } else { q };
    let (d, theta) = if slides { (d + q, theta) } else { (d, theta + q) };
    if convention == "modified" {
        rot_x(alpha) * shift(a, 0., 0.) * rot_z(theta) * shift(0., 0., d)
    } else {
        // As in Spong, Hutchinson and Vidyasagar, eq. 3.10.
        let ((st, ct), (sa, ca)) = (theta.sin_cos(), alpha.sin_cos());
        Matrix4::new(ct, -st * ca, st * sa, a * ct, st, ct * ca, -ct * sa, a * st, 0., sa, ca, d, 0., 0., 0., 1.)
    }
}

fn base_from_body(model: &Model, q: &[f64]) -> Vec<Transform> {
    let mut frames: Vec<Transform> = Vec::new();
    for (joint, &q) in model.joints().iter().zip(q) {
        let parent = joint.parent.map_or(Transform::IDENTITY, |parent| frames[parent]);
        frames.push(parent.then(&joint.transform(q)));
    }
    frames
}

/// Compares the axis, centre of mass and inertia of every body in the base frame with those from the textbook matrices.
fn assert_like_textbook(convention: &str, rows: &[Row], q: &[f64]) {
    let model = read_dh(&table(convention, rows)).expect("a good table");
    let mut frame = shift(0.1, -0.2, 0.3) * rot_z(-0.6) * rot_y(0.5) * rot_x(0.4);
    let inertia = nalgebra::Matrix3::new(0.02, 0.001, 0.002, 0.001, 0.03, -0.003, 0.002, -0.003, 0.025);
    for (i, body) in base_from_body(&model, q).iter().enumerate() {
        let before = frame;
        frame *= textbook(convention, &rows[i], q[i]);
        // Joint axis: z of D-H frame i (modified) or i-1 (standard), through that frame's origin.
        let holder = if convention == "modified" { frame } else { before };
        let axis = body.rotation.mul_vec(model.joints()[i].axis);
        let sign = if rows[i].5 { -1.0 } else { 1.0 };
        for k in 0..3 {
            // Six rows of rotations and lengths of order one give errors of a few 1e-15.
            assert!((axis[k] - sign * holder[(k, 2)]).abs() < 1e-13);
        }
        let moved = model.inertials()[i].expressed_in(body);
        let com = frame * Vector4::new(0.1, 0.2, -0.3, 1.0);
        let rotation = frame.fixed_view::<3, 3>(0, 0);
        let at_com = rotation * inertia * rotation.transpose();
        let (found_com, found_inertia) = (moved.com_m().expect("mass"), moved.inertia_at_com().expect("mass"));
        for k in 0..3 {
            assert!((found_com[k] - com[k]).abs() < 1e-13, "body {i}: {found_com:?} {com}");
            for l in 0..3 {
                // Cancellation of the parallel-axis term, up to 1.5 kg · (7 m)²: 1e-16 of 75.
                assert!((found_inertia.0[k][l] - at_com[(k, l)]).abs() < 1e-12);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn kinematics_equal_the_product_of_textbook_matrices(
        rows in prop::collection::vec((row(), -3.0..3.0), 1..7), standard in any::<bool>()
    ) {
        let (rows, q): (Vec<Row>, Vec<f64>) = rows.into_iter().unzip();
        assert_like_textbook(if standard { "standard" } else { "modified" }, &rows, &q);
    }

    /// Equal to a table that states the other convention, with the same gravity and the same locked joint.
    #[test]
    fn a_table_is_known_in_the_other_convention(rows in proptest::collection::vec(row(), 2..5)) {
        let mounted = |convention: &str| {
            let model = read_dh(&table(convention, &rows)).unwrap().with_gravity(Vec3([1.0, -2.0, 3.0])).unwrap();
            model.locked(&[("j1".to_owned(), 0.3)]).unwrap()
        };
        let [standard, modified] = ["standard", "modified"].map(mounted);
        for (one, other, convention) in
            [(&standard, &modified, DhConvention::Modified), (&modified, &standard, DhConvention::Standard)]
        {
            let (found, model) = one.other_convention().unwrap();
            prop_assert_eq!(found, convention);
            prop_assert_eq!(model.tree_joints(), other.tree_joints());
            prop_assert_eq!(model.inertials(), other.inertials());
            prop_assert_eq!(model.gravity(), other.gravity());
        }
    }
}

#[test]
fn degrees_are_radians_and_right_angles_are_exact() {
    let in_degrees = "convention = \"modified\"\n[[joint]]\nname = \"a\"\nalpha_deg = -90\ntheta_deg = 180\nlimits = { lower_deg = -90, upper_rad = 1.5, velocity_deg_s = 180 }\n";
    let model = read_dh(in_degrees).unwrap();
    let joint = &model.joints()[0];
    assert_eq!(joint.placement.rotation.0, [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    assert_eq!(joint.limits.lower, Some(-std::f64::consts::FRAC_PI_2));
    assert_eq!(joint.limits.upper, Some(1.5));
    assert_eq!(joint.limits.velocity, Some(std::f64::consts::PI));
    assert!(model.bodies()[0].prior().is_none());
}

#[test]
fn inertials_are_the_same_in_all_three_forms() {
    let read = |inertial: &str| {
        read_dh(&format!("convention = \"standard\"\n[[joint]]\nname = \"a\"\na_m = 0.5\nalpha_deg = 30\ninertial = {{ {inertial} }}\n")).unwrap()
    };
    let at_com = read("mass_kg = 2, com_m = [0.5, 0, 0], inertia_at_com = [1, 0, 0, 1, 0, 1]");
    let at_origin = read("mass_kg = 2, com_m = [0.5, 0, 0], inertia_at_origin = [1, 0, 0, 1.5, 0, 1.5]");
    let ten = read("parameters = [2, 1, 0, 0, 1, 0, 0, 1.5, 0, 1.5]");
    assert_eq!(at_com, at_origin);
    assert_eq!(at_com, ten);
}

#[test]
fn parents_make_trees() {
    let text = "convention = \"modified\"\n[base]\nlink = \"torso\"\n[[joint]]\nname = \"a\"\n[[joint]]\nname = \"b\"\n[[joint]]\nname = \"c\"\nparent = \"torso\"\n[[joint]]\nname = \"d\"\nparent = \"a_link\"\n";
    let model = read_dh(text).unwrap();
    assert_eq!(model.joints().iter().map(|joint| joint.parent).collect::<Vec<_>>(), [None, Some(0), None, Some(0)]);
    assert_eq!(model.base().name(), "torso");
}

#[test]
fn the_papers_arm_is_the_urdf_arm_and_has_the_papers_base_parameters() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/robots/paper_2r.toml");
    let model = load_robot(path).unwrap().model;
    let urdf = r#"<robot name="paper-2r"><link name="base"/><link name="link1"/><link name="link2"/>
        <joint name="joint1" type="continuous"><parent link="base"/><child link="link1"/><axis xyz="0 0 1"/></joint>
        <joint name="joint2" type="continuous"><parent link="link1"/><child link="link2"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint></robot>"#;
    assert_eq!(model.joints(), read_urdf(urdf).unwrap().model.joints());
    assert_eq!(model.gravity(), Vec3([0.0, -9.8, 0.0]));
    // The paper's Table 2 with a1 = 1, and its true values of Tables 4 and 5.
    let (one, two) = (model.inertials()[0].0, model.inertials()[1].0);
    assert_eq!([one[9] + two[0], one[1] + two[0], one[2], two[9], two[1], two[2]], [2.0, 2.0, 0.0, 1.0, 1.0, 0.0]);
}
