//! Limits behind the findings of the examination.

use crate::limits::{InvalidLimit, check_limits};

/// Limits behind the findings of the examination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExaminationSettings {
    /// Largest ratio of the residual with the opposite sign of the torque to that with the sign as given, for which the
    /// sign is reported as reversed; 0.5.
    pub max_reversed_ratio: f64,
    /// Residual with the bodies of the robot description, in percent of the torque, from which the description may be
    /// of another robot; 50. The residual contains the friction, which is usually less.
    pub max_nominal_residual_percent: f64,
    /// Size of negative friction, in its standard deviations, above which a joint is reported as reversed; 5. On the
    /// first real logs correct joints stayed above −2.5, dead channels were below −8.
    pub min_friction_deviations: f64,
    /// Size of negative friction relative to the residual of the joint (RMS), above which a joint is reported as
    /// reversed; 0.5. Less may be an unmodelled effect, as for a wrist whose torque is measured behind the gear and is
    /// mostly noise.
    pub min_friction_ratio: f64,
    /// Ratio of a higher cut-off of the differentiator to that of the fit; 4. The torque predicted with both shows the
    /// error from motion above the cut-off of the fit.
    pub finer_cutoff_ratio: f64,
    /// Share of a held-out log, from its start, that determines its torque offsets if each log has separate offsets,
    /// from 0 to 1; 0.25. With the usual length of a log, the offset is then better known than the other parameters,
    /// and most of the log remains as the test.
    pub offset_share: f64,
    /// Unexplained torque of a joint with a function of its position, relative to that without it, up to which a spring
    /// or counterbalance is named; 0.6. Both fits have all parameters of the joint and all friction laws, so that
    /// without such a torque the ratio is close to 1.
    pub max_left_by_position: f64,
    /// Least torque that only the function explains, relative to the torque of the joint (RMS); 0.02. A smaller
    /// function hardly improves the prediction.
    pub min_position_ratio: f64,
}

impl Default for ExaminationSettings {
    fn default() -> Self {
        Self {
            max_reversed_ratio: 0.5,
            max_nominal_residual_percent: 50.0,
            min_friction_deviations: 5.0,
            min_friction_ratio: 0.5,
            finer_cutoff_ratio: 4.0,
            offset_share: 0.25,
            max_left_by_position: 0.6,
            min_position_ratio: 0.02,
        }
    }
}

impl ExaminationSettings {
    /// Checks that all limits are finite and positive.
    ///
    /// # Errors
    /// The first invalid limit.
    pub fn validate(&self) -> Result<(), InvalidLimit> {
        check_limits(&[
            ("max_reversed_ratio", self.max_reversed_ratio),
            ("max_nominal_residual_percent", self.max_nominal_residual_percent),
            ("min_friction_deviations", self.min_friction_deviations),
            ("min_friction_ratio", self.min_friction_ratio),
            ("finer_cutoff_ratio", self.finer_cutoff_ratio),
            ("offset_share", self.offset_share),
            ("max_left_by_position", self.max_left_by_position),
            ("min_position_ratio", self.min_position_ratio),
        ])
    }
}
