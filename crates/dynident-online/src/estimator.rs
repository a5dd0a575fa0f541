//! Recursive estimate that equals the estimate from all samples at once, after every sample.

use crate::error::{OnlineError, check, check_positive};
use dynident_dynamics::{Panels, TermHistory, Workspace, regressor_panels_of_sample};
use dynident_estimation::consistent::PhysicalFit;
use dynident_estimation::{LinearProblem, RecursiveFactor, SegmentSettings, SegmentedFactor, TriangularFactor};
use dynident_identification::RegressorModel;
use dynident_identification::consistent::{ConsistencySettings, consistent_parameters};
use dynident_model::terms::{HysteresisState, JointMotion};
use nalgebra::{Cholesky, DMatrix};
use serde::{Deserialize, Serialize};

/// Weight of new rows above which all rows are rescaled. Otherwise the square of the weight could overflow.
const MAX_GROWTH: f64 = 1e30;

/// Settings of the recursive estimator: weights of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct OnlineSettings {
    /// Standard deviation of each joint's torque error, Nm (N); the rows of the joint are divided by it.
    pub torque_std_nm: Vec<f64>,
    /// Number of samples after which the weight of a sample is halved; `None` keeps all samples with equal weight.
    pub half_life_samples: Option<f64>,
    /// Number of successive samples that contain as much information as one independent sample; above 1 if residuals
    /// are correlated in time.
    pub samples_per_independent: f64,
}

impl OnlineSettings {
    /// Settings for errors with these standard deviations that are independent from sample to sample, without
    /// forgetting.
    pub fn new(torque_std_nm: Vec<f64>) -> Self {
        Self { torque_std_nm, half_life_samples: None, samples_per_independent: 1.0 }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), OnlineError> {
        check_positive("torque_std_nm", &self.torque_std_nm)?;
        check_positive("half_life_samples", self.half_life_samples.as_slice())?;
        if !(self.samples_per_independent >= 1.0 && self.samples_per_independent.is_finite()) {
            let fix = "give 1 or more";
            return Err(OnlineError::Number {
                what: "samples_per_independent",
                value: self.samples_per_independent,
                fix,
            });
        }
        Ok(())
    }
}

/// Estimate of the parameters before the first sample.
#[derive(Clone, Debug)]
pub struct StartingPoint {
    /// Base parameters.
    pub values: Vec<f64>,
    /// Covariance of the base parameters; zero for fixed parameters.
    pub covariance: DMatrix<f64>,
}

/// Recursive estimate of base parameters in square-root form.
///
/// For each joint j, every sample adds one row `w_j/σ_j`, `τ_j/σ_j` (regressor row and torque, divided by the standard
/// deviation of the torque error) to the triangular factor `[R r]` of all previous rows (a [`RecursiveFactor`]). The
/// estimate solves `R θ = r`. No rows are subtracted, so the covariance stays positive definite for any number of
/// samples. Without forgetting, the result equals the least-squares estimate from all samples at once, up to rounding.
/// Bierman, Factorization Methods for Discrete Sequential Estimation (1977), ch. IV.
#[derive(Debug)]
pub struct OnlineEstimator {
    model: RegressorModel,
    settings: OnlineSettings,
    factor: RecursiveFactor,
    /// Weight of new rows. To forget old samples, the weight of new rows is increased instead of reducing that of old
    /// rows.
    growth: f64,
    growth_per_sample: f64,
    samples: u64,
    workspace: Workspace,
    history: TermHistory,
    panels: Panels,
}

/// State of an [`OnlineEstimator`], for storage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EstimatorState {
    /// Entries of the triangular factor, and the number of its samples.
    factor: Vec<f64>,
    factor_samples: usize,
    growth: f64,
    samples: u64,
    memories: Vec<HysteresisState>,
}

