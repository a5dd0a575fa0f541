//! A robot in three dimensions.

use crate::error::ReportError;
use crate::palette::PALETTE;
use crate::plot_data::{check_length, embedded};
use crate::surface::Surface;
use serde::Serialize;

/// How a body moves relative to its parent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BodyMotion {
    /// The body is fixed to its parent.
    #[default]
    Fixed,
    /// The body turns about an axis; its position is in rad.
    Turns,
    /// The body slides along an axis; its position is in m.
    Slides,
}

/// A body of a robot. At position zero, a point `p` of its frame is at `rotation · p + translation` in the parent's
/// frame; it moves about (along) `axis`, which is given in its own frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneBody {
    /// Name.
    pub name: String,
    /// Index of the parent, below the body's own index; `None` for a body that is fixed to the world.
    pub parent: Option<usize>,
    /// Rotation from the body's frame to the parent's frame at position zero, by rows.
    pub rotation: [[f64; 3]; 3],
    /// Origin at position zero in the parent's frame, m.
    pub translation_m: [f64; 3],
    /// Motion relative to the parent.
    pub motion: BodyMotion,
    /// Unit vector of the axis.
    pub axis: [f64; 3],
    /// Joints of [`Scene::joints`] that move the body, with factors: `position = Σ factor · q[joint] + offset`.
    pub drivers: Vec<(usize, f64)>,
    /// Position of the body relative to its parent if all joints are at zero, rad or m.
    pub offset: f64,
    /// Surface in the body's frame.
    pub surface: Surface,
    /// Ellipsoids of uniform density with the inertia of the body; several to compare sets of values.
    pub ellipsoids: Vec<Ellipsoid>,
    /// Pose at [`Scene::posture`] in the world frame, for the still picture: rotation (rows), origin in m.
    pub pose: ([[f64; 3]; 3], [f64; 3]),
}

/// The solid ellipsoid of uniform density with the centre of mass and the inertia of a body: the unit sphere mapped by
/// `p ↦ shape · p + centre`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Ellipsoid {
    /// Centre of mass in the body's frame, m.
    pub centre: [f64; 3],
    /// Map of the unit sphere, rows, m.
    pub shape: [[f64; 3]; 3],
    /// Whether it belongs to the earlier of the two compared sets of values.
    pub earlier: bool,
}

/// A colouring: the class of each body, shown by its colour.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Colouring {
    /// Name of the quantity that the colours show.
    pub name: String,
    /// Legend: text and colour number 0 to 7 of the page's palette.
    pub classes: Vec<(String, usize)>,
    /// Class of each body; `None` is drawn grey.
    pub of: Vec<Option<usize>>,
    /// Text of each body, shown in the list of bodies.
    pub words: Vec<String>,
    /// Index of a gauge of the played motion; if given, the colour of a body is between those of the first two
    /// classes, by the value relative to its limits.
    pub gauge: Option<usize>,
}

/// A quantity of each joint during a motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gauge {
    /// Name with unit.
    pub name: String,
    /// Values by joint and sample; a joint may have none.
    pub values: Vec<Vec<f64>>,
    /// Limits of each joint; `None` without limits.
    pub limits: Vec<Option<[f64; 2]>>,
}

/// A motion that can be played.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMotion {
    /// Name.
    pub name: String,
    /// Time of each sample, s: increasing.
    pub times_s: Vec<f64>,
    /// Positions by joint and sample, rad or m.
    pub q: Vec<Vec<f64>>,
    /// Positions by joint and sample of a second, pale arm, which shows the desired motion; may be empty.
    pub ghost: Vec<Vec<f64>>,
    /// Quantities of the joints.
    pub gauges: Vec<Gauge>,
    /// Distances between bodies.
    pub pairs: Vec<BodyPair>,
}

/// Distance between two bodies during a motion. The view marks their nearest points while they are near.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyPair {
    /// Names of both bodies.
    pub name: String,
    /// Required minimum distance, m.
    pub clearance_m: f64,
    /// Distance below which the bodies are near, m.
    pub near_m: f64,
    /// Distance at each sample, m.
    pub distance_m: Vec<f64>,
    /// Nearest points at each sample, m; used while they are near.
    pub points_m: Vec<[[f64; 3]; 2]>,
}

