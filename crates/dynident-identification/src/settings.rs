//! Settings of an identification: filters, estimator, prior knowledge of bodies, selection of friction.

use crate::consistent::{ConsistencyError, ConsistencySettings};
use crate::diagnosis_settings::DiagnosisSettings;
use crate::estimators::EstimationSettings;
use crate::examination_settings::ExaminationSettings;
use crate::friction::FrictionSource;
use crate::log_noise::LogNoise;
use crate::thresholds::DecisionThresholds;
use dynident_dynamics::ParametricModel;
use dynident_events::EventSettings;
use dynident_recording::MotionSettings;
use dynident_rows::{ParallelFilterSettings, RowSettings};
use serde::{Deserialize, Serialize};

/// Constant torques of the joints in several training logs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum OffsetChoice {
    /// One offset for each joint.
    #[default]
    Shared,
    /// Separate offsets for each training log; base parameters and joints use their mean. Zeros of torque sensors drift
    /// from day to day.
    PerLog,
}

/// Source of the torque gains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum GainChoice {
    /// The format: torque columns are in newton metres after units and scales are applied.
    #[default]
    Stated,
    /// The logs: one gain per joint, estimated from logs without and with a known payload.
    Unknown,
}

/// Lags that may be compensated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LagCandidates {
    /// One lag for all joints, or separate lags of joints that clearly differ.
    #[default]
    CommonOrJoints,
    /// One lag for all joints. For runs under one controller: friction looks like a different lag at each joint, which
    /// varies between runs.
    Common,
}

/// When alternative hypotheses about the logs are tested: see [`diagnosis`](crate::diagnosis).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiagnosisChoice {
    /// Never.
    Never,
    /// If the fit is doubtful: the residual of a consistent robot is clearly larger than that of separate parameters
    /// for each joint, friction drives a joint, or a joint is beyond its limits.
    #[default]
    WhenDoubtful,
    /// Always.
    Always,
}

/// Settings of [`identify`](crate::identify()). The default is weighted least squares with consistent parameters.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct IdentificationSettings {
    /// Differentiation of positions.
    pub motion: MotionSettings,
    /// Low-pass and decimation of torque and regressor.
    pub parallel_filter: ParallelFilterSettings,
    /// Estimator and error bars.
    pub estimation: EstimationSettings,
    /// Prior knowledge of the bodies; `None` skips the physically consistent fit.
    pub consistency: Option<ConsistencySettings>,
    /// Whether to compute intervals of every parameter over all consistent sets that the data do not reject. It takes
    /// some thousand fits; off by default.
    pub intervals: bool,
    /// Joints whose drive inertia is tested, all together; it is added to the model if the test is positive. Empty by
    /// default. Joints with a stated drive inertia are skipped.
    pub drive_inertia: Vec<String>,
    /// Source of the joints' friction; the terms of the robot by default.
    pub friction: FrictionSource,
    /// Whether training logs share their offsets; they do by default.
    pub offsets: OffsetChoice,
    /// Whether training logs share the noise of their joints; they do by default.
    pub log_noise: LogNoise,
    /// Lags of the torque that may be compensated if no lag is stated.
    pub lags: LagCandidates,
    /// Whether torque is in newton metres; it is by default.
    pub gains: GainChoice,
    /// Relative standard deviation of stated gains, independent between joints; it enters the error bars of payloads.
    /// Zero by default.
    pub gain_std: f64,
    /// When alternative hypotheses about the training logs are tested; by default if the fit is doubtful.
    pub diagnosis: DiagnosisChoice,
    /// Thresholds of decisions and of the doubt about a study.
    pub thresholds: DecisionThresholds,
    /// Limits behind the verdicts of that comparison.
    pub diagnosis_limits: DiagnosisSettings,
    /// Limits of the examination that decide whether the fit is doubtful.
    pub examination: ExaminationSettings,
    /// Search for intervals of the logs that no single model explains.
    pub events: EventSettings,
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
            friction: FrictionSource::default(),
            offsets: OffsetChoice::default(),
            log_noise: LogNoise::default(),
            lags: LagCandidates::default(),
            gains: GainChoice::default(),
            gain_std: 0.0,
            diagnosis: DiagnosisChoice::default(),
            thresholds: DecisionThresholds::default(),
            diagnosis_limits: DiagnosisSettings::default(),
            examination: ExaminationSettings::default(),
            events: EventSettings::default(),
        }
    }
}

impl IdentificationSettings {
    /// Settings that define the rows.
    pub fn row_settings(&self) -> RowSettings<'_> {
        RowSettings { motion: &self.motion, parallel_filter: &self.parallel_filter }
    }

    /// Share of a held-out log that determines its own offsets; `None` if all logs share the offsets.
    pub fn held_out_offset_share(&self) -> Option<f64> {
        (self.offsets == OffsetChoice::PerLog).then_some(self.examination.offset_share)
    }

    /// Checks that the named bodies and terms exist.
    ///
    /// # Errors
    /// A name is unknown.
    pub fn check_names(&self, robot: &ParametricModel) -> Result<(), ConsistencyError> {
        let Some(knowledge) = &self.consistency else { return Ok(()) };
        let mut named = knowledge.clone();
        if self.friction.is_selected() {
            // Terms that will be selected do not exist yet.
            named.terms.clear();
        }
        named.check_names(robot.model(), robot.terms())
    }
}
