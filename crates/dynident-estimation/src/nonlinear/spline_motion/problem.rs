//! What is sought, what was measured, what the model has to say of it, and what comes out.

use crate::error::{EstimationError, expect, require, within};
use crate::factor::RankSettings;
use crate::uncertainty::{CovarianceMethod, Estimate};
use dynident_model::terms::JointMotion;
use serde::{Deserialize, Serialize};

/// One uninterrupted piece of a log: positions and torques as they were measured, on an even clock.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineRecord {
    /// Number of the log: pieces of one log share their noise and the smoothness of their motion.
    pub log: usize,
    /// Samples a second.
    pub rate_hz: f64,
    /// Positions (rad, m), joint after joint, as many samples each.
    pub q: Vec<f64>,
    /// Torques (N m, N), likewise.
    pub tau: Vec<f64>,
}

/// Torques of a block of samples about a motion and parameters, with derivatives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TorqueSlopes {
    /// Torques, joint-major.
    pub torque: Vec<f64>,
    /// Derivative of torque `j` by variable `v` at sample `s`, at `(j · 3 joints + v) · samples + s`; variables are
    /// all positions, then all velocities, then all accelerations.
    pub by_motion: Vec<f64>,
    /// For each joint the numbers of the parameters that its torque depends on.
    pub columns: Vec<Vec<usize>>,
    /// For each joint the derivatives by these, column after column.
    pub by_parameters: Vec<Vec<f64>>,
}

/// What [`spline_motion_least_squares`](crate::spline_motion_least_squares()) asks: the torque that a motion needs.
pub trait TorqueModel {
    /// Why a torque could not be made.
    type Error: From<EstimationError>;

    /// Torques, joint-major, of samples `first..first + motion.samples` of record number `record`; `place` holds record
    /// and first. Blocks of a record come in the order of time, from its first sample on.
    ///
    /// # Errors
    /// As the model says.
    fn torque(
        &mut self,
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<Vec<f64>, Self::Error>;

    /// The same with derivatives. A function that jumps may be given the derivative zero: rows near the jump then hold
    /// no information about the instant of it.
    ///
    /// # Errors
    /// As the model says.
    fn slopes(
        &mut self,
        place: (usize, usize),
        motion: &JointMotion<'_>,
        parameters: &[f64],
    ) -> Result<TorqueSlopes, Self::Error>;
}

/// What is sought, what was measured, and where to begin.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineMotionProblem {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// What was measured.
    pub records: Vec<SplineRecord>,
    /// The parameters at the start, such as a least-squares estimate.
    pub parameters: Vec<f64>,
    /// Parameter by parameter whether it stays what it is at the start: what the data do not excite, or is given.
    pub held: Vec<bool>,
}

impl SplineMotionProblem {
    /// Checks shapes and numbers.
    pub(super) fn check(&self) -> Result<(), EstimationError> {
        let joints = self.joints.len();
        if joints == 0 || self.records.is_empty() {
            return Err(EstimationError::Empty);
        }
        expect("parameters of the start", self.names.len(), self.parameters.len())?;
        expect("parameters that are held or not", self.names.len(), self.held.len())?;
        for record in &self.records {
            expect("torques of a record, one for each position", record.q.len(), record.tau.len())?;
            let samples = record.q.len() / joints;
            expect("positions of a record, as many for each joint", samples * joints, record.q.len())?;
            within("rate_hz", record.rate_hz, 1e-6..=1e9, "give samples a second")?;
            if samples < LEAST_SAMPLES {
                let what = "a piece of a log".to_owned();
                return Err(EstimationError::TooFewRows { what, rows: samples, parameters: LEAST_SAMPLES as f64 });
            }
            if let Some(place) = record.q.iter().chain(&record.tau).position(|x| x.is_nan() || x.abs() > LARGEST) {
                let value = record.q.iter().chain(&record.tau).nth(place).copied().unwrap_or(f64::NAN);
                let (row, column) = (place % samples, place / samples);
                return Err(EstimationError::Unusable { row, column, value, limit: LARGEST });
            }
        }
        Ok(())
    }
}

