//! Limits of the detection of invalid samples.

use crate::error::{FilterError, require};

/// Limits of the detection of outliers, spikes, held torque and holes. They are not part of a study file.
#[derive(Clone, Debug, PartialEq)]
pub struct CleaningSettings {
    /// Minimum distance of a torque outlier from its neighbours, in robust standard deviations. Normal noise exceeds
    /// the default of 8 once in 10¹⁵ samples.
    pub outlier_noise_ratio: f64,
    /// Minimum distance of a torque outlier as a share of the spread of the torque, 0.005 by default; smaller outliers
    /// have no effect on a fit.
    pub outlier_spread_share: f64,
    /// Minimum distance of a torque outlier in steps of a quantised channel, 3.5 by default.
    pub outlier_steps: f64,
    /// Minimum ratio of a torque outlier's distance to that of its nearest neighbours, 5 by default. (In a real peak
    /// over several samples, the neighbours deviate as well.)
    pub outlier_neighbour_ratio: f64,
    /// Maximum share of torque outliers, 0.15 by default; if the share is larger, the deviations belong to the signal.
    pub max_outlier_share: f64,
    /// Minimum size of a position spike in robust standard deviations of the fourth difference, 12 by default.
    pub spike_noise_ratio: f64,
    /// Minimum size of a position spike in steps of a quantised encoder, 3.5 by default.
    pub spike_steps: f64,
    /// Maximum share of position spikes, 0.05 by default; if the share is larger, the deviations belong to the signal.
    pub max_spike_share: f64,
    /// Minimum number of samples in a run of held (repeated) torque, 10 by default.
    pub held_samples: usize,
    /// Minimum ratio of the length of a held run to the longest run of equal torque values nearby, 6 by default.
    pub held_run_ratio: usize,
    /// Minimum number of changes of the torque near a held run, 6 by default. (A nearly constant torque repeats because
    /// of its quantisation.)
    pub held_changes_nearby: usize,
    /// Minimum motion during a held run as a share of the motion nearby over the same number of samples, 0.1 by
    /// default.
    pub held_motion_share: f64,
    /// Minimum motion during a held run in steps of a quantised encoder; also the minimum usual change of a quantised
    /// torque over the length of the run, in steps. 4 by default.
    pub held_steps: f64,
    /// Maximum length of a hole that is filled, in periods of the cut-off frequency, 0.2 by default. This is a tenth of
    /// the period of the motion's highest frequency; a polynomial of degree 5 through both sides then has an error
    /// below 1e-4 for a sinusoid of that frequency.
    pub hole_periods: f64,
}

impl Default for CleaningSettings {
    fn default() -> Self {
        Self {
            outlier_noise_ratio: 8.0,
            outlier_spread_share: 0.005,
            outlier_steps: 3.5,
            outlier_neighbour_ratio: 5.0,
            max_outlier_share: 0.15,
            spike_noise_ratio: 12.0,
            spike_steps: 3.5,
            max_spike_share: 0.05,
            held_samples: 10,
            held_run_ratio: 6,
            held_changes_nearby: 6,
            held_motion_share: 0.1,
            held_steps: 4.0,
            hole_periods: 0.2,
        }
    }
}

impl CleaningSettings {
    /// Checks the limits.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        for (name, value) in
            [("outlier_noise_ratio", self.outlier_noise_ratio), ("spike_noise_ratio", self.spike_noise_ratio)]
        {
            require(value.is_finite() && value > 0.0, name, value, "give a finite number above 0")?;
        }
        for (name, value) in [
            ("outlier_spread_share", self.outlier_spread_share),
            ("outlier_steps", self.outlier_steps),
            ("outlier_neighbour_ratio", self.outlier_neighbour_ratio),
            ("spike_steps", self.spike_steps),
            ("held_motion_share", self.held_motion_share),
            ("held_steps", self.held_steps),
            ("hole_periods", self.hole_periods),
        ] {
            require(value.is_finite() && value >= 0.0, name, value, "give a finite number, 0 or more")?;
        }
        for (name, value) in [("max_outlier_share", self.max_outlier_share), ("max_spike_share", self.max_spike_share)]
        {
            require((0.0..=1.0).contains(&value), name, value, "give 0 to 1")?;
        }
        // A run of one sample is never held, and a shorter window around a run would contain no neighbours.
        let fix = "give 2 to 100 samples";
        require((2..=100).contains(&self.held_samples), "held_samples", self.held_samples as f64, fix)
    }
}
