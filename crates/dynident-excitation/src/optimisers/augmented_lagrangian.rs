//! Minimisation under smooth constraints with exact gradients: augmented Lagrangian method with projected L-BFGS.

use super::constrained_problem::{
    AugmentedLagrangianResult, AugmentedLagrangianSettings, AugmentedLagrangianState, AugmentedLagrangianStatus,
    ConstrainedProblem, CurvatureFacts,
};
use super::projected_lbfgs::{Effort, End, Smooth, projected_lbfgs};
use super::{OptimiserError, Progress, Step, Watch, check_bounds, check_length};

/// Minimises a [`ConstrainedProblem`] from `state`. The state is a point, which is first clamped to the bounds, or
/// the end of an earlier search.
///
/// The function of Powell, Hestenes and Rockafellar, L = f + Σ_eq (λ c + ρ c²/2) + Σ_ineq [max(0, λ + ρ c)² - λ²] /
/// 2ρ with multipliers λ and penalty ρ, is minimised inside the bounds by L-BFGS with projected steps. Then λ becomes
/// λ + ρ c (at least 0 for inequalities), and ρ grows if the violation was not halved (Birgin and Martínez,
/// *Practical Augmented Lagrangian Methods*, 2014, algorithm 4.1). Finds a local solution.
///
/// Deterministic. `watch` is called with the best point so far after every evaluation.
///
/// # Errors
/// A setting out of range, a start of the wrong length or where the problem is undefined, a wrong number of
/// multipliers, empty bounds.
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
    // A continued search begins close to its solution.
    let tolerance = if state.multipliers.is_empty() { 0.1 } else { 1e-4 };
    let status = search.descend(&bounds, &mut x, tolerance);
    Ok(search.result(x, status))
}

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

/// The augmented Lagrangian as a function, and the best point so far.
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

    /// Takes multipliers and penalty from `state`, or chooses a penalty at the first point `x`.
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

    /// Runs descents of the augmented Lagrangian with multiplier updates between them, and moves `x` to the end of
    /// the last descent. `tolerance` is the tolerance of the first descent.
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
            // The last evaluation may have been a rejected trial, so the end point is evaluated again.
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

    fn result(mut self, x: Vec<f64>, mut status: AugmentedLagrangianStatus) -> AugmentedLagrangianResult {
        if self.stopped {
            status = AugmentedLagrangianStatus::Stopped;
        }
        self.objective = self.problem.values(&x, &mut self.c);
        let end_violation = (0..self.c.len()).fold(0.0, |worst: f64, i| worst.max(self.violation_of(i)));
        // Only violated constraints are included, because the multipliers of inactive constraints can be wrong before
        // convergence.
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

    /// Writes the gradient weights of the constraints at the current c. Returns the constraints' part of the
    /// augmented Lagrangian (not finite if a constraint is not finite) and the largest violation.
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

    /// Stores the point if it is better: feasible points before infeasible ones, then by value or violation.
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

    /// First-order update of the multipliers at the current c. Returns the violation of feasibility and
    /// complementarity.
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

/// Sums over thousands of constraints, with one partial sum per SIMD lane.
#[derive(Default)]
struct PushSums {
    /// `w² - λ²`.
    squares: [f64; LANES],
    /// `0 c`: zero, or NaN if c is not finite.
    undefined: [f64; LANES],
    worst: [f64; LANES],
}

const LANES: usize = 8;

impl PushSums {
    /// Computes the weights `push(λ + ρ c)` of constraints `c` with multipliers `λ`.
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

    /// Sum of squares (not finite if a constraint is not finite) and largest violation.
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
        // The curvature is that at the point of the gradient, and a rejected trial may follow.
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
