//! Convergence of quantities over runs.

use crate::curve_picture::{Curve, CurvePicture};
use crate::error::ReportError;
use crate::plot_data::{CurveData, PlotData, check_length, embedded, rounded};

/// Quantities by run (or iteration), with optional error bars.
///
/// ```
/// use dynident_report::ConvergencePlot;
/// let plot = ConvergencePlot::new("Tracking error", "rad").log_y().curve("joint 1", vec![0.6, 0.15, 1e-3]);
/// assert_eq!(plot.curves.len(), 1);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ConvergencePlot {
    /// Title.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Label of the x axis; `run` by default.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// Number of the first run; 1 by default.
    pub first: u32,
    /// Name, values by run (NaN for a missing value), and half-widths of the error bars (one per value, or none) of
    /// each curve.
    pub curves: Vec<(String, Vec<f64>, Vec<f64>)>,
    /// Logarithmic y axis.
    pub log_y: bool,
}

impl ConvergencePlot {
    /// Creates a plot without curves.
    pub fn new(title: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            x_label: "run".to_owned(),
            y_label: y_label.into(),
            first: 1,
            curves: Vec::new(),
            log_y: false,
        }
    }

    /// Sets the note below the title.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Adds a curve.
    #[must_use]
    pub fn curve(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.curves.push((name.into(), values, Vec::new()));
        self
    }

    /// Adds a curve with error bars `value ± half_width`.
    #[must_use]
    pub fn curve_with_bars(mut self, name: impl Into<String>, values: Vec<f64>, half_widths: Vec<f64>) -> Self {
        self.curves.push((name.into(), values, half_widths));
        self
    }

    /// Makes the y axis logarithmic.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.log_y = true;
        self
    }

    pub(crate) fn axis(&self) -> Vec<f64> {
        let runs = self.curves.iter().map(|(_, values, _)| values.len()).max().unwrap_or(0);
        (0..runs).map(|run| f64::from(self.first) + run as f64).collect()
    }

    /// Static picture over the axis `x`; [`data`](Self::data) checks the lengths.
    pub(crate) fn picture<'a>(&'a self, x: &'a [f64]) -> CurvePicture<'a> {
        let curve = |(name, values, half_widths): &'a (String, Vec<f64>, Vec<f64>)| {
            let ends = |sign: f64| -> Vec<f64> {
                values.iter().zip(half_widths).map(|(value, half)| value + sign * half).collect()
            };
            let mut filled = values.clone();
            filled.resize(x.len(), f64::NAN);
            let bars = (!half_widths.is_empty()).then(|| [ends(-1.0), ends(1.0)]);
            Curve { name, values: filled, dashed: false, points: false, broad: false, bars }
        };
        CurvePicture {
            title: &self.title,
            x_label: &self.x_label,
            y_label: &self.y_label,
            x,
            curves: self.curves.iter().map(curve).collect(),
            log_y: self.log_y,
            difference: None,
            shaded: &[],
            counts: true,
        }
    }

    pub(crate) fn data(&self) -> Result<String, ReportError> {
        let runs = self.curves.iter().map(|(_, values, _)| values.len()).max().unwrap_or(0);
        let drawn = |value: f64| rounded(value).filter(|value| !self.log_y || *value > 0.0);
        let curves = self
            .curves
            .iter()
            .map(|(name, values, half_widths)| {
                if !half_widths.is_empty() {
                    check_length(&self.title, name, half_widths.len(), values.len())?;
                }
                let mut y: Vec<Option<f64>> = values.iter().map(|value| drawn(*value)).collect();
                y.resize(runs, None);
                let ends = |sign: f64| -> Vec<Option<f64>> {
                    let end = |(value, half): (&f64, &f64)| drawn(value + sign * half);
                    let mut ends: Vec<_> = values.iter().zip(half_widths).map(end).collect();
                    ends.resize(runs, None);
                    ends
                };
                let bars = (!half_widths.is_empty()).then(|| [ends(-1.0), ends(1.0)]);
                Ok(CurveData { name, y, dashed: false, points: true, broad: false, bars })
            })
            .collect::<Result<Vec<_>, ReportError>>()?;
        embedded(&PlotData {
            x: self.axis(),
            curves,
            strip: None,
            shaded: &[],
            x_label: &self.x_label,
            y_label: &self.y_label,
            log: self.log_y,
            counts: true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_of_unequal_length_are_filled_with_gaps() {
        let plot = ConvergencePlot::new("t", "y").curve("a", vec![1.0, 2.0, 3.0]).curve_with_bars(
            "b",
            vec![1.0, 4.0],
            vec![0.5, 5.0],
        );
        let data = plot.data().unwrap();
        assert!(data.contains("[1.0,4.0,null]") && data.contains("[0.5,-1.0,null]"), "{data}");
        assert!(plot.clone().log_y().data().unwrap().contains("[0.5,null,null]"));
        assert!(plot.curve_with_bars("c", vec![1.0], vec![1.0, 2.0]).data().is_err());
        assert!(ConvergencePlot::new("none", "").data().is_ok());
    }
}
