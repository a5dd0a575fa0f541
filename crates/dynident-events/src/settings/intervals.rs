//! Settings of the search for intervals with unexplained torque, and of their kinds.

use super::Rule;
use serde::{Deserialize, Serialize};

/// Limits of the intervals that are tested. "Relative" residuals are relative to the usual residual of the joint in the
/// same state of motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct IntervalSettings {
    /// Relative squared residual that a bin must exceed to increase the sum of an interval. 9.0 by default, three
    /// standard deviations.
    pub bin_ratio: f64,
    /// Limit on the relative squared residual of a bin, so that two events with a longer normal part between them are
    /// not joined. 18.0 by default.
    pub max_bin_ratio: f64,
    /// Amount by which a bin without reliable motion or torque reduces the sum of an interval. 3.0 by default.
    pub unusable_loss: f64,
    /// Minimum sum of relative squared residuals (above `bin_ratio`) of an interval. 20.0 by default.
    pub min_sum: f64,
    /// Minimum number of bins of an interval. 2 by default.
    pub min_bins: usize,
    /// Maximum distance between intervals that are merged into one event, s. 0.3 by default.
    pub merge_s: f64,
    /// Maximum number of intervals before they are merged; rests without torque are not included. 12 by default.
    pub max_intervals: usize,
    /// Largest torque that holds a joint at rest, relative to its dry friction in motion. 2.0 by default.
    pub breakaway_ratio: f64,
    /// Smallest relative squared residual of the worst other interval in the comparison with it. 0.25 by default.
    pub min_other_ratio: f64,
}

impl Default for IntervalSettings {
    fn default() -> Self {
        Self {
            bin_ratio: 9.0,
            max_bin_ratio: 18.0,
            unusable_loss: 3.0,
            min_sum: 20.0,
            min_bins: 2,
            merge_s: 0.3,
            max_intervals: 12,
            breakaway_ratio: 2.0,
            min_other_ratio: 0.25,
        }
    }
}

impl IntervalSettings {
    pub(super) fn rules(&self) -> [Rule; 9] {
        [
            ("intervals.bin_ratio", self.bin_ratio, 1.0, 1e6),
            ("intervals.max_bin_ratio", self.max_bin_ratio, 1.0, 1e6),
            ("intervals.unusable_loss", self.unusable_loss, 0.0, 1e6),
            ("intervals.min_sum", self.min_sum, 0.0, 1e9),
            ("intervals.min_bins", self.min_bins as f64, 1.0, 1e6),
            ("intervals.merge_s", self.merge_s, 0.0, 1e4),
            ("intervals.max_intervals", self.max_intervals as f64, 0.0, 1e4),
            ("intervals.breakaway_ratio", self.breakaway_ratio, 1.0, 100.0),
            ("intervals.min_other_ratio", self.min_other_ratio, 1e-6, 1e6),
        ]
    }
}

/// Rests without torque: drives off, brakes closed.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct DrivesOffSettings {
    /// Maximum torque of each joint if the drives are off, relative to its root mean square torque in the log. 0.1 by
    /// default.
    pub max_torque_ratio: f64,
    /// Smallest torque of a joint relative to the largest of all joints (root mean square) that is used as its
    /// reference. For joints with less torque, this share of the largest torque is used. 0.1 by default.
    pub min_reference_ratio: f64,
    /// Minimum ratio of predicted to measured torque (squares). 10.0 by default.
    pub min_predicted_ratio: f64,
    /// Minimum predicted torque relative to the usual residual of the joint (squares). 16.0 by default, four standard
    /// deviations.
    pub min_predicted_size: f64,
    /// Minimum duration of the rest, s. 0.3 by default.
    pub min_duration_s: f64,
    /// Longest interruption by noise, bins. 2 by default.
    pub max_gap_bins: usize,
    /// Minimum share of the bins of a range in which a joint must rest to be treated as at rest. 0.75 by default.
    pub min_rest_share: f64,
    /// Largest measured torque relative to the torque that carries the weight (both squared), for a rest of all joints
    /// with unexplained torque. 0.3 by default.
    pub max_measured_ratio: f64,
}

