//! Curves as a static picture: for documents, for print, and for pages without scripts.

use crate::decimation::kept_samples;
use crate::error::ReportError;
use crate::pen::{Pen, tenth};
use crate::ticks::{short, shortened, ticks};
use core::fmt::Write;
use serde::Serialize;

/// Colours that colour-blind people can distinguish (after Okabe and Ito), with a contrast of at least 3:1 on white.
/// The dark theme has lighter ones (`report.css`).
pub(crate) const COLOURS: [&str; 8] =
    ["#0072b2", "#c24e00", "#00785a", "#a83c7d", "#8a6d00", "#2a7fae", "#7a3fb0", "#5f6368"];

pub(crate) const MAX_MARKED_SAMPLES: usize = 250;
/// Maximum number of characters of a legend name; width of a character and of a line sample, px.
const MAX_NAME_CHARS: usize = 26;
const CHAR_WIDTH: f64 = 6.2;
const LINE_SAMPLE_WIDTH: f64 = 30.0;
/// Height of a legend row, of the strip below the curves, and of the gap between, px.
const LEGEND_ROW_HEIGHT: f64 = 16.0;
const STRIP_HEIGHT: f64 = 84.0;
const STRIP_GAP: f64 = 26.0;

pub(crate) struct Curve<'a> {
    pub(crate) name: &'a str,
    /// One value per entry of the axis; NaN makes a gap.
    pub(crate) values: Vec<f64>,
    pub(crate) dashed: bool,
    /// Points without a line.
    pub(crate) points: bool,
    /// Broad and pale, below other curves.
    pub(crate) broad: bool,
    /// Lower and upper ends of error bars, one per value.
    pub(crate) bars: Option<[Vec<f64>; 2]>,
}

/// Curves over a common axis, and optionally a strip with the difference of two curves. On a logarithmic axis the
/// stored values are exponents of ten.
pub(crate) struct CurvePicture<'a> {
    pub(crate) title: &'a str,
    pub(crate) x_label: &'a str,
    pub(crate) y_label: &'a str,
    pub(crate) x: &'a [f64],
    pub(crate) curves: Vec<Curve<'a>>,
    pub(crate) log_y: bool,
    /// Name of the difference, and indices of the two curves: the second is subtracted from the first.
    pub(crate) difference: Option<(&'a str, [usize; 2])>,
    /// Shaded intervals of the x axis.
    pub(crate) shaded: &'a [[f64; 2]],
    /// Whether the x axis has integers only, with a margin on both sides.
    pub(crate) counts: bool,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Place {
    /// Separate document: white background, title, fixed colours.
    Document,
    /// Section of a page: colours of the light or dark theme.
    Page,
    /// Part of a printed figure: white background, title, black text.
    Print,
}

impl Place {
    pub(crate) fn colour(self, curve: usize) -> String {
        match self {
            Self::Document | Self::Print => COLOURS[curve % COLOURS.len()].to_owned(),
            Self::Page => format!("var(--c{})", curve % COLOURS.len()),
        }
    }

    /// Colour of text and axes.
    pub(crate) fn ink(self) -> &'static str {
        match self {
            Self::Document => "#444",
            Self::Page => "currentColor",
            Self::Print => "#000",
        }
    }
}

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
    fn at_x(&self, x: f64) -> f64 {
        self.left + (x - self.from) / (self.to - self.from) * (self.right - self.left)
    }

    fn at_y(&self, y: f64) -> f64 {
        self.bottom - (y - self.low) / (self.high - self.low) * (self.bottom - self.top)
    }
}

struct Samples<'a> {
    x: &'a [f64],
    kept: Vec<usize>,
}

impl Samples<'_> {
    fn path(&self, values: &[f64], frame: &Frame) -> String {
        let mut pen = Pen::default();
        for &i in &self.kept {
            pen.to([frame.at_x(self.x[i]), frame.at_y(values[i])]);
        }
        pen.path()
    }

    fn points(&self, values: &[f64], frame: &Frame) -> Vec<[f64; 2]> {
        let finite = self.kept.iter().filter(|&&i| values[i].is_finite());
        finite.map(|&i| [tenth(frame.at_x(self.x[i])), tenth(frame.at_y(values[i]))]).collect()
    }

    fn are_marked(&self) -> bool {
        self.kept.len() <= MAX_MARKED_SAMPLES
    }
}

