//! A motion over time: position, velocity and further quantities of each joint, with limits as dashed lines.

use crate::error::ReportError;
use crate::pen::{Pen, tenth};
use crate::plot_data::{check_axis, check_length};
use serde::Serialize;

/// Width and height of one plot, gaps and margins, px.
const PLOT: [f64; 2] = [230.0, 84.0];
const GAP: [f64; 2] = [62.0, 22.0];
const MARGIN_LEFT: f64 = 62.0;
const MARGIN_TOP: f64 = 64.0;

/// Maximum distance of a drawn limit from the curve, in spans of the curve; beyond it the curve would look flat.
const MAX_LIMIT_DISTANCE: f64 = 4.0;

/// Maximum number of points of a curve, limited by the resolution of the plot.
const MAX_POINTS: usize = 600;

/// One quantity of one joint over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionCurve<'a> {
    /// One value per time; NaN makes a gap.
    pub values: &'a [f64],
    /// Lower and upper limit, if any.
    pub limits: Option<[f64; 2]>,
}

/// A picture of a motion, joints from top to bottom, quantities from left to right. Limits outside of a plot are
/// printed in its corner.
///
/// ```
/// use dynident_report::{MotionCurve, MotionPicture};
/// let times_s: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
/// let q: Vec<f64> = times_s.iter().map(|t| (6.0 * t).sin()).collect();
/// let position = MotionCurve { values: &q, limits: Some([-1.2, 1.2]) };
/// let svg = MotionPicture::new("A swing", &times_s, &["position"]).joint("elbow", vec![position]).svg()?;
/// assert!(svg.contains("elbow") && svg.contains("class=\"limit\""));
/// # Ok::<(), dynident_report::ReportError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotionPicture<'a> {
    title: &'a str,
    times_s: &'a [f64],
    quantities: &'a [&'a str],
    joints: Vec<(&'a str, Vec<MotionCurve<'a>>)>,
}

impl<'a> MotionPicture<'a> {
    /// Creates a picture without joints: title, times in s, and names of the quantities in SI units.
    pub fn new(title: &'a str, times_s: &'a [f64], quantities: &'a [&'a str]) -> Self {
        Self { title, times_s, quantities, joints: Vec::new() }
    }

    /// Adds a joint with one curve per quantity.
    #[must_use]
    pub fn joint(mut self, name: &'a str, curves: Vec<MotionCurve<'a>>) -> Self {
        self.joints.push((name, curves));
        self
    }

    /// Renders the picture as SVG.
    ///
    /// # Errors
    /// Decreasing times, or inconsistent numbers of curves or values.
    pub fn svg(&self) -> Result<String, ReportError> {
        check_axis(self.title, self.times_s)?;
        for (name, curves) in &self.joints {
            check_length(self.title, name, curves.len(), self.quantities.len())?;
            curves.iter().try_for_each(|c| check_length(self.title, name, c.values.len(), self.times_s.len()))?;
        }
        let x_of = |quantity: usize| MARGIN_LEFT + quantity as f64 * (PLOT[0] + GAP[0]);
        let y_of = |joint: usize| MARGIN_TOP + joint as f64 * (PLOT[1] + GAP[1]);
        let rows = self.joints.iter().enumerate().map(|(joint, (name, curves))| Row {
            name,
            y: y_of(joint),
            plots: curves
                .iter()
                .enumerate()
                .map(|(k, curve)| plot([x_of(k), y_of(joint)], self.times_s, curve))
                .collect(),
        });
        let view = Picture {
            title: self.title,
            width: x_of(self.quantities.len()),
            height: y_of(self.joints.len()) + 24.0,
            left: MARGIN_LEFT,
            size: PLOT,
            quantities: self.quantities.iter().enumerate().map(|(k, name)| (x_of(k), *name)).collect(),
            rows: rows.collect(),
            first: format!("{:.2}", self.times_s.first().unwrap_or(&0.0)),
            last: format!("{:.2}", self.times_s.last().unwrap_or(&0.0)),
        };
        crate::templates::rendered("motion_picture.svg", &view)
    }
}

