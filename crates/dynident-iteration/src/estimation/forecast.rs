use crate::estimation::estimate::RunEstimate;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

const MAX_DIRECTIONS: usize = 10;

/// Forecast for the motion of a run, from the estimate before the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MotionForecast {
    /// Whether the motion differs from that of the previous good run.
    pub redesigned: bool,
    /// Why the motion was not changed, if a new motion was searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Forecast reduction of the error bars along the directions with the widest error bars (root mean square),
    /// percent.
    pub gain_percent: f64,
    /// The same forecast reduction if the motion of the previous good run is repeated, percent.
    pub repeat_gain_percent: f64,
    /// Whether the forecast reduction reaches the minimum in the settings.
    pub worth_a_run: bool,
    /// The directions with the widest error bars before the run, widest first.
    pub directions: Vec<ForecastDirection>,
    /// Standard deviation of every base parameter after the run; `None` for parameters that remain undetermined.
    pub std: Vec<Option<f64>>,
    /// Largest torque of each joint along the motion, over all models within the uncertainty (95 % ellipsoid of all
    /// parameters), Nm (N).
    pub largest_torque: Vec<f64>,
}

/// A combination `vᵀ θ` of base parameters with a wide error bar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ForecastDirection {
    /// Weights v, one number per base parameter; the unit is the reciprocal of the parameter's unit.
    pub weights: Vec<f64>,
    /// Error bar `√(vᵀ C v)` before the run, with the covariance C: the torque error that it causes over the
    /// workspace (root mean square, all joints), in units of the torque noise.
    pub before: f64,
    /// Forecast of this error bar after the run.
    pub after: f64,
}

impl MotionForecast {
    /// Returns the actual reduction of the error bars along the directions (root mean square), percent, from the
    /// estimate after the run; `None` if there is nothing to compare.
    pub fn reached_gain_percent(&self, known: &RunEstimate) -> Option<f64> {
        let covariance = covariance(known);
        let bars = |direction: &ForecastDirection| {
            let weights = Some(DVector::from_vec(direction.weights.clone()));
            let weights = weights.filter(|weights| weights.len() == covariance.nrows())?;
            Some((direction.before, bar(&covariance, &weights)))
        };
        let bars: Option<Vec<(f64, f64)>> = self.directions.iter().map(bars).collect();
        gain_percent(&bars?)
    }
}

/// Information of all good runs, and the units in which parameter errors are measured.
#[derive(Clone, Debug)]
pub(crate) struct KnownInformation {
    /// Sum of the information matrices of the good runs.
    pub(crate) total: DMatrix<f64>,
    /// Matrix T with `T Tᵀ = M⁻¹`: each column is a parameter step that causes as much torque as the joint noise,
    /// over the workspace.
    pub(crate) units: DMatrix<f64>,
    /// `T⁻ᵀ`.
    weights: DMatrix<f64>,
}

