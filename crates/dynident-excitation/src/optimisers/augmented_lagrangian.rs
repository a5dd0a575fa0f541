//! Minimisation under smooth constraints with exact gradients: augmented Lagrangian over a projected L-BFGS.

use super::projected_lbfgs::{Effort, End, Smooth, projected_lbfgs};
use super::{OptimiserError, Progress, Step, Watch, check_bounds, check_length, setting};

/// minimise f(x) subject to c_i(x) = 0 for the first [`equalities`](ConstrainedProblem::equalities) constraints,
/// c_i(x) <= 0 for the others, and lower <= x <= upper.
///
/// Evaluation is split in two so that one adjoint sweep gives the gradient of f and of any number of constraints
/// together, reusing what the values needed. Constraints work best when scaled to order one (limit reached = 0, limit
/// exceeded by its own size = 1).
pub(crate) trait ConstrainedProblem {
    /// Number of variables.
    fn variables(&self) -> usize;
    /// Lower and upper bound of each variable; infinite where there is none.
    fn bounds(&self) -> Vec<[f64; 2]>;
    /// Number of constraints.
    fn constraints(&self) -> usize;
    /// How many of them, the first ones, are equalities.
    fn equalities(&self) -> usize {
        0
    }
    /// Writes c(x) and returns f(x), at an `x` inside the bounds. Not finite where they are not defined; the search
    /// then takes a shorter step.
    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64;
    /// Writes the gradient of `f + Σ weights_i c_i` at the `x` of the last [`values`](ConstrainedProblem::values). Most
    /// weights are zero.
    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]);
    /// What gradients are measured by, at an objective f: max(1, |f|), for an objective whose zero has a meaning.
    fn objective_scale(&self, objective: f64) -> f64 {
        objective.abs().max(1.0)
    }
    /// Optional: takes up a positive definite model of the augmented Lagrangian's curvature at the `x` of the last
    /// [`gradient`](ConstrainedProblem::gradient), from which the quasi-Newton matrix starts at every step. Returns
    /// whether there is a model.
    fn prepare_metric(&mut self, _known: &CurvatureFacts<'_>) -> bool {
        false
    }
    /// Multiplies with the inverse of the model of the last [`prepare_metric`](ConstrainedProblem::prepare_metric).
    fn divide_by_metric(&self, _vector: &mut [f64]) {}
}

/// What is known of the augmented Lagrangian at a point, for a model of its curvature.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvatureFacts<'a> {
    /// For every constraint the penalty where it pushes, 0 where it does not.
    pub pushing: &'a [f64],
    /// Gradient.
    pub gradient: &'a [f64],
    /// Variables that no bound holds; a model must not couple the others with them.
    pub free: &'a [bool],
    /// The last step, if any is remembered.
    pub last: Option<Step<'a>>,
}

/// Settings of [`augmented_lagrangian()`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AugmentedLagrangianSettings {
    /// A point is feasible if no constraint is violated by more. Default 1e-8.
    pub feasibility_tolerance: f64,
    /// Converged if the projected gradient of the Lagrangian has no entry above this times
    /// [`objective_scale`](ConstrainedProblem::objective_scale). Default 1e-6.
    pub optimality_tolerance: f64,
    /// Evaluations at most. Default 20,000.
    pub max_evaluations: usize,
    /// Updates of the multipliers at most. Default 100.
    pub max_outer_iterations: usize,
    /// Descent steps between two updates of the multipliers at most. Default 200.
    pub max_inner_iterations: usize,
    /// Differences that L-BFGS remembers. Default 12.
    pub memory: usize,
    /// First penalty; none: from the sizes of f and c at the start, between 1e-6 and 10. Default none.
    pub initial_penalty: Option<f64>,
    /// Factor of the penalty when an update did not halve the violation. Default 10.
    pub penalty_growth: f64,
    /// The problem is declared infeasible when the penalty would go beyond. Default 1e12.
    pub max_penalty: f64,
}

impl Default for AugmentedLagrangianSettings {
    fn default() -> Self {
        Self {
            feasibility_tolerance: 1e-8,
            optimality_tolerance: 1e-6,
            max_evaluations: 20_000,
            max_outer_iterations: 100,
            max_inner_iterations: 200,
            memory: 12,
            initial_penalty: None,
            penalty_growth: 10.0,
            max_penalty: 1e12,
        }
    }
}

