//! Where the torque errors of a result are much larger than its error over all joints: single joints and export
//! formats.

use super::{FormResult, ResultFile};
use dynident_identification::examination::LogValidation;
use dynident_identification::rows::ParallelFilterSettings;
use dynident_model::terms::TermClass;

/// Ratio of two errors below which they are listed as one.
const MAX_EQUAL_RATIO: f64 = 1.01;

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
    pub fn joint_errors(&self, log: &LogValidation) -> Vec<JointError> {
        let (report, settings) = (log.exported(), &self.thresholds.errors);
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
    pub fn weak_joints(&self) -> Vec<JointError> {
        let settings = &self.thresholds.errors;
        let of_log = |log: &LogValidation| {
            let all = log.exported().relative_error_percent.unwrap_or(f64::INFINITY);
            let limit = settings.min_joint_percent.max(settings.min_joint_ratio * all);
            let errors = self.joint_errors(log).into_iter();
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
        let of_motion = self.method.motion_hz.map(ParallelFilterSettings::half_gain_hz);
        of_motion.or_else(|| summary?.filter_cutoff_hz)
    }

    /// Held-out errors of the export formats on one log, the largest first. Formats whose errors differ by less than
    /// 1 % are combined.
    pub fn format_errors(&self, log: &LogValidation) -> Vec<FormatError> {
        let settings = &self.thresholds.errors;
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
