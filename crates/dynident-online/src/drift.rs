//! Detection of drift: a slow change of the robot's parameters.

use crate::error::{OnlineError, check, check_positive};
use crate::estimator::{OnlineEstimator, StartingPoint};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Settings of drift detection.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftSettings {
    /// Time between drift checks, s; at least four half-lives of the estimator's forgetting, so that checks are
    /// independent.
    pub check_s: f64,
    /// Allowed false alarms per hour.
    pub false_alarms_per_hour: f64,
    /// Minimum number of checks that are used to learn mean and variance of the test statistic; at least 2, default 8.
    pub min_learned_checks: usize,
    /// Confidence of the upper limit on the test statistic's variance, between 0 and 1, default 0.95.
    pub variance_confidence: f64,
}

impl DriftSettings {
    /// Default settings: one false alarm in ten hours.
    pub fn new(check_s: f64) -> Self {
        Self { check_s, false_alarms_per_hour: 0.1, min_learned_checks: 8, variance_confidence: 0.95 }
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// A value that is not positive, more allowed alarms than half of the checks, or a value outside its range.
    pub fn validate(&self) -> Result<(), OnlineError> {
        check_positive("check_s", &[self.check_s])?;
        check_positive("false_alarms_per_hour", &[self.false_alarms_per_hour])?;
        let faults = [
            (
                self.level() < 0.5,
                "false_alarms_per_hour",
                self.false_alarms_per_hour,
                "allow fewer than one in two checks",
            ),
            (self.min_learned_checks >= 2, "min_learned_checks", self.min_learned_checks as f64, "give at least 2"),
            (
                self.variance_confidence > 0.0 && self.variance_confidence < 1.0,
                "variance_confidence",
                self.variance_confidence,
                "give a number between 0 and 1",
            ),
        ];
        match faults.into_iter().find(|(is_valid, ..)| !is_valid) {
            Some((_, what, value, fix)) => Err(OnlineError::Number { what, value, fix }),
            None => Ok(()),
        }
    }

    /// Allowed probability of a false alarm in one check.
    fn level(&self) -> f64 {
        self.false_alarms_per_hour * self.check_s / 3600.0
    }
}

/// Result of one drift check.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriftAlarm {
    /// Test statistic: squared distance between estimate and reference, weighted by both covariances and divided by its
    /// mean without drift.
    pub statistic: f64,
    /// Threshold for the allowed false-alarm rate.
    pub threshold: f64,
    /// Index of the base parameter that alone explains the largest part of the distance.
    pub parameter: usize,
}

/// Detects drift by comparing a recursive estimate, which forgets old samples, with a reference estimate.
///
/// The recursive estimate of an [`OnlineEstimator`] solves `R θ = r` with a triangular matrix R; θ₀ is the reference
/// with covariance V₀. If the reference is correct and the torque errors are as in the estimator's settings,
/// `d = r − R θ₀` has the covariance `C = I + R V₀ Rᵀ`. The test statistic is `T = dᵀ C⁻¹ d`. If the samples determine
/// all parameters, T is the squared distance between both estimates, weighted by the inverse of the sum of their
/// covariances. Parameter combinations that the samples do not determine contribute nothing.
///
/// Real errors are neither white nor of the assumed size. Therefore mean m and variance v of T are learned from n
/// checks without drift. As a sum of squares of correlated Gaussian variables, T is approximately `m χ²_ν / ν` with
/// `ν = 2 m²/v` (Satterthwaite, Biometrics Bulletin 2 (1946) 110), so that T/m of a later check follows `F(ν, n ν)`.
/// For ν, the lower limit at 95 % confidence from the n checks is used. The threshold is the value that this F
/// distribution exceeds with probability `f Δ`, where f is the allowed false-alarm rate and Δ the time between checks.
/// Errors depend on speed and load, so the learning motion must be the motion that will be monitored.
#[derive(Clone, Debug)]
pub struct DriftMonitor {
    settings: DriftSettings,
    reference: StartingPoint,
    learned: Vec<f64>,
}

impl DriftMonitor {
    /// Creates a monitor for a reference estimate; no checks are learned yet.
    ///
    /// # Errors
    /// Invalid settings; a reference with values that are not finite, or a covariance of a different size.
    pub fn new(settings: DriftSettings, reference: StartingPoint) -> Result<Self, OnlineError> {
        settings.validate()?;
        let columns = reference.values.len();
        check("values of the reference", &reference.values, columns)?;
        check("covariance of the reference", reference.covariance.as_slice(), columns * columns)?;
        Ok(Self { settings, reference, learned: Vec::new() })
    }

    /// The test statistics of all learned checks, for storage.
    pub fn statistics(&self) -> &[f64] {
        &self.learned
    }

    /// Continues from stored [`statistics`](Self::statistics).
    ///
    /// # Errors
    /// Statistics that are not positive.
    pub fn restore(&mut self, statistics: Vec<f64>) -> Result<(), OnlineError> {
        check_positive("a stored statistic", &statistics)?;
        self.learned = statistics;
        Ok(())
    }

    /// Number of learned checks.
    pub fn learned(&self) -> usize {
        self.learned.len()
    }

    /// Whether enough checks were learned. Before that, [`check`](Self::check) returns `None`.
    pub fn is_ready(&self) -> bool {
        self.learned.len() >= self.settings.min_learned_checks
    }

    /// Learns the test statistic of one check. Call it while the robot still agrees with the reference, at the same
    /// interval as [`check`](Self::check) later: at least eight times, preferably thirty times. Allocates memory.
    ///
    /// # Errors
    /// An estimator of a different robot, or one without samples.
    pub fn learn(&mut self, estimator: &OnlineEstimator) -> Result<(), OnlineError> {
        let (statistic, _) = self.distance(estimator)?;
        check_positive("the distance from the reference", &[statistic])?;
        self.learned.push(statistic);
        Ok(())
    }

    /// Threshold of `T/m` (test statistic divided by its learned mean); `None` before enough checks were learned.
    pub fn threshold(&self) -> Option<f64> {
        if !self.is_ready() {
            return None;
        }
        let count = self.learned.len() as f64;
        let mean = self.learned.iter().sum::<f64>() / count;
        let squares: f64 = self.learned.iter().map(|one| (one / mean - 1.0).powi(2)).sum();
        // Upper limit of the variance.
        let variance =
            squares / ChiSquared::new(count - 1.0).ok()?.inverse_cdf(1.0 - self.settings.variance_confidence);
        let freedom = 2.0 / variance.max(f64::EPSILON);
        let tail = FisherSnedecor::new(freedom, count * freedom).ok()?;
        Some(tail.inverse_cdf(1.0 - self.settings.level()))
    }

    /// Checks for drift; `None` before enough checks were learned. [`DriftAlarm::is_raised`] states whether there is an
    /// alarm. Needs 2 n³ operations for n parameters and allocates memory: do not call it in the control loop.
    ///
    /// # Errors
    /// As [`learn`](Self::learn).
    pub fn check(&self, estimator: &OnlineEstimator) -> Result<Option<DriftAlarm>, OnlineError> {
        let Some(threshold) = self.threshold() else { return Ok(None) };
        let (distance, parameter) = self.distance(estimator)?;
        let mean = self.learned.iter().sum::<f64>() / self.learned.len() as f64;
        Ok(Some(DriftAlarm { statistic: distance / mean, threshold, parameter }))
    }

    /// Test statistic T, and the index of the parameter that alone explains the largest part of it.
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
    /// Whether there is an alarm: the statistic is above its threshold.
    pub fn is_raised(&self) -> bool {
        self.statistic > self.threshold
    }
}
