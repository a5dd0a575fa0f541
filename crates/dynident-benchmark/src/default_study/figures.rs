//! Results of a case from its runs.

use super::fits::{CUTOFF_MULTIPLES, NamedEstimator};
use core::iter::Sum;

/// How many 95 % intervals contain the true value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Covered {
    /// Number of intervals that contain the true value.
    pub inside: usize,
    /// Number of all intervals.
    pub all: usize,
}

impl Covered {
    /// Percentage of the intervals that contain the true value; `None` without intervals.
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

/// Results of one of the estimators that are compared by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorOfName {
    /// RMS error over the runs in which it converged, relative to the standard deviation of the torque.
    pub error: f64,
    /// Error of the default settings in the same runs, without the conditions of physical consistency.
    pub of_default: f64,
    /// Number of runs in which it converged.
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
    /// Error of the written model with the true friction laws and default settings for everything else.
    pub(super) laws_stated: f64,
    /// Errors with the true friction laws and the true lag for each cut-off; infinite for impossible filters.
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

/// Torque errors of one case, RMS over its runs, relative to the standard deviation of the torque.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseFigures {
    /// Number of recordings.
    pub runs: usize,
    /// Error of the physically consistent model that a study with default settings writes.
    pub of_default: f64,
    /// Error of the default settings' estimate without the conditions of physical consistency.
    pub of_default_free: f64,
    /// Error of the written model with the true friction laws and default settings for everything else.
    pub of_laws_stated: f64,
    /// Error of the written model with the true friction laws, the true lag and the best cut-off.
    pub of_best: f64,
    /// Error of the estimate without the conditions of physical consistency, with the true friction laws, the true lag
    /// and the best cut-off.
    pub of_best_free: f64,
    /// Best cut-off relative to that from the position spectra.
    pub best_multiple: f64,
    /// Default cut-off relative to that from the position spectra, geometric mean over the runs.
    pub default_multiple: f64,
    /// Error of ordinary least squares with viscous and Coulomb friction; `None` if it failed in any run.
    pub of_plain: Option<f64>,
    /// Error of the same fit with weights from the noise of each joint.
    pub of_plain_weighted: Option<f64>,
    /// Results of the estimators compared by name, in the order of [`NamedEstimator::ALL`]; `None` if not computed.
    pub by_name: Vec<Option<ErrorOfName>>,
    /// RMS over bodies' base parameters and runs of the default's error relative to the Cramér-Rao bound for unknown
    /// motion and known laws, noise and lag; `None` for load-dependent friction.
    pub over_bound: Option<f64>,
    /// Coverage of the 95 % intervals of the bodies' base parameters with default settings.
    pub bodies: Covered,
    /// Coverage of the 95 % intervals of friction with default settings, for joints whose friction laws were all
    /// selected correctly.
    pub friction: Covered,
    /// Number of joints, over all runs, whose friction law can be distinguished from simpler ones with these
    /// recordings.
    pub tellable: usize,
    /// Number of these joints for which the true law was selected.
    pub told: usize,
    /// Number of joints, over all runs, whose true friction has neither hysteresis nor a part that depends on the
    /// transmitted torque.
    pub without_need: usize,
    /// Number of these joints for which a law with hysteresis or with such a part was selected.
    pub unneeded: usize,
    /// Estimated lag of the torque, mean over the runs, s.
    pub lag_found_s: Option<f64>,
    /// Number of runs in which the 95 % interval of the lag contains the true lag.
    pub lag_held: usize,
    /// Number of runs in which the default settings used instrumental variables.
    pub instruments: usize,
}

impl CaseFigures {
    /// Ratio of the error with default settings to that of the best written model.
    pub fn over_best(&self) -> f64 {
        self.of_default / self.of_best
    }

    /// Ratio of the error with default settings to that with the true friction laws: the effect of selecting the
    /// laws.
    pub fn over_laws_stated(&self) -> f64 {
        self.of_default / self.of_laws_stated
    }

    /// Ratio of the error with the true friction laws and default settings to that of the best written model: the
    /// effect of cut-off and lag.
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
