//! A picture of the arm's way through space: the tool's path and some poses, from above and from the side.

use super::svg::escaped;
use super::{ExportError, Sampled};
use crate::limits::{BoxLimit, Limits};
use core::fmt::Write;
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::{Model, Vec3};

/// Width and height of one view, and what stands around them, px.
const VIEW: [f64; 2] = [420.0, 420.0];
const GAP: f64 = 58.0;
const TOP: f64 = 58.0;

/// Poses that are drawn, both ends included.
const POSES: usize = 9;

/// Most points of a path: more than pixels tell nothing.
const MOST_POINTS: usize = 900;

/// Room that is shown however small the arm, m.
const LEAST_SPAN: f64 = 0.1;

/// A view: its name and the base frame's axes to the right and upwards.
const VIEWS: [(&str, [usize; 2]); 2] = [("from above", [0, 1]), ("from the side", [0, 2])];

/// An SVG picture of the motion in the base frame: from above (x to the right, y upwards) and from the side (x to the right, z upwards), both at one scale. The tool's path is that of the
/// frame farthest out on every last body; arms are drawn from joint to joint, the start in black. Floor, column and boxes of `limits` are drawn where they can be seen.
///
/// # Errors
/// Names, times and motion that do not belong together or to the model, and numbers that are not finite.
pub fn path_svg(sampled: &Sampled<'_>, title: &str, model: &Model, limits: &Limits) -> Result<String, ExportError> {
    sampled.check()?;
    let (expected, found) = (model.dof(), sampled.joints.len());
    if expected != found {
        return Err(ExportError::Shape { what: "joints", expected, found });
    }
    let samples = sampled.motion.samples;
    let tools = tools(model);
    let mut workspace = Workspace::new(model);
    // Base, joints and tools at one sample, m.
    let mut points_at = |sample: usize| -> Vec<Vec3> {
        let q: Vec<f64> = (0..found).map(|joint| sampled.motion.q[joint * samples + sample]).collect();
        let placements = body_placements(model, &mut workspace, &q);
        let origins = placements.iter().map(|placement| placement.translation);
        let tips = tools.iter().map(|(body, at)| placements[*body].point(*at));
        origins.chain(tips).collect()
    };
    let step = samples.div_ceil(MOST_POINTS).max(1);
    let path: Vec<Vec<Vec3>> = (0..samples)
        .step_by(step)
        .chain(samples.checked_sub(1))
        .map(|sample| points_at(sample)[found..].to_vec())
        .collect();
    let poses: Vec<Vec<Vec3>> = match samples {
        0 => Vec::new(),
        _ => (0..POSES).map(|pose| points_at(pose * (samples - 1) / (POSES - 1))).collect(),
    };
    let frame = Frame::around(path.iter().chain(&poses).flatten().copied(), limits);
    let (width, height) = (GAP + 2.0 * (VIEW[0] + GAP), TOP + VIEW[1] + 52.0);
    // Writing to a string cannot fail, here and below.
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"10\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"{GAP}\" y=\"20\" font-size=\"14\">{}</text>\n",
        escaped(title)
    );
    for (index, (name, axes)) in VIEWS.into_iter().enumerate() {
        let view = View { left: GAP + index as f64 * (VIEW[0] + GAP), axes, frame: &frame };
        let _ = writeln!(
            text,
            "<clipPath id=\"view{index}\"><rect x=\"{0}\" y=\"{TOP}\" width=\"{1}\" height=\"{2}\"/></clipPath>\n\
             <text x=\"{0}\" y=\"{3}\" font-size=\"12\" fill=\"#444\">{name}</text>\n<g clip-path=\"url(#view{index})\">",
            view.left,
            VIEW[0],
            VIEW[1],
            TOP - 6.0
        );
        view.limits(&mut text, limits);
        for (pose, points) in poses.iter().enumerate().rev() {
            let (colour, stroke) = if pose == 0 { ("#111", 2.6) } else { ("#e08a1e", 1.4) };
            view.arm(&mut text, model, &tools, points, colour, stroke);
        }
        for tool in 0..tools.len() {
            view.line(&mut text, "path", path.iter().map(|points| points[tool]), "#1565a8", 1.4);
        }
        text.push_str("</g>\n");
        view.scale(&mut text);
    }
    let _ = writeln!(
        text,
        "<text x=\"{GAP}\" y=\"{}\" fill=\"#444\">base frame, m; blue: path of the tool; black: the arm at the start, orange: later; red: floor, column and boxes</text>\n</svg>",
        height - 8.0
    );
    Ok(text)
}

