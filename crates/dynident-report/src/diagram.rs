//! Diagrams of boxes, arrows and texts.

use crate::curve_picture::Place;
use crate::error::ReportError;
use serde::Serialize;

/// Width of a character and height of a line in 13 px type, px.
const CHAR_WIDTH: f64 = 6.8;
const LINE_HEIGHT: f64 = 17.0;

/// Line style.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LineStyle {
    /// Thin.
    Thin,
    /// Thin and dashed, for auxiliary lines: axes of symmetry, dimensions.
    Dashed,
    /// Thin, with an arrowhead at the end.
    Arrow,
    /// Broad, for solid parts: the links of a robot.
    Broad,
}

/// A shape of a diagram, coordinates in px from the upper left corner.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "shape")]
pub enum Shape {
    /// A box with centred lines of text.
    Box {
        /// Centre.
        at: [f64; 2],
        /// Width and height.
        size: [f64; 2],
        /// Lines of text.
        lines: Vec<String>,
        /// Whether it is a diamond (a decision in a flow chart).
        decision: bool,
    },
    /// A line through points.
    Line {
        /// The points.
        points: Vec<[f64; 2]>,
        /// Line style.
        style: LineStyle,
    },
    /// A ring, filled with the background colour.
    Ring {
        /// Centre.
        at: [f64; 2],
        /// Radius.
        radius: f64,
    },
    /// A text.
    Word {
        /// Start of its baseline, or its centre.
        at: [f64; 2],
        /// Text.
        text: String,
        /// Whether `at` is the centre.
        centred: bool,
    },
}

/// A diagram of boxes, lines and texts, with a description for screen readers.
///
/// ```
/// use dynident_report::{Diagram, LineStyle, Shape};
/// let chart = Diagram::new("Two steps", "measure, then identify", [300.0, 160.0])
///     .boxed([150.0, 30.0], [200.0, 36.0], &["measure"])
///     .line(&[[150.0, 48.0], [150.0, 100.0]], LineStyle::Arrow)
///     .boxed([150.0, 118.0], [200.0, 36.0], &["identify"]);
/// assert!(matches!(chart.shapes[1], Shape::Line { .. }));
/// assert!(chart.svg()?.contains("identify"));
/// # Ok::<(), dynident_report::ReportError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Diagram {
    /// Title.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Description for screen readers.
    pub words: String,
    /// Width and height, px.
    pub size: [f64; 2],
    /// Shapes in drawing order.
    pub shapes: Vec<Shape>,
}

impl Diagram {
    /// Creates a diagram without shapes.
    pub fn new(title: impl Into<String>, words: impl Into<String>, size: [f64; 2]) -> Self {
        Self { title: title.into(), note: String::new(), words: words.into(), size, shapes: Vec::new() }
    }

    /// Sets the note below the title.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a box with lines of text; it grows to the width of the longest line.
    #[must_use]
    pub fn boxed(self, at: [f64; 2], size: [f64; 2], lines: &[&str]) -> Self {
        self.framed(at, size, lines, false)
    }

    /// Adds a diamond with lines of text.
    #[must_use]
    pub fn decision(self, at: [f64; 2], size: [f64; 2], lines: &[&str]) -> Self {
        self.framed(at, size, lines, true)
    }

