//! The still picture of a scene.

use crate::error::ReportError;
use crate::palette::PALETTE;
use crate::scene::Scene;
use crate::surface::{cross, dot, norm};
use crate::templates::rendered;
use minijinja::context;
use std::fmt::Write as _;

/// Triangles of the picture, visible and hidden; more would make the page larger and no clearer.
const MAX_TRIANGLES: usize = 5000;

/// Width and height, px.
const SIZE: [f64; 2] = [560.0, 420.0];

const MARGIN: f64 = 16.0;

/// Direction to the viewer: 40° to the right of x, 20° above the horizon; and the axes of the picture.
const VIEW: [[f64; 3]; 3] = [
    [-0.642_787_6, 0.766_044_4, 0.0],
    [-0.262_002_6, -0.219_846_3, 0.939_692_6],
    [0.719_846_3, 0.604_022_8, 0.342_020_1],
];

/// Direction to the light.
const LIGHT: [f64; 3] = [0.35, -0.25, 0.9];

impl Scene {
    /// Renders the robot at [`Scene::posture`] as SVG, coloured by the first colouring; `document` adds a white ground.
    ///
    /// # Errors
    /// Lists with inconsistent lengths.
    pub fn svg(&self, document: bool) -> Result<String, ReportError> {
        self.data()?;
        let mut faces: Vec<(f64, String, [[f64; 2]; 3])> = Vec::new();
        let light = LIGHT.map(|x| x / norm(LIGHT));
        for (index, surface) in self.surfaces(MAX_TRIANGLES).into_iter().enumerate() {
            let (rotation, origin) = &self.bodies[index].pose;
            let surface = surface.placed(rotation, *origin);
            let class = self.colourings.first().and_then(|colouring| Some(colouring.classes[colouring.of[index]?].1));
            let colour = PALETTE[class.unwrap_or(7) % 8];
            for &triangle in &surface.triangles {
                let [a, b, c] = surface.corners(triangle);
                let edge = |to: [f64; 3]| std::array::from_fn(|k| to[k] - a[k]);
                let normal = cross(edge(b), edge(c));
                let area = norm(normal);
                if area <= 0.0 || dot(normal, VIEW[2]) <= 0.0 {
                    continue;
                }
                let shade = 0.55 + 0.45 * (dot(normal, light) / area).max(0.0);
                let [red, green, blue] = colour.map(|part| (part * shade).round());
                let depth = [a, b, c].iter().map(|corner| dot(*corner, VIEW[2])).sum::<f64>();
                let seen = [a, b, c].map(|corner| [dot(corner, VIEW[0]), -dot(corner, VIEW[1])]);
                faces.push((depth, format!("#{:02x}{:02x}{:02x}", red as u8, green as u8, blue as u8), seen));
            }
        }
        faces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let corners = || faces.iter().flat_map(|face| face.2);
        let range =
            |axis: usize| corners().map(|p| p[axis]).fold([f64::MAX, f64::MIN], |[a, b], x| [a.min(x), b.max(x)]);
        let [[left, right], [up, down]] = if faces.is_empty() { [[0.0, 1.0]; 2] } else { [range(0), range(1)] };
        let scale = ((SIZE[0] - 2.0 * MARGIN) / (right - left)).min((SIZE[1] - 2.0 * MARGIN) / (down - up));
        let mut paths = String::new();
        for (_, colour, seen) in &faces {
            let [a, b, c] = seen.map(|[x, y]| {
                [0.5 * SIZE[0] + scale * (x - 0.5 * (left + right)), 0.5 * SIZE[1] + scale * (y - 0.5 * (up + down))]
            });
            // Writing to a string cannot fail.
            let _ = writeln!(
                paths,
                "<path fill=\"{colour}\" stroke=\"{colour}\" d=\"M{:.1} {:.1}L{:.1} {:.1} {:.1} {:.1}z\"/>",
                a[0], a[1], b[0], b[1], c[0], c[1]
            );
        }
        let paths = minijinja::Value::from_safe_string(paths);
        rendered("scene.svg", &context! { size => SIZE, title => self.title, words => self.words, paths, document })
    }
}