impl OnlineEstimator {
    /// Creates an estimator for a robot (a [`ParametricModel`](dynident_dynamics::ParametricModel), or one extended by
    /// an identification), from an initial estimate. Without `start`, [`values`](Self::values) returns false until the
    /// samples determine the parameters.
    ///
    /// # Errors
    /// Settings or a start that do not match the robot, an invalid covariance, or temperature-dependent friction,
    /// because samples have no temperature.
    pub fn new(
        model: impl Into<RegressorModel>,
        settings: OnlineSettings,
        start: Option<&StartingPoint>,
    ) -> Result<Self, OnlineError> {
        settings.validate()?;
        let model = model.into();
        if let Some(joint) = model.joint_that_needs_temperature() {
            return Err(OnlineError::Temperature { joint: model.joint_names().swap_remove(joint) });
        }
        let (dof, columns) = (model.dof(), model.layout().columns().len());
        if settings.torque_std_nm.len() != dof {
            let found = settings.torque_std_nm.len();
            return Err(OnlineError::Length { what: "torque_std_nm", expected: dof, found });
        }
        let first = |joint| model.layout().joint_columns(joint).iter().copied().min().unwrap_or(columns);
        let begins: Vec<usize> = (0..dof).map(first).collect();
        let mut factor = RecursiveFactor::new(columns, &begins);
        if let Some(start) = start {
            // The weight of the initial estimate does not depend on `samples_per_independent`.
            let rows = TriangularFactor::from_rows(columns, &starting_rows(start, columns)?, columns)?;
            factor.start_from(&rows.scaled(settings.samples_per_independent.sqrt())?)?;
        }
        let growth_per_sample = settings.half_life_samples.map_or(1.0, |half| 0.5_f64.powf(-0.5 / half));
        let mut made = Self {
            workspace: Workspace::new(model.model()),
            history: TermHistory::new(model.load_parameters.clone()),
            panels: Panels::default(),
            growth: 1.0,
            growth_per_sample,
            samples: 0,
            factor,
            settings,
            model,
        };
        // Some buffers are allocated at the first sample; this artificial sample allocates them in advance.
        let rest = vec![0.0; dof];
        made.update_regressor(&rest, &rest, &rest);
        made.restart();
        Ok(made)
    }

    /// Model of the robot.
    pub fn model(&self) -> &RegressorModel {
        &self.model
    }

    /// Number of samples so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Triangular factor of all rows, including the initial estimate. With forgetting, it is scaled by a factor that
    /// grows with every sample; [`information`](Self::information) removes this factor.
    pub fn factor(&self) -> &RecursiveFactor {
        &self.factor
    }

    /// Settings of the estimator.
    pub fn settings(&self) -> &OnlineSettings {
        &self.settings
    }

    fn update_regressor(&mut self, q: &[f64], dq: &[f64], ddq: &[f64]) {
        let motion = JointMotion { samples: 1, q, dq, ddq };
        let (model, layout) = (self.model.model(), self.model.layout());
        regressor_panels_of_sample(model, &mut self.workspace, layout, &motion, &mut self.history, &mut self.panels);
    }

    /// The state, for storage.
    pub fn state(&self) -> EstimatorState {
        EstimatorState {
            factor: self.factor.entries(),
            factor_samples: self.factor.samples(),
            growth: self.growth,
            samples: self.samples,
            memories: self.history.memories().to_vec(),
        }
    }

    /// Continues from a stored state of an estimator with the same model and settings.
    ///
    /// # Errors
    /// A state of another model, or values that are not finite.
    pub fn restore(&mut self, state: EstimatorState) -> Result<(), OnlineError> {
        let EstimatorState { factor, factor_samples, growth, samples, memories } = state;
        check("stored factor", &factor, factor.len())?;
        check_positive("stored growth", &[growth])?;
        let known = self.history.memories().len();
        if memories.len() != known {
            return Err(OnlineError::Length { what: "stored memories", expected: known, found: memories.len() });
        }
        self.factor.restore(&factor, factor_samples)?;
        self.history.set_memories(memories);
        (self.growth, self.samples) = (growth, samples);
        Ok(())
    }

