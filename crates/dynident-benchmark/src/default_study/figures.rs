//! Results of a case from its runs.

use super::fits::{CUTOFF_MULTIPLES, NamedEstimator};
use core::iter::Sum;

/// Coverage of 95 % intervals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Covered {
    /// Intervals that contain the truth.
    pub inside: usize,
    /// All intervals.
    pub all: usize,
}

impl Covered {
    /// Coverage in percent; `None` without intervals.
    pub fn percent(self) -> Option<f64> {
        (self.all > 0).then(|| 100.0 * self.inside as f64 / self.all as f64)
    }
}

impl Sum for Covered {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        let add = |sum: Self, one: Self| Self { inside: sum.inside + one.inside, all: sum.all + one.all };
        all.fold(Self::default(), add)
    }
}

/// Results of one estimator by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorOfName {
    /// Its RMS error over the runs in which it converged, as a share.
    pub error: f64,
    /// Error of the default's estimate in the same runs.
    pub of_default: f64,
    /// Runs in which it converged.
    pub settled: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NamedRun {
    NotAsked,
    /// No result, or not converged.
    Failed,
    /// Converged, with its error.
    Settled(f64),
}

pub(super) struct RunFigures {
    pub(super) written: f64,
    pub(super) free: f64,
    /// Error of the written model with the true laws and defaults for everything else.
    pub(super) laws_stated: f64,
    /// Errors with the true laws and lag for each cut-off; infinite for impossible filters.
    pub(super) with_truth: [f64; CUTOFF_MULTIPLES.len()],
    pub(super) plain: Option<f64>,
    pub(super) plain_weighted: Option<f64>,
    pub(super) by_name: Vec<NamedRun>,
    pub(super) square_over_bound: Option<f64>,
    pub(super) bodies: Covered,
    pub(super) friction: Covered,
    pub(super) tellable: usize,
    pub(super) told: usize,
    pub(super) unneeded: usize,
    pub(super) without_need: usize,
    pub(super) lag_found_s: Option<f64>,
    pub(super) lag_is_held: bool,
    pub(super) instruments: bool,
    pub(super) cutoff_hz: f64,
    pub(super) asked_hz: f64,
}

/// Results of one case; errors are RMS values over its runs, as shares.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseFigures {
    /// Number of recordings.
    pub runs: usize,
    /// Error of the model that the default study writes (physically consistent).
    pub of_default: f64,
    /// Error of the default's estimate.
    pub of_default_free: f64,
    /// Error of the written model with the true laws and defaults for everything else.
    pub of_laws_stated: f64,
    /// Error of the written model with true laws, true lag and best cut-off.
    pub of_best: f64,
    /// Error of the estimate with true laws, true lag and best cut-off.
    pub of_best_free: f64,
    /// Best cut-off in units of that from the spectra.
    pub best_multiple: f64,
    /// Default cut-off in these units, geometric mean.
    pub default_multiple: f64,
    /// Error of plain least squares; `None` if it failed in some run.
    pub of_plain: Option<f64>,
    /// The same with weights by joint noise.
    pub of_plain_weighted: Option<f64>,
    /// Errors of estimators by name, in the order of [`NamedEstimator::ALL`]; `None` if not computed.
    pub by_name: Vec<Option<ErrorOfName>>,
    /// RMS over bodies' base parameters and runs of the default's error relative to the Cramér-Rao bound for unknown
    /// motion and known laws, noise and lag; `None` for load-dependent friction.
    pub over_bound: Option<f64>,
    /// Coverage of the default's intervals of bodies' base parameters.
    pub bodies: Covered,
    /// Coverage of the default's friction intervals for joints whose laws were all selected correctly.
    pub friction: Covered,
    /// Number of joints, over all runs, whose law the recordings can distinguish.
    pub tellable: usize,
    /// Number of these joints for which the law was selected.
    pub told: usize,
    /// Number of joints, over all runs, whose true friction has neither memory nor load.
    pub without_need: usize,
    /// Number of these joints for which a law with memory or under load was selected.
    pub unneeded: usize,
    /// Estimated lag, mean over the runs, s.
    pub lag_found_s: Option<f64>,
    /// Runs in which the 95 % interval of the lag contains the truth.
    pub lag_held: usize,
    /// Runs in which the default used instrumental variables.
    pub instruments: usize,
}