fn strip_view(name: &str, values: &[f64], colour: String, samples: &Samples<'_>, above: &Frame) -> StripView {
    let [low, high] = padded(range(values.iter().copied().chain([0.0])));
    let (top, bottom) = (above.bottom + STRIP_GAP, above.bottom + STRIP_GAP + STRIP_HEIGHT);
    let frame = Frame { top, bottom, low, high, ..*above };
    StripView {
        name: shortened(name, MAX_NAME_CHARS),
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
    /// Description for screen readers: ranges of axis and curves, RMS of the difference.
    pub(crate) fn in_words(&self) -> String {
        let range = |values: &[f64]| {
            let finite = values.iter().copied().filter(|value| value.is_finite());
            let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
            (low <= high).then(|| format!("{} to {}", short(low, 3), short(high, 3)))
        };
        let mut words = format!("{}; {}", self.x_label, range(self.x).unwrap_or_else(|| "empty".to_owned()));
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

    /// Height of the strip with its gap, px; zero without a strip.
    pub(crate) fn strip_height(&self) -> f64 {
        let has_strip = self.difference.is_some_and(|(_, of)| of.iter().all(|curve| *curve < self.curves.len()));
        if has_strip { STRIP_GAP + STRIP_HEIGHT } else { 0.0 }
    }

    fn strip(&self) -> Option<(&str, Vec<f64>)> {
        let (name, [of, less]) = self.difference?;
        let (of, less) = (&self.curves.get(of)?.values, &self.curves.get(less)?.values);
        Some((name, of.iter().zip(less).map(|(of, less)| of - less).collect()))
    }

    /// Renders the picture with `width` by `height` px, plus the strip.
    pub(crate) fn svg(&self, width: f64, height: f64, place: Place) -> Result<String, ReportError> {
        let curves: Vec<Vec<f64>> =
            self.curves.iter().map(|curve| curve.values.iter().map(|y| self.on_axis(*y)).collect()).collect();
        let bars = self.curves.iter().filter_map(|curve| curve.bars.as_ref()).flatten().flatten();
        let bars = bars.map(|y| self.on_axis(*y));
        let [low, high] = padded(range(curves.iter().flatten().copied().chain(bars)));
        let [from, to] = self.x_range();

        let (left, right) = (64.0, width - 12.0);
        let titled = if place == Place::Page { 0.0 } else { 18.0 };
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
        let grown = self.strip_height();
        let whole = |x: &f64| !self.counts || (*x == x.round() && *x >= from && *x <= to);
        let count = if self.counts { ((to - from) as usize).clamp(1, 12) } else { 8 };
        let exact = |y: f64| if self.log_y { 10.0_f64.powf(y) } else { y };
        let view = Picture {
            title: self.title,
            words: self.in_words(),
            document: place != Place::Page,
            ink: place.ink(),
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
            shaded: self.shaded(&frame),
            legend: legend.into_iter().enumerate().map(|(k, entry)| (entry, place.colour(k))).collect(),
        };
        crate::templates::rendered("line_plot.svg", &view)
    }

    /// A value on the y axis: its exponent on a logarithmic axis, NaN if undefined.
    fn on_axis(&self, y: f64) -> f64 {
        match self.log_y {
            true if y > 0.0 => y.log10(),
            true => f64::NAN,
            false => y,
        }
    }

    /// Left end and width of each shaded interval inside the frame, px.
    fn shaded(&self, frame: &Frame) -> Vec<[f64; 2]> {
        let inside = |[from, to]: &[f64; 2]| {
            let [left, right] = [from, to].map(|x| frame.at_x(x.clamp(frame.from, frame.to)));
            (right > left).then(|| [tenth(left), tenth(right - left)])
        };
        self.shaded.iter().filter_map(inside).collect()
    }

    fn x_range(&self) -> [f64; 2] {
        let room = if self.counts { 0.3 } else { 0.0 };
        let from = self.x.first().map_or(0.0, |x| x - room);
        let to = self.x.last().map_or(1.0, |x| x + room);
        [from, if to > from { to } else { from + 1.0 }]
    }

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

    fn legend(&self, left: f64, right: f64, first: f64) -> Vec<LegendView> {
        let (mut x, mut y) = (left, first);
        let entries = self.curves.iter().map(|curve| {
            let name = shortened(curve.name, MAX_NAME_CHARS);
            let width = LINE_SAMPLE_WIDTH + CHAR_WIDTH * name.chars().count() as f64 + 14.0;
            if x > left && x + width > right {
                (x, y) = (left, y + LEGEND_ROW_HEIGHT);
            }
            let entry =
                LegendView { name, x: tenth(x), y, points: curve.points, broad: curve.broad, dashed: curve.dashed };
            x += width;
            entry
        });
        entries.collect()
    }
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let finite = values.filter(|value| value.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
}

/// Adds a margin; a flat or empty range gets a default size.
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
    ink: &'static str,
    width: f64,
    height: f64,
    frame: [f64; 4],
    axis: f64,
    x_label: &'a str,
    y_label: &'a str,
    x_ticks: Vec<(f64, String)>,
    y_ticks: Vec<(f64, String)>,
    lines: Vec<CurveView>,
    strip: Option<StripView>,
    shaded: Vec<[f64; 2]>,
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
