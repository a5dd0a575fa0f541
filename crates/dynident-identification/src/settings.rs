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

/// Whether the constant torque of a joint is the same in all training logs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum OffsetChoice {
    /// One offset for each joint, common to all logs.
    #[default]
    Shared,
    /// Separate offsets for each training log, because zeros of torque sensors drift from day to day. The base
    /// parameters contain the mean over the logs.
    PerLog,
}

/// Source of the torque gains (torque per logged unit).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum GainChoice {
    /// Stated by the log format: torque columns are in newton metres after units and scales are applied.
    #[default]
    Stated,
    /// Estimated from the logs: one gain per joint, from logs without and with a known payload.
    Unknown,
}

/// Kinds of lags that may be compensated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LagCandidates {
    /// One lag for all joints, or separate lags of joints that clearly differ.
    #[default]
    CommonOrJoints,
    /// Only one lag for all joints. Used for runs with a controller, where unmodelled friction looks like a lag that
    /// differs between joints and varies between runs.
    Common,
}

/// Whether hypotheses about mistakes in the study are tested; see [`diagnosis`](crate::diagnosis).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiagnosisChoice {
    /// Never.
    Never,
    /// If the fit is doubtful: the residual of a physically consistent robot is clearly larger than that of separate
    /// parameters for each joint, friction drives a joint (negative friction), or a joint exceeds its limits.
    #[default]
    WhenDoubtful,
    /// Always.
    Always,
}

/// Settings of [`identify`](crate::identify()). The default is weighted least squares with physically consistent
/// parameters.
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
    /// Whether to compute intervals of every parameter over all physically consistent sets that the data do not reject.
    /// This takes some thousand fits; off by default.
    pub intervals: bool,
    /// Joints whose drive inertia is tested, with one test for all of them. If the test is positive, it is added to the
    /// model. Joints with a stated drive inertia are skipped. Empty by default.
    pub drive_inertia: Vec<String>,
    /// Source of the joints' friction; the terms of the robot model by default.
    pub friction: FrictionSource,
    /// Whether training logs share one torque offset per joint (default) or have separate offsets.
    pub offsets: OffsetChoice,
    /// Whether training logs share one noise level per joint (default) or have separate noise levels.
    pub log_noise: LogNoise,
    /// Kinds of lags that may be compensated if no lag is stated.
    pub lags: LagCandidates,
    /// Whether the torque columns are in newton metres (default) or have unknown gains.
    pub gains: GainChoice,
    /// Relative standard deviation of stated torque gains, independent between joints; the error bars of payloads
    /// include it. Zero by default.
    pub gain_std: f64,
    /// Whether hypotheses about mistakes in the study are tested; by default only if the fit is doubtful.
    pub diagnosis: DiagnosisChoice,
    /// Thresholds for decisions, and for treating a fit as doubtful.
    pub thresholds: DecisionThresholds,
    /// Limits for the test of hypotheses about mistakes in the study.
    pub diagnosis_limits: DiagnosisSettings,
    /// Limits for the examination of the estimate, which decide whether the fit is doubtful.
    pub examination: ExaminationSettings,
    /// Settings of the search for intervals of the logs that no single model explains.
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

    /// Share of a held-out log that determines separate offsets of this log; `None` if all logs share the offsets.
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
