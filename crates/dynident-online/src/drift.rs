//! Whether the model that was loaded is still true of the robot.

use crate::error::{OnlineError, check, check_positive};
use crate::estimator::{OnlineEstimator, StartingPoint};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Checks from which on the statistic's size and scatter are known well enough.
const LEAST_LEARNED: usize = 8;

/// The confidence with which the statistic scatters no more than is reckoned.
const CONFIDENCE: f64 = 0.95;

/// How drift is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftSettings {
    /// Time from check to check, s: four half-lives of the estimator or more, so that checks are independent.
    pub check_s: f64,
    /// False alarms in an hour.
    pub false_alarms_per_hour: f64,
}

impl DriftSettings {
    /// One false alarm in ten hours.
    pub fn new(check_s: f64) -> Self {
        Self { check_s, false_alarms_per_hour: 0.1 }
    }

    /// That the settings can be met.
    ///
    /// # Errors
    /// A number that is not positive, or more alarms than there are checks.
    pub fn validate(&self) -> Result<(), OnlineError> {
        check_positive("check_s", &[self.check_s])?;
        check_positive("false_alarms_per_hour", &[self.false_alarms_per_hour])?;
        if self.level() < 0.5 {
            return Ok(());
        }
        let fix = "give less than one for every second check";
        Err(OnlineError::Number { what: "false_alarms_per_hour", value: self.false_alarms_per_hour, fix })
    }

    /// The share of checks that may alarm falsely.
    fn level(&self) -> f64 {
        self.false_alarms_per_hour * self.check_s / 3600.0
    }
}

/// What a check found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftAlarm {
    /// How far the parameters are from the reference, in the metric of both covariances, over what is usual: about 1.
    pub statistic: f64,
    /// What it exceeds by chance as often as was allowed.
    pub threshold: f64,
    /// The base parameter that alone would explain most of it.
    pub parameter: usize,
}

/// Compares a forgetting estimate with a reference.
///
/// With R and r the triangle of an [`OnlineEstimator`] that forgets, and θ₀ the reference with its covariance V₀,
/// `d = r − R θ₀` has the covariance `C = I + R V₀ Rᵀ` if the reference is true and errors are as the estimator's
/// settings say. The statistic is `T = dᵀ C⁻¹ d`: where the samples determine all parameters it is the distance between
/// both estimates in the metric of the sum of their covariances, and what they do not determine adds nothing.
///
/// Errors are neither white nor of the size that was thought, so T is measured where the model is true: from n checks,
/// its mean m and variance v. As a sum of squares of Gaussian numbers of any correlation T is close to `m χ²_ν / ν`
/// with `ν = 2 m²/v` (Satterthwaite, Biometrics Bulletin 2 (1946) 110), so that T/m of a later check, its mean found
/// from n others, follows `F(ν, n ν)`. For ν the least is taken that the scatter of n checks allows with 95 %. The
/// threshold is the quantile of that F that is exceeded `f Δ` times, f the false alarms allowed in a time and Δ the
/// time from check to check. Motions with other speeds or loads than those of learning have other errors: learn on
/// what will be watched.
#[derive(Clone, Debug)]
pub struct DriftMonitor {
    settings: DriftSettings,
    reference: StartingPoint,
    learned: Vec<f64>,
}

impl DriftMonitor {
    /// A monitor for a reference, which has learned nothing.
    ///
    /// # Errors
    /// Settings that cannot be met; a reference with numbers that are none, or a covariance of another size.
    pub fn new(settings: DriftSettings, reference: StartingPoint) -> Result<Self, OnlineError> {
        settings.validate()?;
        let columns = reference.values.len();
        check("values of the reference", &reference.values, columns)?;
        check("covariance of the reference", reference.covariance.as_slice(), columns * columns)?;
        Ok(Self { settings, reference, learned: Vec::new() })
    }

