//! CMA-ES: evolution strategy with covariance matrix adaptation, for objectives without derivatives.

use super::{Objective, OptimiserError, Progress, Watch, check_bounds, check_length, evaluate_all, setting};
use core::ops::ControlFlow;
use dynident_model::sample::Random;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Settings of [`cma_es()`]. Strategy constants are the defaults of Hansen, *The CMA Evolution Strategy: A Tutorial*
/// (2016), table 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CmaEsSettings {
    /// Number of candidates of a generation, at least 4; `None`: 4 + ⌊3 ln n⌋ for n variables. Default `None`.
    pub population: Option<usize>,
    /// Number of restarts after the end of a run, each from a random point with twice the candidates (IPOP, Auger and
    /// Hansen 2005). Default 0.
    pub restarts: usize,
    /// Number of evaluations of all runs; after it no generation begins. Default 100,000.
    pub max_evaluations: usize,
    /// Objective value at which the search ends. Default none.
    pub target: Option<f64>,
    /// A run ends if the best values of the last 10 + ⌈30 n/λ⌉ generations and all values of the current generation
    /// differ by less than this. n is the number of variables, λ that of candidates. Default 1e-12.
    pub function_tolerance: f64,
    /// A run ends if the step size falls below this share of the first step size. Default 1e-12.
    pub step_tolerance: f64,
    /// Seed of the random numbers. Default 0.
    pub seed: u64,
}

impl Default for CmaEsSettings {
    fn default() -> Self {
        Self {
            population: None,
            restarts: 0,
            max_evaluations: 100_000,
            target: None,
            function_tolerance: 1e-12,
            step_tolerance: 1e-12,
            seed: 0,
        }
    }
}

impl CmaEsSettings {
    /// Checks the range of every setting.
    ///
    /// # Errors
    /// [`OptimiserError::Setting`] with the first invalid one.
    pub fn validate(&self) -> Result<(), OptimiserError> {
        let population = self.population.unwrap_or(4);
        let usable = population >= 4 && (self.population.is_none() || population <= self.max_evaluations);
        setting("population", population as f64, usable, "at least 4 and at most `max_evaluations`")?;
        let fix = "at most 20 (the population doubles each time)";
        setting("restarts", self.restarts as f64, self.restarts <= 20, fix)?;
        setting("max_evaluations", self.max_evaluations as f64, self.max_evaluations >= 1, "at least 1")?;
        setting("target", self.target.unwrap_or(0.0), !self.target.is_some_and(f64::is_nan), "a number")?;
        let (function, step) = (self.function_tolerance, self.step_tolerance);
        setting("function_tolerance", function, (0.0..f64::INFINITY).contains(&function), "finite and not negative")?;
        setting("step_tolerance", step, (0.0..1.0).contains(&step), "between 0 and 1")
    }
}

/// Reason for the end of a run of [`cma_es()`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CmaEsStatus {
    /// The objective has reached the target.
    TargetReached,
    /// The objective no longer changes.
    FunctionTolerance,
    /// The steps are below the tolerance, or too small to change the mean of the candidates in double precision.
    StepTolerance,
    /// The condition number of the covariance exceeds 1e14.
    IllConditioned,
    /// The step size grew by a factor of 10,000: the start was far away or the objective is unbounded below.
    Diverged,
    /// The evaluations are used up.
    EvaluationLimit,
    /// The callback stopped the search.
    Stopped,
}

/// One run of the strategy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CmaEsRun {
    /// Number of candidates of a generation.
    pub population: usize,
    /// Number of evaluations in this run.
    pub evaluations: usize,
    /// Lowest objective of this run.
    pub value: f64,
    /// Reason for the end of this run.
    pub status: CmaEsStatus,
}

/// Result of [`cma_es()`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CmaEsResult {
    /// Best point of all runs, inside the bounds.
    pub best: Vec<f64>,
    /// Objective of the best point; infinite if the objective was never finite.
    pub value: f64,
    /// Number of evaluations of all runs.
    pub evaluations: usize,
    /// Reason for the end of the last run.
    pub status: CmaEsStatus,
    /// All runs, in order.
    pub runs: Vec<CmaEsRun>,
}