impl AugmentedLagrangianSettings {
    /// Whether every setting is in its range.
    ///
    /// # Errors
    /// [`OptimiserError::Setting`] names the first that is not.
    pub(crate) fn validate(&self) -> Result<(), OptimiserError> {
        let positive = |name, value: f64| setting(name, value, value > 0.0 && value.is_finite(), "positive and finite");
        positive("feasibility_tolerance", self.feasibility_tolerance)?;
        positive("optimality_tolerance", self.optimality_tolerance)?;
        positive("max_evaluations", self.max_evaluations as f64)?;
        positive("max_outer_iterations", self.max_outer_iterations as f64)?;
        positive("max_inner_iterations", self.max_inner_iterations as f64)?;
        positive("memory", self.memory as f64)?;
        positive("initial_penalty", self.initial_penalty.unwrap_or(1.0))?;
        positive("max_penalty", self.max_penalty)?;
        let growth = self.penalty_growth;
        setting("penalty_growth", growth, growth > 1.0 && growth.is_finite(), "finite and above 1")
    }
}

/// Where a search stands, so that another can go on from there.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AugmentedLagrangianState {
    /// The point.
    pub x: Vec<f64>,
    /// Multipliers of the constraints: what the objective would gain per unit of relaxation. Empty for zeros.
    pub multipliers: Vec<f64>,
    /// The penalty; none for that of the settings.
    pub penalty: Option<f64>,
}

impl From<Vec<f64>> for AugmentedLagrangianState {
    /// A point of which nothing else is known.
    fn from(x: Vec<f64>) -> Self {
        Self { x, ..Self::default() }
    }
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AugmentedLagrangianStatus {
    /// Feasible and stationary within the tolerances.
    Converged,
    /// Feasible, and no lower value can be found in double precision, though the gradient is above its tolerance.
    PrecisionLimit,
    /// Outer iterations or evaluations used up.
    IterationLimit,
    /// The penalty reached its end and constraints are still violated: no feasible point near.
    Infeasible,
    /// The callback ended it.
    Stopped,
}

/// What [`augmented_lagrangian()`] found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AugmentedLagrangianResult {
    /// How it ended.
    pub status: AugmentedLagrangianStatus,
    /// The feasible point of the lowest objective among all that were evaluated; if none was feasible, the one with the
    /// smallest violation.
    pub best: Vec<f64>,
    /// Objective there.
    pub value: f64,
    /// Largest violation of a constraint there, max(c_i, 0) or |c_i|.
    pub violation: f64,
    /// Whether that is within the tolerance.
    pub feasible: bool,
    /// The last iterate with its multipliers and penalty. While constraints are still violated it determines more than
    /// [`best`](Self::best), which may be an early point that kept them by standing still.
    pub end: AugmentedLagrangianState,
    /// `f + Σ λ_i c_i` there over the violated constraints: to first order the objective that is left once they are
    /// kept.
    pub lagrangian: f64,
    /// Largest violation there.
    pub end_violation: f64,
    /// Updates of the multipliers.
    pub outer_iterations: usize,
    /// Evaluations of objective and constraints.
    pub evaluations: usize,
}

/// Minimises a [`ConstrainedProblem`] from `state`, a point that is first moved into the bounds, or the end of an
/// earlier search.
///
/// Powell, Hestenes and Rockafellar's function L = f + Σ_eq (λ c + ρ c²/2) + Σ_ineq [max(0, λ + ρ c)² - λ²] / 2ρ is
/// minimised inside the bounds by L-BFGS with projected steps; then λ ← λ + ρ c (not below 0 for inequalities), and ρ
/// grows when the violation was not halved (Birgin and Martínez, *Practical Augmented Lagrangian Methods*, 2014,
/// algorithm 4.1). Finds a local solution.
///
/// Deterministic. `watch` hears the best point so far after every evaluation.
///
/// # Errors
/// A setting out of range, a start of the wrong length or where the problem is not defined, multipliers of another
/// number, empty bounds.
pub(crate) fn augmented_lagrangian(
    problem: &mut impl ConstrainedProblem,
    state: &AugmentedLagrangianState,
    settings: &AugmentedLagrangianSettings,
    watch: &mut Watch<'_>,
) -> Result<AugmentedLagrangianResult, OptimiserError> {
    settings.validate()?;
    let bounds = checked_bounds(problem, state)?;
    let mut x: Vec<f64> = state.x.iter().zip(&bounds).map(|(x, &[lower, upper])| x.clamp(lower, upper)).collect();
    let mut search = Search::new(problem, settings, watch);
    search.begin(state, &x)?;
    // A search that goes on starts near its end.
    let tolerance = if state.multipliers.is_empty() { 0.1 } else { 1e-4 };
    let status = search.descend(&bounds, &mut x, tolerance);
    Ok(search.result(x, status))
}

