//! Thresholds of the search for mistakes in a URDF.

use crate::audit::settings::check_positive;
use crate::error::ModelError;

/// Thresholds of [`slips_with`](super::slips_with), with defaults from published descriptions of arms and humanoids.
#[derive(Clone, Debug, PartialEq)]
pub struct SlipSettings {
    /// Minimum share of the parallel-axis term in the trace of the inertia at which a link is tested for moments about
    /// its origin. Default 0.3.
    pub min_parallel_axis_share: f64,
    /// Share at which one link alone is sufficient evidence. The default of 0.7 is above 0.61, the maximum among 190
    /// correct published links.
    pub sufficient_parallel_axis_share: f64,
    /// Relative tolerance of a total mass in the file, which is rounded and often excludes screws. Default 0.015.
    pub total_mass_tolerance: f64,
    /// Relative tolerance of the total after a correction of one mass; stricter, because many corrections are tried.
    /// Default 0.003.
    pub corrected_mass_tolerance: f64,
    /// Relative tolerance between mirrored links; CAD programs differ by some tenths of a percent. Default 0.02.
    pub twin_tolerance: f64,
    /// Maximum number of differing values for which the remaining values still identify the mirror plane. Default 3.
    pub max_differing_values: usize,
    /// Typical decimal logarithm of the radius of gyration over the body length. Default -0.45.
    pub typical_log10_gyration: f64,
    /// Plausible range of this logarithm for the median of all links. Default -1.2 to 0.8.
    pub log10_gyration_range: [f64; 2],
    /// Plausible range of this logarithm for one link. Default -1.7 to 1.3.
    pub link_log10_gyration_range: [f64; 2],
    /// Typical decimal logarithm of the mass over the cubed body length, kg/m³. Default 2.2.
    pub typical_log10_density: f64,
    /// Plausible range of this logarithm for the median of all links. Default -0.7 to 3.7.
    pub log10_density_range: [f64; 2],
    /// Plausible range of this logarithm for one link. Default -0.7 to 4.2.
    pub link_log10_density_range: [f64; 2],
    /// Largest plausible median distance of the centres of mass, in body lengths. Default 20.
    pub max_com_lengths: f64,
    /// Smallest plausible median distance of the centres of mass after a change of their unit, in body lengths.
    /// Default 0.005.
    pub min_corrected_com_lengths: f64,
    /// Minimum distance between the best and the second-best hypothesis about units, decades; if they are closer, the
    /// result is ambiguous. Default 0.4.
    pub min_misfit_margin: f64,
    /// Distance between two joints, m, above which lengths are implausible, so that units are not tested. Default 10.
    pub max_joint_offset_m: f64,
}

impl Default for SlipSettings {
    fn default() -> Self {
        Self {
            min_parallel_axis_share: 0.3,
            sufficient_parallel_axis_share: 0.7,
            total_mass_tolerance: 0.015,
            corrected_mass_tolerance: 0.003,
            twin_tolerance: 0.02,
            max_differing_values: 3,
            typical_log10_gyration: -0.45,
            log10_gyration_range: [-1.2, 0.8],
            link_log10_gyration_range: [-1.7, 1.3],
            typical_log10_density: 2.2,
            log10_density_range: [-0.7, 3.7],
            link_log10_density_range: [-0.7, 4.2],
            max_com_lengths: 20.0,
            min_corrected_com_lengths: 0.005,
            min_misfit_margin: 0.4,
            max_joint_offset_m: 10.0,
        }
    }
}

impl SlipSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A value that is not positive, or not finite for logarithms.
    pub fn validate(&self) -> Result<(), ModelError> {
        let ranges = [
            self.log10_gyration_range,
            self.link_log10_gyration_range,
            self.log10_density_range,
            self.link_log10_density_range,
            [self.typical_log10_gyration, self.typical_log10_density],
        ];
        if ranges.iter().flatten().any(|value| !value.is_finite()) {
            return Err(ModelError::NotFinite { what: "a logarithm of gyration or density".to_owned() });
        }
        check_positive(&[
            ("min_parallel_axis_share", self.min_parallel_axis_share),
            ("sufficient_parallel_axis_share", self.sufficient_parallel_axis_share),
            ("total_mass_tolerance", self.total_mass_tolerance),
            ("corrected_mass_tolerance", self.corrected_mass_tolerance),
            ("twin_tolerance", self.twin_tolerance),
            ("max_com_lengths", self.max_com_lengths),
            ("min_corrected_com_lengths", self.min_corrected_com_lengths),
            ("min_misfit_margin", self.min_misfit_margin),
            ("max_joint_offset_m", self.max_joint_offset_m),
        ])
    }
}
