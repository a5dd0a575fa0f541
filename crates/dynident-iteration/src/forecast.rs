//! What a run is expected to bring: the error bars after it, before it is made.

use crate::estimate::RunEstimate;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// Directions that a gain is told of: the ten worst, or all of fewer parameters.
const WORST: usize = 10;

/// What a motion was expected to bring by all that was known before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MotionForecast {
    /// Whether the motion is another than that of the good run before.
    pub redesigned: bool,
    /// Why it is not, although another was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// By how much the run is to narrow the bars of the worst directions (their root mean square), percent.
    pub gain_percent: f64,
    /// The same of the motion of the good run before, once more.
    pub repeat_gain_percent: f64,
    /// Whether that is worth a run: the gain that the settings ask for.
    pub worth_a_run: bool,
    /// The directions that are known worst before the run, worst first.
    pub directions: Vec<ForecastDirection>,
    /// Standard deviation of every base parameter after the run; none for what it will not determine either.
    pub std: Vec<Option<f64>>,
    /// For each joint the largest torque along the motion of any model in the uncertainty (the 95 % ellipsoid of all
    /// parameters), Nm (N).
    pub largest_torque: Vec<f64>,
}

/// A combination `vᵀ θ` of base parameters that is known badly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ForecastDirection {
    /// v, one number for each base parameter, 1 over its unit.
    pub weights: Vec<f64>,
    /// `√(vᵀ C v)` by the covariance before the run: the torque error that it makes over all that the arm may do (root
    /// mean square, all joints), in units of the torque's noise.
    pub before: f64,
    /// What was expected after it.
    pub after: f64,
}

impl MotionForecast {
    /// By how much a run has narrowed the bars of the directions (their root mean square), percent, from what is known
    /// after it; none where there is nothing to compare.
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

/// The information of all good runs so far, and what errors of the parameters are measured by.
#[derive(Clone, Debug)]
pub(crate) struct KnownInformation {
    /// Sum over the good runs.
    pub(crate) total: DMatrix<f64>,
    /// T with `T Tᵀ = M⁻¹`: its columns are steps of the parameters that make as much torque as the joints' noise, over
    /// all that the arm may do.
    pub(crate) units: DMatrix<f64>,
    /// `T⁻ᵀ`.
    weights: DMatrix<f64>,
}

impl KnownInformation {
    /// `needed` is M, the mean information of a sample over all that the arm may do.
    pub(crate) fn new(total: DMatrix<f64>, needed: &DMatrix<f64>) -> Self {
        let count = total.nrows();
        let scale: Vec<f64> = needed.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt() } else { 1.0 }).collect();
        let eigen = SymmetricEigen::new(DMatrix::from_fn(count, count, |i, j| needed[(i, j)] / (scale[i] * scale[j])));
        // What makes no torque anywhere is measured by what makes the least.
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
        // Symmetric to the last bit, as eigenvalues expect.
        0.5 * (&measured + measured.transpose())
    }

    /// What a run adds: the worst directions with their bars before and after it, the ratio of these for each, and the
    /// standard deviations after it. Bars before are those of the estimate, whose residuals are correlated in time and
    /// whose covariance says so; the run multiplies them by what information alone would.
    pub(crate) fn after(&self, run: &DMatrix<f64>, known: &RunEstimate) -> Expected {
        let count = self.total.nrows();
        let (before, after) =
            (Inverse::of(self.measured(&self.total)), Inverse::of(self.measured(&(&self.total + run))));
        let found = covariance(known);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| before.values[a].total_cmp(&before.values[b]));
        let mut expected = Expected { directions: Vec::new(), bars: Vec::new(), std: Vec::new() };
        for &place in order.iter().take(WORST) {
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

/// What is expected of a run.
pub(crate) struct Expected {
    pub(crate) directions: Vec<ForecastDirection>,
    /// Bars before and after by information alone, direction by direction.
    bars: Vec<(f64, f64)>,
    pub(crate) std: Vec<Option<f64>>,
}

impl Expected {
    /// By how much the bars of the directions narrow, percent.
    pub(crate) fn gain_percent(&self) -> f64 {
        gain_percent(&self.bars).unwrap_or(0.0)
    }
}

/// `100 (1 - √(Σ after² / Σ before²))`; none where nothing is to be narrowed.
fn gain_percent(bars: &[(f64, f64)]) -> Option<f64> {
    let sums = bars.iter().fold([0.0, 0.0], |[b, a], (before, after)| [b + before * before, a + after * after]);
    (sums[0] > 0.0).then(|| 100.0 * (1.0 - (sums[1] / sums[0]).sqrt()))
}

/// `√(vᵀ C v)`.
fn bar(covariance: &DMatrix<f64>, weights: &DVector<f64>) -> f64 {
    (covariance * weights).dot(weights).max(0.0).sqrt()
}

pub(crate) fn covariance(known: &RunEstimate) -> DMatrix<f64> {
    let count = known.covariance.len();
    DMatrix::from_fn(count, count, |row, column| known.covariance[row][column])
}

/// A positive semi-definite matrix by its eigenvalues, those that are rounding alone taken as the least that is not.
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

    /// Whether a direction has no part in what is not excited at all.
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

    /// The mean information of what is to be predicted.
    fn needed() -> DMatrix<f64> {
        let root = DMatrix::from_row_slice(3, 3, &[1.0, 0.2, 0.5, 0.0, 2.0, -0.4, 0.3, 0.0, 9.0]);
        root.tr_mul(&root)
    }

    /// The same run again: every bar by 1/√2, whatever the covariance that was found is; and with runs enough of it, by
    /// the root of their number.
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

    /// Directions, worst first, do not depend on units, and what is told of them comes back from the covariance.
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
        // What came of it, where exactly the forecast comes true.
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

    /// A parameter that nothing excites has no bar, and is where all is to be gained.
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
