//! Estimators that compare a simulation with the record: direct and inverse dynamic identification (DIDIM),
//! closed-loop input error (CLIE) and closed-loop output error (CLOE).

use crate::error::{EstimationError, expect, require, within};
use crate::factor::{
    FactorWorkspace, RankReport, RankSettings, Split, TriangularFactor, Unexcited, report, solve, split,
};
use crate::uncertainty::{EstimateStatus, covariance_of_all};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Simulated outputs at the instants of the record, in the row order of the record.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedRows {
    /// Output to compare with the record: torque for DIDIM and CLIE, position for CLOE.
    pub output: DVector<f64>,
    /// W, the regressor of the simulated motion, shape (rows, columns); only for DIDIM, otherwise empty (no rows).
    pub regressor: DMatrix<f64>,
}

/// Repeats the experiment in simulation with other parameters: same robot model, controller, reference and filters.
pub trait SimulatedMotion {
    /// Error of a simulation.
    type Error: From<EstimationError>;

    /// Simulates with parameters θ. Returns `None` if the simulation fails (unstable loop, mass matrix not positive
    /// definite); the step is then halved.
    ///
    /// # Errors
    /// Failures that do not depend on the parameters.
    fn simulate(&mut self, parameters: &[f64]) -> Result<Option<SimulatedRows>, Self::Error>;
}

/// Criterion to minimise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SimulatedCriterion {
    /// `‖τ − W(q_s, q̇_s, q̈_s) θ‖` with the simulated motion held fixed in every step: direct and inverse dynamic
    /// identification (DIDIM). Needs no measured position and only a few simulations.
    #[default]
    Didim,
    /// `‖y − y_s(θ)‖` with the Jacobian of the simulation by finite differences. This is closed-loop input error
    /// (CLIE) if y is the torque, closed-loop output error (CLOE) if y is the position. Needs one simulation per
    /// parameter and step.
    Output,
}

/// Settings of [`simulated_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedSettings {
    /// Criterion to minimise.
    pub criterion: SimulatedCriterion,
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// The iteration ends at this step length, in error bars over all directions. Default 1e-3.
    pub tolerance: f64,
    /// Maximum number of steps. Default 30.
    pub max_iterations: usize,
    /// Step of the finite differences, relative to each parameter's `scale`. Default 1e-4.
    pub difference: f64,
}

impl Default for SimulatedSettings {
    fn default() -> Self {
        Self {
            criterion: SimulatedCriterion::default(),
            rank: RankSettings::default(),
            tolerance: 1.0e-3,
            max_iterations: 30,
            difference: 1.0e-4,
        }
    }
}

impl SimulatedSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`].
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        within("tolerance", self.tolerance, 1.0e-10..=1.0, "use a length in error bars from 1e-10 to 1")?;
        within("difference", self.difference, 1.0e-9..=0.1, "use a relative step from 1e-9 to 0.1")?;
        require(self.max_iterations > 0, "max_iterations", 0.0, "use at least 1")
    }
}

/// Input of estimators that simulate the closed loop (DIDIM, CLIE, CLOE): the measured motion and torque, and the
/// parameters with which the iteration of the estimator begins.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedProblem {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Start values: nominal values or a least-squares estimate.
    pub start: Vec<f64>,
    /// Typical size of each parameter, greater than zero: the unit of its finite differences.
    pub scale: Vec<f64>,
    /// Measured outputs, in the row order of the simulation.
    pub measured: DVector<f64>,
    /// Standard deviation of each row's noise.
    pub noise_std: DVector<f64>,
}

/// Result of [`simulated_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimulatedEstimate {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// One value per parameter; the start value for an unexcited parameter.
    pub values: Vec<f64>,
    /// `s² (JᵀJ)⁻¹` with the Jacobian J of rows divided by their noise, and the mean square residual s²; valid for
    /// white noise.
    #[serde(skip)]
    pub covariance: DMatrix<f64>,
    /// Square roots of its diagonal.
    pub std: Vec<f64>,
    /// Sum of squares of the residuals divided by the noise of their rows.
    pub cost: f64,
    /// Number of steps.
    pub iterations: usize,
    /// Number of simulations.
    pub simulations: usize,
    /// Status of the estimator. It is [`EstimateStatus::IterationLimit`] also if no shorter step lowers the cost
    /// although the step is not small.
    pub status: EstimateStatus,
    /// Rank decisions at the last point.
    pub rank: RankReport,
    /// Derivatives of the outputs with respect to the parameters at the last point, shape (rows, parameters): for
    /// DIDIM the regressor W of the simulated motion, for CLIE and CLOE the Jacobian J.
    #[serde(skip)]
    pub jacobian: DMatrix<f64>,
    /// Measured output minus `W θ` (DIDIM) or minus the simulated output. `jacobian · (θ' - values) ≈ residual` is
    /// the problem of the next step. Use it for error bars with residuals that are correlated in time.
    #[serde(skip)]
    pub residual: DVector<f64>,
}

