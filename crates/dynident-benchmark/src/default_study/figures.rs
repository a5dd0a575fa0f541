//! From the runs of a case to its figures.

use super::fits::{MULTIPLES, NamedEstimator};
use core::iter::Sum;

/// How many of some 95 % intervals hold the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Covered {
    /// Those that do.
    pub inside: usize,
    /// All of them.
    pub all: usize,
}

impl Covered {
    /// In percent; none where there are no intervals.
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

/// An estimator that was asked for by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorOfName {
    /// Its error, root mean square over the runs in which it settled, as a share.
    pub error: f64,
    /// The default's error in the same runs, of its estimate.
    pub of_default: f64,
    /// Runs in which it settled.
    pub settled: usize,
}

/// What became of an estimator by name in one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NamedRun {
    NotAsked,
    /// It gave no answer, or did not settle.
    Failed,
    /// Its error.
    Settled(f64),
}

/// Figures of one run; errors are shares.
pub(super) struct RunFigures {
    pub(super) written: f64,
    pub(super) free: f64,
    /// Of the written model with the true laws stated and all else by default.
    pub(super) laws_stated: f64,
    /// With the truth in hand, cut-off by cut-off; infinite where it leaves nothing.
    pub(super) with_truth: [f64; MULTIPLES.len()],
    pub(super) plain: Option<f64>,
    pub(super) plain_weighted: Option<f64>,
    pub(super) by_name: Vec<NamedRun>,
    pub(super) square_over_bound: Option<f64>,
    pub(super) bodies: Covered,
    pub(super) friction: Covered,
    pub(super) tellable: usize,
    pub(super) told: usize,
    pub(super) lag_found_s: Option<f64>,
    pub(super) lag_is_held: bool,
    pub(super) instruments: bool,
    pub(super) cutoff_hz: f64,
    pub(super) asked_hz: f64,
}

/// Figures of one case; errors are root mean squares over its runs, as shares.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseFigures {
    /// Recordings.
    pub runs: usize,
    /// Error of the model that the default writes: physically consistent.
    pub of_default: f64,
    /// Error of the default's estimate.
    pub of_default_free: f64,
    /// Error of the written model with the true laws stated and all else by default.
    pub of_laws_stated: f64,
    /// Error of the written model with the truth in hand: laws, lag and the best cut-off.
    pub of_best: f64,
    /// Error of the estimate with the truth in hand.
    pub of_best_free: f64,
    /// Its cut-off in units of what the spectra ask for.
    pub best_multiple: f64,
    /// The default's cut-off in these units, geometric mean.
    pub default_multiple: f64,
    /// Error of plain least squares; none where it failed in some run.
    pub of_plain: Option<f64>,
    /// The same with every joint weighted by its own noise.
    pub of_plain_weighted: Option<f64>,
    /// Errors of estimators by name, in the order of [`NamedEstimator::ALL`]; none where one was not asked.
    pub by_name: Vec<Option<ErrorOfName>>,
    /// Root mean square over bodies' base parameters and runs of the default's error over the Cramér-Rao bound of
    /// motion unknown, laws, noise and lag known; none where friction depends on the load.
    pub over_bound: Option<f64>,
    /// The default's intervals of bodies' base parameters.
    pub bodies: Covered,
    /// The default's intervals of friction at joints whose laws were all chosen as they are.
    pub friction: Covered,
    /// Joints, over all runs, of which the recordings can tell the law.
    pub tellable: usize,
    /// Those of which it was chosen.
    pub told: usize,
    /// The lag that was found, mean over the runs, s.
    pub lag_found_s: Option<f64>,
    /// Runs in which its 95 % bar holds the truth.
    pub lag_held: usize,
    /// Runs in which the default took instruments.
    pub instruments: usize,
}

impl CaseFigures {
    /// Error of the default's written model over that of the best with the truth in hand.
    pub fn over_best(&self) -> f64 {
        self.of_default / self.of_best
    }

    /// What choosing the laws costs: error of the default over that of the true laws stated, all else by default.
    pub fn over_laws_stated(&self) -> f64 {
        self.of_default / self.of_laws_stated
    }

    /// What cut-off and lag cost: error with the true laws stated, all else by default, over the best.
    pub fn laws_stated_over_best(&self) -> f64 {
        self.of_laws_stated / self.of_best
    }
}

/// The figures of a case; `of_best` are written models' errors with the cut-off that is best, `best` its place and
/// size.
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
        lag_found_s: (!lags.is_empty()).then(|| lags.iter().sum::<f64>() / lags.len() as f64),
        lag_held: runs.iter().filter(|run| run.lag_is_held).count(),
        instruments: runs.iter().filter(|run| run.instruments).count(),
    }
}