impl CaseFigures {
    /// Error of the default's written model relative to the best one.
    pub fn over_best(&self) -> f64 {
        self.of_default / self.of_best
    }

    /// Cost of selecting the laws: error of the default relative to that with the true laws.
    pub fn over_laws_stated(&self) -> f64 {
        self.of_default / self.of_laws_stated
    }

    /// Cost of cut-off and lag: error with the true laws and defaults for everything else, relative to the best.
    pub fn laws_stated_over_best(&self) -> f64 {
        self.of_laws_stated / self.of_best
    }
}

/// Results of a case; `of_best` are the written models' errors with the best cut-off, `best` is its index and size.
pub(super) fn summed(runs: &[RunFigures], best: (usize, f64), of_best: &[f64]) -> CaseFigures {
    let count = runs.len();
    let root = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, all) = values.fold((0.0, 0.0), |(sum, all), value| (sum + value * value, all + 1.0));
        f64::sqrt(sum / all)
    };
    let of_name = |place: usize| {
        let asked = runs.iter().any(|run| run.by_name[place] != NamedRun::NotAsked);
        let error = |run: &RunFigures| match run.by_name[place] {
            NamedRun::Settled(error) => Some((error, run.free)),
            NamedRun::NotAsked | NamedRun::Failed => None,
        };
        let settled = || runs.iter().filter_map(error);
        asked.then(|| ErrorOfName {
            error: root(&mut settled().map(|(error, _)| error)),
            of_default: root(&mut settled().map(|(_, free)| free)),
            settled: settled().count(),
        })
    };
    let all = |of: fn(&RunFigures) -> Option<f64>| -> Option<f64> {
        let errors: Option<Vec<f64>> = runs.iter().map(of).collect();
        errors.map(|errors| root(&mut errors.into_iter()))
    };
    let squares: Option<Vec<f64>> = runs.iter().map(|run| run.square_over_bound).collect();
    let lags: Vec<f64> = runs.iter().filter_map(|run| run.lag_found_s).collect();
    CaseFigures {
        runs: count,
        of_default: root(&mut runs.iter().map(|run| run.written)),
        of_default_free: root(&mut runs.iter().map(|run| run.free)),
        of_laws_stated: root(&mut runs.iter().map(|run| run.laws_stated)),
        of_best: root(&mut of_best.iter().copied()),
        of_best_free: root(&mut runs.iter().map(|run| run.with_truth[best.0])),
        best_multiple: best.1,
        default_multiple: (runs.iter().map(|run| (run.cutoff_hz / run.asked_hz).ln()).sum::<f64>() / count as f64)
            .exp(),
        of_plain: all(|run| run.plain),
        of_plain_weighted: all(|run| run.plain_weighted),
        by_name: (0..NamedEstimator::ALL.len()).map(of_name).collect(),
        over_bound: squares.map(|squares| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()),
        bodies: runs.iter().map(|run| run.bodies).sum(),
        friction: runs.iter().map(|run| run.friction).sum(),
        tellable: runs.iter().map(|run| run.tellable).sum(),
        told: runs.iter().map(|run| run.told).sum(),
        without_need: runs.iter().map(|run| run.without_need).sum(),
        unneeded: runs.iter().map(|run| run.unneeded).sum(),
        lag_found_s: (!lags.is_empty()).then(|| lags.iter().sum::<f64>() / lags.len() as f64),
        lag_held: runs.iter().filter(|run| run.lag_is_held).count(),
        instruments: runs.iter().filter(|run| run.instruments).count(),
    }
}
