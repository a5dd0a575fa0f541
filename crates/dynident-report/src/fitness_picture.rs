//! Fitness of an optimiser's individuals by generation.

use crate::error::ReportError;
use crate::pen::{Pen, tenth};
use crate::plot_data::check_length;
use serde::Serialize;

/// Size of the plot, and margins to the left and above, px.
const PLOT: [f64; 2] = [560.0, 300.0];
const MARGIN_LEFT: f64 = 64.0;
const MARGIN_TOP: f64 = 44.0;

/// Best (dark) and mean (light) fitness of every generation on a logarithmic scale, with the known optimum as a dashed
/// line.
///
/// The scale follows the best fitness: a mean above twice its maximum (for example one individual with rank deficiency)
/// is drawn at the top. Values that are not finite or not positive are not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitnessPicture<'a> {
    /// Title.
    pub title: &'a str,
    /// Best fitness of each generation.
    pub best: &'a [f64],
    /// Mean fitness of each generation.
    pub mean: &'a [f64],
    /// The optimal fitness, if known.
    pub optimum: Option<f64>,
}

impl FitnessPicture<'_> {
    /// Renders the picture as SVG.
    ///
    /// # Errors
    /// If `mean` and `best` have different lengths.
    pub fn svg(&self) -> Result<String, ReportError> {
        check_length(self.title, "mean", self.mean.len(), self.best.len())?;
        let generations = self.best.len();
        let positive = |value: &f64| value.is_finite() && *value > 0.0;
        let optimum = self.optimum.filter(positive);
        let all = self.best.iter().copied().chain(optimum).filter(positive);
        let (low, high) = all.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        let drawn = low <= high;
        let (low, high) = (0.92 * low, 2.0 * high);
        let x_of = |generation: usize| MARGIN_LEFT + PLOT[0] * generation as f64 / generations.max(1) as f64;
        let y_of = |value: f64| MARGIN_TOP + PLOT[1] * (high / value).ln() / (high / low).ln();
        let line = |values: &[f64], most: f64| {
            let mut pen = Pen::default();
            let values = values.iter().map(|value| value.min(most));
            for (generation, value) in (1..).zip(values).filter(|(_, value)| positive(value)) {
                pen.to([x_of(generation), y_of(value)]);
            }
            pen.path()
        };
        let lines =
            || vec![("mean", "#8fb8d8", line(self.mean, high)), ("best", "#1565a8", line(self.best, f64::INFINITY))];
        let shown = if drawn { vec![1, (generations / 2).max(1), generations.max(1)] } else { Vec::new() };
        let view = Picture {
            title: self.title,
            width: MARGIN_LEFT + PLOT[0] + 24.0,
            height: MARGIN_TOP + PLOT[1] + 56.0,
            frame: [MARGIN_LEFT, MARGIN_TOP, PLOT[0], PLOT[1]],
            ticks: if drawn { ticks(low, high) } else { Vec::new() }
                .into_iter()
                .map(|value| (tenth(y_of(value)), value.to_string()))
                .collect(),
            lines: if drawn { lines() } else { Vec::new() },
            optimum: optimum.map(|value| tenth(y_of(value))),
            generations: shown.into_iter().map(|generation| (tenth(x_of(generation)), generation)).collect(),
            known: self.optimum.map(|optimum| format!("{optimum:.3}")),
        };
        crate::templates::rendered("fitness_picture.svg", &view)
    }
}

/// Round numbers (1, 2, 5 times powers of ten) in a range.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (first..=last).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10.0_f64.powi(power)));
    let ticks: Vec<f64> = decades.filter(|value| (low..=high).contains(value)).collect();
    // Only powers of ten for a range of many decades.
    if ticks.len() <= 12 { ticks } else { ticks.into_iter().step_by(3).collect() }
}

#[derive(Serialize)]
struct Picture<'a> {
    title: &'a str,
    width: f64,
    height: f64,
    frame: [f64; 4],
    ticks: Vec<(f64, String)>,
    lines: Vec<(&'static str, &'static str, String)>,
    optimum: Option<f64>,
    generations: Vec<(f64, usize)>,
    known: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curves_are_drawn_without_infinities() {
        let (best, mean) = ([300.0, 170.0, 180.0], [f64::INFINITY, 900.0, 500.0]);
        let svg = FitnessPicture { title: "a & b", best: &best, mean: &mean, optimum: Some(161.283) }.svg().unwrap();
        assert!(svg.contains("class=\"best\"") && svg.contains("optimum 161.283") && svg.contains("a &amp; b"));
        assert!(!svg.contains("inf") && !svg.contains("NaN"));
        assert_eq!(svg.matches("class=\"optimum\"").count(), 1);
        let empty = FitnessPicture { title: "", best: &[], mean: &[], optimum: None }.svg().unwrap();
        assert!(empty.trim_end().ends_with("</svg>") && !empty.contains("inf") && !empty.contains("NaN"));
        assert!(FitnessPicture { title: "", best: &best, mean: &[], optimum: None }.svg().is_err());
    }
}