    /// Starts a new motion with the next sample: friction with hysteresis is reset.
    pub fn restart(&mut self) {
        self.history.restart();
    }

    /// Computes the torque that the base parameters `values` predict for the last sample, and writes it to `out`, in
    /// the scale of the logged torque (before estimated gains are applied), Nm (N). Does not allocate memory.
    ///
    /// # Panics
    /// If the length of `values` is not the number of base parameters, or that of `out` not the number of joints.
    pub fn torque(&self, values: &[f64], out: &mut [f64]) {
        let layout = self.model.layout();
        assert_eq!((values.len(), out.len()), (layout.columns().len(), self.model.dof()), "parameters and joints");
        for (joint, out) in out.iter_mut().enumerate() {
            let columns = layout.joint_columns(joint).iter().zip(self.panels.joint(joint));
            *out = columns.map(|(&column, entry)| values[column] * entry).sum::<f64>() / self.gain(joint);
        }
    }

    fn gain(&self, joint: usize) -> f64 {
        self.model.torque_gains.get(joint).copied().unwrap_or(1.0)
    }

    /// Adds a sample: positions (rad, m), velocities, accelerations and measured torques (Nm, N). Does not allocate
    /// memory.
    ///
    /// # Errors
    /// A vector of a different length or a value that is not finite; the state is then unchanged.
    pub fn add(&mut self, q: &[f64], dq: &[f64], ddq: &[f64], tau: &[f64]) -> Result<(), OnlineError> {
        let dof = self.model.dof();
        for (what, values) in [("q", q), ("dq", dq), ("ddq", ddq), ("tau", tau)] {
            check(what, values, dof)?;
        }
        self.update_regressor(q, dq, ddq);
        let layout = self.model.layout();
        let columns = layout.columns().len();
        for (joint, (tau, std)) in tau.iter().zip(&self.settings.torque_std_nm).enumerate() {
            let weight = self.growth / std;
            let gain = self.gain(joint);
            for (&column, entry) in layout.joint_columns(joint).iter().zip(self.panels.joint(joint)) {
                self.factor.set(joint, column, weight * entry);
            }
            self.factor.set(joint, columns, weight * gain * tau);
        }
        self.factor.absorb()?;
        self.samples += 1;
        self.growth *= self.growth_per_sample;
        if self.growth > MAX_GROWTH {
            self.factor.scale(1.0 / self.growth)?;
            self.growth = 1.0;
        }
        Ok(())
    }

    /// Writes the current base parameters to `out`; returns false while the samples do not determine them.
    ///
    /// # Panics
    /// If the length of `out` is not the number of base parameters.
    pub fn values(&self, out: &mut [f64]) -> bool {
        self.factor.solve(out)
    }

