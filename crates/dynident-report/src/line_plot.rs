//! Curves over a common axis.

use crate::decimation::kept_samples;
use crate::error::ReportError;
use crate::pen::{Pen, tenth};
use crate::plot_data::{CurveData, PlotData, check_axis, check_length, rounded};
use crate::ticks::{short, ticks};
use serde::Serialize;

/// Pixel columns that a curve is drawn for.
const COLUMNS: usize = 1200;

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Its name in the legend.
    pub name: String,
    /// A value for each entry of the axis; NaN leaves a gap.
    pub values: Vec<f64>,
    /// Drawn dashed.
    pub dashed: bool,
    /// Drawn as points without a line.
    pub points: bool,
}

/// Curves over a common axis: zoomed by dragging, values under the pointer, curves switched in the legend.
///
/// Of more than 4800 samples the page holds the least and the largest of each of 1200 pixel columns
/// ([`kept_samples`](crate::kept_samples)): nothing that shows is lost, but zooming in adds no detail.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinePlot {
    /// Headline.
    pub title: String,
    /// A sentence below it; may be empty.
    pub note: String,
    /// What the x axis is, with its unit.
    pub x_label: String,
    /// What the y axis is, with its unit.
    pub y_label: String,
    /// The axis: finite, not decreasing.
    pub x: Vec<f64>,
    /// The curves.
    pub lines: Vec<Line>,
    /// Logarithmic y axis; values that are not positive leave gaps.
    pub log_y: bool,
}

impl LinePlot {
    /// A plot without curves.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>, y_label: impl Into<String>, x: Vec<f64>) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            x,
            lines: Vec::new(),
            log_y: false,
        }
    }

    /// A sentence below the headline.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// A further curve.
    #[must_use]
    pub fn line(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: false, points: false });
        self
    }

    /// A further curve, dashed.
    #[must_use]
    pub fn dashed(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: true, points: false });
        self
    }

    /// A further curve, as points.
    #[must_use]
    pub fn points(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: false, points: true });
        self
    }

    /// The y axis logarithmic.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.log_y = true;
        self
    }

    fn check(&self) -> Result<(), ReportError> {
        check_axis(&self.title, &self.x)?;
        self.lines.iter().try_for_each(|line| check_length(&self.title, &line.name, line.values.len(), self.x.len()))
    }

    /// A value as it can be drawn.
    fn drawn(&self, value: f64) -> f64 {
        if self.log_y && value <= 0.0 { f64::NAN } else { value }
    }

    pub(crate) fn data(&self) -> Result<String, ReportError> {
        self.check()?;
        let curves: Vec<&[f64]> = self.lines.iter().map(|line| &line.values[..]).collect();
        let kept = kept_samples(&self.x, &curves, COLUMNS);
        let curve = |line: &Line| kept.iter().map(|&i| rounded(self.drawn(line.values[i]))).collect();
        PlotData {
            // Times keep their digits: at seven, a long log's samples would fall together.
            x: kept.iter().map(|&i| self.x[i]).collect(),
            curves: self
                .lines
                .iter()
                .map(|line| CurveData {
                    name: &line.name,
                    y: curve(line),
                    dashed: line.dashed,
                    points: line.points,
                    bars: None,
                })
                .collect(),
            x_label: &self.x_label,
            y_label: &self.y_label,
            log: self.log_y,
            counts: false,
        }
        .embedded()
    }

    /// The same as a still picture of `width` by `height` px, for documents.
    ///
    /// # Errors
    /// As [`Report::html`](crate::Report::html).
    pub fn svg(&self, width: f64, height: f64) -> Result<String, ReportError> {
        self.check()?;
        let value = |x: f64| if self.log_y { self.drawn(x).log10() } else { x };
        let curves: Vec<Vec<f64>> =
            self.lines.iter().map(|line| line.values.iter().map(|x| value(*x)).collect()).collect();
        let all = curves.iter().flatten().copied().filter(|x| x.is_finite());
        let [low, high] = padded(all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]));
        let (from, to) = (self.x.first().copied().unwrap_or(0.0), self.x.last().copied().unwrap_or(1.0));
        let to = if to > from { to } else { from + 1.0 };
        let (left, top, right, bottom) = (64.0, 34.0, width - 12.0, height - 42.0);
        let at_x = |x: f64| left + (x - from) / (to - from) * (right - left);
        let at_y = |y: f64| bottom - (y - low) / (high - low) * (bottom - top);
        let views: Vec<&[f64]> = curves.iter().map(|curve| &curve[..]).collect();
        let kept = kept_samples(&self.x, &views, (right - left).max(1.0) as usize);
        let path = |curve: &Vec<f64>| {
            let mut pen = Pen::default();
            for &i in &kept {
                pen.to([at_x(self.x[i]), at_y(curve[i])]);
            }
            pen.path()
        };
        let lines = self.lines.iter().zip(&curves).enumerate().map(|(k, (line, curve))| {
            let points = kept.iter().filter(|&&i| line.points && curve[i].is_finite());
            CurveView {
                name: &line.name,
                colour: COLOURS[k % COLOURS.len()],
                dashed: line.dashed,
                path: if line.points { String::new() } else { path(curve) },
                points: points.map(|&i| [tenth(at_x(self.x[i])), tenth(at_y(curve[i]))]).collect(),
                legend_x: left + 130.0 * k as f64,
            }
        });
        let exact = |y: f64| if self.log_y { 10.0_f64.powf(y) } else { y };
        let view = Picture {
            title: &self.title,
            width,
            height,
            frame: [left, top, right, bottom],
            x_label: &self.x_label,
            y_label: &self.y_label,
            x_ticks: ticks(from, to, 6).into_iter().map(|x| (tenth(at_x(x)), short(x, 4))).collect(),
            y_ticks: ticks(low, high, 5).into_iter().map(|y| (tenth(at_y(y)), short(exact(y), 3))).collect(),
            lines: lines.collect(),
        };
        crate::templates::rendered("line_plot.svg", &view)
    }
}