/// Fits the simulated to the recorded experiment by Gauss-Newton steps:
///
/// ```text
///     DIDIM:       θ_{k+1} = argmin ‖Σ^{-1/2} (τ − W(q_s(θ_k)) θ)‖        (the motion hardly depends on θ: ∂y_s/∂θ ≈ W)
///     CLIE, CLOE:  θ_{k+1} = θ_k + argmin ‖Σ^{-1/2} (y − y_s(θ_k) − J Δ)‖,  J = ∂y_s/∂θ by central differences
/// ```
/// A step that does not lower `‖Σ^{-1/2} (y − y_s(θ))‖` is halved (for DIDIM, one that raises its square by more than
/// 5 %). Noise of the measured position does not enter the regressor; instead controller and reference must be known.
/// Gautier, Janot and Vandanjon, IEEE Trans. Control Syst. Technol. 21 (2013) 428 (DIDIM); Walter and Pronzato,
/// Identification of Parametric Models from Experimental Data (1997), for output errors.
///
/// # Errors
/// [`EstimationError::Mismatch`] for wrong sizes, [`EstimationError::Setting`], [`EstimationError::TooFewRows`],
/// [`EstimationError::Unusable`], and the errors of the simulation; [`EstimationError::NoSimulation`] if the start
/// cannot be simulated.
#[doc(alias("didim", "clie", "cloe", "cle", "output error"))]
pub fn simulated_least_squares<S: SimulatedMotion>(
    problem: &SimulatedProblem,
    settings: &SimulatedSettings,
    simulation: &mut S,
) -> Result<SimulatedEstimate, S::Error> {
    settings.validate()?;
    problem.validate()?;
    let (columns, rows) = (problem.names.len(), problem.measured.len());
    let mut run = Run { problem, settings, simulation, simulations: 0 };
    let mut theta = DVector::from_column_slice(&problem.start);
    let mut now = run.simulated(&theta)?.ok_or(EstimationError::NoSimulation)?;
    let (mut iterations, mut converged) = (0, false);
    let mut linear;
    loop {
        linear = run.linearised(&theta, &now)?;
        if converged || iterations == settings.max_iterations {
            break;
        }
        iterations += 1;
        let Linearised { triangle, choice, .. } = &linear;
        let step = DVector::from_vec(solve(triangle, choice, &settings.rank, &vec![0.0; columns]).values);
        let noise = (now.cost / (rows - choice.free.len()) as f64).sqrt().max(f64::MIN_POSITIVE);
        let length = (triangle.regressor_triangle() * &step).norm() / (choice.free.len().max(1) as f64).sqrt();
        converged = length <= settings.tolerance * noise;
        // Close to the minimum, costs differ by the accuracy of the simulation. The fixed point of DIDIM is not
        // exactly at the minimum cost.
        let most = match settings.criterion {
            SimulatedCriterion::Didim => now.cost * MAX_DIDIM_COST_RATIO,
            SimulatedCriterion::Output if converged => now.cost * (1.0 + settings.tolerance),
            SimulatedCriterion::Output => now.cost,
        };
        let mut better = None;
        let mut share = 1.0;
        while better.is_none() && share > 1.0e-4 {
            let candidate = &theta + &step * share;
            better = run.simulated(&candidate)?.filter(|found| found.cost <= most).map(|found| (candidate, found));
            share *= 0.5;
        }
        let Some((candidate, found)) = better else { break };
        (theta, now) = (candidate, found);
    }
    let simulations = run.simulations;
    let Linearised { jacobian, residual, triangle, choice } = linear;
    let solution = solve(&triangle, &choice, &settings.rank, &vec![0.0; columns]);
    let variance = now.cost / (rows - choice.free.len()) as f64;
    let small = &solution.inverse * solution.inverse.transpose() * variance;
    let (covariance, std) = covariance_of_all(&problem.names, &theta, &choice.free, &small)?;
    let rank = report(&triangle, &choice, &settings.rank, &problem.names, &problem.start);
    Ok(SimulatedEstimate {
        names: problem.names.clone(),
        values: theta.iter().copied().collect(),
        covariance,
        std,
        cost: now.cost,
        iterations,
        simulations,
        status: EstimateStatus::of(converged, &rank),
        rank,
        jacobian,
        residual,
    })
}