fn plot(corner: [f64; 2], times: &[f64], curve: &MotionCurve<'_>) -> Plot {
    let [left, top] = corner;
    let [width, height] = PLOT;
    let finite = curve.values.iter().copied().filter(|x| x.is_finite());
    let (mut lower, mut upper) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if lower > upper {
        (lower, upper) = (0.0, 0.0);
    }
    let span = (upper - lower).max(1e-9);
    let near = |limit: &f64| (limit - lower).abs().min((limit - upper).abs()) <= MAX_LIMIT_DISTANCE * span;
    let (drawn, beyond): (Vec<f64>, Vec<f64>) = curve.limits.into_iter().flatten().partition(near);
    for limit in &drawn {
        (lower, upper) = (lower.min(*limit), upper.max(*limit));
    }
    let margin = 0.06 * (upper - lower).max(1e-9);
    (lower, upper) = (lower - margin, upper + margin);
    let y_of = |value: f64| top + height * (upper - value) / (upper - lower);
    let (start, end) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let step = times.len().div_ceil(MAX_POINTS).max(1);
    let mut pen = Pen::default();
    for sample in (0..times.len()).step_by(step).chain(times.len().checked_sub(1)) {
        pen.to([left + width * (times[sample] - start) / (end - start).max(1e-9), y_of(curve.values[sample])]);
    }
    let beyond: Vec<String> = beyond.into_iter().map(|limit| format!("{limit:.3}")).collect();
    Plot {
        left,
        zero: (lower < 0.0 && upper > 0.0).then(|| tenth(y_of(0.0))),
        limits: drawn.into_iter().map(|limit| tenth(y_of(limit))).collect(),
        path: pen.path(),
        upper: format!("{upper:.2}"),
        lower: format!("{lower:.2}"),
        beyond: beyond.join(", "),
    }
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    width: f64,
    height: f64,
    left: f64,
    size: [f64; 2],
    quantities: Vec<(f64, &'a str)>,
    rows: Vec<Row<'a>>,
    first: String,
    last: String,
}

#[derive(Serialize)]
struct Row<'a> {
    name: &'a str,
    y: f64,
    plots: Vec<Plot>,
}

#[derive(Serialize)]
struct Plot {
    left: f64,
    zero: Option<f64>,
    limits: Vec<f64>,
    path: String,
    upper: String,
    lower: String,
    beyond: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_is_drawn_with_its_near_limits() {
        let times: Vec<f64> = (0..201).map(|i| 0.01 * f64::from(i)).collect();
        let q: Vec<f64> = times.iter().map(|t| t.sin()).collect();
        let curve = |limits| MotionCurve { values: &q, limits };
        let curves = vec![curve(None), curve(Some([-1.1, 1.1])), curve(Some([-1e6, 1e6]))];
        let picture = MotionPicture::new("a < b & \u{7}c", &times, &["position", "velocity", "acceleration"]);
        let svg = picture.clone().joint("one", curves.clone()).joint("two", curves).svg().unwrap();
        assert_eq!(svg.matches("class=\"curve\"").count(), 6);
        // Both velocity limits are near; the acceleration limits are printed instead.
        assert_eq!(svg.matches("class=\"limit\"").count(), 4);
        assert!(
            svg.contains("limits beyond: -1000000.000, 1000000.000") && svg.contains("a &lt; b &amp; \\u0007c"),
            "{svg}"
        );
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        let error = picture.joint("one", vec![curve(None)]).svg().unwrap_err();
        assert!(error.to_string().contains("`one` has 1 entries, but needs 3"), "{error}");
    }

    #[test]
    fn odd_motions_are_drawn_or_refused() {
        assert!(
            MotionPicture::new("", &[], &["q"])
                .joint("j", vec![MotionCurve { values: &[], limits: None }])
                .svg()
                .is_ok()
        );
        let gap = MotionCurve { values: &[1.0, f64::NAN, f64::INFINITY], limits: Some([0.0, 2.0]) };
        let svg = MotionPicture::new("", &[0.0, 1.0, 2.0], &["q"]).joint("j", vec![gap]).svg().unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(MotionPicture::new("", &[1.0, 0.0], &[]).svg().is_err());
    }
}
