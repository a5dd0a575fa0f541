//! Figures for print: one SVG with plots in columns.

use crate::bar_plot::BarPlot;
use crate::convergence_plot::ConvergencePlot;
use crate::curve_picture::{COLOURS, Place};
use crate::error::ReportError;
use crate::line_plot::LinePlot;
use crate::pen::tenth;
use crate::ticks::shortened;
use minijinja::Value;
use serde::Serialize;

/// Size of the text in the pictures, px.
const TEXT_PX: f64 = 12.0;
/// Millimetres of a typographic point.
const MM_PER_POINT: f64 = 25.4 / 72.0;
/// Width of a plot above which a figure gets a further column, px, and gap between columns and rows, px.
const MIN_COLUMN_WIDTH: f64 = 360.0;
const GAP: f64 = 14.0;
/// Height of curves relative to their width, and height of a heading and of a legend row above bars, px.
const HEIGHT_SHARE: f64 = 0.62;
const HEADING_HEIGHT: f64 = 22.0;
const LEGEND_HEIGHT: f64 = 20.0;
/// Width of a character of a heading, px.
const HEADING_CHAR_WIDTH: f64 = 7.0;

/// Size of a printed figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintStyle {
    /// Width of the figure, mm. Default 88, one column of a journal with two columns; both columns are 180 mm.
    pub width_mm: f64,
    /// Size of the text, typographic points. Default 8.
    pub font_pt: f64,
    /// Pixels per inch of a PNG. Default 300.
    pub dpi: f64,
}

impl Default for PrintStyle {
    fn default() -> Self {
        Self { width_mm: 88.0, font_pt: 8.0, dpi: 300.0 }
    }
}

/// A plot of a printed figure.
#[derive(Clone, Debug, PartialEq)]
pub enum PrintPanel {
    /// Curves over a common axis.
    Lines(LinePlot),
    /// Quantities by run.
    Runs(ConvergencePlot),
    /// Bars.
    Bars(BarPlot),
}

/// A figure for print: plots from left to right and from top to bottom, black text on white, fixed colours.
///
/// ```
/// use dynident_report::{LinePlot, PrintFigure, PrintPanel, PrintStyle};
/// let plot = LinePlot::new("Elbow", "t, s", "torque, Nm", vec![0.0, 1.0]).line("measured", vec![1.0, 2.0]);
/// let figure = PrintFigure { title: "Torque".into(), panels: vec![PrintPanel::Lines(plot)] };
/// let svg = figure.svg(&PrintStyle::default())?;
/// assert!(svg.contains("width=\"88.0mm\""));
/// # Ok::<(), dynident_report::ReportError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrintFigure {
    /// Title for screen readers; it is not drawn, because a publication has a caption.
    pub title: String,
    /// The plots.
    pub panels: Vec<PrintPanel>,
}

impl PrintFigure {
    /// Renders the figure. Its text has the size of the style at the width of the style; the height depends on the
    /// plots.
    ///
    /// # Errors
    /// A plot with inconsistent lists or a decreasing axis; a width or text size without room for a plot.
    pub fn svg(&self, style: &PrintStyle) -> Result<String, ReportError> {
        let PrintStyle { width_mm, font_pt, .. } = *style;
        let mm_per_px = font_pt * MM_PER_POINT / TEXT_PX;
        let width = width_mm / mm_per_px;
        if !(width.is_finite() && (MIN_WIDTH..=MAX_WIDTH).contains(&width) && font_pt > 0.0) {
            return Err(ReportError::PrintSize { width_mm, font_pt });
        }
        let fitting = ((width + GAP) / (MIN_COLUMN_WIDTH + GAP)).floor().max(1.0) as usize;
        let columns = fitting.min(self.panels.len().max(1));
        let column_width = (width - GAP * (columns - 1) as f64) / columns as f64;
        let mut panels = Vec::with_capacity(self.panels.len());
        let mut y = 0.0;
        for row in self.panels.chunks(columns) {
            let mut tallest = 0.0_f64;
            for (column, panel) in row.iter().enumerate() {
                let (view, height) = panel.view(column_width)?;
                panels.push(PanelView { x: tenth((column_width + GAP) * column as f64), y: tenth(y), ..view });
                tallest = tallest.max(height);
            }
            y += tallest + GAP;
        }
        let height = (y - GAP).max(1.0);
        let view = FigureView {
            title: &self.title,
            width: tenth(width),
            height: tenth(height),
            width_mm,
            height_mm: tenth(height * mm_per_px),
            mark: COLOURS[1],
            panels,
        };
        crate::templates::rendered("print_figure.svg", &view)
    }
}

/// Minimum and maximum width of a figure in pixels with text of 12 px: room for one plot, and the size of a poster.
const MIN_WIDTH: f64 = 200.0;
const MAX_WIDTH: f64 = 20_000.0;

