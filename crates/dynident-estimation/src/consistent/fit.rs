//! The physically consistent fit.

use super::assembly::AssembledProgram;
use super::cone::least_eigenvalue;
use super::conic::Program;
use super::coordinates::pseudo_inertia;
use super::description::{PhysicalProblem, expect};
use super::interior_point::{Ending, InteriorPointResult, OnTheWay, interior_point, interior_point_on_the_way};
use super::log_cholesky::log_cholesky;
use super::{PhysicalError, PhysicalRoute, PhysicalSettings};
use nalgebra::DVector;
use serde::Serialize;

/// How a fit ended. Every fit satisfies the constraints, whatever its status; the status says how near to the optimum
/// it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhysicalStatus {
    /// Optimal within the tolerance asked, by certificate.
    Solved,
    /// Double precision allowed no further progress; the certificate says how near it came.
    Stalled,
    /// The iterations were used up.
    IterationLimit,
}

/// What was found of one body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalBodyFit {
    /// Its name.
    pub name: String,
    /// Smallest eigenvalue of the pseudo-inertia whitened by the reference, `P0^{-1/2} P P0^{-1/2}`: at least the
    /// margin. Of a known body as it was given.
    pub least_whitened_eigenvalue: f64,
    /// Smallest eigenvalue of the pseudo-inertia in SI units.
    pub least_eigenvalue: f64,
    /// Whether the data want the body outside of what is physically consistent: its margin is used up.
    pub on_the_boundary: bool,
}

/// A physically consistent fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhysicalFit {
    /// Standard parameters π: ten for each body, then the scalars.
    pub parameters: Vec<f64>,
    /// Base parameters `θ = B π`: what the torque depends on.
    pub base_values: Vec<f64>,
    /// How it ended.
    pub status: PhysicalStatus,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Stationarity of the Lagrangian: largest entry over one plus the largest of its terms. Of the solution as the
    /// solver holds it, with twice the digits of `parameters`.
    pub stationarity: f64,
    /// Duality gap over one plus the objective: how much the objective could still fall.
    pub duality_gap: f64,
    /// `½‖R₁ B π − ρ₁‖²`: half the squared distance from the data's own optimum, in standard deviations of the rows.
    pub data_objective: f64,
    /// γ times the distance from the prior. A consistent set fits the data better by at most γ times how much farther
    /// from the prior it lies.
    pub prior_objective: f64,
    /// `√(2 data_objective)`: how many standard deviations (of white residuals) the fit moved from the data's own
    /// optimum because of constraints and prior. By chance alone, the true parameters lie about the square root of
    /// their number away.
    pub moved_sigma: f64,
    /// Body by body.
    pub bodies: Vec<PhysicalBodyFit>,
    /// Names of the constraints that hold with equality and push.
    pub active: Vec<String>,
}

impl PhysicalFit {
    /// The larger of stationarity and duality gap; the points themselves are feasible by construction.
    pub fn kkt_residual(&self) -> f64 {
        self.stationarity.max(self.duality_gap)
    }

    /// For every base parameter how far it moved from the estimate `values` in units of the standard deviations `std`;
    /// none where that is zero.
    ///
    /// # Errors
    /// [`PhysicalError::Mismatch`] unless both have one entry for each base parameter.
    pub fn moves_in_std(&self, values: &[f64], std: &[f64]) -> Result<Vec<Option<f64>>, PhysicalError> {
        expect("base parameters", self.base_values.len(), values.len())?;
        expect("standard deviations", self.base_values.len(), std.len())?;
        let moves = self.base_values.iter().zip(values).zip(std);
        Ok(moves.map(|((after, before), &std)| (std > 0.0).then(|| (after - before) / std)).collect())
    }
}

/// The bodies, friction and drives that fit the data best among those that are physically consistent:
///
/// ```text
///     minimise ½‖R₁ B π − ρ₁‖² + γ D(π, π0)
///     subject to  P(π_i) ⪰ ε P0_i,  and the limits of masses, total mass, centres of mass and scalars
/// ```
///
/// A convex problem with one optimum (Sousa and Cortesão, IJRR 33 (2014) 931; Wensing, Kim and Slotine, RA-L 3 (2018)
/// 60; Lee, Wensing and Park, T-RO 36 (2020) 348). Data see base parameters only; the prior decides what they leave
/// open: another consistent set fits better by at most γ times how much farther from the prior it lies. The result is
/// judged by a duality gap that does not depend on the route.
///
/// ```
/// use dynident_estimation::consistent::{BaseMap, PhysicalBody, PhysicalProblem, physical_fit, rough_body};
/// use dynident_estimation::TriangularFactor;
/// use nalgebra::DMatrix;
/// // A pendulum's data say that Ixx = 0.02 and m ry = −0.3, each to 1 %. No single body has both with at most 1 kg.
/// let body = PhysicalBody {
///     name: "bob".into(), reference: rough_body(1.0, 0.1), mass_kg: Some([0.1, 1.0]),
///     known: None, com_box_m: None, inside: None,
/// };
/// let base = DMatrix::from_fn(2, 10, |row, column| f64::from((row == 0 && column == 4) || (row == 1 && column == 2)));
/// // Rows 100/0.02 Ixx = 100 and 100/0.3 m ry = −100: columns one after another, then the right-hand side.
/// let factor = TriangularFactor::from_rows(2, &[5000.0, 0.0, 0.0, 100.0 / 0.3, 100.0, -100.0], 2)?;
/// let problem = PhysicalProblem::new(BaseMap::new(base)?, vec![body], vec![], &factor)?;
/// let fit = physical_fit(&problem, &Default::default())?;
/// // Ixx ≥ m ry² for a centre of mass off the axis: the first moment must give way.
/// assert!(fit.parameters[4] * fit.parameters[0] > fit.parameters[2].powi(2));
/// assert!(fit.bodies[0].on_the_boundary && fit.kkt_residual() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PhysicalError::Setting`], and [`PhysicalError::Contradictory`] with the names of the constraints that exclude each
/// other. A solver that does not reach the tolerance is a [`PhysicalStatus`].
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

/// As [`physical_fit`], with what is on the way of the interior point, whatever the route.
pub(super) fn physical_fit_on_the_way(
    problem: &PhysicalProblem,
    settings: &PhysicalSettings,
) -> Result<(PhysicalFit, Option<OnTheWay>), PhysicalError> {
    settings.validate()?;
    let assembled = AssembledProgram::new(problem, settings);
    let start = assembled.interior_start(problem)?;
    let limits = (settings.tolerance, settings.max_iterations);
    let found = interior_point_on_the_way(&assembled.program, start, limits);
    let fit = match &found {
        Some((solved, _)) if settings.route == PhysicalRoute::InteriorPoint && solved.ending == Ending::Solved => {
            finished(problem, settings, &assembled, solved)
        }
        _ => physical_fit(problem, settings)?,
    };
    Ok((fit, found.map(|(_, on_the_way)| on_the_way)))
}

/// The interior point, and where it stalls short of the tolerance (2 of 1,000 problems with a prior against data of a
/// million times its weight) the better of both routes by certificate.
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
    // The program counts its data rows the same way; the rest of its objective is the prior's.
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
        // Strict complementarity: the multiplier is on the larger side of the pair.
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
