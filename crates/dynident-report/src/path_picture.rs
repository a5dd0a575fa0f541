//! Path of an arm in space: tool path and some poses, from above and from the side.

use crate::error::ReportError;
use crate::pen::{Pen, tenth};
use serde::Serialize;

/// Width and height of one view, gap and top margin, px.
const VIEW: [f64; 2] = [420.0, 420.0];
const GAP: f64 = 58.0;
const MARGIN_TOP: f64 = 58.0;

const MIN_SPAN: f64 = 0.1;

/// Views: name, and horizontal and vertical axis of the base frame.
const VIEWS: [(&str, [usize; 2]); 2] = [("from above", [0, 1]), ("from the side", [0, 2])];

/// A point in the base frame: x, y, z in m.
pub type Place = [f64; 3];

/// The arm at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArmPose {
    /// Straight rods between joints, and from the last joints to their tools.
    pub rods: Vec<[Place; 2]>,
    /// Joints, drawn as dots.
    pub joints: Vec<Place>,
}

/// A vertical column that the arm avoids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnShape {
    /// Its axis, x and y in the base frame, m.
    pub axis_xy_m: [f64; 2],
    /// Its radius, m.
    pub radius_m: f64,
}

/// A picture of a motion in the base frame: from above (x to the right, y upwards) and from the side (x to the right, z
/// upwards), both at one scale; tool paths blue, the first pose black, later ones orange. Floor, column and boxes are
/// drawn where visible.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PathPicture<'a> {
    /// Title.
    pub title: &'a str,
    /// Path of each tool.
    pub paths: Vec<Vec<Place>>,
    /// Poses in the order of time.
    pub poses: Vec<ArmPose>,
    /// Height of the floor, m.
    pub floor_m: Option<f64>,
    /// The column.
    pub column: Option<ColumnShape>,
    /// Boxes: minimum and maximum of x, y and z, m; `None` for an open side.
    pub boxes: Vec<[Option<[f64; 2]>; 3]>,
}

impl PathPicture<'_> {
    /// Renders the picture as SVG.
    ///
    /// # Errors
    /// If the template fails.
    pub fn svg(&self) -> Result<String, ReportError> {
        let frame = self.frame();
        let views = VIEWS.into_iter().enumerate().map(|(index, (name, axes))| {
            let view = View { left: GAP + index as f64 * (VIEW[0] + GAP), axes, frame: &frame };
            view.drawn(name, self)
        });
        let picture = Picture {
            title: self.title,
            width: GAP + 2.0 * (VIEW[0] + GAP),
            height: MARGIN_TOP + VIEW[1] + 52.0,
            gap: GAP,
            top: MARGIN_TOP,
            size: VIEW,
            views: views.collect(),
        };
        crate::templates::rendered("path_picture.svg", &picture)
    }

    fn frame(&self) -> Frame {
        let rods = self.poses.iter().flat_map(|pose| pose.rods.iter().flatten().chain(&pose.joints));
        let points = self.paths.iter().flatten().chain(rods).filter(|point| point.iter().all(|x| x.is_finite()));
        let (mut low, mut high) = ([0.0_f64; 3], [0.0_f64; 3]);
        for point in points {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
            }
        }
        let span = |low: &Place, high: &Place| (0..3).fold(MIN_SPAN, |span, axis| span.max(high[axis] - low[axis]));
        let near = span(&low, &high);
        let mut edges: Vec<(usize, f64)> = self.floor_m.iter().map(|height| (2, *height)).collect();
        if let Some(column) = &self.column {
            let ends = |axis: usize| [-1.0, 1.0].map(|side| (axis, column.axis_xy_m[axis] + side * column.radius_m));
            edges.extend(ends(0).into_iter().chain(ends(1)));
        }
        for (axis, ends) in self.boxes.iter().flat_map(|sides| sides.iter().enumerate()) {
            edges.extend(ends.iter().flatten().map(|end| (axis, *end)));
        }
        // Distant limits are excluded, because the arm would become too small.
        for (axis, edge) in edges {
            if edge > low[axis] - near && edge < high[axis] + near {
                (low[axis], high[axis]) = (low[axis].min(edge), high[axis].max(edge));
            }
        }
        let middle = core::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        Frame { middle, half: 0.54 * span(&low, &high) }
    }
}

