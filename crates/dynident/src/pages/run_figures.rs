//! Figures of runs for the page of an iteration.

use crate::result::{IterationRun, IterationsFile};

/// Half-width of a 95 % error bar, in standard deviations.
pub(super) const HALF_WIDTH_95: f64 = 1.96;

/// Maximum number of distinguishable curves in a plot.
pub(super) const MAX_CURVES: usize = 6;

/// Number of the run, with its trajectory if each trajectory has a separate iteration.
pub(super) fn run_name(run: &IterationRun) -> String {
    run.leg.map_or_else(|| run.run.to_string(), |leg| format!("{} of leg {leg}", run.run))
}

/// Whether the true parameters are known.
pub(super) fn is_known(file: &IterationsFile) -> bool {
    file.runs.iter().flat_map(|run| &run.parameters).any(|parameter| parameter.error.is_some())
}

/// The last accepted run with an estimate.
pub(super) fn last_good(file: &IterationsFile) -> Option<&IterationRun> {
    file.runs.iter().rev().find(|run| run.accepted && !run.parameters.is_empty())
}

/// Largest tracking error of all joints, rad (m).
pub(super) fn worst(run: &IterationRun) -> f64 {
    run.max_tracking_error_rad.iter().fold(0.0, |most, error| most.max(*error))
}

/// Root mean square of a run's parameter errors, in standard deviations.
pub(super) fn error_in_bars(run: &IterationRun) -> Option<f64> {
    let squares: Vec<f64> = run
        .parameters
        .iter()
        .filter_map(|parameter| Some((parameter.error?, parameter.std.filter(|std| *std > 0.0)?)))
        .map(|(error, std)| (error / std).powi(2))
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Largest absolute parameter error.
pub(super) fn largest_error(run: &IterationRun) -> Option<f64> {
    run.parameters.iter().filter_map(|parameter| parameter.error.map(f64::abs)).reduce(f64::max)
}
