//! Results of a cell (one estimator, robot and noise level) from the answers of its runs.

use super::trial::Answer;
use serde::Serialize;

/// Results of one parameter in one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ParameterFigures {
    /// Symbol of the base parameter.
    pub symbol: String,
    /// True value of the parameter.
    pub truth: f64,
    /// Cramér-Rao lower bound of the parameter's standard deviation, for exactly known motion.
    pub bound: f64,
    /// The bound for unknown motion, with information about the motion from the noisy positions only.
    pub bound_with_motion: f64,
    /// Mean error over the runs without failure.
    pub bias: f64,
    /// RMS error over the runs without failure.
    pub rmse: f64,
    /// Percentage of the 95 % intervals that contain the true value.
    pub coverage_percent: Option<f64>,
}

/// Results of one estimator on one robot at one noise level.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CellFigures {
    /// Name of the robot.
    pub robot: String,
    /// Name of the noise level.
    pub noise: String,
    /// Name of the estimator.
    pub estimator: String,
    /// Number of runs.
    pub runs: usize,
    /// Runs without a result, not converged, or diverged (error more than 50 times that of the start values).
    pub failures: usize,
    /// `√(mean over parameters of (bias/bound)²)`. Its sampling error is about `RMSE over bound / √runs`.
    pub bias_over_bound: Option<f64>,
    /// `√(mean over parameters of (RMSE/bound)²)`: 1 is the optimum of an unbiased estimator.
    pub rmse_over_bound: Option<f64>,
    /// `√(mean over parameters of (RMSE/bound_with_motion)²)`: 1 is the optimum of an unbiased estimator with unknown
    /// motion.
    pub rmse_over_bound_with_motion: Option<f64>,
    /// Symbol of the parameter with the largest ratio of RMS error to Cramér-Rao bound.
    pub worst_parameter: Option<String>,
    /// Ratio of RMS error to Cramér-Rao bound of that parameter.
    pub worst_rmse_over_bound: Option<f64>,
    /// Percentage of all 95 % intervals that contain the true value.
    pub coverage_percent: Option<f64>,
    /// Mean processor time of one estimate, without shared rows, milliseconds. The only result that varies between
    /// repetitions.
    pub time_ms: f64,
    /// Results of every base parameter.
    pub parameters: Vec<ParameterFigures>,
}

/// Error relative to that of the start values above which a run is treated as diverged, as in BIRDy.
const MAX_ERROR_OVER_START: f64 = 50.0;

/// Whether an answer is usable: converged, finite, and at most 50 times as far from the truth as the start (norms over
/// parameters in units of their bounds).
pub(super) fn usable(answer: &Answer, truth: &[f64], start: &[f64], bound: &[f64]) -> bool {
    let distance = |values: &[f64]| -> f64 {
        values.iter().zip(truth).zip(bound).map(|((x, t), b)| ((x - t) / b).powi(2)).sum::<f64>().sqrt()
    };
    answer.converged
        && answer.values.len() == truth.len()
        && distance(&answer.values).is_finite()
        && distance(&answer.values) <= MAX_ERROR_OVER_START * distance(start)
}

pub(super) struct Cell<'a> {
    pub(super) robot: &'a str,
    pub(super) noise: &'a str,
    pub(super) estimator: &'a str,
    pub(super) symbols: &'a [String],
    pub(super) truth: &'a [f64],
    pub(super) bound: &'a [f64],
    pub(super) bound_with_motion: &'a [f64],
}

