//! Curves as a still picture: for documents, for paper, and for who reads a page without its script.

use crate::decimation::kept_samples;
use crate::error::ReportError;
use crate::pen::{Pen, tenth};
use crate::ticks::{short, ticks};
use core::fmt::Write;
use serde::Serialize;

/// The page's colours: distinguished by people who see colours differently (after Okabe and Ito), three to one and more
/// against white. The page has lighter ones for dark paper (`report.css`).
pub(crate) const COLOURS: [&str; 8] =
    ["#0072b2", "#c24e00", "#00785a", "#a83c7d", "#8a6d00", "#2a7fae", "#7a3fb0", "#5f6368"];

/// Samples up to which each is marked: a line through a few points is no curve.
pub(crate) const MARKED: usize = 250;
/// Letters of a name in the legend, and what a letter and the sample of a line before it take, px.
const LETTERS: usize = 26;
const LETTER: f64 = 6.2;
const SAMPLE: f64 = 30.0;
/// Height of a row of the legend, of the strip below the curves and of the axis between, px.
const LEGEND: f64 = 16.0;
const STRIP: f64 = 84.0;
const BETWEEN: f64 = 26.0;

/// One curve.
pub(crate) struct Curve<'a> {
    pub(crate) name: &'a str,
    /// A value for each entry of the axis; NaN leaves a gap.
    pub(crate) values: Vec<f64>,
    pub(crate) dashed: bool,
    /// Points alone.
    pub(crate) points: bool,
    /// Broad and pale, to lie below others.
    pub(crate) broad: bool,
    /// Lower and upper ends of error bars, none or one for each value.
    pub(crate) bars: Option<[Vec<f64>; 2]>,
}

/// Curves over a common axis, a logarithm's axis as its exponents, and below them the difference of two, if asked for.
pub(crate) struct CurvePicture<'a> {
    pub(crate) title: &'a str,
    pub(crate) x_label: &'a str,
    pub(crate) y_label: &'a str,
    pub(crate) x: &'a [f64],
    pub(crate) curves: Vec<Curve<'a>>,
    pub(crate) log_y: bool,
    /// Name of the difference, and which curve less which.
    pub(crate) difference: Option<(&'a str, [usize; 2])>,
    /// Whole numbers on the axis, with some room before the first and after the last.
    pub(crate) counts: bool,
}

/// Where a picture appears.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Place {
    /// Alone: on white, with its title and colours of its own.
    Document,
    /// Under a headline of a page, in the page's colours, light or dark.
    Page,
}

impl Place {
    /// The colour of a curve.
    fn colour(self, curve: usize) -> String {
        match self {
            Self::Document => COLOURS[curve % COLOURS.len()].to_owned(),
            Self::Page => format!("var(--c{})", curve % COLOURS.len()),
        }
    }
}

/// A rectangle for curves, px, and the ranges of its axes.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    from: f64,
    to: f64,
    low: f64,
    high: f64,
}

impl Frame {
    /// A value of the x axis, px.
    fn at_x(&self, x: f64) -> f64 {
        self.left + (x - self.from) / (self.to - self.from) * (self.right - self.left)
    }

    /// A value of the y axis, px.
    fn at_y(&self, y: f64) -> f64 {
        self.bottom - (y - self.low) / (self.high - self.low) * (self.bottom - self.top)
    }
}

/// The samples that are drawn.
struct Samples<'a> {
    x: &'a [f64],
    kept: Vec<usize>,
}

impl Samples<'_> {
    /// The line through values of the y axis.
    fn path(&self, values: &[f64], frame: &Frame) -> String {
        let mut pen = Pen::default();
        for &i in &self.kept {
            pen.to([frame.at_x(self.x[i]), frame.at_y(values[i])]);
        }
        pen.path()
    }

    /// The points of the finite values of the y axis.
    fn points(&self, values: &[f64], frame: &Frame) -> Vec<[f64; 2]> {
        let finite = self.kept.iter().filter(|&&i| values[i].is_finite());
        finite.map(|&i| [tenth(frame.at_x(self.x[i])), tenth(frame.at_y(values[i]))]).collect()
    }

    /// Whether each sample is marked.
    fn are_marked(&self) -> bool {
        self.kept.len() <= MARKED
    }
}

