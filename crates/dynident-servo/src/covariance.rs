//! Covariance of the coordinates from the sums of the time periods.

use crate::normal::{PeriodSums, symmetric};
use crate::parameters::FreeParameter;
use nalgebra::{DMatrix, DVector};

/// Number of neighbouring samples with equal errors, for each joint: the variance of the moments `Σ w g e` of the
/// periods, divided by the variance for independent samples; median over the coordinates. `now` are the numbers with
/// which the sums were computed.
pub(crate) fn correlated_samples(now: &[f64], sums: &[PeriodSums]) -> Vec<f64> {
    let of_joint = |(joint, now): (usize, &f64)| {
        let columns = sums.first().map_or(0, |own| own.diagonals[joint].len());
        let mut ratios: Vec<f64> = (0..columns)
            .filter_map(|k| {
                let expected: f64 = sums.iter().map(|own| own.diagonals[joint][k]).sum();
                let together: f64 = sums.iter().map(|own| own.moments[joint][k].powi(2)).sum();
                // The moments were computed with the weights 1 / (variance × correlated).
                (expected > 0.0).then(|| now * together / expected)
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).map_or(1.0, |ratio| ratio.max(1.0))
    };
    now.iter().enumerate().map(of_joint).collect()
}

/// Covariance of the coordinates, from the priors and a jackknife over periods (MacKinnon and White 1985; Bell and
/// McCaffrey 2002). Without a period that has the information `G` and the moments `s`, the coordinates change by
/// `(H - G)⁻¹ s`, where `H` is the Hessian. A covariance from the moments alone (White 1980) is too small if one period
/// determines much of a coordinate. `None` if the Hessian without a period is not positive definite.
pub(crate) fn jackknife(
    periods: &[PeriodSums],
    hessian: &DMatrix<f64>,
    parameters: &[FreeParameter],
) -> Option<DMatrix<f64>> {
    let columns = parameters.len();
    let inverse = hessian.clone().cholesky()?.inverse();
    let count = periods.len() as f64;
    if count < 2.0 {
        return Some(inverse);
    }
    let changes: Vec<DVector<f64>> = periods
        .iter()
        .map(|period| {
            let rest = hessian - symmetric(&period.gram, columns);
            Some(rest.cholesky()?.solve(&period.moment()))
        })
        .collect::<Option<_>>()?;
    let mean = changes.iter().sum::<DVector<f64>>() / count;
    let priors = parameters.iter().map(|parameter| parameter.prior_sd.powi(-2));
    let priors = DMatrix::from_diagonal(&DVector::from_iterator(columns, priors));
    let mut covariance = &inverse * priors * &inverse;
    for change in &changes {
        let own = change - &mean;
        covariance.ger((count - 1.0) / count, &own, &own, 1.0);
    }
    Some(covariance)
}