/// The bounds of a problem, checked together with the state from which its search begins.
fn checked_bounds(
    problem: &impl ConstrainedProblem,
    state: &AugmentedLagrangianState,
) -> Result<Vec<[f64; 2]>, OptimiserError> {
    if !state.multipliers.is_empty() {
        check_length("multipliers", problem.constraints(), state.multipliers.len())?;
    }
    let bounds = problem.bounds();
    check_length("start", problem.variables(), state.x.len())?;
    check_length("bounds", problem.variables(), bounds.len())?;
    check_bounds(&bounds, false)?;
    if state.x.iter().any(|x| x.is_nan()) {
        return Err(OptimiserError::Start);
    }
    Ok(bounds)
}

/// The augmented Lagrangian as a function, and the record of what was seen.
struct Search<'a, 'w, P: ConstrainedProblem> {
    problem: &'a mut P,
    settings: &'a AugmentedLagrangianSettings,
    watch: &'a mut Watch<'w>,
    equalities: usize,
    multipliers: Vec<f64>,
    penalty: f64,
    objective: f64,
    c: Vec<f64>,
    weights: Vec<f64>,
    curvature: Vec<f64>,
    best: Vec<f64>,
    best_value: f64,
    best_violation: f64,
    outer: usize,
    evaluations: usize,
    stopped: bool,
}

impl<'a, 'w, P: ConstrainedProblem> Search<'a, 'w, P> {
    fn new(problem: &'a mut P, settings: &'a AugmentedLagrangianSettings, watch: &'a mut Watch<'w>) -> Self {
        let constraints = problem.constraints();
        Self {
            equalities: problem.equalities().min(constraints),
            problem,
            settings,
            watch,
            multipliers: vec![0.0; constraints],
            penalty: 1.0,
            objective: f64::NAN,
            c: vec![0.0; constraints],
            weights: vec![0.0; constraints],
            curvature: Vec::new(),
            best: Vec::new(),
            best_value: f64::INFINITY,
            best_violation: f64::INFINITY,
            outer: 0,
            evaluations: 0,
            stopped: false,
        }
    }

    /// Takes over multipliers and penalty of `state`, or chooses a penalty at the first point `x`.
    fn begin(&mut self, state: &AugmentedLagrangianState, x: &[f64]) -> Result<(), OptimiserError> {
        if !state.multipliers.is_empty() {
            self.multipliers.clone_from(&state.multipliers);
        }
        self.penalty = state.penalty.unwrap_or(self.penalty);
        if !self.value(x).is_finite() {
            return Err(OptimiserError::Start);
        }
        self.penalty = state.penalty.or(self.settings.initial_penalty).unwrap_or_else(|| {
            let squares: f64 = (0..self.c.len()).map(|i| self.violation_of(i).powi(2)).sum();
            (2.0 * self.objective.abs() / squares.max(1e-12)).clamp(1e-6, 10.0)
        });
        Ok(())
    }

