//! The physically consistent fit.

use super::assembly::AssembledProgram;
use super::cone::least_eigenvalue;
use super::conic::Program;
use super::coordinates::pseudo_inertia;
use super::description::{PhysicalProblem, expect};
use super::interior_point::{CentralPath, Ending, InteriorPointResult, interior_point, interior_point_with_path};
use super::log_cholesky::log_cholesky;
use super::{PhysicalError, PhysicalRoute, PhysicalSettings};
use nalgebra::DVector;
use serde::Serialize;

/// Status of a fit. Every fit satisfies the constraints; the status describes its distance from the optimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhysicalStatus {
    /// Optimal within the tolerance, by certificate.
    Solved,
    /// No further progress in double precision; see the certificate for the distance from the optimum.
    Stalled,
    /// The iteration limit was reached.
    IterationLimit,
}

/// Result for one body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalBodyFit {
    /// Name of the body.
    pub name: String,
    /// Smallest eigenvalue of the pseudo-inertia whitened by the reference, `P0^{-1/2} P P0^{-1/2}`: at least the
    /// margin, except for a known body.
    pub least_whitened_eigenvalue: f64,
    /// Smallest eigenvalue of the pseudo-inertia in SI units.
    pub least_eigenvalue: f64,
    /// Whether the body is at the margin of physical consistency: the data alone give an inconsistent body.
    pub on_the_boundary: bool,
}

/// A physically consistent fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalFit {
    /// Standard parameters π: ten per body, then the scalars.
    pub parameters: Vec<f64>,
    /// Base parameters `θ = B π`, which determine the torque.
    pub base_values: Vec<f64>,
    /// Status of the fit.
    pub status: PhysicalStatus,
    /// Number of iterations of the solver.
    pub iterations: usize,
    /// Stationarity of the Lagrangian: largest entry divided by one plus its largest term. Evaluated for the internal
    /// solution, which has twice the digits of `parameters`.
    pub stationarity: f64,
    /// Duality gap divided by one plus the objective: bound of the possible decrease of the objective.
    pub duality_gap: f64,
    /// `½‖R₁ B π − ρ₁‖²`: half the squared distance from the optimum of the data, in standard deviations of the rows.
    pub data_objective: f64,
    /// γ times the distance from the prior. Any other consistent set fits the data better by at most γ times its
    /// additional distance from the prior.
    pub prior_objective: f64,
    /// `√(2 data_objective)`: distance, in standard deviations of white residuals, from the optimum of the data due to
    /// constraints and prior. The expected distance of the true parameters is about the square root of their number.
    pub moved_sigma: f64,
    /// Results by body.
    pub bodies: Vec<PhysicalBodyFit>,
    /// Names of the active constraints.
    pub active: Vec<String>,
}

impl PhysicalFit {
    /// The larger of stationarity and duality gap. Every returned point satisfies the constraints.
    pub fn kkt_residual(&self) -> f64 {
        self.stationarity.max(self.duality_gap)
    }

    /// Change of every base parameter from the estimate `values`, divided by the standard deviation in `std`; `None`
    /// where this standard deviation is zero.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] for a wrong number of values.
    pub fn moves_in_std(&self, values: &[f64], std: &[f64]) -> Result<Vec<Option<f64>>, PhysicalError> {
        expect("base parameters", self.base_values.len(), values.len())?;
        expect("standard deviations", self.base_values.len(), std.len())?;
        let moves = self.base_values.iter().zip(values).zip(std);
        Ok(moves.map(|((after, before), &std)| (std > 0.0).then(|| (after - before) / std)).collect())
    }
}

/// Finds the physically consistent bodies, friction and drive parameters that fit the data best:
///
/// ```text
///     minimise ½‖R₁ B π − ρ₁‖² + γ D(π, π0)
///     subject to  P(π_i) ⪰ ε P0_i,  and the limits of masses, total mass, centres of mass and scalars
/// ```
///
/// The problem is convex with one optimum (Sousa and Cortesão, IJRR 33 (2014) 931; Wensing, Kim and Slotine, RA-L 3
/// (2018) 60; Lee, Wensing and Park, T-RO 36 (2020) 348). The data depend on base parameters only; the prior
/// determines all other combinations. Any other consistent set fits the data better by at most γ times its additional
/// distance from the prior. The duality gap certifies the result independently of the solver.
///
/// ```
/// use dynident_estimation::consistent::{BaseMap, PhysicalBody, PhysicalProblem, physical_fit, rough_body};
/// use dynident_estimation::TriangularFactor;
/// use nalgebra::DMatrix;
/// // A pendulum with measured Ixx = 0.02 and m ry = −0.3, each to 1 %. No body of at most 1 kg has both.
/// let body = PhysicalBody {
///     name: "bob".into(), reference: rough_body(1.0, 0.1), mass_kg: Some([0.1, 1.0]),
///     known: None, com_box_m: None, inside: None,
/// };
/// let base = DMatrix::from_fn(2, 10, |row, column| f64::from((row == 0 && column == 4) || (row == 1 && column == 2)));
/// // Rows 100/0.02 Ixx = 100 and 100/0.3 m ry = −100: columns one after another, then the right-hand side.
/// let factor = TriangularFactor::from_rows(2, &[5000.0, 0.0, 0.0, 100.0 / 0.3, 100.0, -100.0], 2)?;
/// let problem = PhysicalProblem::new(BaseMap::new(base)?, vec![body], vec![], &factor)?;
/// let fit = physical_fit(&problem, &Default::default())?;
/// // Ixx ≥ m ry² for a centre of mass off the axis, so the first moment must change.
/// assert!(fit.parameters[4] * fit.parameters[0] > fit.parameters[2].powi(2));
/// assert!(fit.bodies[0].on_the_boundary && fit.kkt_residual() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PhysicalError::Setting`], and [`PhysicalError::Contradictory`] with the names of the contradicting constraints. A
/// solver that does not reach the tolerance is a [`PhysicalStatus`].
#[doc(alias("lmi", "sdp", "pseudo-inertia", "physical consistency", "log-cholesky"))]
pub fn physical_fit(problem: &PhysicalProblem, settings: &PhysicalSettings) -> Result<PhysicalFit, PhysicalError> {
    settings.validate()?;
    let assembled = AssembledProgram::new(problem, settings);
    let start = assembled.interior_start(problem)?;
    let solved = match settings.route {
        PhysicalRoute::InteriorPoint => interior_point_else_log_cholesky(&assembled.program, &start, settings),
        PhysicalRoute::LogCholesky => {
            log_cholesky(&assembled.program, &start, settings.tolerance, settings.max_iterations)
        }
    }
    .ok_or(PhysicalError::Breakdown)?;
    Ok(finished(problem, settings, &assembled, &solved))
}