/// The page's colours: distinguished by people who see colours differently (Okabe and Ito), and dark enough on white.
pub(crate) const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#7a3fb0", "#5f6368"];

/// A little air above and below; a flat or empty range gets one of its own.
fn padded([low, high]: [f64; 2]) -> [f64; 2] {
    if !(low.is_finite() && high.is_finite()) {
        return [0.0, 1.0];
    }
    let air = if high > low { 0.05 * (high - low) } else { (0.1 * low.abs()).max(1e-12) };
    [low - air, high + air]
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    width: f64,
    height: f64,
    frame: [f64; 4],
    x_label: &'a str,
    y_label: &'a str,
    x_ticks: Vec<(f64, String)>,
    y_ticks: Vec<(f64, String)>,
    lines: Vec<CurveView<'a>>,
}

#[derive(Serialize)]
struct CurveView<'a> {
    name: &'a str,
    colour: &'a str,
    dashed: bool,
    path: String,
    points: Vec<[f64; 2]>,
    legend_x: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> LinePlot {
        LinePlot::new("a <b>", "t, s", "τ, Nm", vec![0.0, 1.0, 2.0, 3.0]).line("x", vec![1.0, f64::NAN, -2.0, 1e-9])
    }

    #[test]
    fn gaps_are_null_and_break_the_picture() {
        assert!(plot().data().unwrap().contains("[1.0,null,-2.0,1e-9]"));
        let svg = plot().svg(400.0, 200.0).unwrap();
        let curve = svg.lines().find(|line| line.contains(COLOURS[0])).unwrap();
        assert_eq!((curve.matches('M').count(), curve.matches('L').count()), (2, 1), "{curve}");
        assert!(svg.contains("a &lt;b&gt;") && !svg.contains("NaN"));
    }

    #[test]
    fn a_logarithmic_axis_has_no_place_for_what_is_not_positive() {
        assert!(plot().log_y().data().unwrap().contains("[1.0,null,null,1e-9]"));
        assert!(!plot().log_y().svg(400.0, 200.0).unwrap().contains("NaN"));
    }

    #[test]
    fn odd_plots_are_drawn_or_refused() {
        let empty = LinePlot::new("empty", "", "", Vec::new());
        assert!(empty.data().is_ok() && !empty.svg(300.0, 100.0).unwrap().contains("NaN"));
        let all_gap = LinePlot::new("gap", "", "", vec![1.0]).line("x", vec![f64::NAN]).points("y", vec![2.0]);
        assert!(!all_gap.svg(300.0, 100.0).unwrap().contains("NaN"));
        let short = plot().line("y", vec![1.0]);
        assert!(short.data().unwrap_err().to_string().contains("`y` has 1 entries where 4"));
        let backwards = LinePlot::new("b", "", "", vec![1.0, 0.5]);
        assert!(backwards.data().unwrap_err().to_string().contains("entry 1"));
    }
}