    /// Covariance of the base parameters, `κ (RᵀR)⁻¹` with the triangular factor R and κ =
    /// [`samples_per_independent`](OnlineSettings::samples_per_independent). `None` while the samples do not determine
    /// the parameters. Allocates memory.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let triangle = self.information().regressor_triangle();
        let columns = triangle.ncols();
        let inverse = triangle.solve_upper_triangular(&DMatrix::identity(columns, columns))?;
        let covariance = &inverse * inverse.transpose();
        covariance.iter().all(|value| value.is_finite()).then_some(covariance)
    }

    /// Triangular factor R of the information matrix: `(RᵀR)⁻¹` is the covariance of the base parameters. Allocates
    /// memory.
    pub fn information(&self) -> TriangularFactor {
        let scale = self.growth_per_sample / self.growth / self.settings.samples_per_independent.sqrt();
        // Numerator and denominator are positive and finite, because the growth of the weight is bounded.
        self.factor.to_triangular().scaled(scale).unwrap_or_else(|_| self.factor.to_triangular())
    }

    /// Computes the physically consistent parameters of all bodies and terms that fit the samples best, as
    /// [`consistent_parameters`] does for the triangular factors of logs. The rows of all joints are treated as rows of
    /// one joint, because each is divided by its noise. Needs milliseconds and allocates memory: do not call it in the
    /// control loop.
    ///
    /// # Errors
    /// As [`consistent_parameters`].
    pub fn consistent(&self, settings: &ConsistencySettings) -> Result<PhysicalFit, OnlineError> {
        let factor = self.information();
        let size = factor.columns() + 1;
        let panel: Vec<f64> =
            (0..size).flat_map(|c| (0..size).map(move |r| (r, c))).map(|(r, c)| factor.entry(r, c)).collect();
        let mut rows = SegmentedFactor::new(size - 1, SegmentSettings::for_rows(size))?;
        rows.absorb(&panel, size)?;
        let names = self.model.parametric.base().expressions();
        let mut problem = LinearProblem::new(names, vec!["all joints".into()]);
        problem.add("online", 0, (0..size - 1).collect(), rows)?;
        Ok(consistent_parameters(&self.model.parametric, &problem, &[1.0], settings)?)
    }
}

/// Rows that represent the initial estimate θ₀ with covariance V: `L⁻¹ θ = L⁻¹ θ₀` with `V = L Lᵀ`.
fn starting_rows(start: &StartingPoint, columns: usize) -> Result<Vec<f64>, OnlineError> {
    check("values of the start", &start.values, columns)?;
    if start.covariance.shape() != (columns, columns) {
        let found = start.covariance.nrows();
        return Err(OnlineError::Length { what: "covariance of the start", expected: columns, found });
    }
    // Fixed parameters have no variance; they get a thousandth of the smallest standard deviation of the other
    // parameters.
    let mut covariance = start.covariance.clone();
    let least = covariance.diagonal().iter().copied().filter(|variance| *variance > 0.0).fold(f64::INFINITY, f64::min);
    for held in 0..columns {
        if least.is_finite() && covariance.column(held).iter().all(|entry| *entry == 0.0) {
            covariance[(held, held)] = 1e-6 * least;
        }
    }
    let root = match Cholesky::new(covariance.clone()) {
        Some(own) => {
            own.l().solve_lower_triangular(&DMatrix::identity(columns, columns)).ok_or(OnlineError::Covariance)?
        }
        None => inverse_square_root(&covariance)?,
    };
    let right = &root * nalgebra::DVector::from_column_slice(&start.values);
    Ok(root.iter().chain(right.iter()).copied().collect())
}

/// `V^(-1/2)` of a rank-deficient covariance V, for example from fewer time segments than parameters. Small eigenvalues
/// of the correlation matrix are raised to 1e-4 of the largest one. Otherwise parameter combinations that are unknown
/// would be treated as exactly known.
fn inverse_square_root(covariance: &DMatrix<f64>) -> Result<DMatrix<f64>, OnlineError> {
    const MIN_EIGENVALUE_RATIO: f64 = 1e-4;
    let std = covariance.diagonal().map(f64::sqrt);
    if !std.iter().all(|value| *value > 0.0 && value.is_finite()) {
        return Err(OnlineError::Covariance);
    }
    let correlation = DMatrix::from_fn(std.len(), std.len(), |i, j| covariance[(i, j)] / (std[i] * std[j]));
    let eigen = correlation.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    // Negative eigenvalues are accepted only within rounding errors.
    if eigen.eigenvalues.min() < -1e-9 * largest {
        return Err(OnlineError::Covariance);
    }
    let scale = eigen.eigenvalues.map(|value| value.max(MIN_EIGENVALUE_RATIO * largest).sqrt());
    Ok(DMatrix::from_fn(std.len(), std.len(), |i, j| eigen.eigenvectors[(j, i)] / (scale[i] * std[j])))
}