/// The shown space: centre, and half the width of a view, m.
struct Frame {
    middle: Place,
    half: f64,
}

struct View<'a> {
    left: f64,
    axes: [usize; 2],
    frame: &'a Frame,
}

impl View<'_> {
    fn pixels_per_m(&self) -> f64 {
        0.5 * VIEW[0] / self.frame.half
    }

    fn x(&self, metres: f64) -> f64 {
        self.left + 0.5 * VIEW[0] + (metres - self.frame.middle[self.axes[0]]) * self.pixels_per_m()
    }

    fn y(&self, metres: f64) -> f64 {
        MARGIN_TOP + 0.5 * VIEW[1] - (metres - self.frame.middle[self.axes[1]]) * self.pixels_per_m()
    }

    fn at(&self, point: &Place) -> [f64; 2] {
        [self.x(point[self.axes[0]]), self.y(point[self.axes[1]])]
    }

    fn line<'p>(&self, points: impl IntoIterator<Item = &'p Place>) -> String {
        let mut pen = Pen::default();
        for point in points {
            pen.to(self.at(point));
        }
        pen.path()
    }

    fn drawn(&self, name: &'static str, picture: &PathPicture<'_>) -> PathView {
        let poses = picture.poses.iter().enumerate().rev().map(|(place, pose)| Pose {
            colour: if place == 0 { "#111" } else { "#e08a1e" },
            stroke: if place == 0 { 2.6 } else { 1.4 },
            rods: pose.rods.iter().map(|rod| self.line(rod)).collect(),
            dots: pose.joints.iter().map(|joint| self.at(joint).map(tenth)).collect(),
        });
        PathView {
            name,
            left: self.left,
            floor: self.floor(picture),
            round: self.round_column(picture),
            boxes: self.standing_column(picture).into_iter().chain(self.boxes(picture)).collect(),
            poses: poses.collect(),
            paths: picture.paths.iter().map(|path| self.line(path)).collect(),
            x_ticks: self.ticks(0).into_iter().map(|(metres, text)| (tenth(self.x(metres)), text)).collect(),
            y_ticks: self.ticks(1).into_iter().map(|(metres, text)| (tenth(self.y(metres)), text)).collect(),
            axes: self.axes.map(|axis| ["x", "y", "z"][axis]),
        }
    }

    /// Upper edge and height of the floor in the view from the side, px; `None` from above.
    fn floor(&self, picture: &PathPicture<'_>) -> Option<[f64; 2]> {
        let height = picture.floor_m.filter(|_| self.axes[1] == 2)?;
        let y = self.y(height);
        Some([tenth(y), tenth((MARGIN_TOP + VIEW[1] - y).max(0.0) + 2.0)])
    }

    fn round_column(&self, picture: &PathPicture<'_>) -> Option<[f64; 3]> {
        let column = picture.column.filter(|_| self.axes[1] != 2)?;
        let [x, y] = column.axis_xy_m;
        Some([self.x(x), self.y(y), column.radius_m * self.pixels_per_m()].map(tenth))
    }

    fn standing_column(&self, picture: &PathPicture<'_>) -> Option<Shape> {
        let column = picture.column.filter(|_| self.axes[1] == 2)?;
        let radius = column.radius_m * self.pixels_per_m();
        let corner = [self.x(column.axis_xy_m[0]) - radius, MARGIN_TOP - 2.0];
        Some(Shape {
            class: "column",
            filled: true,
            corner: corner.map(tenth),
            size: [tenth(2.0 * radius), VIEW[1] + 4.0],
        })
    }

    fn boxes(&self, picture: &PathPicture<'_>) -> impl Iterator<Item = Shape> {
        // An open side is outside of the picture.
        let far = 3.0 * self.frame.half;
        picture.boxes.iter().map(move |sides| {
            let [[left, right], [lower, upper]] = self.axes.map(|axis| {
                let middle = self.frame.middle[axis];
                sides[axis].unwrap_or([middle - far, middle + far]).map(|end| end.clamp(middle - far, middle + far))
            });
            let size = [self.x(right) - self.x(left), self.y(lower) - self.y(upper)].map(tenth);
            Shape { class: "box", filled: false, corner: [self.x(left), self.y(upper)].map(tenth), size }
        })
    }

    fn ticks(&self, place: usize) -> Vec<(f64, String)> {
        let Frame { middle, half } = self.frame;
        let span = 2.0 * half;
        let decade = 10.0_f64.powf((span / 4.0).log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|part| part * decade).into_iter().find(|step| span / step <= 6.0);
        let step = step.unwrap_or(span);
        let digits = usize::from(step < 1.0) + usize::from(step < 0.0999) + usize::from(step < 0.00999);
        let (first, last) = (middle[self.axes[place]] - half, middle[self.axes[place]] + half);
        let ticks = (first / step).ceil() as i64..=(last / step).floor() as i64;
        ticks.map(|tick| tick as f64 * step).map(|metres| (metres, format!("{metres:.digits$}"))).collect()
    }
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    width: f64,
    height: f64,
    gap: f64,
    top: f64,
    size: [f64; 2],
    views: Vec<PathView>,
}

