//! Arms without stated limits: a feasible motion never touches the floor or the arm itself. The referee tests surface
//! points of each shape against the others, independent of search and check.

use crate::common::Job;
use core::f64::consts::TAU;
use core::fmt::Write;
use core::ops::ControlFlow;
use dynident::dynamics::{Workspace, body_placements};
use dynident::model::collision::{CollisionGeometry, CollisionShape};
use dynident::model::sample::Random;
use dynident::model::{Model, Transform, Vec3};
use dynident::{DesignOutcome, Study, design_study};
use std::path::Path;

/// A search of a second or so.
const SMALL: &str =
    "duration_s = 6.0\nsearch = { starts = 2, rounds = 0, evaluations_per_start = 80, polish_evaluations = 120 }";

struct Part {
    kind: &'static str,
    at: [f64; 3],
    axis: [f64; 3],
    range: f64,
    shape: String,
    centre: [f64; 3],
}

fn xyz([x, y, z]: [f64; 3]) -> String {
    format!("{x} {y} {z}")
}

fn urdf(base: &str, parts: &[Part]) -> String {
    let mut text = format!("<robot name=\"arm\"><link name=\"base\">{base}</link>");
    for (k, part) in parts.iter().enumerate() {
        let parent = if k == 0 { "base".to_owned() } else { format!("link{k}") };
        let _ = write!(
            text,
            "<joint name=\"j{n}\" type=\"{}\"><parent link=\"{parent}\"/><child link=\"link{n}\"/><origin xyz=\"{}\"/>\
             <axis xyz=\"{}\"/><limit lower=\"-{r}\" upper=\"{r}\" velocity=\"2\" effort=\"2000\"/></joint>\
             <link name=\"link{n}\"><inertial><origin xyz=\"{c}\"/><mass value=\"3\"/>\
             <inertia ixx=\"0.02\" iyy=\"0.03\" izz=\"0.025\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>\
             <collision><origin xyz=\"{c}\"/><geometry>{}</geometry></collision></link>",
            part.kind,
            xyz(part.at),
            xyz(part.axis),
            part.shape,
            n = k + 1,
            r = part.range,
            c = xyz(part.centre),
        );
    }
    text + "</robot>"
}