impl PrintPanel {
    fn view(&self, width: f64) -> Result<(PanelView, f64), ReportError> {
        let height = HEIGHT_SHARE * width.min(2.0 * MIN_COLUMN_WIDTH);
        let inner = |svg: String, height: f64| {
            let svg = Value::from_safe_string(svg);
            (PanelView { x: 0.0, y: 0.0, heading: String::new(), legend: String::new(), below: 0.0, svg }, height)
        };
        Ok(match self {
            Self::Lines(plot) => {
                plot.check()?;
                let picture = plot.picture();
                inner(picture.svg(width, height, Place::Print)?, height + picture.strip_height())
            }
            Self::Runs(plot) => {
                plot.data()?;
                let axis = plot.axis();
                inner(plot.picture(&axis).svg(width, height, Place::Print)?, height)
            }
            Self::Bars(plot) => {
                let below = HEADING_HEIGHT + if plot.reference_label.is_empty() { 0.0 } else { LEGEND_HEIGHT };
                let (view, height) = inner(plot.printed(width)?, below + plot.height());
                let heading = shortened(&plot.title, ((width / HEADING_CHAR_WIDTH) as usize).max(8));
                (PanelView { heading, legend: plot.reference_label.clone(), below, ..view }, height)
            }
        })
    }
}

#[derive(Serialize)]
struct FigureView<'a> {
    title: &'a str,
    width: f64,
    height: f64,
    width_mm: f64,
    height_mm: f64,
    /// Colour of reference marks.
    mark: &'static str,
    panels: Vec<PanelView>,
}

#[derive(Serialize)]
struct PanelView {
    x: f64,
    y: f64,
    heading: String,
    legend: String,
    /// Top of the plot below heading and legend, px.
    below: f64,
    svg: Value,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines() -> PrintPanel {
        let plot = LinePlot::new("a <b>", "t, s", "Nm", vec![0.0, 1.0]).line("x", vec![1.0, 2.0]);
        PrintPanel::Lines(plot.line("y", vec![1.5, 2.0]).difference("x minus y", 0, 1))
    }

    fn figure(panels: Vec<PrintPanel>) -> PrintFigure {
        PrintFigure { title: "t & u".into(), panels }
    }

    /// Widths of all pictures in a figure, px; the first is that of the figure.
    fn widths(svg: &str) -> Vec<f64> {
        let width = |part: &str| part.split_once("viewBox=\"0 0 ")?.1.split(' ').next()?.parse::<f64>().ok();
        svg.split("<svg ").filter_map(width).collect()
    }

    #[test]
    fn text_has_its_size_and_wide_figures_have_columns() {
        let figure = figure(vec![lines(), lines(), lines()]);
        let narrow = figure.svg(&PrintStyle::default()).unwrap();
        // 12 px are 8 pt, or 2.822 mm: 88 mm are 374.2 px.
        assert_eq!(widths(&narrow)[0], 374.2);
        assert!(narrow.contains("width=\"88.0mm\"") && !narrow.contains("currentColor") && !narrow.contains("var("));
        let wide = figure.svg(&PrintStyle { width_mm: 180.0, ..PrintStyle::default() }).unwrap();
        let [all, first, second, third] = widths(&wide)[..] else { panic!("{:?}", widths(&wide)) };
        assert!(first < 0.5 * all && first == second && second == third, "{first} of {all}");
        let small = figure.svg(&PrintStyle { font_pt: 6.0, ..PrintStyle::default() }).unwrap();
        assert!(widths(&small)[0] > widths(&narrow)[0]);
    }

    #[test]
    fn bars_and_runs_stay_inside_and_names_are_escaped() {
        let bars = BarPlot::new("masses <i>", "kg").reference_label("a & b").bar(
            "m\"1".repeat(30),
            2.0,
            Some(0.5),
            Some(-1.0),
        );
        let runs = ConvergencePlot::new("error", "rad").log_y().curve("joint", vec![1.0, 0.1, f64::NAN]);
        let svg = figure(vec![PrintPanel::Bars(bars), PrintPanel::Runs(runs)]).svg(&PrintStyle::default()).unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("<i>") && svg.contains("a &amp; b"), "{svg}");
        assert!(widths(&svg).iter().all(|width| (*width - 374.2).abs() < 0.1), "{:?}", widths(&svg));
        assert!(!svg.contains("currentColor") && !svg.contains("var("));
    }

    #[test]
    fn sizes_without_room_are_refused() {
        for (width_mm, font_pt) in [(0.0, 8.0), (88.0, 0.0), (f64::NAN, 8.0), (20.0, 12.0), (88.0, -8.0), (1e9, 8.0)] {
            let error =
                figure(vec![lines()]).svg(&PrintStyle { width_mm, font_pt, dpi: 300.0 }).unwrap_err().to_string();
            assert!(error.contains("mm"), "{error}");
        }
        assert!(figure(Vec::new()).svg(&PrintStyle::default()).is_ok());
    }
}
