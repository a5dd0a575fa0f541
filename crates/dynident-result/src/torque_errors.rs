//! Where the torque errors of a result are much larger than its error over all joints: single joints and export
//! formats.

use super::{FormResult, ResultFile};
use dynident_identification::examination::LogValidation;
use dynident_model::terms::TermClass;
use dynident_study::{Expected, StudyError};

/// Ratio of two errors below which they are listed as one.
const MAX_EQUAL_RATIO: f64 = 1.01;

/// Largest frequency of the torque in held-out errors, relative to the spectral cut-off of the motion
/// (`method.motion_hz`).
const MOTION_BAND_RATIO: f64 = 0.7;

/// Thresholds of statements about torque errors. All errors are relative to the measured torque (root mean squares).
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueErrorSettings {
    /// Largest held-out error that is rated as good, percent. Default 10: real arms with a correct study have 2 to 10.
    pub max_good_percent: f64,
    /// Largest held-out error that is not rated as bad, percent. Default 60, like
    /// [`ProblemSettings::max_unexplained_percent`](super::ProblemSettings).
    pub max_fair_percent: f64,
    /// Smallest error of a joint that is reported as much worse than the robot, percent. Default 20.
    pub min_joint_percent: f64,
    /// Error of a joint divided by that of all joints together, from which the joint is reported as much worse.
    /// Default 2.
    pub min_joint_ratio: f64,
    /// Torque of a joint divided by the largest torque of a joint with the same unit (root mean squares), up to which
    /// the torque is reported as small. Default 0.1.
    pub max_small_torque_ratio: f64,
    /// Error of an export format divided by that of the model, from which the format is reported as worse. Default 1.2.
    pub min_form_ratio: f64,
}

impl Default for TorqueErrorSettings {
    fn default() -> Self {
        Self {
            max_good_percent: 10.0,
            max_fair_percent: 60.0,
            min_joint_percent: 20.0,
            min_joint_ratio: 2.0,
            max_small_torque_ratio: 0.1,
            min_form_ratio: 1.2,
        }
    }
}

impl TorqueErrorSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting that is not a positive number, with its value.
    pub fn validate(&self) -> Result<(), StudyError> {
        for (key, value) in [
            ("max_good_percent", self.max_good_percent),
            ("max_fair_percent", self.max_fair_percent),
            ("min_joint_percent", self.min_joint_percent),
            ("min_joint_ratio", self.min_joint_ratio),
            ("max_small_torque_ratio", self.max_small_torque_ratio),
            ("min_form_ratio", self.min_form_ratio),
        ] {
            Expected::Positive.check(key, value)?;
        }
        Ok(())
    }
}

/// The held-out torque error of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointError {
    /// The joint.
    pub name: String,
    /// Error relative to the measured torque of the joint, percent.
    pub relative_error_percent: f64,
    /// Root mean square error, in `unit`.
    pub rmse: f64,
    /// `Nm`, `N`, or `Nm (N)` if the result does not state it.
    pub unit: String,
    /// Whether the measured torque is small compared with that of another joint.
    pub is_small: bool,
}

/// The held-out error of the formats of one class.
#[derive(Clone, Debug, PartialEq)]
pub struct FormatError {
    /// Names of the formats: `URDF, SDF`.
    pub formats: String,
    /// Torque error, percent.
    pub relative_error_percent: f64,
    /// Whether the error is clearly larger than that of the identified model.
    pub is_worse: bool,
}

impl ResultFile {
    /// Unit of the torque of joint number `joint`: `Nm`, `N`, or `Nm (N)` if the result does not state it.
    pub fn torque_unit(&self, joint: usize) -> &str {
        self.robot.torque_units.get(joint).map_or("Nm (N)", String::as_str)
    }

    /// Unit of the torque of all joints: `Nm`, `N`, or `Nm (N)` for a robot with both.
    pub fn common_torque_unit(&self) -> &str {
        let first = self.torque_unit(0);
        let is_common = (1..self.robot.joints.len()).all(|joint| self.torque_unit(joint) == first);
        if is_common { first } else { "Nm (N)" }
    }