/// Results of a cell: `answers` contains one entry per run, `None` for a failure.
pub(super) fn figures(cell: &Cell<'_>, answers: &[Option<Answer>], time_ms: f64) -> CellFigures {
    let good: Vec<&Answer> = answers.iter().flatten().collect();
    let count = good.len() as f64;
    let parameters: Vec<ParameterFigures> = (0..cell.truth.len())
        .map(|p| {
            let truth = cell.truth[p];
            let mean = |of: &dyn Fn(&Answer) -> f64| good.iter().map(|answer| of(answer)).sum::<f64>() / count;
            let bars =
                good.iter().filter_map(|answer| answer.half_width_95.as_ref().map(|bars| (answer.values[p], bars[p])));
            let (inside, all) = bars.fold((0_usize, 0_usize), |(inside, all), (value, bar)| {
                (inside + usize::from((value - truth).abs() <= bar), all + 1)
            });
            ParameterFigures {
                symbol: cell.symbols[p].clone(),
                truth,
                bound: cell.bound[p],
                bound_with_motion: cell.bound_with_motion[p],
                bias: mean(&|answer| answer.values[p] - truth),
                rmse: mean(&|answer| (answer.values[p] - truth).powi(2)).sqrt(),
                coverage_percent: (all > 0).then(|| 100.0 * inside as f64 / all as f64),
            }
        })
        .collect();
    let parameters = if good.is_empty() { Vec::new() } else { parameters };
    let root_mean = |of: &dyn Fn(&ParameterFigures) -> f64| {
        let sum: f64 = parameters.iter().map(|p| of(p).powi(2)).sum();
        (!parameters.is_empty()).then(|| (sum / parameters.len() as f64).sqrt())
    };
    let covered: Vec<f64> = parameters.iter().filter_map(|p| p.coverage_percent).collect();
    let worst = parameters.iter().max_by(|a, b| (a.rmse / a.bound).total_cmp(&(b.rmse / b.bound)));
    CellFigures {
        robot: cell.robot.to_owned(),
        noise: cell.noise.to_owned(),
        estimator: cell.estimator.to_owned(),
        runs: answers.len(),
        failures: answers.len() - good.len(),
        bias_over_bound: root_mean(&|p| p.bias / p.bound),
        rmse_over_bound: root_mean(&|p| p.rmse / p.bound),
        rmse_over_bound_with_motion: root_mean(&|p| p.rmse / p.bound_with_motion),
        worst_parameter: worst.map(|p| p.symbol.clone()),
        worst_rmse_over_bound: worst.map(|p| p.rmse / p.bound),
        coverage_percent: (!covered.is_empty()).then(|| covered.iter().sum::<f64>() / covered.len() as f64),
        time_ms,
        parameters,
    }
}

/// The cells as CSV, one line each.
pub fn cells_csv(cells: &[CellFigures]) -> String {
    use std::fmt::Write;
    let mut text = String::from(
        "robot,noise,estimator,runs,failures,bias_over_bound,rmse_over_bound,worst_parameter,worst_rmse_over_bound,coverage_percent,time_ms,rmse_over_bound_with_motion\n",
    );
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.6}"));
    for cell in cells {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{:.3},{}",
            cell.robot,
            cell.noise,
            cell.estimator,
            cell.runs,
            cell.failures,
            number(cell.bias_over_bound),
            number(cell.rmse_over_bound),
            cell.worst_parameter.as_deref().unwrap_or_default(),
            number(cell.worst_rmse_over_bound),
            number(cell.coverage_percent),
            cell.time_ms,
            number(cell.rmse_over_bound_with_motion),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(value: f64, bar: f64) -> Answer {
        Answer { values: vec![value], half_width_95: Some(vec![bar]), converged: true }
    }

    /// Errors +1, -3 and a failure on a parameter with a bound of 2: bias -1, RMSE √5; one of two intervals covers the
    /// truth.
    #[test]
    fn figures_by_hand() {
        let symbols = ["m1".to_owned()];
        let cell = Cell {
            robot: "r",
            noise: "n",
            estimator: "e",
            symbols: &symbols,
            truth: &[10.0],
            bound: &[2.0],
            bound_with_motion: &[4.0],
        };
        let figures = figures(&cell, &[Some(answer(11.0, 1.5)), None, Some(answer(7.0, 1.5))], 2.0);
        assert_eq!((figures.runs, figures.failures), (3, 1));
        assert!((figures.bias_over_bound.unwrap() - 0.5).abs() < 1e-15);
        assert!((figures.rmse_over_bound.unwrap() - 5.0_f64.sqrt() / 2.0).abs() < 1e-15);
        assert!((figures.rmse_over_bound_with_motion.unwrap() - 5.0_f64.sqrt() / 4.0).abs() < 1e-15);
        assert_eq!(figures.coverage_percent, Some(50.0));
        assert!(cells_csv(&[figures]).lines().nth(1).unwrap().starts_with("r,n,e,3,1,0.500000,1.118034,m1,"));
    }

    #[test]
    fn divergence_is_measured_from_the_start() {
        let far = answer(10.0 + 49.0, 1.0);
        assert!(usable(&far, &[10.0], &[11.0], &[2.0]) && !usable(&far, &[10.0], &[10.5], &[2.0]));
        assert!(!usable(&answer(f64::NAN, 1.0), &[10.0], &[11.0], &[2.0]));
    }
}
