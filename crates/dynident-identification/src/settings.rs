//! How a model is identified: filters, estimator, what is known of the bodies, whose friction is chosen.

use crate::consistent::{ConsistencyError, ConsistencySettings};
use crate::diagnosis::DiagnosisSettings;
use crate::estimators::EstimationSettings;
use crate::examination::ExaminationSettings;
use crate::friction::{FrictionSearch, JointFriction};
use crate::log_noise::LogNoise;
use dynident_dynamics::ParametricModel;
use dynident_recording::MotionSettings;
use dynident_rows::{ParallelFilterSettings, RowSettings};
use serde::{Deserialize, Serialize};

/// Whether logs share the constant torques of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum OffsetChoice {
    /// One offset for each joint.
    #[default]
    Shared,
    /// Each training log has its own; base parameters and joints hold their mean. Zeros of torque sensors drift from
    /// day to day.
    PerLog,
}

/// Who says what a unit of logged torque is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum GainChoice {
    /// The format: torque columns are newton metres once their units and scales are in force.
    #[default]
    Stated,
    /// The logs: joint by joint one gain, from logs without and with a payload that is known.
    Unknown,
}

/// Which lags may be taken off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LagCandidates {
    /// One for all joints, or joints with one of their own where the rows say so.
    #[default]
    CommonOrJoints,
    /// One for all joints: of runs under one controller friction leaves a lag of its own at each joint, and not the
    /// same in every run.
    Common,
}

/// Whether other readings of the logs are tried: see [`diagnosis`](crate::diagnosis).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiagnosisChoice {
    /// Not at all.
    Never,
    /// Where the fit gives reason to: a consistent robot leaves clearly more than parameters of each joint's own, or
    /// friction drives a joint, or a joint is beyond its limits.
    #[default]
    WhenDoubtful,
    /// In any case.
    Always,
}

/// Everything that [`identify`](crate::identify()) can be given beside robot and recordings; the default is weighted
/// least squares with consistent parameters.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct IdentificationSettings {
    /// From positions to velocities and accelerations.
    pub motion: MotionSettings,
    /// The low-pass and decimation that torque and regressor go through alike.
    pub parallel_filter: ParallelFilterSettings,
    /// The estimator.
    pub estimation: EstimationSettings,
    /// What is known of the bodies; `None` leaves parameters as they are estimated, consistent or not.
    pub consistency: Option<ConsistencySettings>,
    /// Intervals for every parameter over all consistent sets that the data do not reject; some thousand fits, so not
    /// by default.
    pub intervals: bool,
    /// Joints whose drives the training logs show to have inertia or not: it is tested for all of them together, and
    /// they have it where it is seen. None by default; joints that have a drive inertia by their terms are passed over.
    pub drive_inertia: Vec<String>,
    /// Joints whose friction the training logs choose; none by default.
    pub friction: Vec<FrictionSearch>,
    /// Friction that other recordings chose and the robot's terms hold already: what is unknown of its constants stands
    /// in the error bars by what these recordings tell of them. None by default, and without effect where friction is
    /// chosen.
    pub friction_before: Vec<JointFriction>,
    /// Whether training logs share their offsets; by default they do.
    pub offsets: OffsetChoice,
    /// Whether training logs share the noise of their joints; by default they do.
    pub log_noise: LogNoise,
    /// Which lags of the torque may be taken off the rows where none is stated; by default one for all joints, or
    /// joints with one of their own.
    pub lags: LagCandidates,
    /// Whether torque is in newton metres; by default it is.
    pub gains: GainChoice,
    /// Standard deviation of stated gains as a share of each, independent from joint to joint: it goes into the error
    /// bars of payloads. Zero by default.
    pub gain_std: f64,
    /// Whether other readings of the training logs are compared with the study's; where the fit gives reason to, by
    /// default.
    pub diagnosis: DiagnosisChoice,
    /// Limits behind the verdicts of that comparison.
    pub diagnosis_limits: DiagnosisSettings,
    /// Limits of the examination that decide whether the fit is doubtful.
    pub examination: ExaminationSettings,
}

impl Default for IdentificationSettings {
    fn default() -> Self {
        Self {
            motion: MotionSettings::default(),
            parallel_filter: ParallelFilterSettings::default(),
            estimation: EstimationSettings::default(),
            consistency: Some(ConsistencySettings::default()),
            intervals: false,
            drive_inertia: Vec::new(),
            friction: Vec::new(),
            friction_before: Vec::new(),
            offsets: OffsetChoice::default(),
            log_noise: LogNoise::default(),
            lags: LagCandidates::default(),
            gains: GainChoice::default(),
            gain_std: 0.0,
            diagnosis: DiagnosisChoice::default(),
            diagnosis_limits: DiagnosisSettings::default(),
            examination: ExaminationSettings::default(),
        }
    }
}

impl IdentificationSettings {
    /// The settings that make rows.
    pub fn row_settings(&self) -> RowSettings<'_> {
        RowSettings { motion: &self.motion, parallel_filter: &self.parallel_filter }
    }

    /// Checks that the bodies and terms of which something is known are there.
    ///
    /// # Errors
    /// A name that the robot does not have.
    pub fn check_names(&self, robot: &ParametricModel) -> Result<(), ConsistencyError> {
        let Some(knowledge) = &self.consistency else { return Ok(()) };
        let mut named = knowledge.clone();
        if !self.friction.is_empty() {
            // Terms that the logs are to choose are not there yet.
            named.terms.clear();
        }
        named.check_names(robot.model(), robot.terms())
    }
}