/// The difference of two curves, in a strip below the frame.
fn strip_view(name: &str, values: &[f64], colour: String, samples: &Samples<'_>, above: &Frame) -> StripView {
    let [low, high] = padded(range(values.iter().copied().chain([0.0])));
    let (top, bottom) = (above.bottom + BETWEEN, above.bottom + BETWEEN + STRIP);
    let frame = Frame { top, bottom, low, high, ..*above };
    StripView {
        name: shortened(name),
        colour,
        top,
        bottom,
        zero: tenth(frame.at_y(0.0)),
        ticks: ticks(low, high, 3).into_iter().map(|y| (tenth(frame.at_y(y)), short(y, 3))).collect(),
        path: samples.path(values, &frame),
        points: if samples.are_marked() { samples.points(values, &frame) } else { Vec::new() },
    }
}

impl CurvePicture<'_> {
    /// What a person who does not see the picture is told: ranges of axis and curves, size of the difference.
    pub(crate) fn in_words(&self) -> String {
        let range = |values: &[f64]| {
            let finite = values.iter().copied().filter(|value| value.is_finite());
            let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
            (low <= high).then(|| format!("{} to {}", short(low, 3), short(high, 3)))
        };
        let mut words = format!("{}; {}", self.x_label, range(self.x).unwrap_or_else(|| "empty".to_owned()));
        // Writing to a string cannot fail.
        for curve in &self.curves {
            let range = range(&curve.values).unwrap_or_else(|| "no values".to_owned());
            let _ = write!(words, "; {}: {range}", curve.name);
        }
        if let Some((name, values)) = self.strip() {
            let squares: Vec<f64> =
                values.iter().filter(|value| value.is_finite()).map(|value| value * value).collect();
            if !squares.is_empty() {
                let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
                let _ = write!(words, "; {name}: root mean square {}", short(rms, 3));
            }
        }
        words + &format!("; in {}", self.y_label)
    }

    /// The difference of two curves.
    fn strip(&self) -> Option<(&str, Vec<f64>)> {
        let (name, [of, less]) = self.difference?;
        let (of, less) = (&self.curves.get(of)?.values, &self.curves.get(less)?.values);
        Some((name, of.iter().zip(less).map(|(of, less)| of - less).collect()))
    }

    /// The picture, `width` by `height` px without the strip.
    pub(crate) fn svg(&self, width: f64, height: f64, place: Place) -> Result<String, ReportError> {
        let curves: Vec<Vec<f64>> =
            self.curves.iter().map(|curve| curve.values.iter().map(|y| self.on_axis(*y)).collect()).collect();
        let bars = self.curves.iter().filter_map(|curve| curve.bars.as_ref()).flatten().flatten();
        let bars = bars.map(|y| self.on_axis(*y));
        let [low, high] = padded(range(curves.iter().flatten().copied().chain(bars)));
        let [from, to] = self.x_range();

        // The frame, below the title and the legend.
        let (left, right) = (64.0, width - 12.0);
        let titled = if place == Place::Document { 18.0 } else { 0.0 };
        let legend = self.legend(left, right, titled + 12.0);
        let top = legend.last().map_or(titled, |entry| entry.y) + 8.0;
        let frame = Frame { left, right, top, bottom: height - 42.0, from, to, low, high };
        let strip = self.strip();
        let views: Vec<&[f64]> =
            curves.iter().map(|curve| &curve[..]).chain(strip.iter().map(|(_, values)| &values[..])).collect();
        let kept = kept_samples(self.x, &views, ((right - left) / 2.0).max(1.0) as usize);
        let samples = Samples { x: self.x, kept };

        let lines = self.curves.iter().zip(&curves).enumerate();
        let lines = lines.map(|(k, (curve, values))| self.line(curve, values, place.colour(k), &samples, &frame));
        let lines = lines.collect();
        let strip =
            strip.map(|(name, values)| strip_view(name, &values, place.colour(self.curves.len()), &samples, &frame));
        let grown = strip.as_ref().map_or(0.0, |_| BETWEEN + STRIP);
        let whole = |x: &f64| !self.counts || (*x == x.round() && *x >= from && *x <= to);
        let count = if self.counts { ((to - from) as usize).clamp(1, 12) } else { 8 };
        let exact = |y: f64| if self.log_y { 10.0_f64.powf(y) } else { y };
        let view = Picture {
            title: self.title,
            words: self.in_words(),
            document: place == Place::Document,
            width,
            height: height + grown,
            frame: [left, top, right, frame.bottom],
            axis: frame.bottom + grown,
            x_label: self.x_label,
            y_label: self.y_label,
            x_ticks: (ticks(from, to, count).into_iter().filter(whole))
                .map(|x| (tenth(frame.at_x(x)), short(x, 4)))
                .collect(),
            y_ticks: ticks(low, high, 5).into_iter().map(|y| (tenth(frame.at_y(y)), short(exact(y), 3))).collect(),
            lines,
            strip,
            legend: legend.into_iter().enumerate().map(|(k, entry)| (entry, place.colour(k))).collect(),
        };
        crate::templates::rendered("line_plot.svg", &view)
    }

    /// A value on the y axis: its exponent on a logarithmic one, NaN if it has none.
    fn on_axis(&self, y: f64) -> f64 {
        match self.log_y {
            true if y > 0.0 => y.log10(),
            true => f64::NAN,
            false => y,
        }
    }

    /// The first and the last value of the x axis.
    fn x_range(&self) -> [f64; 2] {
        let room = if self.counts { 0.3 } else { 0.0 };
        let from = self.x.first().map_or(0.0, |x| x - room);
        let to = self.x.last().map_or(1.0, |x| x + room);
        [from, if to > from { to } else { from + 1.0 }]
    }

    /// One curve, whose values on the y axis are `values`.
    fn line(
        &self,
        curve: &Curve<'_>,
        values: &[f64],
        colour: String,
        samples: &Samples<'_>,
        frame: &Frame,
    ) -> CurveView {
        let whiskers = curve.bars.as_ref().map(|[lower, upper]| {
            let ends = |&i: &usize| -> Option<String> {
                let end = |ends: &[f64]| ends.get(i).copied().map(|y| self.on_axis(y)).filter(|y| y.is_finite());
                let (x, upper) = (tenth(frame.at_x(self.x[i])), tenth(frame.at_y(end(upper)?)));
                let lower = tenth(end(lower).map_or(frame.bottom, |y| frame.at_y(y)));
                let left = tenth(x - 4.0);
                Some(format!("M{x} {upper}V{lower}M{left} {upper}h8M{left} {lower}h8"))
            };
            samples.kept.iter().filter(|&&i| values[i].is_finite()).filter_map(ends).collect::<String>()
        });
        let has_points = curve.points || (samples.are_marked() && !curve.broad);
        CurveView {
            colour,
            dashed: curve.dashed,
            broad: curve.broad,
            path: if curve.points { String::new() } else { samples.path(values, frame) },
            whiskers: whiskers.unwrap_or_default(),
            points: if has_points { samples.points(values, frame) } else { Vec::new() },
        }
    }

    /// The names, each next to a sample of its line, in rows.
    fn legend(&self, left: f64, right: f64, first: f64) -> Vec<LegendView> {
        let (mut x, mut y) = (left, first);
        let entries = self.curves.iter().map(|curve| {
            let name = shortened(curve.name);
            let width = SAMPLE + LETTER * name.chars().count() as f64 + 14.0;
            if x > left && x + width > right {
                (x, y) = (left, y + LEGEND);
            }
            let entry =
                LegendView { name, x: tenth(x), y, points: curve.points, broad: curve.broad, dashed: curve.dashed };
            x += width;
            entry
        });
        entries.collect()
    }
}