/// Minimises `objective` from `start` with initial standard deviations `steps` (one per variable), inside `bounds`.
///
/// (μ/μ_w, λ)-CMA-ES with cumulative step-size adaptation, rank-one and rank-μ update (Hansen 2016, fig. 6). A
/// candidate outside the bounds is evaluated at the nearest point inside, and ranked with a penalty. The penalty is
/// the square of its distance (in the scale of the search) times the spread of the generation's values (Hansen 2016,
/// appendix B.5).
///
/// Candidates are evaluated in parallel; the result depends only on the seed.
///
/// # Errors
/// A setting out of range, vectors of different lengths, empty bounds, a step that is not positive, or no variable.
pub fn cma_es(
    objective: impl Fn(&[f64]) -> f64 + Sync,
    start: &[f64],
    steps: &[f64],
    bounds: &[[f64; 2]],
    settings: &CmaEsSettings,
    watch: &mut Watch<'_>,
) -> Result<CmaEsResult, OptimiserError> {
    minimised(&objective, start, steps, bounds, settings, watch)
}

/// [`cma_es()`], compiled once for all objectives.
fn minimised(
    objective: &Objective<'_>,
    start: &[f64],
    steps: &[f64],
    bounds: &[[f64; 2]],
    settings: &CmaEsSettings,
    watch: &mut Watch<'_>,
) -> Result<CmaEsResult, OptimiserError> {
    check_input(start, steps, bounds, settings)?;
    let mut from = clamped(start, bounds);
    let result = CmaEsResult {
        best: from.clone(),
        value: f64::INFINITY,
        evaluations: 0,
        status: CmaEsStatus::EvaluationLimit,
        runs: Vec::new(),
    };
    let random = Random::new(settings.seed);
    let mut search = Search { objective, bounds, settings, random, generations: 0, result };
    let smallest = settings.population.unwrap_or(4 + (3.0 * (start.len() as f64).ln()) as usize);
    for run in 0..=settings.restarts {
        let population = smallest << run;
        if run > 0 && population > settings.max_evaluations.saturating_sub(search.result.evaluations) {
            search.result.status = CmaEsStatus::EvaluationLimit;
            break;
        }
        let ended = search.run(Strategy::new(&from, steps, population), watch);
        search.result.runs.push(ended);
        search.result.status = ended.status;
        if matches!(ended.status, CmaEsStatus::Stopped | CmaEsStatus::TargetReached | CmaEsStatus::EvaluationLimit) {
            break;
        }
        from = search.random_place(start, steps);
    }
    Ok(search.result)
}

fn check_input(
    start: &[f64],
    steps: &[f64],
    bounds: &[[f64; 2]],
    settings: &CmaEsSettings,
) -> Result<(), OptimiserError> {
    settings.validate()?;
    setting("variables", start.len() as f64, !start.is_empty(), "at least 1")?;
    check_length("steps", start.len(), steps.len())?;
    check_length("bounds", start.len(), bounds.len())?;
    check_bounds(bounds, false)?;
    for &step in steps {
        setting("steps", step, step > 0.0 && step.is_finite(), "positive and finite")?;
    }
    if start.iter().any(|x| !x.is_finite()) {
        return Err(OptimiserError::Start);
    }
    Ok(())
}

fn clamped(x: &[f64], bounds: &[[f64; 2]]) -> Vec<f64> {
    x.iter().zip(bounds).map(|(x, b)| x.clamp(b[0], b[1])).collect()
}

/// All runs of a search, and the best point so far.
struct Search<'a> {
    objective: &'a Objective<'a>,
    bounds: &'a [[f64; 2]],
    settings: &'a CmaEsSettings,
    random: Random,
    generations: usize,
    result: CmaEsResult,
}