    /// Descents of the augmented Lagrangian with updates of the multipliers between them; moves `x` to the end of the
    /// last. `tolerance` is the first descent's.
    fn descend(&mut self, bounds: &[[f64; 2]], x: &mut [f64], mut tolerance: f64) -> AugmentedLagrangianStatus {
        let settings = self.settings;
        let mut last_measure = f64::INFINITY;
        while self.outer < settings.max_outer_iterations {
            let scale = self.problem.objective_scale(self.objective);
            let wanted = tolerance.max(settings.optimality_tolerance) * scale;
            let effort =
                Effort { tolerance: wanted, iterations: settings.max_inner_iterations, memory: settings.memory };
            let (end, stationarity) = projected_lbfgs(self, bounds, x, &effort);
            if self.halted() {
                break;
            }
            // Values and constraints at the point where the descent ended; the last evaluation may have been a
            // rejected trial.
            self.value(x);
            self.outer += 1;
            let measure = self.update_multipliers();
            let scale = self.problem.objective_scale(self.objective);
            let within = measure <= settings.feasibility_tolerance;
            if within && stationarity <= settings.optimality_tolerance * scale {
                return AugmentedLagrangianStatus::Converged;
            }
            if within && end == End::NoDescent && tolerance <= settings.optimality_tolerance {
                return AugmentedLagrangianStatus::PrecisionLimit;
            }
            if !within && measure > 0.5 * last_measure {
                self.penalty *= settings.penalty_growth;
                if self.penalty > settings.max_penalty {
                    return AugmentedLagrangianStatus::Infeasible;
                }
            }
            last_measure = measure;
            tolerance *= 0.1;
        }
        AugmentedLagrangianStatus::IterationLimit
    }

    /// The result of a search that ended at `x`.
    fn result(mut self, x: Vec<f64>, mut status: AugmentedLagrangianStatus) -> AugmentedLagrangianResult {
        if self.stopped {
            status = AugmentedLagrangianStatus::Stopped;
        }
        // The last evaluation may have been a rejected trial.
        self.objective = self.problem.values(&x, &mut self.c);
        let end_violation = (0..self.c.len()).fold(0.0, |worst: f64, i| worst.max(self.violation_of(i)));
        // Slack is not included: multipliers of a search that has not converged may weigh it absurdly.
        let pushing =
            self.multipliers.iter().zip(&self.c).map(|(multiplier, c)| (multiplier * c).max(0.0)).sum::<f64>();
        let feasible = self.best_violation <= self.settings.feasibility_tolerance;
        if feasible && status == AugmentedLagrangianStatus::Infeasible {
            status = AugmentedLagrangianStatus::PrecisionLimit;
        }
        AugmentedLagrangianResult {
            status,
            value: self.best_value,
            violation: self.best_violation,
            feasible,
            outer_iterations: self.outer,
            evaluations: self.evaluations,
            best: self.best,
            end: AugmentedLagrangianState { x, multipliers: self.multipliers, penalty: Some(self.penalty) },
            lagrangian: self.objective + pushing,
            end_violation,
        }
    }

    fn violation_of(&self, i: usize) -> f64 {
        if i < self.equalities { self.c[i].abs() } else { self.c[i].max(0.0) }
    }

    /// Takes up the constraints at the current c: their forces into the weights. Returns what they add to the augmented
    /// Lagrangian, which is not finite where a constraint is not, and the largest violation.
    fn push(&mut self) -> (f64, f64) {
        let (equal, above) = self.c.split_at(self.equalities);
        let (of_equal, of_above) = self.multipliers.split_at(self.equalities);
        let (to_equal, to_above) = self.weights.split_at_mut(self.equalities);
        let mut sums = PushSums::default();
        sums.take(equal, of_equal, to_equal, self.penalty, |force| force, f64::abs);
        sums.take(above, of_above, to_above, self.penalty, |force| force.max(0.0), |c| c);
        let (squares, worst) = sums.of_all_lanes();
        (squares / (2.0 * self.penalty), worst)
    }

    /// Keeps the point, whose largest violation is `violation`, if it is better: feasible before infeasible, then by
    /// value or violation.
    fn record(&mut self, x: &[f64], violation: f64) {
        let tolerance = self.settings.feasibility_tolerance;
        let better = if violation <= tolerance {
            self.best_violation > tolerance || self.objective < self.best_value
        } else {
            violation < self.best_violation
        };
        if better {
            self.best = x.to_vec();
            self.best_value = self.objective;
            self.best_violation = violation;
        }
    }

