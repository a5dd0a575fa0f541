//! Bars with error bars.

use crate::curve_picture::{COLOURS, Place};
use crate::error::ReportError;
use crate::pen::tenth;
use crate::ticks::{short, shortened, ticks};
use serde::Serialize;

/// Maximum number of characters of a label; the tooltip has the full label.
const MAX_LABEL_CHARS: usize = 38;
/// Maximum number of bars in the description for screen readers.
const MAX_SPOKEN_BARS: usize = 12;
/// Width of the plot, the labels and the figures, and height of a row, px.
const WIDTH: f64 = 800.0;
const LABEL_WIDTH: f64 = 270.0;
const FIGURE_WIDTH: f64 = 140.0;
const ROW_HEIGHT: f64 = 22.0;
/// Width of a character in a printed figure, px, and largest share of the width for the labels.
const PRINT_CHAR_WIDTH: f64 = 6.6;
const MAX_PRINT_LABEL_SHARE: f64 = 0.4;
/// Width of the axis for each tick, px.
const TICK_WIDTH: f64 = 60.0;

/// One bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Label.
    pub label: String,
    /// Value; without a bar if it is not finite.
    pub value: f64,
    /// Half-width of the error bar.
    pub half_width: Option<f64>,
    /// Reference value (for example a prior or the true value), drawn as a mark.
    pub reference: Option<f64>,
}

/// Horizontal bars with error bars and reference marks, from top to bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct BarPlot {
    /// Title.
    pub title: String,
    /// Note below the title; may be empty.
    pub note: String,
    /// Label of the axis, with its unit.
    pub label: String,
    /// Legend of the reference marks; may be empty.
    pub reference_label: String,
    /// The bars, from top to bottom.
    pub bars: Vec<Bar>,
    /// Whether the plot is closed until the reader opens it.
    pub is_folded: bool,
}

impl BarPlot {
    /// Creates a plot without bars.
    pub fn new(title: impl Into<String>, label: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            note: String::new(),
            label: label.into(),
            reference_label: String::new(),
            bars: Vec::new(),
            is_folded: false,
        }
    }

    /// Closes the plot until the reader opens it.
    #[must_use]
    pub fn folded(mut self) -> Self {
        self.is_folded = true;
        self
    }

    /// Sets the note below the title.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Sets the legend of the reference marks.
    #[must_use]
    pub fn reference_label(mut self, label: impl Into<String>) -> Self {
        self.reference_label = label.into();
        self
    }

    /// Adds a bar.
    #[must_use]
    pub fn bar(
        mut self,
        label: impl Into<String>,
        value: f64,
        half_width: Option<f64>,
        reference: Option<f64>,
    ) -> Self {
        self.bars.push(Bar { label: label.into(), value, half_width, reference });
        self
    }

    fn in_words(&self) -> String {
        let bars = self.bars.iter().map(|bar| {
            let half = bar.half_width.map_or_else(String::new, |half| format!(" ± {}", short(half, 2)));
            format!("{}: {}{half}", shortened(&bar.label, MAX_LABEL_CHARS), short(bar.value, 4))
        });
        let shown: Vec<String> = bars.take(MAX_SPOKEN_BARS).collect();
        let more = self.bars.len().saturating_sub(MAX_SPOKEN_BARS);
        let rest = if more > 0 { format!("; and {more} more, listed in the table") } else { String::new() };
        format!("{}; {}{rest}", self.label, shown.join("; "))
    }

    /// Renders the plot as SVG; its colours are those of the page, or the defaults in the SVG.
    ///
    /// # Errors
    /// If the template fails.
    pub fn svg(&self) -> Result<String, ReportError> {
        self.picture([WIDTH, LABEL_WIDTH, FIGURE_WIDTH], MAX_LABEL_CHARS, Place::Page)
    }

    /// Renders the plot with a width of `width` px for a printed figure.
    pub(crate) fn printed(&self, width: f64) -> Result<String, ReportError> {
        let longest = |lengths: &mut dyn Iterator<Item = usize>| lengths.max().unwrap_or(0) as f64;
        let figures = longest(&mut self.bars.iter().map(|bar| bar.figure().chars().count()));
        let labels = longest(&mut self.bars.iter().map(|bar| bar.label.chars().count())).max(self.label.len() as f64);
        let most = MAX_PRINT_LABEL_SHARE * width;
        let labels = (PRINT_CHAR_WIDTH * labels + 4.0).min(most);
        let chars = (labels / PRINT_CHAR_WIDTH) as usize;
        self.picture([width, labels, PRINT_CHAR_WIDTH * figures + 12.0], chars.max(2), Place::Print)
    }

    /// Height of the picture, px.
    pub(crate) fn height(&self) -> f64 {
        26.0 + ROW_HEIGHT * self.bars.len() as f64 + 8.0
    }

    /// Renders the plot with the widths of the whole plot, the labels and the values, px.
    fn picture(
        &self,
        [width, labels, figures]: [f64; 3],
        label_chars: usize,
        place: Place,
    ) -> Result<String, ReportError> {
        let ends = self.bars.iter().filter(|bar| is_drawn(bar.value)).flat_map(|bar| {
            let half = bar.drawn_half_width().unwrap_or(0.0);
            [bar.value - half, bar.value + half].into_iter().chain(bar.reference.filter(|value| is_drawn(*value)))
        });
        let [low, high] = ends.fold([0.0_f64, 0.0_f64], |[a, b], x| [a.min(x), b.max(x)]);
        let high = if high > low { high } else { low + 1.0 };
        let (left, right) = (labels + 8.0, width - figures);
        let at = |x: f64| tenth(left + (x - low) / (high - low) * (right - left));
        let bars = self.bars.iter().enumerate().map(|(k, bar)| {
            let shown = is_drawn(bar.value).then_some(bar.value);
            BarView {
                y: 26.0 + ROW_HEIGHT * k as f64,
                label: shortened(&bar.label, label_chars),
                whole: &bar.label,
                from: at(shown.unwrap_or(0.0).min(0.0)),
                length: (at(shown.unwrap_or(0.0).max(0.0)) - at(shown.unwrap_or(0.0).min(0.0))).max(0.0),
                whisker: bar.drawn_half_width().map(|half| [at(bar.value - half), at(bar.value + half)]),
                mark: bar.reference.filter(|value| is_drawn(*value)).map(at),
                figure: bar.figure(),
                reference: bar.reference.map(|value| short(value, 4)),
            }
        });
        let [bar_colour, mark_colour, paper, grid] = match place {
            Place::Page => ["var(--c0, #0072b2)", "var(--c1, #c24e00)", "var(--paper, #fff)", "#8884"],
            Place::Document | Place::Print => [COLOURS[0], COLOURS[1], "#fff", "#ddd"],
        };
        let view = Picture {
            plot: self.label.clone(),
            title: &self.title,
            words: self.in_words(),
            width,
            height: self.height(),
            right,
            labels,
            zero: at(0.0),
            ticks: ticks(low, high, ((right - left) / TICK_WIDTH).clamp(2.0, 5.0) as usize)
                .into_iter()
                .map(|x| (at(x), short(x, 3)))
                .collect(),
            bars: bars.collect(),
            ink: place.ink(),
            colours: [bar_colour, mark_colour],
            paper,
            grid,
        };
        crate::templates::rendered("bar_plot.svg", &view)
    }
}