impl KnownInformation {
    /// `needed` is M, the mean information matrix of one sample over the workspace.
    pub(crate) fn new(total: DMatrix<f64>, needed: &DMatrix<f64>) -> Self {
        let count = total.nrows();
        let scale: Vec<f64> = needed.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt() } else { 1.0 }).collect();
        let eigen = SymmetricEigen::new(DMatrix::from_fn(count, count, |i, j| needed[(i, j)] / (scale[i] * scale[j])));
        // Directions that cause no torque get the smallest positive unit.
        let least = f64::EPSILON.sqrt() * eigen.eigenvalues.amax();
        let root = eigen.eigenvalues.map(|value| value.max(least).sqrt());
        let vectors = eigen.eigenvectors;
        let units = DMatrix::from_fn(count, count, |i, j| vectors[(i, j)] / (scale[i] * root[j]));
        let weights = DMatrix::from_fn(count, count, |i, j| vectors[(i, j)] * scale[i] * root[j]);
        Self { total, units, weights }
    }

    /// `Tᵀ D T`.
    fn measured(&self, information: &DMatrix<f64>) -> DMatrix<f64> {
        let measured = self.units.tr_mul(information) * &self.units;
        // Made exactly symmetric, as the eigenvalue solver requires.
        0.5 * (&measured + measured.transpose())
    }

    /// Forecast of a run: the directions with the widest error bars before it, with their error bars before and after
    /// it, and the standard deviations of the parameters after it. The error bars before the run are those of the
    /// estimate, whose covariance includes correlated residuals. The forecast multiplies them by the ratio that
    /// follows from the information matrices.
    pub(crate) fn after(&self, run: &DMatrix<f64>, known: &RunEstimate) -> Expected {
        let count = self.total.nrows();
        let (before, after) =
            (Inverse::of(self.measured(&self.total)), Inverse::of(self.measured(&(&self.total + run))));
        let found = covariance(known);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| before.values[a].total_cmp(&before.values[b]));
        let mut expected = Expected { directions: Vec::new(), bars: Vec::new(), std: Vec::new() };
        for &place in order.iter().take(MAX_DIRECTIONS) {
            let direction = before.vectors.column(place).into_owned();
            let information_alone = (before.values[place].sqrt().recip(), after.variance(&direction).sqrt());
            let ratio = (information_alone.1 / information_alone.0).min(1.0);
            let weights = &self.weights * &direction;
            let bar = bar(&found, &weights);
            expected.bars.push(information_alone);
            let weights = weights.iter().copied().collect();
            expected.directions.push(ForecastDirection { weights, before: bar, after: ratio * bar });
        }
        for k in 0..count {
            let parameter = self.units.row(k).transpose();
            let (then, now) = (before.variance(&parameter).sqrt(), after.variance(&parameter).sqrt());
            let undetermined = known.fixed.contains(&k) || known.std[k] <= 0.0;
            let std = if undetermined { now } else { known.std[k] * (now / then).min(1.0) };
            expected.std.push(after.determines(&parameter).then_some(std));
        }
        expected
    }
}

pub(crate) struct Expected {
    pub(crate) directions: Vec<ForecastDirection>,
    /// Error bars before and after the run from the information matrices alone, direction by direction.
    bars: Vec<(f64, f64)>,
    pub(crate) std: Vec<Option<f64>>,
}

impl Expected {
    pub(crate) fn gain_percent(&self) -> f64 {
        gain_percent(&self.bars).unwrap_or(0.0)
    }
}

/// `100 (1 - √(Σ after² / Σ before²))`; `None` if there is nothing to reduce.
fn gain_percent(bars: &[(f64, f64)]) -> Option<f64> {
    let sums = bars.iter().fold([0.0, 0.0], |[b, a], (before, after)| [b + before * before, a + after * after]);
    (sums[0] > 0.0).then(|| 100.0 * (1.0 - (sums[1] / sums[0]).sqrt()))
}

/// Standard deviation `√(vᵀ C v)` of the combination with weights v.
fn bar(covariance: &DMatrix<f64>, weights: &DVector<f64>) -> f64 {
    (covariance * weights).dot(weights).max(0.0).sqrt()
}

pub(crate) fn covariance(known: &RunEstimate) -> DMatrix<f64> {
    let count = known.covariance.len();
    DMatrix::from_fn(count, count, |row, column| known.covariance[row][column])
}

/// Inverse of a positive semi-definite matrix by its eigenvalues; eigenvalues at rounding level are replaced by the
/// smallest significant one.
struct Inverse {
    values: Vec<f64>,
    vectors: DMatrix<f64>,
    least: f64,
}

impl Inverse {
    fn of(matrix: DMatrix<f64>) -> Self {
        let count = matrix.nrows();
        let eigen = SymmetricEigen::new(matrix);
        let least = f64::EPSILON * count as f64 * eigen.eigenvalues.amax();
        let values = eigen.eigenvalues.iter().map(|value| value.max(least)).collect();
        Self { values, vectors: eigen.eigenvectors, least }
    }

    /// `uᵀ M⁻¹ u`.
    fn variance(&self, direction: &DVector<f64>) -> f64 {
        let shares = self.vectors.tr_mul(direction);
        shares.iter().zip(&self.values).map(|(share, value)| share * share / value).sum()
    }