impl Search<'_> {
    fn run(&mut self, mut strategy: Strategy, watch: &mut Watch<'_>) -> CmaEsRun {
        let before = self.result.evaluations;
        let mut lowest_of_run = f64::INFINITY;
        let status = loop {
            let candidates = strategy.sample(&mut self.random);
            let inside: Vec<Vec<f64>> =
                candidates.iter().map(|y| clamped(&strategy.unscaled(y), self.bounds)).collect();
            let values = evaluate_all(self.objective, &inside);
            let result = &mut self.result;
            result.evaluations += values.len();
            self.generations += 1;
            let lowest = (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
            lowest_of_run = lowest_of_run.min(values[lowest]);
            if values[lowest] < result.value {
                result.value = values[lowest];
                result.best.clone_from(&inside[lowest]);
            }
            let progress = Progress {
                best: &result.best,
                value: result.value,
                violation: 0.0,
                iteration: self.generations,
                evaluations: result.evaluations,
            };
            if let ControlFlow::Break(()) = watch(&progress) {
                break CmaEsStatus::Stopped;
            }
            if self.settings.target.is_some_and(|target| result.value <= target) {
                break CmaEsStatus::TargetReached;
            }
            let ranked = strategy.penalised(&candidates, &inside, &values);
            strategy.update(&candidates, &ranked);
            if let Some(status) = strategy.end(&values, self.settings) {
                break status;
            }
            if result.evaluations >= self.settings.max_evaluations {
                break CmaEsStatus::EvaluationLimit;
            }
        };
        let evaluations = self.result.evaluations - before;
        CmaEsRun { population: strategy.population, evaluations, value: lowest_of_run, status }
    }

    /// Random start of the next run: anywhere inside finite bounds, otherwise around the first start.
    fn random_place(&mut self, start: &[f64], steps: &[f64]) -> Vec<f64> {
        (0..start.len())
            .map(|i| {
                let [lower, upper] = self.bounds[i];
                let anywhere = if (upper - lower).is_finite() {
                    self.random.uniform(lower, upper)
                } else {
                    start[i] + steps[i] * self.random.normal()
                };
                anywhere.clamp(lower, upper)
            })
            .collect()
    }
}

/// The distribution N(mean, σ² C) and its evolution paths, in variables divided by the initial steps.
struct Strategy {
    steps: Vec<f64>,
    population: usize,
    weights: Vec<f64>,
    mu_eff: f64,
    mean: DVector<f64>,
    sigma: f64,
    covariance: DMatrix<f64>,
    /// Eigenvectors of the covariance; the field below contains the square roots of its eigenvalues.
    axes: DMatrix<f64>,
    lengths: DVector<f64>,
    path_sigma: DVector<f64>,
    path_c: DVector<f64>,
    generation: usize,
    decomposed_at: usize,
    recent: VecDeque<f64>,
}

impl Strategy {
    fn new(start: &[f64], steps: &[f64], population: usize) -> Self {
        let n = start.len();
        let parents = population / 2;
        let raw: Vec<f64> =
            (1..=parents).map(|rank| f64::midpoint(population as f64, 1.0).ln() - (rank as f64).ln()).collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        Self {
            mu_eff: 1.0 / weights.iter().map(|w| w * w).sum::<f64>(),
            weights,
            population,
            mean: DVector::from_iterator(n, start.iter().zip(steps).map(|(x, step)| x / step)),
            steps: steps.to_vec(),
            sigma: 1.0,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            lengths: DVector::from_element(n, 1.0),
            path_sigma: DVector::zeros(n),
            path_c: DVector::zeros(n),
            generation: 0,
            decomposed_at: 0,
            recent: VecDeque::new(),
        }
    }

    fn sample(&self, random: &mut Random) -> Vec<DVector<f64>> {
        (0..self.population)
            .map(|_| {
                let z = DVector::from_fn(self.mean.len(), |_, _| random.normal());
                &self.mean + &self.axes * z.component_mul(&self.lengths) * self.sigma
            })
            .collect()
    }

    fn unscaled(&self, y: &DVector<f64>) -> Vec<f64> {
        y.iter().zip(&self.steps).map(|(y, step)| y * step).collect()
    }

    fn penalised(&self, candidates: &[DVector<f64>], inside: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
        let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        finite.sort_by(f64::total_cmp);
        let quartiles = finite.get(3 * finite.len() / 4).zip(finite.get(finite.len() / 4));
        let spread = quartiles.map_or(1.0, |(high, low)| (high - low).max(f64::MIN_POSITIVE));
        let variance = self.sigma * self.sigma * self.covariance.trace() / self.mean.len() as f64;
        (0..values.len())
            .map(|k| {
                let distance: f64 = (0..self.mean.len())
                    .map(|i| (candidates[k][i] - inside[k][i] / self.steps[i]).powi(2))
                    // Smaller distances are rounding errors of the division.
                    .filter(|d| *d > 1e-28 * variance)
                    .sum();
                values[k] + spread * distance / variance
            })
            .collect()
    }

