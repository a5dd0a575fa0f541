//! How far the values of a physical fit are to be expected from the truth, by data and description together.

use super::PhysicalPrior;
use super::description::{PhysicalProblem, expect, finite};
use super::error::PhysicalError;
use super::settings::PhysicalSettings;
use nalgebra::{DMatrix, DVector};

/// What is believed of the truth beside the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Belief {
    /// Standard deviation of a body about its reference as a share: of its mass, of its inertia, and of its extent for
    /// the centre of mass.
    pub body_share: f64,
    /// Standard deviation of each scalar about its prior, in its own unit.
    pub scalar_std: Vec<f64>,
}

/// Standard deviation of the error of every parameter of a [`physical_fit`](super::physical_fit), bodies' ten each and
/// then scalars, for a truth that is drawn by `belief`; zero for bodies that are known. `covariance` (base, base) is
/// that of the base parameters which the fit follows, whatever widened it.
///
/// The fit, linear about its reference, is `x̂ = A GᵀR₁ θ̂ + ..` with `A = (GᵀG + W)⁻¹`: G are the weighted rows over
/// the unknowns x, which are one standard deviation of the belief long, and W is what the fit's own prior adds. It errs
/// by `A GᵀR₁ (θ̂ − θ) − A W x`, two independent parts with the covariances `U V Uᵀ`, `U = A GᵀR₁`, and `(A W)(A W)ᵀ`.
/// So a value that the data tell has the bar of the data, one that they do not tell that of the description, and the
/// bar counts what a prior leaves open that weighs less than the belief. Limits, which only make errors smaller, are
/// left out.
///
/// # Errors
/// [`PhysicalError::Mismatch`] for shapes that do not fit, [`PhysicalError::NotFinite`] for numbers that are none, and
/// what [`PhysicalSettings::validate`] returns.
pub fn expected_error(
    problem: &PhysicalProblem,
    settings: &PhysicalSettings,
    covariance: &DMatrix<f64>,
    belief: &Belief,
) -> Result<Vec<f64>, PhysicalError> {
    settings.validate()?;
    let (base, parameters) = problem.base.matrix().shape();
    expect("rows of the covariance", base, covariance.nrows())?;
    expect("columns of the covariance", base, covariance.ncols())?;
    expect("deviations of scalars", problem.scalars.len(), belief.scalar_std.len())?;
    finite("an entry of the covariance", covariance.as_slice())?;
    finite("a deviation of a scalar", &belief.scalar_std)?;

    // One standard deviation of every unknown in parameters, and the rows of the fit's own prior over the unknowns.
    let free: Vec<usize> = (0..problem.bodies.len()).filter(|&body| problem.bodies[body].known.is_none()).collect();
    let unknowns = 10 * free.len() + problem.scalars.len();
    let mut spread = DMatrix::zeros(parameters, unknowns);
    let mut prior_rows: Vec<DVector<f64>> = Vec::new();
    let root = settings.prior_weight.sqrt();
    for (place, &body) in free.iter().enumerate() {
        let whitening = &problem.whitenings[body];
        let own = whitening.to_parameters * belief.body_share;
        spread.view_mut((10 * body, 10 * place), (10, 10)).copy_from(&own);
        let units = whitening.units();
        for k in 0..10 {
            let mut row = DVector::zeros(unknowns);
            match settings.prior {
                PhysicalPrior::Entropic | PhysicalPrior::Pullback => row[10 * place + k] = root * belief.body_share,
                PhysicalPrior::Euclidean => {
                    row.rows_mut(10 * place, 10).copy_from(&(own.row(k).transpose() * (root / units[k])));
                }
            }
            prior_rows.push(row);
        }
        if let Some([_, std_kg]) = problem.mass_beliefs.get(body).copied().flatten() {
            let mut row = DVector::zeros(unknowns);
            row.rows_mut(10 * place, 10).copy_from(&(own.row(0).transpose() / std_kg));
            prior_rows.push(row);
        }
    }
    let first = 10 * problem.bodies.len();
    for (index, (scalar, std)) in problem.scalars.iter().zip(&belief.scalar_std).enumerate() {
        let unknown = 10 * free.len() + index;
        spread[(first + index, unknown)] = *std;
        let mut row = DVector::zeros(unknowns);
        row[unknown] = root * std / scalar.scale;
        prior_rows.push(row);
    }
    let prior_rows = DMatrix::from_fn(prior_rows.len(), unknowns, |row, column| prior_rows[row][column]);

    // A = (GᵀG + W)⁻¹ by the triangle of the stacked rows, which keeps twice the digits.
    let rows = &problem.triangle * (problem.base.matrix() * &spread);
    let mut stacked = DMatrix::zeros(rows.nrows() + prior_rows.nrows(), unknowns);
    stacked.rows_mut(0, rows.nrows()).copy_from(&rows);
    stacked.rows_mut(rows.nrows(), prior_rows.nrows()).copy_from(&prior_rows);
    let triangle = stacked.qr().r();
    let inverse = |right: DMatrix<f64>| -> Result<DMatrix<f64>, PhysicalError> {
        let half = triangle.tr_solve_upper_triangular(&right);
        let whole = half.and_then(|half| triangle.solve_upper_triangular(&half));
        whole.ok_or(PhysicalError::NotFinite { what: "a solution of the linearised fit".into(), value: f64::NAN })
    };
    let of_noise = &spread * inverse(rows.transpose() * &problem.triangle)?;
    let of_prior = &spread * inverse(prior_rows.transpose() * &prior_rows)?;
    let of_noise_covariance = &of_noise * covariance;
    let variance = |parameter: usize| {
        of_noise_covariance.row(parameter).dot(&of_noise.row(parameter)) + of_prior.row(parameter).norm_squared()
    };
    Ok((0..parameters).map(|parameter| variance(parameter).max(0.0).sqrt()).collect())
}
