//! Problem, settings, model trait and results.

use crate::error::{EstimationError, expect, require, within};
use crate::factor::RankSettings;
use crate::uncertainty::{CovarianceMethod, Estimate};
use dynident_model::terms::JointMotion;
use serde::{Deserialize, Serialize};

/// One uninterrupted piece of a log: measured positions and torques at a constant rate.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineRecord {
    /// Index of the log. Pieces of one log share noise levels and smoothness.
    pub log: usize,
    /// Sampling rate.
    pub rate_hz: f64,
    /// Positions (rad, m), joint after joint, with the same number of samples each.
    pub q: Vec<f64>,
    /// Torques (N m, N), in the same order.
    pub tau: Vec<f64>,
}

/// Torques of a block of samples at given motion and parameters, with derivatives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TorqueSlopes {
    /// Torques, joint-major.
    pub torque: Vec<f64>,
    /// Derivative of torque `j` by variable `v` at sample `s`, at `(j · 3 joints + v) · samples + s`; variables are
    /// all positions, then all velocities, then all accelerations.
    pub by_motion: Vec<f64>,
    /// Indices of the parameters of each joint's torque.
    pub columns: Vec<Vec<usize>>,
    /// Derivatives of each joint's torque by these parameters, column after column.
    pub by_parameters: Vec<Vec<f64>>,
}

/// Torque model of [`spline_motion_least_squares`](crate::spline_motion_least_squares()).
pub trait TorqueModel {
    /// Error of the model.
    type Error: From<EstimationError>;

    /// Torques of samples `first..first + motion.samples` of a record, joint-major; `place` is (record, first). The
    /// blocks of a record are evaluated in order of time, starting with its first sample.
    ///
    /// # Errors
    /// Defined by the model.
    fn torque(
        &mut self,
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<Vec<f64>, Self::Error>;

    /// Torques with derivatives. A discontinuous function may have the derivative zero; rows near the jump then carry
    /// no information about its instant.
    ///
    /// # Errors
    /// Defined by the model.
    fn slopes(
        &mut self,
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<TorqueSlopes, Self::Error>;
}

/// Measurements and start values.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineMotionProblem {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Measured positions and torques.
    pub records: Vec<SplineRecord>,
    /// Start values of the parameters, for example a least-squares estimate.
    pub parameters: Vec<f64>,
    /// Whether each parameter is held at its start value (unexcited or given).
    pub held: Vec<bool>,
}

impl SplineMotionProblem {
    pub(super) fn check(&self) -> Result<(), EstimationError> {
        let joints = self.joints.len();
        if joints == 0 || self.records.is_empty() {
            return Err(EstimationError::Empty);
        }
        expect("parameters of the start", self.names.len(), self.parameters.len())?;
        expect("flags of held parameters", self.names.len(), self.held.len())?;
        for record in &self.records {
            expect("torques of a record, one for each position", record.q.len(), record.tau.len())?;
            let samples = record.q.len() / joints;
            expect("positions of a record, as many for each joint", samples * joints, record.q.len())?;
            within("rate_hz", record.rate_hz, 1e-6..=1e9, "use samples per second")?;
            if samples < MIN_SAMPLES {
                let what = "a piece of a log".to_owned();
                return Err(EstimationError::TooFewRows { what, rows: samples, parameters: MIN_SAMPLES as f64 });
            }
            if let Some(place) = record.q.iter().chain(&record.tau).position(|x| x.is_nan() || x.abs() > MAX_MAGNITUDE)
            {
                let value = record.q.iter().chain(&record.tau).nth(place).copied().unwrap_or(f64::NAN);
                let (row, column) = (place % samples, place / samples);
                return Err(EstimationError::Unusable { row, column, value, limit: MAX_MAGNITUDE });
            }
        }
        Ok(())
    }
}

/// Minimum number of samples of a piece; a shorter piece does not determine its motion.
const MIN_SAMPLES: usize = 16;
/// Largest accepted magnitude; larger values would overflow when squared and summed.
const MAX_MAGNITUDE: f64 = 1e100;

/// Settings of [`spline_motion_least_squares`](crate::spline_motion_least_squares()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SplineMotionSettings {
    /// Criteria for an excited column after the motion is eliminated.
    #[serde(skip)]
    pub rank: RankSettings,
    /// Method of the reported covariance of whitened rows.
    #[serde(skip)]
    pub covariance: CovarianceMethod,
    /// Maximum order of the autoregression of a torque's residuals; Schwarz's criterion (BIC) selects the order.
    /// Default 4; 0 assumes white torque noise.
    pub most_autoregression: usize,
    /// The iteration ends at this step length of the parameters, in error bars over all directions. Default 0.03.
    pub tolerance: f64,
    /// Maximum number of steps. Default 30; five to ten are usual.
    pub max_iterations: usize,
    /// Time scale of the robot relative to an arm of usual size (about 1.2 m). It multiplies `max_knot_spacing_s` and
    /// `max_noise_memory_s`. Default 1.
    #[serde(skip)]
    pub own_second_s: f64,
    /// Longest tested time between two knots, s, for a robot of time scale 1. Default 0.5.
    #[serde(skip)]
    pub max_knot_spacing_s: f64,
    /// Longest correlation time of torque noise, s, for a robot of time scale 1. Residuals with a longer correlation
    /// are model errors; whitening them would remove the information of slow motion about the parameters. Default
    /// 0.1.
    #[serde(skip)]
    pub max_noise_memory_s: f64,
    /// Seconds between two knots; by default the most likely spacing for the positions.
    pub knot_spacing_s: Option<f64>,
    /// Maximum number of unknowns of the motion over all joints and logs; a larger number increases the knot spacing.
    /// Default 60 000, which needs about 200 MB.
    pub max_unknowns: usize,
}

