//! Thresholds of the audit.

use crate::error::ModelError;

/// Thresholds of [`audit_with`](super::audit_with), with defaults that the published descriptions of common arms pass.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditSettings {
    /// Largest plausible mass of a link, kg; links of common arms are lighter than the default of 1000.
    pub max_link_mass_kg: f64,
    /// Largest violation of the triangle inequality that is only a warning, relative to the largest moment: moments
    /// in files often have 3 digits. Default 0.01.
    pub moment_rounding: f64,
    /// Distance of the centre of mass from the link's frame, in body lengths, above which it is implausible. Default
    /// 3.
    pub max_distance_lengths: f64,
    /// Distance of the centre of mass from the link's frame, in body lengths, above which it is a problem, usually a
    /// wrong unit. Default 50.
    pub problem_distance_lengths: f64,
    /// Largest plausible radius of gyration of a body, relative to its size: the body's length, or the diagonal of
    /// its collision shapes if that is larger. Mass inside this size gives at most 0.5. The default of 1.3 comes from
    /// 1,526 bodies of 95 published URDFs. The fitted inertia of a Franka link 1 has 1.13, and 60 bodies are above
    /// 1.3. The bodies among these 60 that were inspected by hand have placeholders or the inertia of another link.
    pub max_gyration_sizes: f64,
    /// Smallest plausible inertia, as a share of the inertia of a uniform box around the collision shapes. Default
    /// 1/12: of the same bodies, two are below this share, and the next higher value is 0.15.
    pub min_box_inertia_share: f64,
    /// Share of the parallel-axis term in the inertia above which the moments are probably about the link's origin. A
    /// uniform rod about its end has 0.75; correct inertials rarely exceed the default of 0.7.
    pub max_parallel_axis_share: f64,
    /// Largest plausible distance between two joints, m. Default 10.
    pub max_joint_offset_m: f64,
    /// Largest plausible position limit, rad. The default of 30 is nearly five turns: more than usual multi-turn
    /// joints, and far below 180 (a limit in degrees).
    pub max_position_limit_rad: f64,
    /// Largest plausible position limit of a prismatic joint, m. Default 100.
    pub max_position_limit_m: f64,
    /// Largest plausible velocity limit, rad/s. The default of 100 is twice the limit of small legged robots.
    pub max_velocity_limit_rad_s: f64,
}

impl Default for AuditSettings {
    fn default() -> Self {
        Self {
            max_link_mass_kg: 1000.0,
            moment_rounding: 1e-2,
            max_distance_lengths: 3.0,
            problem_distance_lengths: 50.0,
            max_gyration_sizes: 1.3,
            min_box_inertia_share: 1.0 / 12.0,
            max_parallel_axis_share: 0.7,
            max_joint_offset_m: 10.0,
            max_position_limit_rad: 30.0,
            max_position_limit_m: 100.0,
            max_velocity_limit_rad_s: 100.0,
        }
    }
}

impl AuditSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A value that is not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        check_positive(&[
            ("max_link_mass_kg", self.max_link_mass_kg),
            ("moment_rounding", self.moment_rounding),
            ("max_distance_lengths", self.max_distance_lengths),
            ("problem_distance_lengths", self.problem_distance_lengths),
            ("max_gyration_sizes", self.max_gyration_sizes),
            ("min_box_inertia_share", self.min_box_inertia_share),
            ("max_parallel_axis_share", self.max_parallel_axis_share),
            ("max_joint_offset_m", self.max_joint_offset_m),
            ("max_position_limit_rad", self.max_position_limit_rad),
            ("max_position_limit_m", self.max_position_limit_m),
            ("max_velocity_limit_rad_s", self.max_velocity_limit_rad_s),
        ])
    }
}

pub(super) fn check_positive(settings: &[(&'static str, f64)]) -> Result<(), ModelError> {
    match settings.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        Some(&(setting, value)) => Err(ModelError::NotPositive { setting, value }),
        None => Ok(()),
    }
}
