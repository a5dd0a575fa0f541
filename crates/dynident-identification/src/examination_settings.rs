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
}

impl Default for ExaminationSettings {
    fn default() -> Self {
        Self {
            max_reversed_ratio: 0.5,
            max_nominal_residual_percent: 50.0,
            min_friction_deviations: 5.0,
            min_friction_ratio: 0.5,
            finer_cutoff_ratio: 4.0,
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
        ])
    }
}