/// Like [`physical_fit`], and also returns the iterates of the interior-point method for any route.
pub(super) fn physical_fit_with_path(
    problem: &PhysicalProblem,
    settings: &PhysicalSettings,
) -> Result<(PhysicalFit, Option<CentralPath>), PhysicalError> {
    settings.validate()?;
    let assembled = AssembledProgram::new(problem, settings);
    let start = assembled.interior_start(problem)?;
    let limits = (settings.tolerance, settings.max_iterations);
    let found = interior_point_with_path(&assembled.program, start, limits);
    let fit = match &found {
        Some((solved, _)) if settings.route == PhysicalRoute::InteriorPoint && solved.ending == Ending::Solved => {
            finished(problem, settings, &assembled, solved)
        }
        _ => physical_fit(problem, settings)?,
    };
    Ok((fit, found.map(|(_, central_path)| central_path)))
}

/// Interior point; if it does not reach the tolerance (2 of 1,000 problems with a prior against data of a million
/// times its weight), the better result of both routes by certificate.
fn interior_point_else_log_cholesky(
    program: &Program,
    start: &DVector<f64>,
    settings: &PhysicalSettings,
) -> Option<InteriorPointResult> {
    let first = interior_point(program, start.clone(), settings.tolerance, settings.max_iterations);
    if first.as_ref().is_some_and(|first| first.ending == Ending::Solved) {
        return first;
    }
    let residual = |solved: &InteriorPointResult| solved.certificate.stationarity.max(solved.certificate.gap);
    let second = log_cholesky(program, start, settings.tolerance, settings.max_iterations);
    match (first, second) {
        (Some(first), Some(mut second)) if residual(&second) < residual(&first) => {
            second.iterations += first.iterations;
            Some(second)
        }
        (first, second) => first.or(second),
    }
}

fn finished(
    problem: &PhysicalProblem,
    settings: &PhysicalSettings,
    assembled: &AssembledProgram,
    solved: &InteriorPointResult,
) -> PhysicalFit {
    let parameters = assembled.parameters(problem, &solved.x);
    let base = problem.base.matrix() * DVector::from_column_slice(&parameters);
    let data_objective = 0.5 * (&problem.triangle * &base - &problem.rotated).norm_squared();
    // The rest of the program's objective is the prior's term.
    let in_program = 0.5 * (&assembled.program.data * &solved.x - &assembled.program.target).norm_squared();
    let prior_objective = solved.certificate.objective - in_program + assembled.constant;
    let bodies = problem
        .bodies
        .iter()
        .enumerate()
        .map(|(index, body)| {
            let own = &parameters[10 * index..10 * index + 10];
            let whitened = least_eigenvalue(&problem.whitenings[index].whitened(own));
            PhysicalBodyFit {
                name: body.name.clone(),
                least_whitened_eigenvalue: whitened,
                least_eigenvalue: least_eigenvalue(&pseudo_inertia(own)),
                on_the_boundary: body.known.is_none() && whitened <= 1.1 * settings.margin,
            }
        })
        .collect();
    let scale = 1.0 + solved.certificate.objective.abs();
    let active = assembled
        .program
        .rows
        .iter()
        .zip(&solved.multipliers.rows)
        // Strict complementarity: an active row has the larger multiplier.
        .filter(|(row, z)| **z / scale > row.value(&solved.x).max(1.0e-9))
        .map(|(row, _)| assembled.names[row.label].clone())
        .collect();
    PhysicalFit {
        parameters,
        base_values: base.iter().copied().collect(),
        status: match solved.ending {
            Ending::Solved => PhysicalStatus::Solved,
            Ending::Stalled => PhysicalStatus::Stalled,
            Ending::Limit => PhysicalStatus::IterationLimit,
        },
        iterations: solved.iterations,
        stationarity: solved.certificate.stationarity,
        duality_gap: solved.certificate.gap,
        data_objective,
        prior_objective,
        moved_sigma: (2.0 * data_objective).sqrt(),
        bodies,
        active,
    }
}
