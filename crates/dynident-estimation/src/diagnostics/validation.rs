//! Errors of predicted torque per joint and over all joints, computed sample by sample.

use crate::error::EstimationError;
use crate::factor::MAX_MAGNITUDE;
use serde::{Deserialize, Serialize};

/// Running sums over samples of measured and predicted torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    samples: usize,
    error_square: f64,
    torque_square: f64,
    mean: f64,
    /// Sum of squares about the mean (Welford, Technometrics 4 (1962) 419).
    spread: f64,
    max_error: f64,
}

/// Compares predicted with measured torque sample by sample, in constant memory.
///
/// ```
/// use dynident_estimation::Validation;
/// let mut validation = Validation::new(vec!["shoulder".into()]);
/// validation.add(&[3.0], &[3.0])?;
/// validation.add(&[4.0], &[3.5])?;
/// let report = validation.report();
/// assert!((report.joints[0].relative_error_percent.unwrap() - 10.0).abs() < 1e-12); // 100 · 0.5 / 5
/// # Ok::<(), dynident_estimation::EstimationError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    names: Vec<String>,
    sums: Vec<Sums>,
}

/// Errors of one joint. Torque in N m (force in N for a prismatic joint).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointValidation {
    /// The joint.
    pub name: String,
    /// Number of compared samples.
    pub samples: usize,
    /// `√(Σ(τ − τ̂)² / samples)`.
    pub rmse_nm: f64,
    /// `100 ‖τ − τ̂‖ / ‖τ‖`; `None` if the measured torque is zero.
    pub relative_error_percent: Option<f64>,
    /// `max |τ − τ̂|`.
    pub max_error_nm: f64,
    /// `1 − Σ(τ − τ̂)² / Σ(τ − mean τ)²`; `None` if the measured torque is constant.
    pub r_squared: Option<f64>,
}

/// Errors of all joints stacked into one vector, and of every joint. R² of the stacked vector uses the mean over all
/// joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ValidationReport {
    /// Largest number of samples of any joint.
    pub samples: usize,
    /// Like [`JointValidation::rmse_nm`], over all joints stacked.
    pub rmse_nm: f64,
    /// Like [`JointValidation::relative_error_percent`], over all joints stacked.
    pub relative_error_percent: Option<f64>,
    /// Like [`JointValidation::max_error_nm`], over all joints.
    pub max_error_nm: f64,
    /// Like [`JointValidation::r_squared`], over all joints stacked.
    pub r_squared: Option<f64>,
    /// Errors of every joint.
    pub joints: Vec<JointValidation>,
}

impl Validation {
    /// Creates an empty comparison.
    pub fn new(joints: Vec<String>) -> Self {
        let sums = vec![Sums::default(); joints.len()];
        Self { names: joints, sums }
    }

    /// Adds one sample: measured and predicted torque of every joint.
    ///
    /// # Errors
    /// [`EstimationError::Mismatch`] for a wrong number of values; [`EstimationError::Unusable`] for NaN or infinity
    /// (the column is the joint). On error nothing is added.
    pub fn add(&mut self, measured: &[f64], predicted: &[f64]) -> Result<(), EstimationError> {
        for (what, values) in [("measured torques", measured), ("predicted torques", predicted)] {
            if values.len() != self.sums.len() {
                let (expected, found) = (self.sums.len(), values.len());
                return Err(EstimationError::Mismatch { what: what.into(), expected, found });
            }
            check(values, |joint| (0, joint))?;
        }
        for (joint, sums) in self.sums.iter_mut().enumerate() {
            sums.add(measured[joint], predicted[joint]);
        }
        Ok(())
    }

    /// Adds consecutive samples of joint number `joint`.
    ///
    /// # Errors
    /// Same as for [`add`](Self::add), and [`EstimationError::Mismatch`] for a joint out of range.
    pub fn add_joint(&mut self, joint: usize, measured: &[f64], predicted: &[f64]) -> Result<(), EstimationError> {
        let joints = self.sums.len();
        if measured.len() != predicted.len() {
            let (expected, found) = (measured.len(), predicted.len());
            return Err(EstimationError::Mismatch { what: "predicted torques".into(), expected, found });
        }
        let Some(sums) = self.sums.get_mut(joint) else {
            let what = "joint number, below the number of joints".into();
            return Err(EstimationError::Mismatch { what, expected: joints, found: joint });
        };
        check(measured, |row| (row, joint))?;
        check(predicted, |row| (row, joint))?;
        for (measured, predicted) in measured.iter().zip(predicted) {
            sums.add(*measured, *predicted);
        }
        Ok(())
    }

    /// The results so far. Without samples all errors are zero and the ratios `None`.
    pub fn report(&self) -> ValidationReport {
        let joints: Vec<JointValidation> =
            self.names.iter().zip(&self.sums).map(|(name, sums)| sums.figures(name.clone())).collect();
        let all = self.sums.iter().fold(Sums::default(), |all, sums| all.merged(sums)).figures(String::new());
        ValidationReport {
            samples: self.sums.iter().map(|sums| sums.samples).max().unwrap_or(0),
            rmse_nm: all.rmse_nm,
            relative_error_percent: all.relative_error_percent,
            max_error_nm: all.max_error_nm,
            r_squared: all.r_squared,
            joints,
        }
    }
}

impl Sums {
    fn add(&mut self, measured: f64, predicted: f64) {
        let error = measured - predicted;
        self.samples += 1;
        self.error_square += error * error;
        self.torque_square += measured * measured;
        let before = measured - self.mean;
        self.mean += before / self.samples as f64;
        self.spread += before * (measured - self.mean);
        self.max_error = self.max_error.max(error.abs());
    }

    /// Merges the sums of two sets of samples (Chan, Golub and LeVeque, The American Statistician 37 (1983) 242).
    fn merged(&self, other: &Self) -> Self {
        let samples = self.samples + other.samples;
        let difference = other.mean - self.mean;
        let share = if samples > 0 { other.samples as f64 / samples as f64 } else { 0.0 };
        Self {
            samples,
            error_square: self.error_square + other.error_square,
            torque_square: self.torque_square + other.torque_square,
            mean: self.mean + difference * share,
            spread: self.spread + other.spread + difference * difference * share * self.samples as f64,
            max_error: self.max_error.max(other.max_error),
        }
    }

    fn figures(&self, name: String) -> JointValidation {
        let ratio = |part: f64, whole: f64| (whole > 0.0).then(|| part / whole);
        JointValidation {
            name,
            samples: self.samples,
            rmse_nm: ratio(self.error_square, self.samples as f64).unwrap_or(0.0).sqrt(),
            relative_error_percent: ratio(self.error_square, self.torque_square).map(|share| 100.0 * share.sqrt()),
            max_error_nm: self.max_error,
            r_squared: ratio(self.error_square, self.spread).map(|share| 1.0 - share),
        }
    }
}

fn check(values: &[f64], place: impl Fn(usize) -> (usize, usize)) -> Result<(), EstimationError> {
    match values.iter().position(|value| value.is_nan() || value.abs() > MAX_MAGNITUDE) {
        Some(index) => {
            let (row, column) = place(index);
            Err(EstimationError::Unusable { row, column, value: values[index], limit: MAX_MAGNITUDE })
        }
        None => Ok(()),
    }
}
