//! Figs. 2 to 6: the logistic function, the splice, the effects of ω and T, and the windows.

use crate::piece::{PaperFigure, rough, shown};
use dynident_excitation::families::{SplicedLogistic, SplicedLogisticSettings};
use dynident_excitation::{Family, Motion, grid};
use dynident_report::LinePlot;

const POINTS: usize = 801;

fn logistic(t: f64) -> f64 {
    1.0 / (1.0 + (-t).exp())
}

/// Fig. 2: the function and its derivatives, by f' = f(1 - f), f'' = f(1 - f)(1 - 2f).
pub(crate) fn figure_2() -> PaperFigure {
    let times: Vec<f64> = grid(20.0, POINTS).into_iter().map(|t| t - 10.0).collect();
    let of = |curve: fn(f64) -> f64| times.iter().map(|&t| curve(logistic(t))).collect::<Vec<f64>>();
    let (f, first, second) = (of(|f| f), of(|f| f * (1.0 - f)), of(|f| f * (1.0 - f) * (1.0 - 2.0 * f)));
    let rest = first[0].max(second[0]);
    let plot = LinePlot::new("Logistic function", "t", "f", times).line("f", f).line("f'", first).line("f''", second);
    PaperFigure::new(2, plot, "with its derivatives, which depend only on its value")
        .value("largest_derivative_at_minus_10", rest)
        .caption(format!("At t = −10 no derivative is above {} (the paper: below 1e-4)", rough(rest)))
}

/// Position of one spliced stroke with A = 1, h = 0, and its largest rate at the start.
fn spliced(omega: f64, period_s: f64, duration_s: f64) -> Option<(Vec<f64>, f64)> {
    let settings =
        SplicedLogisticSettings { periods_s: Some(vec![period_s]), offsets: Some(vec![0.0]), ..Default::default() };
    let family = SplicedLogistic::new(1, duration_s, &settings).ok()?;
    let mut motion = Motion::default();
    family.motion(&[1.0, omega], &grid(duration_s, POINTS), &mut motion);
    let rest = motion.dq[0].abs().max(motion.ddq[0].abs());
    Some((motion.q, rest))
}

/// Fig. 3: ω = 1, T = 40.
pub(crate) fn figure_3() -> PaperFigure {
    let (q, rest) = spliced(1.0, 40.0, 40.0).unwrap_or_default();
    let plot = LinePlot::new("Spliced logistic function", "t, s", "q, rad", grid(40.0, POINTS)).line("A = 1, ω = 1", q);
    PaperFigure::new(3, plot, "velocity and acceleration at both ends and at the splice are below 1e-4")
        .value("largest_rate_at_rest", rest)
        .caption(format!("Largest speed (rad/s) and acceleration (rad/s²) at the start: {}", rough(rest)))
}

/// Fig. 4: different ω at T = 80.
pub(crate) fn figure_4() -> PaperFigure {
    let mut plot = LinePlot::new("Different ω at T = 80", "t, s", "q, rad", grid(80.0, POINTS));
    for omega in [0.6, 0.8, 1.0, 1.5] {
        let (q, _) = spliced(omega, 80.0, 80.0).unwrap_or_default();
        plot = plot.line(format!("ω = {omega}"), q);
    }
    PaperFigure::new(4, plot, "the paper does not state the plotted values")
}

/// Fig. 5: different T at ω = 0.6.
pub(crate) fn figure_5() -> PaperFigure {
    let times = grid(100.0, POINTS);
    let mut plot = LinePlot::new("Different T at ω = 0.6", "t, s", "q, rad", times.clone());
    for period in [70.0, 80.0, 90.0, 100.0] {
        let (q, _) = spliced(0.6, period, period).unwrap_or_default();
        // The grid of the stroke ends at T.
        let at = |t: f64| if t <= period { sampled(&q, t / period) } else { f64::NAN };
        plot = plot.line(format!("T = {period}"), times.iter().map(|&t| at(t)).collect());
    }
    PaperFigure::new(5, plot, "the paper does not state the plotted values")
}

/// Linear interpolation between samples, `share` from 0 to 1.
fn sampled(values: &[f64], share: f64) -> f64 {
    let place = share * (values.len().max(2) - 1) as f64;
    let left = (place.floor() as usize).min(values.len().saturating_sub(2));
    match values.get(left..left + 2) {
        Some([a, b]) => a + (place - left as f64) * (b - a),
        _ => f64::NAN,
    }
}

/// Fig. 6: the part of a stroke around its mid-points that is used.
pub(crate) fn figure_6(amplitude: f64, omega: f64, window_s: f64) -> PaperFigure {
    let period = 40.0 / omega;
    let times = grid(period, POINTS);
    let (q, _) = spliced(omega, period, period).unwrap_or_default();
    let q: Vec<f64> = q.into_iter().map(|q| amplitude * q).collect();
    let middles = [0.25 * period, 0.75 * period];
    let inside = |t: f64| middles.iter().any(|middle| (t - middle).abs() <= window_s);
    let used = times.iter().zip(&q).map(|(&t, &q)| if inside(t) { q } else { f64::NAN }).collect();
    let plot = LinePlot::new("Areas involved in the identification", "t, s", "q, rad", times)
        .dashed("whole stroke", q)
        .line("used", used);
    PaperFigure::new(6, plot, "the solid part is used: mid-points ± δ, of the optimum inside (18)")
        .value("delta_s", window_s)
        .caption(format!("δ = {} s", shown(window_s)))
}