const Z: [f64; 3] = [0.0, 0.0, 1.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const X: [f64; 3] = [1.0, 0.0, 0.0];

fn arm(seed: u64, size: f64) -> String {
    let mut random = Random::new(seed);
    let axes = [Z, Y, Y, Z, Y, Z];
    let joints = 4 + (seed % 3) as usize;
    let mut at = [0.0, 0.0, 0.12 * size];
    let mut parts = Vec::new();
    for axis in axes.into_iter().take(joints) {
        let length = size * random.uniform(0.12, 0.45);
        let wide = size * random.uniform(0.03, 0.06);
        let shape = if random.uniform(0.0, 1.0) < 0.5 {
            format!("<box size=\"{wide} {} {length}\"/>", 1.3 * wide)
        } else {
            format!("<cylinder radius=\"{}\" length=\"{length}\"/>", 0.6 * wide)
        };
        parts.push(Part { kind: "revolute", at, axis, range: 2.7, shape, centre: [0.0, 0.0, 0.5 * length] });
        at = [0.0, random.uniform(-0.02, 0.02) * size, length + 0.04 * size];
    }
    let base = format!(
        "<collision><origin xyz=\"0 0 {}\"/><geometry><cylinder radius=\"{}\" length=\"{}\"/></geometry></collision>",
        0.05 * size,
        0.09 * size,
        0.1 * size
    );
    urdf(&base, &parts)
}

fn scara(seed: u64) -> String {
    let reach = Random::new(seed).uniform(0.2, 0.5);
    let bar = format!("<box size=\"{reach} 0.08 0.06\"/>");
    let part =
        |kind, at, axis, range, shape: &str, centre| Part { kind, at, axis, range, shape: shape.to_owned(), centre };
    urdf(
        "<collision><origin xyz=\"0 0 0.2\"/><geometry><cylinder radius=\"0.07\" length=\"0.4\"/></geometry></collision>",
        &[
            part("revolute", [0.0, 0.0, 0.45], Z, 2.5, &bar, [0.5 * reach, 0.0, 0.0]),
            part("revolute", [reach, 0.0, 0.08], Z, 2.6, &bar, [0.5 * reach, 0.0, 0.0]),
            part(
                "prismatic",
                [reach, 0.0, -0.1],
                Z,
                0.3,
                "<cylinder radius=\"0.02\" length=\"0.3\"/>",
                [0.0, 0.0, -0.1],
            ),
            part("revolute", [0.0, 0.0, -0.25], Z, 3.0, "<sphere radius=\"0.03\"/>", [0.0; 3]),
        ],
    )
}

fn leg(seed: u64) -> String {
    let length = Random::new(seed).uniform(0.2, 0.45);
    let bone = format!("<cylinder radius=\"0.025\" length=\"{length}\"/>");
    let part = |at, axis, shape: &str, centre| Part {
        kind: "revolute",
        at,
        axis,
        range: 2.6,
        shape: shape.to_owned(),
        centre,
    };
    urdf(
        "<collision><geometry><box size=\"0.5 0.2 0.12\"/></geometry></collision>",
        &[
            part([0.2, 0.14, 0.0], X, "<sphere radius=\"0.035\"/>", [0.0; 3]),
            part([0.0, 0.07, 0.0], Y, &bone, [0.0, 0.0, -0.5 * length]),
            part([0.0, 0.0, -length], Y, &bone, [0.0, 0.0, -0.5 * length]),
        ],
    )
}

fn surface(geometry: &CollisionGeometry) -> Vec<Vec3> {
    let steps = |count: i32| (-count..=count).map(move |k| f64::from(k) / f64::from(count));
    match geometry {
        CollisionGeometry::Box { size_m } => steps(6)
            .flat_map(|u| steps(6).map(move |v| (u, v)))
            .flat_map(|(u, v)| (0..3).flat_map(move |axis| [-1.0, 1.0].map(|end| (u, v, axis, end))))
            .map(|(u, v, axis, end): (f64, f64, usize, f64)| {
                let mut point = [0.0; 3];
                (point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3]) = (end, u, v);
                Vec3(core::array::from_fn(|k| 0.5 * size_m[k] * point[k]))
            })
            .collect(),
        CollisionGeometry::Cylinder { radius_m, length_m } => (0..24)
            .flat_map(|k| steps(8).map(move |s| (TAU * f64::from(k) / 24.0, s)))
            .flat_map(|(angle, s)| {
                let (sin, cos) = angle.sin_cos();
                let side = Vec3([radius_m * cos, radius_m * sin, 0.5 * length_m * s]);
                let end = Vec3([radius_m * s * cos, radius_m * s * sin, 0.5 * length_m]);
                [side, end, Vec3([end[0], end[1], -end[2]])]
            })
            .collect(),
        CollisionGeometry::Sphere { radius_m } => {
            let mut random = Random::new(1);
            (0..200).map(|_| random.direction().scale(*radius_m)).collect()
        }
        other => panic!("no such shape here: {other:?}"),
    }
}

fn inside(geometry: &CollisionGeometry, p: Vec3) -> bool {
    match geometry {
        CollisionGeometry::Box { size_m } => (0..3).all(|k| p[k].abs() <= 0.5 * size_m[k]),
        CollisionGeometry::Cylinder { radius_m, length_m } => {
            p[0].hypot(p[1]) <= *radius_m && p[2].abs() <= 0.5 * length_m
        }
        CollisionGeometry::Sphere { radius_m } => p.norm() <= *radius_m,
        other => panic!("no such shape here: {other:?}"),
    }
}

struct Referee<'a> {
    model: &'a Model,
    shapes: Vec<(Option<usize>, &'a CollisionShape, Vec<Vec3>)>,
}

impl<'a> Referee<'a> {
    fn new(model: &'a Model) -> Self {
        let bodies = core::iter::once((None, model.base())).chain((0..).map(Some).zip(model.bodies()));
        let links = bodies.flat_map(|(index, body)| body.links.iter().map(move |link| (index, link)));
        let shapes = links.flat_map(|(index, link)| link.collision.iter().map(move |shape| (index, shape)));
        Self { model, shapes: shapes.map(|(index, shape)| (index, shape, surface(&shape.geometry))).collect() }
    }

    /// Touching pairs of shapes, and the lowest point of the moving shapes.
    fn look(&self, q: &[f64]) -> (Vec<[usize; 2]>, f64) {
        let mut workspace = Workspace::new(self.model);
        let placements = body_placements(self.model, &mut workspace, q);
        let at = |k: usize| {
            let (body, shape, _) = &self.shapes[k];
            body.map_or(Transform::IDENTITY, |body| placements[body]).then(&shape.placement)
        };
        let parent = |body: Option<usize>| body.map(|body| self.model.joints()[body].parent);
        let mut touching = Vec::new();
        let mut lowest = f64::INFINITY;
        for i in 0..self.shapes.len() {
            let (own, _, points) = &self.shapes[i];
            let here = at(i);
            if own.is_some() {
                lowest = points.iter().map(|point| here.point(*point)[2]).fold(lowest, f64::min);
            }
            for j in 0..self.shapes.len() {
                let (other, shape, _) = &self.shapes[j];
                let neighbours = own == other || parent(*own) == Some(*other) || parent(*other) == Some(*own);
                let to_other = at(j).inverse().then(&here);
                if !neighbours && points.iter().any(|point| inside(&shape.geometry, to_other.point(*point))) {
                    touching.push([i.min(j), i.max(j)]);
                }
            }
        }
        (touching, lowest)
    }
}