    /// First-order update at the current c. Returns how far feasibility and complementarity are missed.
    fn update_multipliers(&mut self) -> f64 {
        let mut measure: f64 = 0.0;
        for i in 0..self.c.len() {
            let (c, multiplier) = (self.c[i], self.multipliers[i]);
            if i < self.equalities {
                measure = measure.max(c.abs());
                self.multipliers[i] = (multiplier + self.penalty * c).clamp(-1e12, 1e12);
            } else {
                measure = measure.max(c.max(-multiplier / self.penalty).abs());
                self.multipliers[i] = (multiplier + self.penalty * c).clamp(0.0, 1e12);
            }
        }
        measure
    }
}

/// Sums over constraints, of which there are thousands: each lane has its own, so that they are made side by side.
#[derive(Default)]
struct PushSums {
    /// `w² - λ²`.
    squares: [f64; LANES],
    /// `0 c`: zero, or no number where c is not a finite one.
    undefined: [f64; LANES],
    worst: [f64; LANES],
}

const LANES: usize = 8;

impl PushSums {
    /// Makes the weights `push(λ + ρ c)` of constraints `c` with multipliers `λ`.
    fn take(
        &mut self,
        c: &[f64],
        multipliers: &[f64],
        weights: &mut [f64],
        penalty: f64,
        push: impl Fn(f64) -> f64,
        violation: impl Fn(f64) -> f64,
    ) {
        let mut one = |lane: usize, c: f64, multiplier: f64| {
            let weight = push(multiplier + penalty * c);
            self.squares[lane] += weight * weight - multiplier * multiplier;
            self.undefined[lane] += 0.0 * c;
            self.worst[lane] = self.worst[lane].max(violation(c));
            weight
        };
        let (whole, rest) = c.as_chunks::<LANES>();
        let (multipliers, of_rest) = multipliers.as_chunks::<LANES>();
        let (weights, to_rest) = weights.as_chunks_mut::<LANES>();
        for ((c, multipliers), weights) in whole.iter().zip(multipliers).zip(weights) {
            for lane in 0..LANES {
                weights[lane] = one(lane, c[lane], multipliers[lane]);
            }
        }
        for (lane, ((c, multiplier), weight)) in rest.iter().zip(of_rest).zip(to_rest).enumerate() {
            *weight = one(lane, *c, *multiplier);
        }
    }

    /// The sum of squares, not finite where a constraint is not, and the largest violation.
    fn of_all_lanes(&self) -> (f64, f64) {
        let squares: f64 = self.squares.iter().zip(&self.undefined).map(|(a, b)| a + b).sum();
        (squares, self.worst.iter().copied().fold(0.0, f64::max))
    }
}

impl<P: ConstrainedProblem> Smooth for Search<'_, '_, P> {
    fn value(&mut self, x: &[f64]) -> f64 {
        self.objective = self.problem.values(x, &mut self.c);
        self.evaluations += 1;
        let (pushing, violation) = self.push();
        let value = self.objective + pushing;
        if !value.is_finite() {
            return f64::NAN;
        }
        self.record(x, violation);
        let progress = Progress {
            best: &self.best,
            value: self.best_value,
            violation: self.best_violation,
            iteration: self.outer,
            evaluations: self.evaluations,
        };
        self.stopped |= (self.watch)(&progress).is_break();
        value
    }

    fn gradient(&mut self, gradient: &mut [f64]) {
        self.problem.gradient(&self.weights, gradient);
        // A rejected trial may follow; the curvature belongs to the point of the gradient.
        self.curvature.clear();
        let (equal, above) = self.weights.split_at(self.equalities);
        self.curvature.resize(equal.len(), self.penalty);
        self.curvature.extend(above.iter().map(|weight| if *weight > 0.0 { self.penalty } else { 0.0 }));
    }

    fn prepare_metric(&mut self, gradient: &[f64], free: &[bool], last: Option<Step<'_>>) -> bool {
        self.problem.prepare_metric(&CurvatureFacts { pushing: &self.curvature, gradient, free, last })
    }

    fn divide_by_metric(&self, vector: &mut [f64]) {
        self.problem.divide_by_metric(vector);
    }

    fn halted(&self) -> bool {
        self.stopped || self.evaluations >= self.settings.max_evaluations
    }
}

#[cfg(test)]
#[path = "augmented_lagrangian_tests.rs"]
mod tests;