/// A robot in three dimensions, which can be turned and zoomed. Colours show what is known of each body, and motions
/// can be played. Without scripts or WebGL, and in print, it is a still picture.
///
/// ```
/// use dynident_report::{BodyMotion, Report, Scene, SceneBody, Surface};
/// const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let rod = SceneBody {
///     name: "rod".into(),
///     rotation: UPRIGHT,
///     motion: BodyMotion::Turns,
///     axis: [0.0, 1.0, 0.0],
///     drivers: vec![(0, 1.0)],
///     surface: Surface::rod([0.0; 3], [0.0, 0.0, 0.5], 0.05),
///     pose: (UPRIGHT, [0.0; 3]),
///     ..SceneBody::default()
/// };
/// let scene = Scene { title: "Pendulum".into(), joints: vec!["hinge".into()], bodies: vec![rod], posture: vec![0.0], ..Scene::default() };
/// let mut report = Report::new("One joint");
/// report.add(scene);
/// assert!(report.html()?.contains("data-scene"));
/// # Ok::<(), dynident_report::ReportError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Title.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Whether the picture is at most 300 px high instead of 460 px, with a closed list of bodies.
    pub is_low: bool,
    /// Description for screen readers.
    pub words: String,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Bodies, parents first.
    pub bodies: Vec<SceneBody>,
    /// Positions of the joints in the still picture and at the start, rad or m.
    pub posture: Vec<f64>,
    /// Colourings, the first one is shown first.
    pub colourings: Vec<Colouring>,
    /// Motions to play.
    pub motions: Vec<SceneMotion>,
    /// Height of the floor, m.
    pub floor_m: Option<f64>,
    /// Vertical column: x and y of its axis, and its radius, m.
    pub column_m: Option<[f64; 3]>,
    /// Boxes as ranges of x, y and z, m; an open side is `None`.
    pub boxes_m: Vec<[[Option<f64>; 2]; 3]>,
}

/// Maximum number of triangles of all bodies together.
const MAX_TRIANGLES: usize = 40_000;

/// Number of steps into which the extent of a body is divided for the coordinates of its vertices.
const VERTEX_STEPS: f64 = 8191.0;

#[derive(Serialize)]
struct SceneData<'a> {
    /// Red, green and blue of each colour number, 0 to 255.
    palette: [[f64; 3]; 8],
    joints: &'a [String],
    bodies: Vec<BodyData<'a>>,
    posture: &'a [f64],
    colourings: Vec<ColouringData<'a>>,
    motions: Vec<MotionData<'a>>,
    floor: Option<f64>,
    column: Option<[f64; 3]>,
    boxes: &'a [[[Option<f64>; 2]; 3]],
}

#[derive(Serialize)]
struct BodyData<'a> {
    name: &'a str,
    parent: Option<usize>,
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    motion: BodyMotion,
    axis: [f64; 3],
    drivers: &'a [(usize, f64)],
    offset: f64,
    /// Coordinates of the vertices as steps from `low`, in one list.
    low: [f64; 3],
    step: f64,
    vertices: Vec<u32>,
    triangles: Vec<u32>,
    ellipsoids: &'a [Ellipsoid],
}

#[derive(Serialize)]
struct ColouringData<'a> {
    name: &'a str,
    classes: &'a [(String, usize)],
    of: &'a [Option<usize>],
    words: &'a [String],
    gauge: Option<usize>,
}

#[derive(Serialize)]
struct MotionData<'a> {
    name: &'a str,
    t: Vec<Option<f64>>,
    q: Vec<Vec<Option<f64>>>,
    ghost: Vec<Vec<Option<f64>>>,
    gauges: Vec<GaugeData<'a>>,
    pairs: Vec<PairData<'a>>,
}

#[derive(Serialize)]
struct PairData<'a> {
    name: &'a str,
    clearance: f64,
    near: f64,
    distance: Vec<Option<f64>>,
    /// Coordinates of the nearest points of both bodies by sample; null while the bodies are not near.
    points: Vec<Vec<Option<f64>>>,
}

#[derive(Serialize)]
struct GaugeData<'a> {
    name: &'a str,
    values: Vec<Vec<Option<f64>>>,
    limits: &'a [Option<[f64; 2]>],
}

impl Scene {
    /// Data for the page's script.
    pub(crate) fn data(&self) -> Result<String, ReportError> {
        self.check()?;
        let data = SceneData {
            palette: PALETTE,
            joints: &self.joints,
            bodies: self
                .bodies
                .iter()
                .zip(self.surfaces(MAX_TRIANGLES))
                .map(|(body, surface)| body.data(&surface))
                .collect(),
            posture: &self.posture,
            colourings: self.colourings.iter().map(Colouring::data).collect(),
            motions: self.motions.iter().map(SceneMotion::data).collect(),
            floor: self.floor_m,
            column: self.column_m,
            boxes: &self.boxes_m,
        };
        embedded(&data)
    }

    /// Surfaces of the bodies with at most `triangles` triangles together; larger surfaces get larger shares.
    pub(crate) fn surfaces(&self, triangles: usize) -> Vec<Surface> {
        let all: usize = self.bodies.iter().map(|body| body.surface.triangles.len()).sum();
        let share = |surface: &Surface| {
            if all <= triangles { surface.clone() } else { surface.within(surface.triangles.len() * triangles / all) }
        };
        self.bodies.iter().map(|body| share(&body.surface)).collect()
    }