impl SimulatedProblem {
    fn validate(&self) -> Result<(), EstimationError> {
        expect("starting values", self.names.len(), self.start.len())?;
        expect("scales", self.names.len(), self.scale.len())?;
        expect("noise of rows", self.measured.len(), self.noise_std.len())?;
        let usable = |setting, values: &[f64], positive: bool, fix| {
            let bad = values.iter().find(|value| !value.is_finite() || positive && **value <= 0.0);
            bad.map_or(Ok(()), |&value| Err(EstimationError::Setting { setting, value, fix }))
        };
        usable("start", &self.start, false, "use finite values")?;
        usable("scale", &self.scale, true, "use the typical size of each parameter, greater than zero")?;
        usable("noise_std", self.noise_std.as_slice(), true, "use standard deviations greater than zero")?;
        usable("measured", self.measured.as_slice(), false, "remove rows without a measurement")
    }
}

/// Maximum factor by which a step of DIDIM may increase the cost. With torque noise its fixed point differs from the
/// minimum by a part of an error bar.
const MAX_DIDIM_COST_RATIO: f64 = 1.05;

struct Run<'a, S> {
    problem: &'a SimulatedProblem,
    settings: &'a SimulatedSettings,
    simulation: &'a mut S,
    simulations: usize,
}

struct SimulationPoint {
    rows: SimulatedRows,
    cost: f64,
}

struct Linearised {
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    triangle: TriangularFactor,
    choice: Split,
}

impl<S: SimulatedMotion> Run<'_, S> {
    /// The linear problem at a simulation with parameters `theta`.
    fn linearised(&mut self, theta: &DVector<f64>, now: &SimulationPoint) -> Result<Linearised, S::Error> {
        let (problem, settings) = (self.problem, self.settings);
        let (columns, rows) = (problem.names.len(), problem.measured.len());
        let jacobian = match settings.criterion {
            SimulatedCriterion::Didim => {
                expect("rows of the simulated regressor", rows, now.rows.regressor.nrows())?;
                expect("columns of the simulated regressor", columns, now.rows.regressor.ncols())?;
                now.rows.regressor.clone()
            }
            SimulatedCriterion::Output => self.jacobian(theta, now, settings.difference)?,
        };
        // DIDIM compares the measured torque with W θ, which equals the simulated torque except for static friction
        // and filters.
        let residual = match settings.criterion {
            SimulatedCriterion::Didim => &problem.measured - &jacobian * theta,
            SimulatedCriterion::Output => &problem.measured - &now.rows.output,
        };
        let panel: Vec<f64> = jacobian
            .column_iter()
            .flat_map(|column| column.iter().zip(&problem.noise_std).map(|(v, s)| v / s).collect::<Vec<_>>())
            .chain(residual.iter().zip(&problem.noise_std).map(|(v, s)| v / s))
            .collect();
        let mut triangle = TriangularFactor::new(columns);
        triangle.absorb_with(&mut FactorWorkspace::default(), &panel, rows)?;
        let choice = split(&triangle, &settings.rank, &Unexcited::default());
        if rows <= choice.free.len() {
            let (what, parameters) = ("all channels".to_owned(), choice.free.len() as f64);
            return Err(EstimationError::TooFewRows { what, rows, parameters }.into());
        }
        Ok(Linearised { jacobian, residual, triangle, choice })
    }

    fn simulated(&mut self, theta: &DVector<f64>) -> Result<Option<SimulationPoint>, S::Error> {
        self.simulations += 1;
        let Some(rows) = self.simulation.simulate(theta.as_slice())? else { return Ok(None) };
        let measured = &self.problem.measured;
        expect("rows of the simulation", measured.len(), rows.output.len())?;
        let cost = (measured - &rows.output).component_div(&self.problem.noise_std).norm_squared();
        Ok(cost.is_finite().then_some(SimulationPoint { rows, cost }))
    }

    /// Central differences; one-sided if one side cannot be simulated, zero if neither can.
    fn jacobian(
        &mut self,
        theta: &DVector<f64>,
        now: &SimulationPoint,
        relative: f64,
    ) -> Result<DMatrix<f64>, S::Error> {
        let mut jacobian = DMatrix::zeros(self.problem.measured.len(), theta.len());
        for k in 0..theta.len() {
            let h = relative * self.problem.scale[k];
            let mut side = |sign: f64| {
                let mut at = theta.clone();
                at[k] += sign * h;
                self.simulated(&at)
            };
            let (above, below) = (side(1.0)?, side(-1.0)?);
            let width = h * (f64::from(above.is_some()) + f64::from(below.is_some()));
            if width > 0.0 {
                let above = above.as_ref().map_or(&now.rows.output, |s| &s.rows.output);
                let below = below.as_ref().map_or(&now.rows.output, |s| &s.rows.output);
                jacobian.set_column(k, &((above - below) / width));
            }
        }
        Ok(jacobian)
    }
}
