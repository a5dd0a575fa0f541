//! Collision shapes in mesh files: concave links whose convex hulls overlap, COLLADA, and unusable files. The tests
//! write the meshes.

use core::fmt::Write;
use core::ops::ControlFlow;
use dynident_dynamics::{ParametricModel, Workspace, body_placements};
use dynident_excitation::check::{LimitReport, check_limits};
use dynident_excitation::criteria::DOptimal;
use dynident_excitation::families::{Fourier, FourierSettings};
use dynident_excitation::limits::{AssumedLimits, LimitSet, Limits, LimitsInForce, ShapesOfLinks, StartPositions};
use dynident_excitation::{DesignSettings, DesignTask, Family, Motion, design};
use dynident_model::{Model, Transform, Vec3};
use std::path::Path;

const DURATION_S: f64 = 6.0;

fn block(low: [f64; 3], high: [f64; 3]) -> Vec<[f64; 3]> {
    let corner = |k: usize| core::array::from_fn(|axis| if k >> axis & 1 == 0 { low[axis] } else { high[axis] });
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    faces.into_iter().flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]]).map(corner).collect()
}

/// A binary STL file.
fn stl(corners: &[[f64; 3]]) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((corners.len() as u32 / 3).to_le_bytes());
    for triangle in corners.chunks_exact(3) {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// A COLLADA file in centimetres whose node maps x to z.
fn collada(corners_cm: &[[f64; 3]]) -> String {
    let numbers = corners_cm.iter().flatten().fold(String::new(), |mut text, x| {
        let _ = write!(text, "{x} ");
        text
    });
    let places = (0..corners_cm.len()).fold(String::new(), |mut text, k| {
        let _ = write!(text, "{k} ");
        text
    });
    format!(
        r##"<?xml version="1.0" encoding="utf-8"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="rod"><mesh><source id="p"><float_array id="pa" count="{count}">{numbers}</float_array>
<technique_common><accessor source="#pa" count="{corners}" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{triangles}"><input semantic="VERTEX" source="#v" offset="0"/><p>{places}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><rotate>0 1 0 -90</rotate><instance_geometry url="#rod"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##,
        count = 3 * corners_cm.len(),
        corners = corners_cm.len(),
        triangles = corners_cm.len() / 3,
    )
}

fn link(name: &str, collision: &str) -> String {
    format!(
        "<link name=\"{name}\"><inertial><origin xyz=\"0.02 0.01 0.1\"/><mass value=\"2\"/>\
         <inertia ixx=\"0.02\" iyy=\"0.03\" izz=\"0.025\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>{collision}</link>"
    )
}

fn mesh(file: &str) -> String {
    format!("<collision><geometry><mesh filename=\"{file}\"/></geometry></collision>")
}

fn joint(name: &str, [parent, child]: [&str; 2], xyz: &str, axis: &str, range: f64) -> String {
    format!(
        "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{xyz}\"/>\
         <axis xyz=\"{axis}\"/><limit lower=\"-{range}\" upper=\"{range}\" velocity=\"2\" effort=\"200\"/></joint>"
    )
}

/// A robot and its limits for a study without limits.
fn in_force(folder: &Path, description: &str, pieces: usize) -> (Model, LimitsInForce) {
    let model = dynident_model::read_urdf(&format!("<robot name=\"arm\">{description}</robot>")).unwrap().model;
    let shapes = ShapesOfLinks::of(&model, folder);
    let settings = AssumedLimits { mesh_pieces: pieces, ..AssumedLimits::default() };
    let limits =
        LimitsInForce::new(&model, &shapes, &settings, &Limits::default(), &StartPositions::default()).unwrap();
    (model, limits)
}

/// Runs a small search; returns the result of the check, and calls `look` with the placements of all bodies at 50 Hz.
fn designed(model: &Model, limits: &Limits, mut look: impl FnMut(&[Transform])) -> Vec<LimitReport> {
    let robot = ParametricModel::new(model.clone(), Vec::new()).unwrap();
    let family = Fourier::new(model.dof(), DURATION_S, &FourierSettings::default()).unwrap();
    let task = DesignTask {
        family: &family,
        criteria: &[&DOptimal],
        limits: &LimitSet::new(limits, model).unwrap(),
        layout: robot.layout(),
        torque_std_nm: &vec![1.0; model.dof()],
        prior: None,
    };
    let settings = DesignSettings {
        starts: Some(2),
        rounds: Some(0),
        evaluations_per_start: Some(80),
        polish_evaluations: 120,
        ..DesignSettings::default()
    };
    let best = design(&task, &settings, |_| ControlFlow::Continue(())).unwrap();
    let motion_at = |times: &[f64], out: &mut Motion| family.motion(&best.parameters, times, out);
    let times: Vec<f64> = (0..=300).map(|k| f64::from(k) / 50.0).collect();
    let (mut motion, mut workspace) = (Motion::default(), Workspace::new(model));
    motion_at(&times, &mut motion);
    for sample in 0..times.len() {
        let q: Vec<f64> = (0..model.dof()).map(|joint| motion.q[motion.of(joint)][sample]).collect();
        look(body_placements(model, &mut workspace, &q));
    }
    check_limits(limits, model, DURATION_S, 1000.0, motion_at).unwrap()
}

fn broken(reports: &[LimitReport]) -> Vec<&LimitReport> {
    reports.iter().filter(|report| report.violated).collect()
}

/// A bar that turns inside a channel: the channel's convex hull always contains it, its walls do not.
#[test]
fn links_apart_by_their_meshes_only_are_kept_apart_and_move() {
    let folder = tempfile::tempdir().unwrap();
    let channel = [
        block([-0.2, -0.1, -0.02], [0.2, 0.1, 0.0]),
        block([-0.2, 0.08, 0.0], [0.2, 0.1, 0.2]),
        block([-0.2, -0.1, 0.0], [0.2, -0.08, 0.2]),
    ];
    std::fs::write(folder.path().join("channel.stl"), stl(&channel.concat())).unwrap();
    std::fs::write(folder.path().join("bar.stl"), stl(&block([-0.17, -0.01, -0.25], [0.13, 0.01, -0.2]))).unwrap();
    let ball = "<collision><origin xyz=\"0 0 0.05\"/><geometry><sphere radius=\"0.02\"/></geometry></collision>";
    let description = [
        link("base", &mesh("channel.stl")),
        link("post", ball),
        link("bar", &mesh("bar.stl")),
        joint("j1", ["base", "post"], "0 0 0.3", "0 0 1", 0.5),
        joint("j2", ["post", "bar"], "0.02 0 0", "0 0 1", 0.5),
    ];
    let lists = |limits: &LimitsInForce| limits.not_checked.iter().any(|text| text.contains("base / bar"));
    let (model, hulls) = in_force(folder.path(), &description.concat(), 1);
    assert!(lists(&hulls), "convex hulls overlap in every posture: {:?}", hulls.not_checked);
    let (_, limits) = in_force(folder.path(), &description.concat(), 8);
    assert!(!lists(&limits), "{:?}", limits.not_checked);
    let mut widest = 0.0_f64;
    let reports = designed(&model, &limits.limits, |placements| {
        for [x, y] in [[-0.17, -0.01], [-0.17, 0.01], [0.13, -0.01], [0.13, 0.01]] {
            widest = widest.max(placements[1].point(Vec3([x, y, -0.2]))[1].abs());
        }
    });
    assert!(broken(&reports).is_empty(), "{:?}", broken(&reports));
    assert!(reports.iter().any(|report| report.joint == "base / bar"), "{reports:?}");
    assert!(widest < 0.08, "the bar reaches {widest} m, the walls are at 0.08 m");
    // The bar moves.
    assert!(widest > 0.03, "{widest}");
}

/// A rod whose only shape is a COLLADA file and that could turn through the column of the arm.
#[test]
fn a_rod_from_collada_stays_out_of_the_column() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("rod.dae"), collada(&block([0.0, -1.0, -1.0], [50.0, 1.0, 1.0]))).unwrap();
    let column = "<collision><origin xyz=\"0 0 0.25\"/><geometry><box size=\"0.12 0.12 0.5\"/></geometry></collision>";
    let beam = "<collision><origin xyz=\"0 0 0.2\"/><geometry><box size=\"0.06 0.06 0.4\"/></geometry></collision>";
    let description = [
        "<link name=\"base\"/>".to_owned(),
        link("column", column),
        link("beam", beam),
        link("rod", &mesh("rod.dae")),
        joint("j1", ["base", "column"], "0 0 0.1", "0 0 1", 2.7),
        joint("j2", ["column", "beam"], "0 0.1 0.45", "0 1 0", 2.7),
        joint("j3", ["beam", "rod"], "0 -0.1 0.4", "0 1 0", 2.7),
    ];
    let (model, limits) = in_force(folder.path(), &description.concat(), 8);
    assert!(!limits.not_checked.iter().any(|text| text.contains("rod")), "{:?}", limits.not_checked);
    let mut inside = 0;
    let reports = designed(&model, &limits.limits, |placements| {
        let column_from_rod = placements[0].inverse().then(&placements[2]);
        for step in 0..=50 {
            let Vec3([x, y, z]) = column_from_rod.point(Vec3([0.0, 0.0, 0.01 * f64::from(step)]));
            inside += usize::from(x.abs() <= 0.06 && y.abs() <= 0.06 && (0.0..=0.5).contains(&z));
        }
    });
    assert!(broken(&reports).is_empty(), "{:?}", broken(&reports));
    assert_eq!(inside, 0, "points of the rod in the column");
}