impl Default for DrivesOffSettings {
    fn default() -> Self {
        Self {
            max_torque_ratio: 0.1,
            min_reference_ratio: 0.1,
            min_predicted_ratio: 10.0,
            min_predicted_size: 16.0,
            min_duration_s: 0.3,
            max_gap_bins: 2,
            min_rest_share: 0.75,
            max_measured_ratio: 0.3,
        }
    }
}

impl DrivesOffSettings {
    pub(super) fn rules(&self) -> [Rule; 8] {
        [
            ("drives_off.max_torque_ratio", self.max_torque_ratio, 0.0, 1.0),
            ("drives_off.min_reference_ratio", self.min_reference_ratio, 0.0, 1.0),
            ("drives_off.min_predicted_ratio", self.min_predicted_ratio, 1.0, 1e6),
            ("drives_off.min_predicted_size", self.min_predicted_size, 0.0, 1e6),
            ("drives_off.min_duration_s", self.min_duration_s, 0.0, 1e4),
            ("drives_off.max_gap_bins", self.max_gap_bins as f64, 0.0, 1e6),
            ("drives_off.min_rest_share", self.min_rest_share, 0.0, 1.0),
            ("drives_off.max_measured_ratio", self.max_measured_ratio, 0.0, 1.0),
        ]
    }
}

/// A joint at its mechanical stop.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct StopSettings {
    /// Maximum distance of the joint from the end of its range in the log, relative to the range. 0.03 by default.
    pub max_distance: f64,
    /// Minimum travel of another joint during the stop, relative to its range in the log. 0.1 by default.
    pub min_other_travel: f64,
    /// Minimum mean residual torque relative to the usual residual of the joint (squares). 9.0 by default, three
    /// standard deviations.
    pub min_residual_ratio: f64,
}

impl Default for StopSettings {
    fn default() -> Self {
        Self { max_distance: 0.03, min_other_travel: 0.1, min_residual_ratio: 9.0 }
    }
}

impl StopSettings {
    pub(super) fn rules(&self) -> [Rule; 3] {
        [
            ("stop.max_distance", self.max_distance, 0.0, 0.5),
            ("stop.min_other_travel", self.min_other_travel, 0.0, 1.0),
            ("stop.min_residual_ratio", self.min_residual_ratio, 0.0, 1e6),
        ]
    }
}

/// Kind of an interval with unexplained torque.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct KindSettings {
    /// Maximum time between the start (end) of an interval and the first (last) bin with reliable motion, s. If it is
    /// shorter, the event is treated as lasting from the start (to the end) of the log. 1.0 by default.
    pub end_s: f64,
    /// Minimum share of the squared residual in an interval that a kind of event must explain to be selected. 0.6 by
    /// default.
    pub min_explained_share: f64,
    /// Largest share by which a load may explain more than an offset, if the offset is selected, because it has fewer
    /// parameters. 0.05 by default.
    pub max_load_lead: f64,
    /// Minimum ratio of a joint's squared residual in the event to its usual squared residual, if the contact is at the
    /// link of this joint. 1.0 by default.
    pub min_touch_ratio: f64,
    /// Minimum evidence of a joint that belongs to the event, relative to the joint with the strongest evidence. 0.02
    /// by default.
    pub min_joint_ratio: f64,
}

impl Default for KindSettings {
    fn default() -> Self {
        Self { end_s: 1.0, min_explained_share: 0.6, max_load_lead: 0.05, min_touch_ratio: 1.0, min_joint_ratio: 0.02 }
    }
}

impl KindSettings {
    pub(super) fn rules(&self) -> [Rule; 5] {
        [
            ("kind.end_s", self.end_s, 0.0, 1e6),
            ("kind.min_explained_share", self.min_explained_share, 0.0, 1.0),
            ("kind.max_load_lead", self.max_load_lead, 0.0, 1.0),
            ("kind.min_touch_ratio", self.min_touch_ratio, 0.0, 1e6),
            ("kind.min_joint_ratio", self.min_joint_ratio, 0.0, 1.0),
        ]
    }
}