    /// Errors of the exported model at each joint of a held-out log, the largest relative error first. Joints without
    /// torque are omitted.
    pub fn joint_errors(&self, log: &LogValidation, settings: &TorqueErrorSettings) -> Vec<JointError> {
        let report = log.exported();
        let torque = |joint: usize| {
            let joint = &report.joints[joint];
            let percent = joint.relative_error_percent.filter(|percent| *percent > 0.0)?;
            Some(100.0 * joint.rmse_nm / percent)
        };
        let largest = |unit: &str| {
            let same = (0..report.joints.len()).filter(|joint| self.torque_unit(*joint) == unit);
            same.filter_map(torque).fold(0.0, f64::max)
        };
        let of_joint = |index: usize| {
            let (joint, unit) = (&report.joints[index], self.torque_unit(index));
            Some(JointError {
                name: joint.name.clone(),
                relative_error_percent: joint.relative_error_percent?,
                rmse: joint.rmse_nm,
                unit: unit.to_owned(),
                is_small: torque(index).is_some_and(|own| own <= settings.max_small_torque_ratio * largest(unit)),
            })
        };
        let mut errors: Vec<JointError> = (0..report.joints.len()).filter_map(of_joint).collect();
        errors.sort_by(|a, b| b.relative_error_percent.total_cmp(&a.relative_error_percent));
        errors
    }

    /// The joints with much larger held-out errors than all joints of the same log together, the worst first. Each
    /// joint is listed with its largest error.
    pub fn weak_joints(&self, settings: &TorqueErrorSettings) -> Vec<JointError> {
        let of_log = |log: &LogValidation| {
            let all = log.exported().relative_error_percent.unwrap_or(f64::INFINITY);
            let limit = settings.min_joint_percent.max(settings.min_joint_ratio * all);
            let errors = self.joint_errors(log, settings).into_iter();
            errors.filter(|joint| joint.relative_error_percent >= limit).collect::<Vec<_>>()
        };
        let mut errors: Vec<JointError> = self.validation.iter().flat_map(of_log).collect();
        errors.sort_by(|a, b| b.relative_error_percent.total_cmp(&a.relative_error_percent));
        let mut worst: Vec<JointError> = Vec::new();
        for error in errors {
            if worst.iter().all(|known| known.name != error.name) {
                worst.push(error);
            }
        }
        worst
    }

    /// Frequency below which held-out errors compare torque, Hz; `None` if the torque is not filtered.
    pub fn held_out_band_hz(&self, log: &LogValidation) -> Option<f64> {
        let summary = self.logs.iter().find(|summary| summary.log == log.log);
        let of_motion = self.method.motion_hz.map(|motion_hz| MOTION_BAND_RATIO * motion_hz);
        of_motion.or_else(|| summary?.filter_cutoff_hz)
    }

    /// Held-out errors of the export formats on one log, the largest first. Formats whose errors differ by less than
    /// 1 % are combined.
    pub fn format_errors(&self, log: &LogValidation, settings: &TorqueErrorSettings) -> Vec<FormatError> {
        let mut errors: Vec<FormatError> = Vec::new();
        // Without hysteresis friction, code with state equals code without state.
        let is_own = |form: &&FormResult| form.class != TermClass::WithState || form.has_memory();
        let error = |form: &FormResult| {
            let error = form.held_out.iter().find(|error| error.log == log.log)?;
            let relative_error_percent = error.relative_error_percent?;
            let is_larger = |model: f64| relative_error_percent >= settings.min_form_ratio * model;
            let is_worse = error.model_relative_error_percent.is_some_and(is_larger);
            Some(FormatError { formats: form.short_name().to_owned(), relative_error_percent, is_worse })
        };
        let mut all: Vec<FormatError> = self.forms.iter().filter(is_own).filter_map(error).collect();
        all.sort_by(|a, b| b.relative_error_percent.total_cmp(&a.relative_error_percent));
        for next in all {
            let is_equal = |last: &&mut FormatError| {
                last.relative_error_percent < MAX_EQUAL_RATIO * next.relative_error_percent
                    && last.is_worse == next.is_worse
            };
            match errors.last_mut().filter(is_equal) {
                Some(last) => last.formats = format!("{}, {}", last.formats, next.formats),
                None => errors.push(next),
            }
        }
        errors
    }
}

impl FormResult {
    /// Short name of the formats of this class.
    pub fn short_name(&self) -> &'static str {
        match self.class {
            TermClass::DampingAndFriction => "URDF, SDF",
            TermClass::DampingFrictionAndInertia => "MJCF",
            TermClass::FunctionsOfMotion => "code",
            TermClass::WithState => "function step of code",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_positive() {
        assert!(TorqueErrorSettings::default().validate().is_ok());
        let wrong = TorqueErrorSettings { min_form_ratio: 0.0, ..TorqueErrorSettings::default() };
        assert!(wrong.validate().unwrap_err().to_string().contains("min_form_ratio"));
    }
}
