//! The fitness curve of a search by generations: the paper's Fig. 7, and its numbers.

use super::svg::escaped;
use crate::optimisers::Generation;
use core::fmt::Write;

/// The plot and what stands around it, px.
const PLOT: [f64; 2] = [560.0, 300.0];
const LEFT: f64 = 64.0;
const TOP: f64 = 44.0;

/// Best, best so far and mean fitness of every generation, 17 digits; what is not finite is left empty.
pub fn fitness_csv(history: &[Generation]) -> String {
    let mut text = String::from("generation,best,best_so_far,mean\n");
    let number = |value: f64| if value.is_finite() { format!("{value:?}") } else { String::new() };
    for (generation, Generation { best, best_so_far, mean }) in (1..).zip(history) {
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(text, "{generation},{},{},{}", number(*best), number(*best_so_far), number(*mean));
    }
    text
}

/// An SVG picture of the best (solid) and mean (thin) fitness of every generation on a logarithmic scale, with the known optimum dashed.
/// The scale is that of the best: a mean beyond twice their largest (one individual without full rank is enough) is drawn at the top.
pub fn fitness_svg(title: &str, history: &[Generation], optimum: Option<f64>) -> String {
    let (width, height) = (LEFT + PLOT[0] + 24.0, TOP + PLOT[1] + 56.0);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"14\">{}</text>\n",
        escaped(title)
    );
    let drawn = |value: f64| value.is_finite() && value > 0.0;
    let all = history.iter().map(|one| one.best).chain(optimum).filter(|value| drawn(*value));
    let (low, high) = all.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    if low <= high {
        let (low, high) = (0.92 * low, 2.0 * high);
        let x_of = |generation: usize| LEFT + PLOT[0] * generation as f64 / history.len().max(1) as f64;
        let y_of = |value: f64| TOP + PLOT[1] * (high / value).ln() / (high / low).ln();
        for value in ticks(low, high) {
            let y = y_of(value);
            let _ = writeln!(
                text,
                "<path d=\"M{LEFT} {y:.1}h{}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#444\">{value}</text>",
                PLOT[0],
                LEFT - 6.0,
                y + 4.0
            );
        }
        if let Some(optimum) = optimum.filter(|value| drawn(*value)) {
            let y = y_of(optimum);
            let _ = writeln!(
                text,
                "<path class=\"optimum\" d=\"M{LEFT} {y:.1}h{}\" stroke=\"#c22\" stroke-dasharray=\"5 3\"/>",
                PLOT[0]
            );
        }
        let mean: Vec<f64> = history.iter().map(|one| one.mean.min(high)).collect();
        let best: Vec<f64> = history.iter().map(|one| one.best).collect();
        for (name, colour, values) in [("mean", "#8fb8d8", mean), ("best", "#1565a8", best)] {
            let mut path = String::new();
            for (generation, value) in (1..).zip(values).filter(|(_, value)| drawn(*value)) {
                let to = if path.is_empty() { 'M' } else { 'L' };
                let _ = write!(path, "{to}{:.1} {:.1}", x_of(generation), y_of(value));
            }
            let _ = writeln!(
                text,
                "<path class=\"{name}\" d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.2\"/>"
            );
        }
        let (middle, bottom) = (history.len() / 2, TOP + PLOT[1] + 16.0);
        for generation in [1, middle.max(1), history.len().max(1)] {
            let x = x_of(generation);
            let _ = writeln!(
                text,
                "<text x=\"{x:.1}\" y=\"{bottom}\" text-anchor=\"middle\" fill=\"#444\">{generation}</text>"
            );
        }
    }
    let _ = writeln!(
        text,
        "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#bbb\"/>",
        PLOT[0], PLOT[1]
    );
    let known = optimum.map_or(String::new(), |optimum| format!("; dashed: optimum {optimum:.3}"));
    let _ = writeln!(
        text,
        "<text x=\"{LEFT}\" y=\"{}\" fill=\"#444\">fitness by generation: best dark, mean light{known}</text>\n</svg>",
        height - 14.0
    );
    text
}

/// Round numbers (1, 2, 5 times powers of ten) inside a range.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (first..=last).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10.0_f64.powi(power)));
    let ticks: Vec<f64> = decades.filter(|value| (low..=high).contains(value)).collect();
    // A search over many decades: whole ones are enough.
    if ticks.len() <= 12 { ticks } else { ticks.into_iter().step_by(3).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_and_table_hold_every_generation_and_no_infinity() {
        let one = |best, mean| Generation { best, best_so_far: 170.0, mean };
        let history = [one(300.0, f64::INFINITY), one(170.0, 900.0), one(180.0, 500.0)];
        let csv = fitness_csv(&history);
        assert_eq!(csv.lines().nth(1), Some("1,300.0,170.0,"));
        assert_eq!(csv.lines().count(), 4);
        let svg = fitness_svg("a & b", &history, Some(161.283));
        assert!(svg.contains("class=\"best\"") && svg.contains("optimum 161.283") && svg.contains("a &amp; b"));
        assert!(!svg.contains("inf") && !svg.contains("NaN"));
        // Lower values stand lower in the picture.
        assert_eq!(svg.matches("class=\"optimum\"").count(), 1);
        assert!(fitness_svg("", &[], None).ends_with("</svg>\n"));
    }
}
