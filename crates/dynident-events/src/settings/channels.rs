//! Settings of the searches for faults of the recorder and for slow changes.

use super::Rule;
use serde::{Deserialize, Serialize};

/// Holes of a log that were filled by straight lines.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct FilledHoleSettings {
    /// Minimum number of successive samples on one straight line. 6 by default.
    pub min_samples: usize,
    /// Maximum second difference on a straight line, relative to the median of the channel. 0.04 by default; by chance,
    /// 3 % of the samples of a joint are below it.
    pub max_curvature: f64,
    /// Maximum share of samples on straight lines. 0.3 by default; a larger share is a property of the recorder.
    pub max_share: f64,
    /// Minimum number of joints whose torque changes along the line: at rest, a torque without noise is constant. 1 by
    /// default.
    pub min_sloped_joints: usize,
    /// Minimum change of a torque along the line, relative to the median second difference of the channel. 0.1 by
    /// default.
    pub min_slope: f64,
    /// Ratio of third to second differences (medians) below which a torque has no noise and is not searched. 0.6 by
    /// default; it is 1.8 for white noise, and 0.3 for a sine with 20 samples per period.
    pub max_smooth_ratio: f64,
    /// Time before and after the hole in which the filter of the positions spreads its effect, s. 0.12 by default.
    pub margin_s: f64,
}

impl Default for FilledHoleSettings {
    fn default() -> Self {
        Self {
            min_samples: 6,
            max_curvature: 0.04,
            max_share: 0.3,
            min_sloped_joints: 1,
            min_slope: 0.1,
            max_smooth_ratio: 0.6,
            margin_s: 0.12,
        }
    }
}

impl FilledHoleSettings {
    pub(super) fn rules(&self) -> [Rule; 7] {
        [
            ("filled_hole.min_samples", self.min_samples as f64, 1.0, 1e6),
            ("filled_hole.max_curvature", self.max_curvature, 0.0, 1.0),
            ("filled_hole.max_share", self.max_share, 0.0, 1.0),
            ("filled_hole.min_sloped_joints", self.min_sloped_joints as f64, 0.0, 1e3),
            ("filled_hole.min_slope", self.min_slope, 0.0, 1e6),
            ("filled_hole.max_smooth_ratio", self.max_smooth_ratio, 0.0, 10.0),
            ("filled_hole.margin_s", self.margin_s, 0.0, 1e4),
        ]
    }
}

/// Overflow of the number format of a torque.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct OverflowSettings {
    /// Maximum distance of both ends of a jump from the ends of the torque's range, relative to the range. 0.15 by
    /// default.
    pub max_end_distance: f64,
    /// Maximum duration of a jump, s, but at least one sample. 0.02 by default; the removal of outliers can spread a
    /// jump.
    pub max_jump_s: f64,
    /// Minimum ratio of two mean square residuals: fit to all parts of the log, and fit to the parts without overflow.
    /// 10.0 by default. Dry friction also jumps at a reversal, but one model explains both directions, so the ratio
    /// stays small.
    pub min_residual_ratio: f64,
    /// Minimum duration of an overflow, and of a normal part between two overflows, bins. 2 by default.
    pub min_bins: usize,
    /// Jumps that follow each other within this time are treated as noise at the limit of the range, bins. 4.0 by
    /// default.
    pub max_noise_bins: f64,
    /// Smallest mean residual of an overflow, relative to the size of the jump. 0.6 by default.
    pub min_jump_ratio: f64,
    /// Limit on the mean residual of an overflow, relative to the size of the jump. 1.4 by default.
    pub max_jump_ratio: f64,
    /// Longest overflow at a peak, s. 0.3 by default.
    pub max_short_s: f64,
    /// Minimum number of overflows at peaks. 2 by default.
    pub min_short_intervals: usize,
    /// Minimum size of the jumps at peaks relative to the dry friction, which jumps by twice its value at a reversal.
    /// 4.0 by default.
    pub min_friction_ratio: f64,
    /// Maximum share of a joint's bins with overflow. 0.5 by default.
    pub max_share: f64,
    /// Number of bins before and after an overflow that can contain samples of it. 1.5 by default.
    pub margin_bins: f64,
}

impl Default for OverflowSettings {
    fn default() -> Self {
        Self {
            max_end_distance: 0.15,
            max_jump_s: 0.02,
            min_residual_ratio: 10.0,
            min_bins: 2,
            max_noise_bins: 4.0,
            min_jump_ratio: 0.6,
            max_jump_ratio: 1.4,
            max_short_s: 0.3,
            min_short_intervals: 2,
            min_friction_ratio: 4.0,
            max_share: 0.5,
            margin_bins: 1.5,
        }
    }
}

impl OverflowSettings {
    pub(super) fn rules(&self) -> [Rule; 12] {
        [
            ("overflow.max_end_distance", self.max_end_distance, 0.0, 0.5),
            ("overflow.max_jump_s", self.max_jump_s, 0.0, 10.0),
            ("overflow.min_residual_ratio", self.min_residual_ratio, 1.0, 1e6),
            ("overflow.min_bins", self.min_bins as f64, 1.0, 1e6),
            ("overflow.max_noise_bins", self.max_noise_bins, 0.0, 1e6),
            ("overflow.min_jump_ratio", self.min_jump_ratio, 0.0, 1.0),
            ("overflow.max_jump_ratio", self.max_jump_ratio, 1.0, 100.0),
            ("overflow.max_short_s", self.max_short_s, 0.0, 1e4),
            ("overflow.min_short_intervals", self.min_short_intervals as f64, 1.0, 1e6),
            ("overflow.min_friction_ratio", self.min_friction_ratio, 0.0, 1e6),
            ("overflow.max_share", self.max_share, 0.0, 0.5),
            ("overflow.margin_bins", self.margin_bins, 0.0, 1e6),
        ]
    }
}

/// Slow changes of a torque, and a sudden change of its offset.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TrendSettings {
    /// Minimum share of a joint's squared residual that the change must explain, for a warning. 0.5 by default.
    pub min_share: f64,
    /// Minimum size of the change relative to the torque of the joint (both root mean square), for a warning. 0.03 by
    /// default.
    pub min_effect: f64,
    /// Maximum residual of a model with a sudden change, relative to a model with a slow change (squares), for a sudden
    /// change. 0.7 by default.
    pub max_step_ratio: f64,
    /// Number of parts of a log, each of which is predicted from the others. 10 by default.
    pub parts: usize,
}

impl Default for TrendSettings {
    fn default() -> Self {
        Self { min_share: 0.5, min_effect: 0.03, max_step_ratio: 0.7, parts: 10 }
    }
}

impl TrendSettings {
    pub(super) fn rules(&self) -> [Rule; 4] {
        [
            ("trend.min_share", self.min_share, 0.0, 1.0),
            ("trend.min_effect", self.min_effect, 0.0, 10.0),
            ("trend.max_step_ratio", self.max_step_ratio, 0.0, 1.0),
            ("trend.parts", self.parts as f64, 2.0, 1000.0),
        ]
    }
}