/// Every last body and the place on it of the link frame that stands farthest out.
fn tools(model: &Model) -> Vec<(usize, Vec3)> {
    let last = |body: &usize| model.joints().iter().all(|joint| joint.parent != Some(*body));
    let farthest = |body: usize| {
        let places = model.bodies()[body].links.iter().map(|link| link.placement.translation);
        let far = places.fold(Vec3::ZERO, |far, place| if place.norm() >= far.norm() { place } else { far });
        (body, far)
    };
    (0..model.dof()).filter(last).map(farthest).collect()
}

/// The part of space that is shown: a middle, and half the width of a view in metres.
struct Frame {
    middle: [f64; 3],
    half: f64,
}

impl Frame {
    /// All points, the base, and what limits add near them.
    fn around(points: impl Iterator<Item = Vec3>, limits: &Limits) -> Self {
        let (mut low, mut high) = ([0.0_f64; 3], [0.0_f64; 3]);
        for point in points {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
            }
        }
        let span = (0..3).fold(LEAST_SPAN, |span, axis| span.max(high[axis] - low[axis]));
        let mut edges: Vec<(usize, f64)> = limits.floor.iter().map(|floor| (2, floor.height_m)).collect();
        if let Some(column) = &limits.column {
            let ends = |axis: usize| [-1.0, 1.0].map(|side| (axis, column.axis_xy_m[axis] + side * column.radius_m));
            edges.extend(ends(0).into_iter().chain(ends(1)));
        }
        for limit in &limits.boxes {
            let sides = [limit.x_m, limit.y_m, limit.z_m];
            edges.extend(
                sides
                    .into_iter()
                    .enumerate()
                    .flat_map(|(axis, ends)| ends.into_iter().flatten().map(move |end| (axis, end))),
            );
        }
        // What is farther away than the arm is large would make the arm small.
        for (axis, edge) in edges {
            if edge > low[axis] - span && edge < high[axis] + span {
                (low[axis], high[axis]) = (low[axis].min(edge), high[axis].max(edge));
            }
        }
        let span = (0..3).fold(LEAST_SPAN, |span, axis| span.max(high[axis] - low[axis]));
        Self { middle: core::array::from_fn(|axis| 0.5 * (low[axis] + high[axis])), half: 0.54 * span }
    }
}