fn designed(folder: &Path, description: &str) -> DesignOutcome {
    std::fs::write(folder.join("arm.urdf"), description).unwrap();
    let path = folder.join("study.toml");
    let study = Study::parse(&format!("[robot]\nfile = \"arm.urdf\"\n[design]\n{SMALL}\n"), &path).unwrap();
    design_study(&study, &path, &Job::options(1), |_| ControlFlow::Continue(())).unwrap()
}

/// Designs a motion and returns its contacts.
fn faults(name: &str, description: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let outcome = designed(folder.path(), description);
    if !outcome.file.feasible {
        return vec![format!("{name}: not feasible: {:?}", outcome.file.diagnosis)];
    }
    let model = outcome.robot.model();
    let referee = Referee::new(model);
    let (allowed, _) = referee.look(&vec![0.0; model.dof()]);
    let floor = !outcome.file.not_checked.iter().any(|text| text.starts_with("floor"));
    let (times, motion) = outcome.sampled(50.0);
    let mut faults = Vec::new();
    for (sample, time) in times.iter().enumerate() {
        let q: Vec<f64> = (0..model.dof()).map(|joint| motion.q[motion.of(joint)][sample]).collect();
        let (touching, lowest) = referee.look(&q);
        faults.extend(
            touching.iter().filter(|pair| !allowed.contains(pair)).map(|pair| format!("{name}: {pair:?} at {time} s")),
        );
        if floor && lowest < 0.0 {
            faults.push(format!("{name}: {lowest} m at {time} s"));
        }
    }
    faults
}

/// One arm, SCARA and leg by default; fifteen arms, five with long reach, five SCARAs and five legs in a long run.
#[test]
fn motions_touch_neither_floor_nor_arm() {
    let mut arms =
        vec![("arm 1".to_owned(), arm(1, 1.0)), ("scara 1".to_owned(), scara(1)), ("leg 1".to_owned(), leg(1))];
    let others = |seed: &u64| *seed != 1;
    arms.extend((0..15).filter(others).map(|seed| (format!("arm {seed}"), arm(seed, 1.0))));
    arms.extend((20..25).map(|seed| (format!("long reach {seed}"), arm(seed, 4.0))));
    arms.extend((0..5).filter(others).map(|seed| (format!("scara {seed}"), scara(seed))));
    arms.extend((0..5).filter(others).map(|seed| (format!("leg {seed}"), leg(seed))));
    arms.truncate(dynident_testing::count(3, arms.len()));
    let faults: Vec<String> = arms.iter().flat_map(|(name, description)| faults(name, description)).collect();
    assert!(faults.is_empty(), "{faults:#?}");
}

/// The referee detects contacts: without the defaults a motion does touch.
#[test]
fn without_the_defaults_a_motion_is_not_called_clear_of_anything() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.urdf"), arm(1, 1.0)).unwrap();
    let path = folder.path().join("study.toml");
    let off = "[design.defaults]\nfloor = false\nself_collision = false\nacceleration = false\nstop_margin_percent = 0";
    let text = format!("[robot]\nfile = \"arm.urdf\"\n[design]\n{SMALL}\n{off}\n");
    let study = Study::parse(&text, &path).unwrap();
    let outcome = design_study(&study, &path, &Job::options(1), |_| ControlFlow::Continue(())).unwrap();
    assert!(outcome.file.assumed.is_empty(), "{:?}", outcome.file.assumed);
    let missing = outcome.file.not_checked.join("\n");
    assert!(["floor", "self-collision", "acceleration"].iter().all(|what| missing.contains(what)), "{missing}");
    let model = outcome.robot.model();
    let (referee, (times, motion)) = (Referee::new(model), outcome.sampled(50.0));
    let touches = (0..times.len()).any(|sample| {
        let q: Vec<f64> = (0..model.dof()).map(|joint| motion.q[motion.of(joint)][sample]).collect();
        let (touching, lowest) = referee.look(&q);
        !touching.is_empty() || lowest < 0.0
    });
    assert!(touches, "this arm's free motion goes through the floor");
}
