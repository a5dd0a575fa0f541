//! Curves over a common axis.

use crate::curve_picture::{Curve, CurvePicture, Place};
use crate::decimation::kept_samples;
use crate::error::ReportError;
use crate::plot_data::{CurveData, PlotData, StripData, check_axis, check_length, embedded, rounded, rounded_time};

const PIXEL_COLUMNS: usize = 1200;

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// One value per entry of the axis; NaN makes a gap.
    pub values: Vec<f64>,
    /// Drawn dashed.
    pub dashed: bool,
    /// Drawn as points without a line.
    pub points: bool,
    /// Broad and pale, so that differences to a curve above are visible.
    pub broad: bool,
}

/// Curves over a common axis. The plot shows the values at the cursor, zooms by dragging, and shows or hides curves
/// by their legend.
///
/// For more than 4800 samples the page contains the minimum and maximum of each of 1200 pixel columns
/// ([`kept_samples`](crate::kept_samples)): the plot looks the same, but zooming adds no detail.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinePlot {
    /// Title.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// The axis: finite, not decreasing.
    pub x: Vec<f64>,
    /// The curves.
    pub lines: Vec<Line>,
    /// Logarithmic y axis; values that are not positive give gaps.
    pub log_y: bool,
    /// Strip with the difference of two curves on a separate scale: its name, and the indices of the two curves, of
    /// which the second is subtracted from the first.
    pub difference: Option<(String, [usize; 2])>,
    /// Joint that the plot belongs to; the plot is hidden if another joint is chosen in the picture of the robot.
    /// Empty if it belongs to no joint.
    pub joint: String,
    /// Shaded intervals of the x axis.
    pub shaded: Vec<[f64; 2]>,
}

