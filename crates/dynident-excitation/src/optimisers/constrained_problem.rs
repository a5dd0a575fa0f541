//! Constrained problem of the augmented Lagrangian method, with settings, state and result.

use super::{OptimiserError, Step, setting};

/// Minimises f(x) subject to c_i(x) = 0 for the first [`equalities`](ConstrainedProblem::equalities) constraints,
/// c_i(x) <= 0 for the others, and lower <= x <= upper.
///
/// The evaluation has two parts, so that one adjoint sweep computes the gradient of f and of any number of
/// constraints together from stored intermediate values. Constraints should be scaled to order one (0 at the limit, 1
/// if the limit is exceeded by its own size).
pub(crate) trait ConstrainedProblem {
    fn variables(&self) -> usize;
    /// Lower and upper bound of each variable; infinite without bound.
    fn bounds(&self) -> Vec<[f64; 2]>;
    fn constraints(&self) -> usize;
    fn equalities(&self) -> usize {
        0
    }
    /// Writes c(x) and returns f(x) at an `x` inside the bounds. If a value is not finite, the function is undefined
    /// there, and the search takes a shorter step.
    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64;
    /// Writes the gradient of `f + Σ weights_i c_i` at the `x` of the last [`values`](ConstrainedProblem::values). Most
    /// weights are zero.
    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]);
    /// Scale of gradients at the objective value f: max(1, |f|), for an objective with a meaningful zero.
    fn objective_scale(&self, objective: f64) -> f64 {
        objective.abs().max(1.0)
    }
    /// Optional: prepares a positive definite model of the curvature of the augmented Lagrangian at the `x` of the
    /// last [`gradient`](ConstrainedProblem::gradient). The model initialises the quasi-Newton matrix at every step.
    /// Returns whether there is a model.
    fn prepare_metric(&mut self, _known: &CurvatureFacts<'_>) -> bool {
        false
    }
    /// Multiplies a vector by the inverse of the model of the last
    /// [`prepare_metric`](ConstrainedProblem::prepare_metric).
    fn divide_by_metric(&self, _vector: &mut [f64]) {}
}

/// Data about the augmented Lagrangian at a point, for a model of its curvature.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvatureFacts<'a> {
    /// Penalty of each active constraint; 0 for inactive constraints.
    pub pushing: &'a [f64],
    pub gradient: &'a [f64],
    /// Variables that are not at a bound; a model must not couple them with the others.
    pub free: &'a [bool],
    /// The last step, if L-BFGS still stores it.
    pub last: Option<Step<'a>>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AugmentedLagrangianSettings {
    /// Maximum violation at which a point is feasible. Default 1e-8.
    pub feasibility_tolerance: f64,
    /// Convergence tolerance of the largest entry of the projected gradient of the Lagrangian, times
    /// [`objective_scale`](ConstrainedProblem::objective_scale). Default 1e-6.
    pub optimality_tolerance: f64,
    /// Maximum number of evaluations. Default 20,000.
    pub max_evaluations: usize,
    /// Maximum number of multiplier updates. Default 100.
    pub max_outer_iterations: usize,
    /// Maximum number of descent steps between two multiplier updates. Default 200.
    pub max_inner_iterations: usize,
    /// Number of steps that L-BFGS stores. Default 12.
    pub memory: usize,
    /// Initial penalty. With `None` it follows from the sizes of f and c at the start, between 1e-6 and 10. Default
    /// `None`.
    pub initial_penalty: Option<f64>,
    /// Factor by which the penalty grows if an update did not halve the violation. Default 10.
    pub penalty_growth: f64,
    /// Penalty above which the problem is reported as infeasible. Default 1e12.
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
    /// Checks the range of every setting.
    ///
    /// # Errors
    /// [`OptimiserError::Setting`] with the first invalid one.
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

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AugmentedLagrangianState {
    pub x: Vec<f64>,
    /// Multipliers of the constraints: decrease of the objective per unit of relaxation. Empty means zeros.
    pub multipliers: Vec<f64>,
    /// Penalty; `None` selects the penalty of the settings.
    pub penalty: Option<f64>,
}

impl From<Vec<f64>> for AugmentedLagrangianState {
    /// State at a point without multipliers.
    fn from(x: Vec<f64>) -> Self {
        Self { x, ..Self::default() }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AugmentedLagrangianStatus {
    /// The point is feasible and stationary within the tolerances.
    Converged,
    /// The point is feasible and no lower value exists in double precision, although the gradient exceeds its
    /// tolerance.
    PrecisionLimit,
    IterationLimit,
    /// The maximum penalty is reached and constraints are still violated: there is no feasible point nearby.
    Infeasible,
    Stopped,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AugmentedLagrangianResult {
    pub status: AugmentedLagrangianStatus,
    /// The feasible point of the lowest objective among all evaluated ones; without a feasible point, the one with the
    /// smallest violation.
    pub best: Vec<f64>,
    /// Objective at `best`.
    pub value: f64,
    /// Largest violation at `best`, max(c_i, 0) or |c_i|.
    pub violation: f64,
    /// Whether the violation is within the tolerance.
    pub feasible: bool,
    /// The last iterate with its multipliers and penalty. While constraints are violated, it is a better start than
    /// [`best`](Self::best), which can be an early point that kept them only because the motion was almost at rest.
    pub end: AugmentedLagrangianState,
    /// `f + Σ λ_i c_i` over the violated constraints at the last iterate: to first order, the objective after the
    /// constraints are satisfied.
    pub lagrangian: f64,
    /// Largest violation at the last iterate.
    pub end_violation: f64,
    /// Number of multiplier updates.
    pub outer_iterations: usize,
    /// Number of evaluations of objective and constraints.
    pub evaluations: usize,
}