/// The first letters of a long name.
fn shortened(name: &str) -> String {
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    name.chars().take(LETTERS - 1).chain(['…']).collect()
}

/// The least and the largest finite value.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let finite = values.filter(|value| value.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
}

/// A little air above and below; a flat or empty range gets one of its own.
fn padded(bounds: [f64; 2]) -> [f64; 2] {
    let [low, high] = bounds;
    if !(low.is_finite() && high.is_finite()) {
        return [0.0, 1.0];
    }
    let air = if high > low { 0.05 * (high - low) } else { (0.1 * low.abs()).max(1e-12) };
    [low - air, high + air]
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    words: String,
    document: bool,
    width: f64,
    height: f64,
    frame: [f64; 4],
    /// Where the x axis has its numbers.
    axis: f64,
    x_label: &'a str,
    y_label: &'a str,
    x_ticks: Vec<(f64, String)>,
    y_ticks: Vec<(f64, String)>,
    lines: Vec<CurveView>,
    strip: Option<StripView>,
    legend: Vec<(LegendView, String)>,
}

#[derive(Serialize)]
struct CurveView {
    colour: String,
    dashed: bool,
    broad: bool,
    path: String,
    whiskers: String,
    points: Vec<[f64; 2]>,
}

#[derive(Serialize)]
struct StripView {
    name: String,
    colour: String,
    top: f64,
    bottom: f64,
    zero: f64,
    ticks: Vec<(f64, String)>,
    path: String,
    points: Vec<[f64; 2]>,
}

#[derive(Serialize)]
struct LegendView {
    name: String,
    x: f64,
    y: f64,
    points: bool,
    broad: bool,
    dashed: bool,
}