impl LinePlot {
    /// Creates a plot without curves.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>, y_label: impl Into<String>, x: Vec<f64>) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            x,
            lines: Vec::new(),
            log_y: false,
            difference: None,
            joint: String::new(),
            shaded: Vec::new(),
        }
    }

    /// Sets the joint that the plot belongs to.
    #[must_use]
    pub fn of_joint(mut self, joint: impl Into<String>) -> Self {
        self.joint = joint.into();
        self
    }

    /// Sets the note below the title.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a curve.
    #[must_use]
    pub fn line(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: false, points: false, broad: false });
        self
    }

    /// Adds a dashed curve.
    #[must_use]
    pub fn dashed(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: true, points: false, broad: false });
        self
    }

    /// Adds a curve as points.
    #[must_use]
    pub fn points(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: false, points: true, broad: false });
        self
    }

    /// Adds a broad, pale curve, below other curves.
    #[must_use]
    pub fn broad(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.lines.push(Line { name: name.into(), values, dashed: false, points: false, broad: true });
        self
    }

    /// Adds a strip with curve `of` minus curve `less` (indices from 0), on a separate scale.
    #[must_use]
    pub fn difference(mut self, name: impl Into<String>, of: usize, less: usize) -> Self {
        self.difference = Some((name.into(), [of, less]));
        self
    }

    /// Shades an interval of the x axis.
    #[must_use]
    pub fn shaded(mut self, from: f64, to: f64) -> Self {
        self.shaded.push([from, to]);
        self
    }

    /// Makes the y axis logarithmic.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.log_y = true;
        self
    }

    pub(crate) fn check(&self) -> Result<(), ReportError> {
        check_axis(&self.title, &self.x)?;
        if let Some((name, of)) = &self.difference {
            let largest = of.iter().max().map_or(0, |largest| largest + 1);
            check_length(&self.title, name, self.lines.len(), largest.max(self.lines.len()))?;
        }
        self.lines.iter().try_for_each(|line| check_length(&self.title, &line.name, line.values.len(), self.x.len()))
    }

    fn drawn(&self, value: f64) -> f64 {
        if self.log_y && value <= 0.0 { f64::NAN } else { value }
    }

    pub(crate) fn data(&self) -> Result<String, ReportError> {
        self.check()?;
        let strip = self.difference.as_ref().map(|(_, [of, less])| -> Vec<f64> {
            let pairs = self.lines[*of].values.iter().zip(&self.lines[*less].values);
            pairs.map(|(of, less)| of - less).collect()
        });
        let curves: Vec<&[f64]> = self.lines.iter().map(|line| &line.values[..]).chain(strip.as_deref()).collect();
        let kept = kept_samples(&self.x, &curves, PIXEL_COLUMNS);
        let curve = |line: &Line| kept.iter().map(|&i| rounded(self.drawn(line.values[i]))).collect();
        embedded(&PlotData {
            x: kept.iter().map(|&i| rounded_time(self.x[i])).collect(),
            curves: self
                .lines
                .iter()
                .map(|line| CurveData {
                    name: &line.name,
                    y: curve(line),
                    dashed: line.dashed,
                    points: line.points,
                    broad: line.broad,
                    bars: None,
                })
                .collect(),
            strip: self.difference.as_ref().map(|(name, of)| StripData { name, of: *of }),
            shaded: &self.shaded,
            x_label: &self.x_label,
            y_label: &self.y_label,
            log: self.log_y,
            counts: false,
        })
    }

    /// Renders the plot as a static SVG of `width` by `height` px, for documents.
    ///
    /// # Errors
    /// Same as for [`Report::html`](crate::Report::html).
    pub fn svg(&self, width: f64, height: f64) -> Result<String, ReportError> {
        self.check()?;
        self.picture().svg(width, height, Place::Document)
    }

    pub(crate) fn picture(&self) -> CurvePicture<'_> {
        let curve = |line: &'_ Line| -> Vec<f64> { line.values.iter().map(|value| self.drawn(*value)).collect() };
        CurvePicture {
            title: &self.title,
            x_label: &self.x_label,
            y_label: &self.y_label,
            x: &self.x,
            curves: (self.lines.iter())
                .map(|line| Curve {
                    name: &line.name,
                    values: curve(line),
                    dashed: line.dashed,
                    points: line.points,
                    broad: line.broad,
                    bars: None,
                })
                .collect(),
            log_y: self.log_y,
            difference: self.difference.as_ref().map(|(name, of)| (&name[..], *of)),
            shaded: &self.shaded,
            counts: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve_picture::COLOURS;

    fn plot() -> LinePlot {
        LinePlot::new("a <b>", "t, s", "τ, Nm", vec![0.0, 1.0, 2.0, 3.0]).line("x", vec![1.0, f64::NAN, -2.0, 1e-9])
    }

    #[test]
    fn gaps_are_null_and_break_the_picture() {
        assert!(plot().data().unwrap().contains("[1.0,null,-2.0,1e-9]"));
        let svg = plot().svg(400.0, 200.0).unwrap();
        let group = svg.split_once(&format!("<g stroke=\"{}\"", COLOURS[0])).unwrap().1;
        let curve = group.lines().nth(1).unwrap();
        assert_eq!((curve.matches('M').count(), curve.matches('L').count()), (2, 1), "{curve}");
        assert!(svg.contains("a &lt;b&gt;") && !svg.contains("NaN"));
    }

    #[test]
    fn a_logarithmic_axis_skips_values_that_are_not_positive() {
        assert!(plot().log_y().data().unwrap().contains("[1.0,null,null,1e-9]"));
        assert!(!plot().log_y().svg(400.0, 200.0).unwrap().contains("NaN"));
    }

    #[test]
    fn a_difference_has_a_separate_strip() {
        let pair = LinePlot::new("t", "t, s", "Nm", vec![0.0, 1.0]).broad("predicted", vec![1.0, 2.0]);
        let pair = pair.line("measured", vec![1.5, 2.5]).difference("measured less predicted", 1, 0);
        let (with, without) = (pair.svg(400.0, 200.0).unwrap(), plot().svg(400.0, 200.0).unwrap());
        assert!(with.contains("measured less predicted") && with.contains("root mean square 0.5"), "{with}");
        assert!(with.contains("viewBox=\"0 0 400.0 310.0") && without.contains("viewBox=\"0 0 400.0 200.0"), "{with}");
        assert!(pair.data().unwrap().contains("\"of\":[1,0]"));
        let none = plot().difference("of nothing", 0, 3);
        assert!(none.data().is_err() && none.svg(300.0, 100.0).is_err());
    }

    #[test]
    fn a_shaded_interval_is_clipped_to_the_axis() {
        let plot = plot().shaded(1.0, 9.0);
        assert!(plot.data().unwrap().contains("\"shaded\":[[1.0,9.0]]"));
        let svg = plot.svg(400.0, 200.0).unwrap();
        // The axis is from 64 to 388 px, for 0 to 3 s.
        let shade = svg.split_once("class=\"shaded\"").unwrap().1;
        assert!(shade.starts_with(" x=\"172.0\"") && shade.contains("width=\"216.0\""), "{svg}");
        assert!(!self::plot().svg(400.0, 200.0).unwrap().contains("shaded"));
        let odd = self::plot().shaded(f64::NAN, 2.0).shaded(7.0, 8.0).svg(400.0, 200.0).unwrap();
        assert!(!odd.contains("NaN") && !odd.contains("shaded"), "{odd}");
    }

    #[test]
    fn odd_plots_are_drawn_or_refused() {
        let empty = LinePlot::new("empty", "", "", Vec::new());
        assert!(empty.data().is_ok() && !empty.svg(300.0, 100.0).unwrap().contains("NaN"));
        let all_gap = LinePlot::new("gap", "", "", vec![1.0]).line("x", vec![f64::NAN]).points("y", vec![2.0]);
        assert!(!all_gap.svg(300.0, 100.0).unwrap().contains("NaN"));
        let short = plot().line("y", vec![1.0]);
        assert!(short.data().unwrap_err().to_string().contains("`y` has 1 entries, but needs 4"));
        let backwards = LinePlot::new("b", "", "", vec![1.0, 0.5]);
        assert!(backwards.data().unwrap_err().to_string().contains("entry 1"));
    }
}
