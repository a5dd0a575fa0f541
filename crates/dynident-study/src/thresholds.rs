//! `[thresholds]`: thresholds of decisions, findings and statements.

use crate::error::StudyError;
use crate::report_thresholds::{DifferenceSettings, ProblemSettings, TorqueErrorSettings};
use dynident_identification::diagnosis::DiagnosisSettings;
use dynident_identification::examination::ExaminationSettings;
use dynident_identification::{
    CutoffThresholds, DecisionThresholds, DescriptionThresholds, DoubtThresholds, DriveInertiaThresholds,
    EstimationThresholds, EventSettings, FrictionThresholds, GainThresholds, IdentificationSettings, LagThresholds,
    LogLoadThresholds, LogVariationThresholds, MotionThresholds, NoiseThresholds,
};
use serde::{Deserialize, Serialize};

/// Thresholds of decisions, findings and statements. The defaults suit all robots with which they were tested; each key
/// names its evidence.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ThresholdSection {
    /// Test for drive inertia.
    pub drive_inertia: DriveInertiaThresholds,
    /// Selection of cut-offs.
    pub cutoff: CutoffThresholds,
    /// Significance of friction terms.
    pub friction: FrictionThresholds,
    /// When a fit is doubtful, so that mistakes in the study are searched.
    pub doubt: DoubtThresholds,
    /// Which bodies differ from the robot description.
    pub description: DescriptionThresholds,
    /// Loads that a single training log carries.
    pub log_load: LogLoadThresholds,
    /// Selection of the lag.
    pub lag: LagThresholds,
    /// Test for noise in the regressor.
    pub noise: NoiseThresholds,
    /// Variation between logs.
    pub log_variation: LogVariationThresholds,
    /// Requirements on the motion of the simultaneous method.
    pub motion: MotionThresholds,
    /// Drive gains.
    pub gain: GainThresholds,
    /// Examination of the estimate.
    pub examination: ExaminationSettings,
    /// Search for mistakes in study, robot description and logs.
    pub diagnosis: DiagnosisSettings,
    /// Search for intervals of a log that no single model explains.
    pub events: EventSettings,
    /// Statements in reports and on the terminal.
    pub report: ReportThresholds,
}

/// Thresholds of statements in reports and on the terminal.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ReportThresholds {
    /// Torque errors.
    pub errors: TorqueErrorSettings,
    /// Reasons against loading a model into a robot.
    pub problems: ProblemSettings,
    /// Bodies that differ from the robot description.
    pub differences: DifferenceSettings,
}

impl ThresholdSection {
    /// Whether all thresholds have their default values.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Thresholds of the decisions before the last fit.
    fn decisions(&self) -> DecisionThresholds {
        let mut own = DecisionThresholds::default();
        (own.drive_inertia, own.cutoff, own.friction) = (self.drive_inertia, self.cutoff, self.friction);
        (own.doubt, own.description, own.log_load) = (self.doubt, self.description, self.log_load);
        own
    }

    /// Thresholds of the estimation.
    fn estimation(&self) -> EstimationThresholds {
        let mut own = EstimationThresholds::default();
        (own.lag, own.noise, own.log_variation) = (self.lag, self.noise, self.log_variation);
        (own.motion, own.gain) = (self.motion, self.gain);
        own
    }

    /// Copies the thresholds of the identification to its settings.
    pub(crate) fn apply(&self, settings: &mut IdentificationSettings) {
        (settings.thresholds, settings.estimation.thresholds) = (self.decisions(), self.estimation());
        (settings.examination, settings.diagnosis_limits, settings.events) =
            (self.examination, self.diagnosis, self.events);
    }

    /// Checks the thresholds.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), StudyError> {
        self.decisions().validate()?;
        self.estimation().validate()?;
        self.events.validate()?;
        self.examination.validate().map_err(StudyError::at("[thresholds.examination]"))?;
        self.diagnosis.validate().map_err(StudyError::at("[thresholds.diagnosis]"))?;
        let ReportThresholds { errors, problems, differences } = &self.report;
        errors.validate().map_err(StudyError::at("[thresholds.report.errors]"))?;
        problems.validate().map_err(StudyError::at("[thresholds.report.problems]"))?;
        differences.validate().map_err(StudyError::at("[thresholds.report.differences]"))
    }
}

impl ReportThresholds {
    /// Whether all thresholds have their default values.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

#[cfg(test)]
mod tests {
    use super::IdentificationSettings;
    use crate::Study;
    use std::path::Path;

    const STUDY: &str = "robot.file = \"arm.urdf\"\n";

    fn study(thresholds: &str) -> Result<Study, String> {
        Study::parse(&format!("{STUDY}{thresholds}"), Path::new("study.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn a_key_changes_one_threshold_and_defaults_are_not_written() {
        let plain = study("").unwrap();
        assert!(plain.thresholds.is_default() && !plain.to_toml().unwrap().contains("thresholds"));
        let own = study("[thresholds]\nlag.max_reversal_std = 3.5\nevents.stop.max_distance = 0.05\n").unwrap();
        let mut expected = plain.thresholds.clone();
        expected.lag.max_reversal_std = 3.5;
        expected.events.stop.max_distance = 0.05;
        assert_eq!(own.thresholds, expected);
        let mut settings = IdentificationSettings::default();
        own.thresholds.apply(&mut settings);
        assert_eq!(settings.estimation.thresholds.lag.max_reversal_std, 3.5);
        assert_eq!(settings.events.stop.max_distance, 0.05);
        let again = Study::parse(&own.to_toml().unwrap(), Path::new("study.toml")).unwrap();
        assert_eq!(again.thresholds, expected);
    }

    #[test]
    fn invalid_thresholds_are_rejected_with_their_key() {
        for (key, name) in [
            ("lag.prior_std_s = -1.0", "thresholds.lag.prior_std_s"),
            ("description.error_factors = [0.0, 1.0, 2.0]", "thresholds.description.error_factors"),
            ("log_load.min_deviations = nan", "thresholds.log_load.min_deviations"),
            ("events.trend.parts = 1", "thresholds.events.trend.parts"),
            ("examination.max_reversed_ratio = 0.0", "max_reversed_ratio"),
            ("diagnosis.held_out.min_share_of_repeat = -0.5", "held_out.min_share_of_repeat"),
            ("report.errors.min_form_ratio = 0.0", "min_form_ratio"),
            ("report.problems.max_error_ratio = 0.0", "max_error_ratio"),
            ("report.differences.min_certain_probability = 0.0", "min_certain_probability"),
            ("lag.min_own_shares = 0.5", "min_own_shares"),
        ] {
            let error = study(&format!("[thresholds]\n{key}\n")).unwrap_err();
            assert!(error.contains(name), "{key}: {error}");
        }
    }
}