#[derive(Serialize)]
struct PathView {
    name: &'static str,
    left: f64,
    floor: Option<[f64; 2]>,
    round: Option<[f64; 3]>,
    boxes: Vec<Shape>,
    poses: Vec<Pose>,
    paths: Vec<String>,
    x_ticks: Vec<(f64, String)>,
    y_ticks: Vec<(f64, String)>,
    axes: [&'static str; 2],
}

#[derive(Serialize)]
struct Shape {
    class: &'static str,
    filled: bool,
    corner: [f64; 2],
    size: [f64; 2],
}

#[derive(Serialize)]
struct Pose {
    colour: &'static str,
    stroke: f64,
    rods: Vec<String>,
    dots: Vec<[f64; 2]>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tip of a rod of 1 m that turns by 90° about the base.
    #[test]
    fn a_quarter_turn_is_a_quarter_circle() {
        let tip = |degrees: i32| [f64::from(degrees).to_radians().cos(), f64::from(degrees).to_radians().sin(), 0.0];
        let pose = |degrees| ArmPose { rods: vec![[[0.0; 3], tip(degrees)]], joints: vec![[0.0; 3]] };
        let picture = PathPicture {
            title: "a < b",
            paths: vec![(0..=90).map(tip).collect()],
            poses: (0..=9).map(|k| pose(10 * k)).collect(),
            floor_m: Some(-0.3),
            column: Some(ColumnShape { axis_xy_m: [0.0; 2], radius_m: 0.2 }),
            boxes: vec![[Some([-0.5, 1.5]), None, None]],
        };
        let svg = picture.svg().unwrap();
        assert_eq!(svg.matches("class=\"path\"").count(), 2, "one tool, two views");
        assert_eq!(svg.matches("class=\"arm\"").count(), 10 * 2);
        let drawn = ["floor", "column", "box"].map(|class| svg.matches(&format!("class=\"{class}\"")).count());
        assert_eq!(drawn, [1, 2, 2]);
        assert!(!svg.contains("NaN") && !svg.contains("inf") && svg.contains("a &lt; b"));
        // From above all points have the same distance to the base, within some tenths of a pixel.
        let first = svg.split("class=\"path\" d=\"M").nth(1).unwrap().split('"').next().unwrap();
        let points: Vec<Vec<f64>> =
            first.split('L').map(|point| point.split(' ').map(|x| x.parse().unwrap()).collect()).collect();
        let base = [points[90][0], points[0][1]];
        let radius = points[0][0] - base[0];
        assert!(radius > 50.0, "{points:?}");
        for point in &points {
            let distance = (point[0] - base[0]).hypot(point[1] - base[1]);
            assert!((distance - radius).abs() < 0.3, "{point:?}");
        }
    }

    #[test]
    fn nothing_and_what_is_not_finite_leave_gaps() {
        for paths in [Vec::new(), vec![vec![[0.0; 3], [f64::NAN, 1.0, f64::INFINITY], [1.0; 3]]]] {
            let svg = PathPicture { paths, ..PathPicture::default() }.svg().unwrap();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }
}