    /// Updates mean, paths, covariance and step size (Hansen 2016, equations 39 to 47 with positive weights).
    fn update(&mut self, candidates: &[DVector<f64>], ranked: &[f64]) {
        let n = self.mean.len() as f64;
        let mu_eff = self.mu_eff;
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n);
        let c_1 = 2.0 / ((n + 1.3).powi(2) + mu_eff);
        let c_mu = (1.0 - c_1).min(2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0).powi(2) + mu_eff));
        let expected_length = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));

        let mut order: Vec<usize> = (0..ranked.len()).collect();
        order.sort_by(|&a, &b| ranked[a].total_cmp(&ranked[b]).then(a.cmp(&b)));
        let offsets: Vec<DVector<f64>> =
            order.iter().take(self.weights.len()).map(|&k| (&candidates[k] - &self.mean) / self.sigma).collect();
        let mut shift = DVector::zeros(self.mean.len());
        for (offset, weight) in offsets.iter().zip(&self.weights) {
            shift.axpy(*weight, offset, 1.0);
        }
        self.mean.axpy(self.sigma, &shift, 1.0);
        self.generation += 1;

        let whitened = &self.axes * (self.axes.tr_mul(&shift)).component_div(&self.lengths);
        self.path_sigma *= 1.0 - c_sigma;
        self.path_sigma.axpy((c_sigma * (2.0 - c_sigma) * mu_eff).sqrt(), &whitened, 1.0);
        let length = self.path_sigma.norm();
        let settled = (1.0 - (1.0 - c_sigma).powi(2 * self.generation as i32)).sqrt();
        // The path is not updated while the step size is still adapting.
        let steady = length / settled < (1.4 + 2.0 / (n + 1.0)) * expected_length;
        self.path_c *= 1.0 - c_c;
        if steady {
            self.path_c.axpy((c_c * (2.0 - c_c) * mu_eff).sqrt(), &shift, 1.0);
        }
        let lost = if steady { 0.0 } else { c_c * (2.0 - c_c) };
        self.covariance *= 1.0 + c_1 * lost - c_1 - c_mu;
        self.covariance.ger(c_1, &self.path_c, &self.path_c, 1.0);
        for (offset, weight) in offsets.iter().zip(&self.weights) {
            self.covariance.ger(c_mu * weight, offset, offset, 1.0);
        }
        self.sigma *= ((c_sigma / d_sigma) * (length / expected_length - 1.0)).exp();
        // The matrix is decomposed only after significant changes (Hansen 2016, appendix B.2).
        let pause = 1.0 / (10.0 * n * (c_1 + c_mu));
        if (self.generation - self.decomposed_at) as f64 > pause {
            self.decompose();
        }
    }

    fn decompose(&mut self) {
        self.decomposed_at = self.generation;
        self.covariance = 0.5 * (&self.covariance + self.covariance.transpose());
        let eigen = SymmetricEigen::new(self.covariance.clone());
        self.axes = eigen.eigenvectors;
        self.lengths = eigen.eigenvalues.map(|value| value.max(f64::MIN_POSITIVE).sqrt());
    }

    /// Returns the reason if this run has ended (Hansen 2016, appendix B.3).
    fn end(&mut self, values: &[f64], settings: &CmaEsSettings) -> Option<CmaEsStatus> {
        let n = self.mean.len();
        let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let window = 10 + (30 * n).div_ceil(self.population);
        self.recent.push_back(lowest);
        if self.recent.len() > window {
            self.recent.pop_front();
        }
        let deviations: Vec<f64> = (0..n).map(|i| self.covariance[(i, i)].max(0.0).sqrt()).collect();
        let reach = (0..n).map(|i| self.sigma * deviations[i].max(self.path_c[i].abs())).fold(0.0, f64::max);
        if !self.sigma.is_finite() || self.sigma * self.lengths.max() > 1e4 {
            return Some(CmaEsStatus::Diverged);
        }
        if self.lengths.max() > 1e7 * self.lengths.min() {
            return Some(CmaEsStatus::IllConditioned);
        }
        let stuck = (0..n).all(|i| self.mean[i] == self.mean[i] + 0.2 * self.sigma * deviations[i]);
        if reach < settings.step_tolerance || stuck {
            return Some(CmaEsStatus::StepTolerance);
        }
        let oldest = self.recent.iter().copied().fold(f64::INFINITY, f64::min);
        let newest = self.recent.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Equal infinite values also mean that the objective no longer changes, although their difference is NaN.
        let flat = |low: f64, high: f64| low == high || high - low <= settings.function_tolerance;
        (self.recent.len() == window && flat(oldest, newest) && flat(lowest, highest))
            .then_some(CmaEsStatus::FunctionTolerance)
    }
}

#[cfg(test)]
#[path = "cma_es_tests.rs"]
mod tests;