    /// Checks that it has learned from.
    pub fn learned(&self) -> usize {
        self.learned.len()
    }

    /// Whether enough was learned to check: [`check`](Self::check) is none before.
    pub fn is_ready(&self) -> bool {
        self.learned.len() >= LEAST_LEARNED
    }

    /// Learns from a time in which the reference is true of the robot; to be called as often as
    /// [`check`](Self::check) will be, eight times at least and better thirty. Allocates.
    ///
    /// # Errors
    /// An estimator of another robot, or one that has seen nothing.
    pub fn learn(&mut self, estimator: &OnlineEstimator) -> Result<(), OnlineError> {
        let (statistic, _) = self.distance(estimator)?;
        check_positive("the distance from the reference", &[statistic])?;
        self.learned.push(statistic);
        Ok(())
    }

    /// What `T/m` may reach; none before enough was learned.
    pub fn threshold(&self) -> Option<f64> {
        if !self.is_ready() {
            return None;
        }
        let count = self.learned.len() as f64;
        let mean = self.learned.iter().sum::<f64>() / count;
        let squares: f64 = self.learned.iter().map(|one| (one / mean - 1.0).powi(2)).sum();
        // The greatest variance that is likely to have scattered so little.
        let variance = squares / ChiSquared::new(count - 1.0).ok()?.inverse_cdf(1.0 - CONFIDENCE);
        let freedom = 2.0 / variance.max(f64::EPSILON);
        let tail = FisherSnedecor::new(freedom, count * freedom).ok()?;
        Some(tail.inverse_cdf(1.0 - self.settings.level()))
    }

    /// How far the estimate is from the reference now; none before enough was learned. An alarm if its statistic is
    /// above its threshold. Takes 2 n³ operations for n parameters and allocates: not for the loop that controls.
    ///
    /// # Errors
    /// As [`learn`](Self::learn).
    pub fn check(&self, estimator: &OnlineEstimator) -> Result<Option<DriftAlarm>, OnlineError> {
        let Some(threshold) = self.threshold() else { return Ok(None) };
        let (distance, parameter) = self.distance(estimator)?;
        let mean = self.learned.iter().sum::<f64>() / self.learned.len() as f64;
        Ok(Some(DriftAlarm { statistic: distance / mean, threshold, parameter }))
    }

    /// T, and the parameter that alone explains most of it.
    fn distance(&self, estimator: &OnlineEstimator) -> Result<(f64, usize), OnlineError> {
        let factor = estimator.information();
        let columns = self.reference.values.len();
        if factor.columns() != columns {
            return Err(OnlineError::Length {
                what: "values of the reference",
                expected: factor.columns(),
                found: columns,
            });
        }
        let triangle = factor.regressor_triangle();
        let off = factor.rotated_torque() - &triangle * DVector::from_column_slice(&self.reference.values);
        let covariance =
            DMatrix::identity(columns, columns) + &triangle * &self.reference.covariance * triangle.transpose();
        let lower = covariance.cholesky().ok_or(OnlineError::Covariance)?;
        let whitened = |mut of: DMatrix<f64>| {
            // The diagonal of a Cholesky factor is positive.
            lower.l_dirty().solve_lower_triangular_mut(&mut of);
            of
        };
        let off = whitened(DMatrix::from_column_slice(columns, 1, off.as_slice()));
        let triangle = whitened(triangle);
        let explained = |column: usize| {
            let own = triangle.column(column);
            let square = own.norm_squared();
            if square > 0.0 { own.dot(&off.column(0)).powi(2) / square } else { 0.0 }
        };
        let parameter = (0..columns).max_by(|&a, &b| explained(a).total_cmp(&explained(b))).unwrap_or(0);
        Ok((off.norm_squared(), parameter))
    }
}

impl DriftAlarm {
    /// Whether the statistic is above its threshold.
    pub fn is_raised(&self) -> bool {
        self.statistic > self.threshold
    }
}