impl Default for SplineMotionSettings {
    fn default() -> Self {
        Self {
            rank: RankSettings::default(),
            covariance: CovarianceMethod::default(),
            most_autoregression: 4,
            tolerance: 0.03,
            max_iterations: 30,
            own_second_s: 1.0,
            max_knot_spacing_s: 0.5,
            max_noise_memory_s: 0.1,
            knot_spacing_s: None,
            max_unknowns: 60_000,
        }
    }
}

impl SplineMotionSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for an order above 16, a tolerance outside 1e-6 to 1, fewer than two iterations,
    /// fewer than a thousand unknowns, a time or time scale that is not positive, or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        let fix = "use 0 to 16";
        require(self.most_autoregression <= 16, "most_autoregression", self.most_autoregression as f64, fix)?;
        within("tolerance", self.tolerance, 1.0e-6..=1.0, "use a length in error bars from 1e-6 to 1")?;
        for (setting, value) in [
            ("own_second_s", self.own_second_s),
            ("max_knot_spacing_s", self.max_knot_spacing_s),
            ("max_noise_memory_s", self.max_noise_memory_s),
        ] {
            require(value > 0.0 && value.is_finite(), setting, value, "use a positive number")?;
        }
        require(self.max_iterations >= 2, "max_iterations", self.max_iterations as f64, "use at least 2")?;
        let fix = "use seconds above 0 and at most 10000";
        require(
            self.knot_spacing_s.is_none_or(|s| s > 0.0 && s <= 1e4),
            "knot_spacing_s",
            self.knot_spacing_s.unwrap_or_default(),
            fix,
        )?;
        require(self.max_unknowns >= 1000, "max_unknowns", self.max_unknowns as f64, "use at least 1000")
    }
}

/// Estimated noise and motion of one joint in one log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SplineJointFit {
    /// Standard deviation of the noise of one position sample, rad (m).
    pub position_std: f64,
    /// Standard deviation of the innovation of a row's torque, N m (N).
    pub torque_std: f64,
    /// Coefficients of the autoregression of the torque noise from row to row; empty for white noise.
    pub torque_autoregression: Vec<f64>,
    /// Order r of the motion prior: the r-th derivative of the position is white noise.
    pub order: usize,
    /// Effective number of spline functions of the motion that positions and torques determine.
    pub used_functions: f64,
}

/// Estimated motion of one log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SplineLogFit {
    /// Seconds between two knots.
    pub knot_spacing_s: f64,
    /// Number of spline functions of every joint's motion.
    pub functions: usize,
    /// Number of rows of each joint's torque.
    pub rows: usize,
    /// Number of samples averaged in one row.
    pub samples_of_row: usize,
    /// Results by joint.
    pub joints: Vec<SplineJointFit>,
}

/// Result of [`spline_motion_least_squares`](crate::spline_motion_least_squares()).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SplineMotionEstimate {
    /// The parameters. The "joints" of this estimate are channels: torque, position and roughness of every joint in
    /// every log, with σ of whitened rows.
    pub estimate: Estimate,
    /// Positions, velocities and accelerations of every record, joint-major.
    #[serde(skip)]
    pub motion: Vec<[Vec<f64>; 3]>,
    /// Results by log.
    pub logs: Vec<SplineLogFit>,
    /// Sum of squares for the start values of parameters and motion, with the final noise levels.
    pub cost_at_start: f64,
    /// Sum of squares of the result.
    pub cost: f64,
}