/// A shorter piece says too little of its own motion.
const LEAST_SAMPLES: usize = 16;
/// The square of a larger number leaves no room for sums.
const LARGEST: f64 = 1e100;

/// Settings of [`spline_motion_least_squares`](crate::spline_motion_least_squares()).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SplineMotionSettings {
    /// When a column counts as excited, once the motion is taken out.
    #[serde(skip)]
    pub rank: RankSettings,
    /// The covariance to report, of whitened rows.
    #[serde(skip)]
    pub covariance: CovarianceMethod,
    /// Highest order of the autoregression that a torque's residuals may have; the order is Schwarz's. Default 4; 0
    /// takes the torque's noise for white.
    pub most_autoregression: usize,
    /// Length of a step of the parameters, in error bars over all directions, at which the iteration ends. Default
    /// 0.03.
    pub tolerance: f64,
    /// Most steps. Default 30; five to ten are usual.
    pub max_iterations: usize,
    /// Seconds to which a second of a usual arm corresponds: the unit of the longest spacing of knots (0.5) and of the
    /// longest memory of the torque's noise (0.1). Default 1.
    #[serde(skip)]
    pub own_second_s: f64,
    /// Seconds between two knots; by default what the positions make likeliest.
    pub knot_spacing_s: Option<f64>,
    /// Most unknowns of the motion over all joints and logs: knots move apart where there would be more. Default
    /// 60 000, which take some 200 MB.
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
    /// fewer than a thousand unknowns, a second that is not positive, or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        let fix = "give 0 to 16";
        require(self.most_autoregression <= 16, "most_autoregression", self.most_autoregression as f64, fix)?;
        within("tolerance", self.tolerance, 1.0e-6..=1.0, "give a length in error bars from 1e-6 to 1")?;
        let is_second = self.own_second_s > 0.0 && self.own_second_s.is_finite();
        require(is_second, "own_second_s", self.own_second_s, "give a positive number")?;
        require(self.max_iterations >= 2, "max_iterations", self.max_iterations as f64, "give at least 2")?;
        let fix = "give seconds, above 0 and at most 10000";
        require(
            self.knot_spacing_s.is_none_or(|s| s > 0.0 && s <= 1e4),
            "knot_spacing_s",
            self.knot_spacing_s.unwrap_or_default(),
            fix,
        )?;
        require(self.max_unknowns >= 1000, "max_unknowns", self.max_unknowns as f64, "give at least 1000")
    }
}

/// Noise and motion of one joint in one log, as they were found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SplineJointFit {
    /// Standard deviation of a sample's position, rad (m).
    pub position_std: f64,
    /// Standard deviation of what is new in a row's torque, N m (N).
    pub torque_std: f64,
    /// Coefficients of the autoregression from row to row that its torque's noise was found to be; none if white.
    pub torque_autoregression: Vec<f64>,
    /// The derivative of the position that is white noise by the prior.
    pub order: usize,
    /// How many of the motion's functions positions and torques determine.
    pub used_functions: f64,
}

/// One log's motion, as it was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SplineLogFit {
    /// Seconds between two knots.
    pub knot_spacing_s: f64,
    /// Functions of every joint's motion.
    pub functions: usize,
    /// Rows of each joint's torque.
    pub rows: usize,
    /// How many samples a row is the mean of.
    pub samples_of_row: usize,
    /// Joint by joint.
    pub joints: Vec<SplineJointFit>,
}

/// What [`spline_motion_least_squares`](crate::spline_motion_least_squares()) found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SplineMotionEstimate {
    /// The parameters. Joints of the estimate are channels here: torques, positions and roughness of every log's
    /// joints; their σ are those of whitened rows.
    pub estimate: Estimate,
    /// Positions, velocities and accelerations of every record, joint-major.
    #[serde(skip)]
    pub motion: Vec<[Vec<f64>; 3]>,
    /// Log by log.
    pub logs: Vec<SplineLogFit>,
    /// What the sum of squares was with the parameters and the motion of the start, and the noise of the end.
    pub cost_at_start: f64,
    /// What it is.
    pub cost: f64,
}