fn is_drawn(value: f64) -> bool {
    value.is_finite() && value.abs() < 1e300
}

impl Bar {
    fn drawn_half_width(&self) -> Option<f64> {
        self.half_width.filter(|half| is_drawn(*half) && is_drawn(self.value))
    }

    /// The value with its error bar as text.
    fn figure(&self) -> String {
        match self.drawn_half_width() {
            Some(half) => format!("{} ± {}", short(self.value, 4), short(half, 2)),
            None => short(self.value, 4),
        }
    }
}

#[derive(Serialize)]
struct Picture<'a> {
    plot: String,
    title: &'a str,
    words: String,
    width: f64,
    height: f64,
    right: f64,
    labels: f64,
    zero: f64,
    ticks: Vec<(f64, String)>,
    bars: Vec<BarView<'a>>,
    ink: &'static str,
    /// Colours of bars and reference marks.
    colours: [&'static str; 2],
    paper: &'static str,
    grid: &'static str,
}

#[derive(Serialize)]
struct BarView<'a> {
    y: f64,
    label: String,
    whole: &'a str,
    from: f64,
    length: f64,
    whisker: Option<[f64; 2]>,
    mark: Option<f64>,
    figure: String,
    reference: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_stay_inside_the_plot_for_any_values() {
        let plot = BarPlot::new("t", "kg")
            .bar("a \"b\" <c>", 2.0, Some(0.5), Some(-1.0))
            .bar("gap", f64::NAN, Some(1.0), None)
            .bar("far", f64::INFINITY, None, Some(f64::NAN))
            .bar("é".repeat(100), -3.0, None, None);
        let svg = plot.svg().unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(svg.contains("a &quot;b&quot; &lt;c&gt;") && svg.contains('…'));
        assert!(!BarPlot::new("none", "").svg().unwrap().contains("NaN"));
    }
}