    /// Whether a direction has no component in the null space, so that the data determine it.
    fn determines(&self, direction: &DVector<f64>) -> bool {
        let most = f64::EPSILON.sqrt() * direction.norm_squared();
        let lost = self.values.iter().enumerate().filter(|(_, value)| **value <= self.least);
        lost.into_iter().all(|(place, _)| self.vectors.column(place).dot(direction).powi(2) <= most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_identification::examination::LagChoice;

    fn known(covariance: &DMatrix<f64>) -> RunEstimate {
        let count = covariance.nrows();
        RunEstimate {
            values: vec![1.0; count],
            std: (0..count).map(|k| covariance[(k, k)].sqrt()).collect(),
            covariance: covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
            rows: 100,
            joint_sigma: vec![1.0],
            fixed: Vec::new(),
            possible: None,
            impossible: None,
            friction: Vec::new(),
            torque_lags: Vec::new(),
            lag: LagChoice::default(),
            differentiator: None,
            near_rest: Vec::new(),
            run_offsets: Vec::new(),
        }
    }

    fn needed() -> DMatrix<f64> {
        let root = DMatrix::from_row_slice(3, 3, &[1.0, 0.2, 0.5, 0.0, 2.0, -0.4, 0.3, 0.0, 9.0]);
        root.tr_mul(&root)
    }

    /// Repeating a run scales every error bar by 1/√2, for any covariance; enough runs scale it by the root of
    /// their number.
    #[test]
    fn a_repeated_run_narrows_by_the_root_of_the_number() {
        let root = DMatrix::from_row_slice(3, 3, &[2.0, 0.3, 0.0, 0.0, 1.0, -0.4, 0.1, 0.0, 30.0]);
        let one = root.tr_mul(&root);
        let found = 4.0 * one.clone().try_inverse().unwrap();
        for runs in 1..4_u32 {
            let total = f64::from(runs) * &one;
            let expected = KnownInformation::new(total, &needed()).after(&one, &known(&found));
            let ratio = (f64::from(runs) / f64::from(runs + 1)).sqrt();
            assert!((expected.gain_percent() - 100.0 * (1.0 - ratio)).abs() < 1e-9);
            for (k, std) in expected.std.iter().enumerate() {
                assert!((std.unwrap() / (ratio * found[(k, k)].sqrt()) - 1.0).abs() < 1e-9);
            }
        }
    }

    /// The worst directions do not depend on units, and their error bars follow from the covariance.
    #[test]
    fn worst_directions_have_no_units() {
        let root = DMatrix::from_row_slice(3, 3, &[2.0, 0.3, 0.0, 0.0, 1.0, -0.4, 0.1, 0.0, 30.0]);
        let one = root.tr_mul(&root);
        let found = one.clone().try_inverse().unwrap();
        let run = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 5.0, 2.0]));
        let expected = KnownInformation::new(one.clone(), &needed()).after(&run, &known(&found));
        let units = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1e3, 1e-2]));
        let inverse = units.clone().try_inverse().unwrap();
        let other = KnownInformation::new(&inverse * &one * &inverse, &(&inverse * needed() * &inverse))
            .after(&(&inverse * &run * &inverse), &known(&(&units * &found * &units)));
        assert!((expected.gain_percent() - other.gain_percent()).abs() < 1e-7);
        for (a, b) in expected.directions.iter().zip(&other.directions) {
            assert!((a.before - b.before).abs() < 1e-9 && (a.after - b.after).abs() < 1e-9);
        }
        assert!(expected.directions.is_sorted_by(|a, b| a.before >= b.before));
        // The gain that is reached equals the forecast if it comes true exactly.
        let after = (&one + &run).try_inverse().unwrap();
        let forecast = MotionForecast {
            redesigned: true,
            reason: None,
            gain_percent: expected.gain_percent(),
            repeat_gain_percent: 0.0,
            worth_a_run: true,
            directions: expected.directions,
            std: expected.std,
            largest_torque: Vec::new(),
        };
        let reached = forecast.reached_gain_percent(&known(&after)).unwrap();
        assert!((reached - forecast.gain_percent).abs() < 1e-7);
        for (k, std) in forecast.std.iter().enumerate() {
            assert!((std.unwrap() - after[(k, k)].sqrt()).abs() < 1e-9);
        }
    }

    /// A parameter that is not excited has no error bar and the largest possible gain.
    #[test]
    fn what_nothing_excites() {
        let one = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 0.0]));
        let mut known = known(&DMatrix::from_diagonal(&DVector::from_vec(vec![0.25, 0.0])));
        known.fixed = vec![1];
        let information = KnownInformation::new(one.clone(), &DMatrix::identity(2, 2));
        assert_eq!(information.after(&one, &known).std[1], None);
        let both = information.after(&DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 9.0])), &known);
        assert!((both.std[1].unwrap() - 1.0 / 3.0).abs() < 1e-9);
        assert!(both.gain_percent() > 99.0);
    }
}
