//! Expected error of a physical fit from data and prior together.

use super::PhysicalPrior;
use super::description::{PhysicalProblem, expect, finite};
use super::error::PhysicalError;
use super::settings::PhysicalSettings;
use nalgebra::{DMatrix, DVector};

/// Prior uncertainty of the true parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct MassPrior {
    /// Relative standard deviation of a body about its reference: of the mass and the inertia relative to their
    /// values, of the centre of mass relative to the extent of the body.
    pub body_share: f64,
    /// Standard deviation of each scalar about its prior, in the unit of the scalar.
    pub scalar_std: Vec<f64>,
}

/// Standard deviation of the error of every parameter of a [`physical_fit`](super::physical_fit) (ten per body, then
/// the scalars) if the true parameters are distributed as `belief`; zero for known bodies. `covariance` (base, base)
/// is that of the fitted base parameters, including all its extra terms.
///
/// Linearised about its reference, the fit is `x̂ = A GᵀR₁ θ̂ + ..` with `A = (GᵀG + W)⁻¹`: G are the weighted rows
/// over the unknowns x in units of the belief's standard deviation, W is the information of the fit's prior. The error
/// is `A GᵀR₁ (θ̂ − θ) − A W x`, the sum of two independent parts with covariances `U V Uᵀ`, `U = A GᵀR₁`, and `(A
/// W)(A W)ᵀ`. So an identifiable value gets the error bar of the data and an unidentifiable one that of the belief.
/// Limits only reduce errors and are ignored.
///
/// # Errors
/// [`PhysicalError::Mismatch`] for wrong shapes, [`PhysicalError::NotFinite`], and the errors of
/// [`PhysicalSettings::validate`].
pub fn expected_error(
    problem: &PhysicalProblem,
    settings: &PhysicalSettings,
    covariance: &DMatrix<f64>,
    belief: &MassPrior,
) -> Result<Vec<f64>, PhysicalError> {
    settings.validate()?;
    let (base, parameters) = problem.base.matrix().shape();
    expect("rows of the covariance", base, covariance.nrows())?;
    expect("columns of the covariance", base, covariance.ncols())?;
    expect("deviations of scalars", problem.scalars.len(), belief.scalar_std.len())?;
    finite("an entry of the covariance", covariance.as_slice())?;
    finite("a deviation of a scalar", &belief.scalar_std)?;

    // Change of the parameters by one standard deviation of every unknown, and the rows of the fit's prior.
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
        for (own, _) in problem.prior_rows(body) {
            for k in 0..own.nrows() {
                let mut row = DVector::zeros(unknowns);
                row.rows_mut(10 * place, 10).copy_from(&(own.row(k).transpose() * belief.body_share));
                prior_rows.push(row);
            }
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

    // A = (GᵀG + W)⁻¹ from the triangle of the stacked rows, which keeps twice as many digits as GᵀG.
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