#[test]
fn every_dropped_shape_is_listed_with_its_link_and_file() {
    let folder = tempfile::tempdir().unwrap();
    let files: [(&str, &[u8]); 4] = [
        ("pointer.stl", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n"),
        ("cloud.ply", b"ply\nformat ascii 1.0\nend_header\n"),
        ("broken.dae", b"<COLLADA><library_geometries>"),
        ("empty.stl", b"solid nothing\nendsolid nothing\n"),
    ];
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let cone = "<collision><geometry><cone radius=\"0.1\" length=\"0.1\"/></geometry></collision>";
    let shapes = [
        mesh("package://nowhere/missing.stl"),
        mesh("pointer.stl"),
        mesh("cloud.ply"),
        mesh("broken.dae"),
        mesh("empty.stl"),
        cone.to_owned(),
        String::new(),
    ];
    let ball = "<collision><geometry><sphere radius=\"0.02\"/></geometry></collision>";
    let mut description = link("base", ball);
    for (k, shape) in shapes.iter().enumerate() {
        let name = format!("arm{k}");
        let parent = if k == 0 { "base".to_owned() } else { format!("arm{}", k - 1) };
        // The last one is fixed, with a mass and without a shape.
        let kind = |text: String| if k == 6 { text.replace("revolute", "fixed") } else { text };
        description += &kind(joint(&format!("j{k}"), [&parent, &name], "0 0 0.2", "0 1 0", 1.0));
        description += &link(&name, shape);
    }
    let (_, limits) = in_force(folder.path(), &description, 8);
    let listed = &limits.not_checked;
    for (link, what) in [
        ("arm0", "package://nowhere/missing.stl"),
        ("arm1", "pointer.stl: cannot be read: it is a Git LFS pointer"),
        ("arm2", "cloud.ply: unknown format"),
        ("arm3", "broken.dae: malformed XML"),
        ("arm4", "empty.stl: no vertices"),
        ("arm5", "<cone>"),
    ] {
        let start = format!("a collision shape of link `{link}`: ");
        assert!(listed.iter().any(|text| text.starts_with(&start) && text.contains(what)), "{link}: {listed:#?}");
    }
    let without = listed.iter().find(|text| text.starts_with("links without a collision shape: "));
    assert!(without.is_some_and(|text| text.ends_with("arm6")), "{listed:#?}");
}