    fn framed(mut self, at: [f64; 2], size: [f64; 2], lines: &[&str], decision: bool) -> Self {
        let [width, height] = size;
        let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0) as f64;
        // The text of a diamond needs more width than that of a box, because a diamond is narrower above and below
        // its centre.
        let room = if decision { 1.7 } else { 1.0 };
        let size =
            [width.max(room * CHAR_WIDTH * longest + 12.0), height.max(room * LINE_HEIGHT * lines.len() as f64 + 8.0)];
        let lines = lines.iter().map(|&line| line.to_owned()).collect();
        self.shapes.push(Shape::Box { at, size, lines, decision });
        self
    }

    /// Adds a line.
    #[must_use]
    pub fn line(mut self, points: &[[f64; 2]], style: LineStyle) -> Self {
        self.shapes.push(Shape::Line { points: points.to_vec(), style });
        self
    }

    /// Adds a ring.
    #[must_use]
    pub fn ring(mut self, at: [f64; 2], radius: f64) -> Self {
        self.shapes.push(Shape::Ring { at, radius });
        self
    }

    /// Adds a text that starts at `at`.
    #[must_use]
    pub fn word(mut self, at: [f64; 2], text: impl Into<String>) -> Self {
        self.shapes.push(Shape::Word { at, text: text.into(), centred: false });
        self
    }

    /// Renders the diagram as SVG on white, for documents.
    ///
    /// # Errors
    /// If the template fails.
    pub fn svg(&self) -> Result<String, ReportError> {
        self.picture(Place::Document)
    }

    pub(crate) fn picture(&self, place: Place) -> Result<String, ReportError> {
        let shapes = self.shapes.iter().map(|shape| match shape {
            Shape::Box { at: [x, y], size: [w, h], lines, decision } => {
                let (left, right, up, down) = (x - 0.5 * w, x + 0.5 * w, y - 0.5 * h, y + 0.5 * h);
                let path = if *decision {
                    format!("M{x} {up}L{right} {y}L{x} {down}L{left} {y}z")
                } else {
                    format!("M{left} {up}H{right}V{down}H{left}z")
                };
                let first = y + 4.5 - 0.5 * LINE_HEIGHT * (lines.len() as f64 - 1.0);
                let words =
                    lines.iter().enumerate().map(|(k, text)| (*x, first + LINE_HEIGHT * k as f64, text.as_str()));
                ShapeView { kind: "box", path, words: words.collect(), centred: true }
            }
            Shape::Line { points, style } => {
                let corner = |(k, [x, y]): (usize, &[f64; 2])| format!("{}{x} {y}", if k == 0 { 'M' } else { 'L' });
                let mut path: String = points.iter().enumerate().map(corner).collect();
                if *style == LineStyle::Arrow {
                    path += &head(points);
                }
                let kind = match style {
                    LineStyle::Thin | LineStyle::Arrow => "thin",
                    LineStyle::Dashed => "dashed",
                    LineStyle::Broad => "broad",
                };
                ShapeView { kind, path, words: Vec::new(), centred: false }
            }
            Shape::Ring { at: [x, y], radius: r } => {
                let path = format!("M{} {y}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 {} 0z", x - r, 2.0 * r, -2.0 * r);
                ShapeView { kind: "box", path, words: Vec::new(), centred: false }
            }
            Shape::Word { at: [x, y], text, centred } => {
                ShapeView { kind: "word", path: String::new(), words: vec![(*x, *y, text)], centred: *centred }
            }
        });
        let view = Picture {
            title: &self.title,
            words: &self.words,
            document: place == Place::Document,
            size: self.size,
            shapes: shapes.collect(),
        };
        crate::templates::rendered("diagram.svg", &view)
    }
}

/// Path of an arrowhead at the end of a line.
fn head(points: &[[f64; 2]]) -> String {
    let [.., [x0, y0], [x1, y1]] = points else { return String::new() };
    let length = (x1 - x0).hypot(y1 - y0);
    if length <= 0.0 {
        return String::new();
    }
    let (ux, uy) = ((x1 - x0) / length, (y1 - y0) / length);
    // 9 px long, 4.5 px to each side.
    let end = |side: f64| [x1 - 9.0 * ux - side * 4.5 * uy, y1 - 9.0 * uy + side * 4.5 * ux];
    let ([ax, ay], [bx, by]) = (end(1.0), end(-1.0));
    format!("M{ax:.1} {ay:.1}L{x1} {y1}L{bx:.1} {by:.1}")
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    words: &'a str,
    document: bool,
    size: [f64; 2],
    shapes: Vec<ShapeView<'a>>,
}

#[derive(Serialize)]
struct ShapeView<'a> {
    kind: &'static str,
    path: String,
    words: Vec<(f64, f64, &'a str)>,
    centred: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_and_frames_hold_their_words() {
        let long = "a name that is wider than its frame <b>";
        let chart = Diagram::new("t", "words", [400.0, 200.0])
            .boxed([200.0, 50.0], [20.0, 10.0], &[long])
            .line(&[[0.0, 0.0], [0.0, 0.0]], LineStyle::Arrow)
            .line(&[[0.0, 0.0], [30.0, 40.0]], LineStyle::Arrow)
            .ring([10.0, 10.0], 4.0)
            .word([5.0, 5.0], "θ₁ & φ");
        let svg = chart.svg().unwrap();
        assert!(svg.contains("&lt;b&gt;") && svg.contains("θ₁ &amp; φ") && !svg.contains("NaN"), "{svg}");
        assert!(
            matches!(&chart.shapes[0], Shape::Box { size: [width, height], .. } if *width > 200.0 && *height > 17.0)
        );
        // Arrowhead from (0, 0) to (30, 40): 9 px back along the line, 4.5 px to each side.
        assert!(svg.contains("L30 40") && svg.contains("M21.0 35.5"), "{svg}");
        assert!(svg.contains("role=\"img\" aria-label=\"t: words\""));
    }
}