/// One view of the frame.
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
        TOP + 0.5 * VIEW[1] - (metres - self.frame.middle[self.axes[1]]) * self.pixels_per_m()
    }

    fn at(&self, point: Vec3) -> [f64; 2] {
        [self.x(point[self.axes[0]]), self.y(point[self.axes[1]])]
    }

    fn line(&self, text: &mut String, class: &str, points: impl Iterator<Item = Vec3>, colour: &str, stroke: f64) {
        let mut path = String::new();
        for point in points {
            let [x, y] = self.at(point);
            let _ = write!(path, "{}{x:.1} {y:.1}", if path.is_empty() { "M" } else { "L" });
        }
        let _ = writeln!(
            text,
            "<path class=\"{class}\" d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{stroke}\" stroke-linejoin=\"round\"/>"
        );
    }

    /// One pose: rods from each joint to its parent's, and to the tools, with a dot on each joint.
    fn arm(
        &self,
        text: &mut String,
        model: &Model,
        tools: &[(usize, Vec3)],
        points: &[Vec3],
        colour: &str,
        stroke: f64,
    ) {
        let joints = model.joints().iter().enumerate().map(|(body, joint)| (joint.parent, body));
        let tips = tools.iter().enumerate().map(|(tool, (body, _))| (Some(*body), model.dof() + tool));
        for (from, to) in joints.chain(tips) {
            let from = from.map_or(Vec3::ZERO, |body| points[body]);
            self.line(text, "arm", [from, points[to]].into_iter(), colour, stroke);
        }
        for point in &points[..model.dof()] {
            let [x, y] = self.at(*point);
            let _ = writeln!(text, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{stroke}\" fill=\"{colour}\"/>");
        }
    }

    fn limits(&self, text: &mut String, limits: &Limits) {
        const RED: &str = "stroke=\"#c22\" stroke-dasharray=\"5 3\"";
        let bottom = TOP + VIEW[1];
        if let (Some(floor), [_, 2]) = (&limits.floor, self.axes) {
            let y = self.y(floor.height_m);
            let _ = writeln!(
                text,
                "<rect class=\"floor\" x=\"{}\" y=\"{y:.1}\" width=\"{}\" height=\"{:.1}\" fill=\"#c22\" fill-opacity=\"0.08\" {RED}/>",
                self.left - 2.0,
                VIEW[0] + 4.0,
                (bottom - y).max(0.0) + 2.0
            );
        }
        if let Some(column) = &limits.column {
            let [x, y] = column.axis_xy_m;
            let radius = column.radius_m * self.pixels_per_m();
            let fill = "fill=\"#c22\" fill-opacity=\"0.08\"";
            let _ = match self.axes {
                [_, 2] => writeln!(
                    text,
                    "<rect class=\"column\" x=\"{:.1}\" y=\"{}\" width=\"{:.1}\" height=\"{}\" {fill} {RED}/>",
                    self.x(x) - radius,
                    TOP - 2.0,
                    2.0 * radius,
                    VIEW[1] + 4.0
                ),
                _ => writeln!(
                    text,
                    "<circle class=\"column\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius:.1}\" {fill} {RED}/>",
                    self.x(x),
                    self.y(y)
                ),
            };
        }
        for BoxLimit { x_m, y_m, z_m, .. } in &limits.boxes {
            let sides = [*x_m, *y_m, *z_m];
            // A free side lies outside the picture.
            let far = 3.0 * self.frame.half;
            let ends = |axis: usize| {
                let middle = self.frame.middle[axis];
                sides[axis].unwrap_or([middle - far, middle + far]).map(|end| end.clamp(middle - far, middle + far))
            };
            let [[left, right], [lower, upper]] = self.axes.map(ends);
            let _ = writeln!(
                text,
                "<rect class=\"box\" x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" {RED}/>",
                self.x(left),
                self.y(upper),
                self.x(right) - self.x(left),
                self.y(lower) - self.y(upper)
            );
        }
    }

    /// The frame with its scales.
    fn scale(&self, text: &mut String) {
        let bottom = TOP + VIEW[1];
        let _ = writeln!(
            text,
            "<rect x=\"{}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#bbb\"/>",
            self.left, VIEW[0], VIEW[1]
        );
        let span = 2.0 * self.frame.half;
        let decade = 10.0_f64.powf((span / 4.0).log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|part| part * decade).into_iter().find(|step| span / step <= 6.0);
        let step = step.unwrap_or(span);
        let digits = usize::from(step < 1.0) + usize::from(step < 0.0999) + usize::from(step < 0.00999);
        for (place, axis) in self.axes.into_iter().enumerate() {
            let (first, last) = (self.frame.middle[axis] - self.frame.half, self.frame.middle[axis] + self.frame.half);
            for tick in (first / step).ceil() as i64..=(last / step).floor() as i64 {
                let metres = tick as f64 * step;
                let _ = if place == 0 {
                    let x = self.x(metres);
                    writeln!(
                        text,
                        "<path d=\"M{x:.1} {bottom}v4\" stroke=\"#888\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"#444\">{metres:.digits$}</text>",
                        bottom + 14.0
                    )
                } else {
                    let y = self.y(metres);
                    writeln!(
                        text,
                        "<path d=\"M{0} {y:.1}h-4\" stroke=\"#888\"/><text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\" fill=\"#444\">{metres:.digits$}</text>",
                        self.left,
                        self.left - 6.0,
                        y + 3.5
                    )
                };
            }
            let name = ["x", "y", "z"][axis];
            let _ = if place == 0 {
                writeln!(
                    text,
                    "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{name}</text>",
                    self.left + VIEW[0],
                    bottom + 26.0
                )
            } else {
                writeln!(
                    text,
                    "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{name}</text>",
                    self.left - 32.0,
                    TOP + 10.0
                )
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{ColumnLimit, FloorLimit};
    use crate::motion::Motion;
    use dynident_model::InertialParameters;
    use dynident_model::sample::planar_2r;

    /// The planar arm with links of 1 m, first joint turning a quarter, second at rest.
    #[test]
    fn a_quarter_turn_is_a_quarter_circle() {
        let rod = InertialParameters([1.0, 0.5, 0.0, 0.0, 0.1, 0.0, 0.0, 0.4, 0.0, 0.4]);
        let model = planar_2r(1.0, rod, rod);
        let joints: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
        let mut motion = Motion::default();
        let times: Vec<f64> = (0..=90).map(f64::from).collect();
        motion.reset(2, times.len());
        for (sample, time) in times.iter().enumerate() {
            motion.q[sample] = time.to_radians();
        }
        let limits = Limits {
            floor: Some(FloorLimit { height_m: -0.3, points: Vec::new() }),
            column: Some(ColumnLimit { radius_m: 0.2, axis_xy_m: [0.0, 0.0], points: Vec::new() }),
            boxes: vec![BoxLimit { x_m: Some([-0.5, 1.5]), ..BoxLimit::default() }],
            ..Limits::default()
        };
        let sampled = Sampled { joints: &joints, times_s: &times, motion: &motion };
        let svg = path_svg(&sampled, "a < b", &model, &limits).unwrap();
        assert_eq!(svg.matches("class=\"path\"").count(), 2, "one tool, two views");
        // Two joints and a tool in nine poses and two views.
        assert_eq!(svg.matches("class=\"arm\"").count(), 3 * POSES * 2);
        let drawn = ["floor", "column", "box"].map(|class| svg.matches(&format!("class=\"{class}\"")).count());
        assert_eq!(drawn, [1, 2, 2]);
        assert!(!svg.contains("NaN") && !svg.contains("inf") && svg.contains("a &lt; b"));
        // The second joint goes round a circle of 1 m about the base: in the view from above its distance from the base is that in pixels, to a tenth of a pixel and the like of its rounding.
        let first = svg.split("class=\"path\" d=\"M").nth(1).unwrap().split('"').next().unwrap();
        let points: Vec<Vec<f64>> =
            first.split('L').map(|point| point.split(' ').map(|x| x.parse().unwrap()).collect()).collect();
        let base = [points[0][0], points.last().unwrap()[1]];
        let quarter = [points.last().unwrap()[0], points[0][1]];
        let radius = points[0][0] - quarter[0];
        assert!(radius > 50.0 && (quarter[1] - base[1] - radius).abs() < 0.3, "{points:?}");
        for point in &points {
            let distance = (point[0] - quarter[0]).hypot(point[1] - quarter[1]);
            assert!((distance - radius).abs() < 0.3, "{point:?}");
        }
        assert!(path_svg(&Sampled { joints: &joints[..1], ..sampled }, "", &model, &limits).is_err());
    }
}