    fn check(&self) -> Result<(), ReportError> {
        let (joints, bodies) = (self.joints.len(), self.bodies.len());
        let length = |what: &str, found: usize, expected: usize| check_length(&self.title, what, found, expected);
        length("posture", self.posture.len(), joints)?;
        for (index, body) in self.bodies.iter().enumerate() {
            let parents = body.parent.filter(|&parent| parent >= index).into_iter().count();
            length(&format!("parents of `{}` after it", body.name), parents, 0)?;
            let missing = body.drivers.iter().filter(|(joint, _)| *joint >= joints).count();
            length(&format!("unknown joints of `{}`", body.name), missing, 0)?;
        }
        for colouring in &self.colourings {
            length(&format!("{}: classes of bodies", colouring.name), colouring.of.len(), bodies)?;
            length(&format!("{}: texts", colouring.name), colouring.words.len(), bodies)?;
        }
        for motion in &self.motions {
            length(&format!("{}: joints", motion.name), motion.q.len(), joints)?;
            let ghosts = if motion.ghost.is_empty() { 0 } else { joints };
            length(&format!("{}: joints of the second arm", motion.name), motion.ghost.len(), ghosts)?;
            for row in motion.q.iter().chain(&motion.ghost) {
                length(&format!("{}: samples", motion.name), row.len(), motion.times_s.len())?;
            }
            for gauge in &motion.gauges {
                length(&format!("{}: joints", gauge.name), gauge.values.len(), joints)?;
                length(&format!("{}: limits", gauge.name), gauge.limits.len(), joints)?;
                for row in gauge.values.iter().filter(|row| !row.is_empty()) {
                    length(&format!("{}: samples", gauge.name), row.len(), motion.times_s.len())?;
                }
            }
            for pair in &motion.pairs {
                length(&format!("{}: distances", pair.name), pair.distance_m.len(), motion.times_s.len())?;
                length(&format!("{}: points", pair.name), pair.points_m.len(), motion.times_s.len())?;
            }
        }
        Ok(())
    }
}

impl SceneBody {
    fn data(&self, surface: &Surface) -> BodyData<'_> {
        let [low, high] = surface.bounds_m();
        let extent = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let step = if extent > 0.0 { extent / VERTEX_STEPS } else { 1.0 };
        let steps = |vertex: &[f64; 3]| [0, 1, 2].map(|a| ((vertex[a] - low[a]) / step).round() as u32);
        BodyData {
            name: &self.name,
            parent: self.parent,
            rotation: self.rotation,
            translation: self.translation_m,
            motion: self.motion,
            axis: self.axis,
            drivers: &self.drivers,
            offset: self.offset,
            low,
            step,
            vertices: surface.vertices_m.iter().flat_map(steps).collect(),
            triangles: surface.triangles.iter().flatten().copied().collect(),
            ellipsoids: &self.ellipsoids,
        }
    }
}

impl Colouring {
    fn data(&self) -> ColouringData<'_> {
        ColouringData { name: &self.name, classes: &self.classes, of: &self.of, words: &self.words, gauge: self.gauge }
    }
}

impl SceneMotion {
    fn data(&self) -> MotionData<'_> {
        let gauge = |gauge: &'_ Gauge| -> Vec<Vec<Option<f64>>> { listed(&gauge.values, 4) };
        MotionData {
            name: &self.name,
            t: row(&self.times_s, 7),
            q: listed(&self.q, 6),
            ghost: listed(&self.ghost, 6),
            gauges: self
                .gauges
                .iter()
                .map(|own| GaugeData { name: &own.name, values: gauge(own), limits: &own.limits })
                .collect(),
            pairs: self.pairs.iter().map(BodyPair::data).collect(),
        }
    }
}

impl BodyPair {
    fn data(&self) -> PairData<'_> {
        let coordinate = |end: usize, axis: usize| -> Vec<f64> {
            let samples = self.distance_m.iter().zip(&self.points_m);
            samples
                .map(|(distance, points)| if *distance < self.near_m { points[end][axis] } else { f64::NAN })
                .collect()
        };
        let points: Vec<Vec<f64>> = (0..6).map(|place| coordinate(place / 3, place % 3)).collect();
        PairData {
            name: &self.name,
            clearance: self.clearance_m,
            near: self.near_m,
            distance: row(&self.distance_m, 4),
            points: listed(&points, 4),
        }
    }
}

fn listed(rows: &[Vec<f64>], digits: usize) -> Vec<Vec<Option<f64>>> {
    rows.iter().map(|values| row(values, digits)).collect()
}

/// Values with a number of significant digits; null where not finite.
fn row(values: &[f64], digits: usize) -> Vec<Option<f64>> {
    let short = |value: &f64| value.is_finite().then(|| format!("{value:.*e}", digits - 1).parse().unwrap_or(*value));
    values.iter().map(short).collect()
}
