//! Limits of the diagnosis, which searches for mistakes in study, robot description and logs.
//!
//! The "unexplained share" of a joint is the residual of its torque divided by its torque (root mean squares), 0 to 1.
//! The score of a hypothesis is the sum of the logarithms of this share over all joints, plus costs.

use crate::limits::{InvalidLimit, check_limits};
use serde::{Deserialize, Serialize};

/// Limits of the diagnosis, grouped by topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DiagnosisSettings {
    /// Comparison of hypotheses.
    pub score: ScoreSettings,
    /// Acceptance of one hypothesis.
    pub acceptance: AcceptanceSettings,
    /// Plausibility of the motion.
    pub motion: MotionLimits,
    /// Channels that were logged too late or too early.
    pub late_channel: LateChannelSettings,
    /// Comparison with the robot description.
    pub description: DescriptionSettings,
    /// Channels that no correction repairs.
    pub channels: ChannelSettings,
    /// Held-out logs.
    pub held_out: HeldOutSettings,
}

/// Limits for the comparison of hypotheses.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ScoreSettings {
    /// Smallest improvement of the score with which another hypothesis replaces the study as written. Default 0.6, as
    /// if the unexplained share of one joint fell to 0.55 of its value. On seven sets of real logs, the best wrong
    /// hypothesis gains 0.41.
    pub min_gain: f64,
    /// Smallest improvement of the score with which another sample rate is accepted. Default 1.2. Wrong hypotheses for
    /// correct rates gain up to 1.1, corrections of wrong rates 2.0 and more.
    pub min_gain_of_rate: f64,
    /// Improvement of the score above which another gain of one torque needs no further evidence. Default 1.2. On real
    /// logs, a wrong gain reaches 0.83.
    pub min_gain_of_torque_gain: f64,
    /// Largest score difference between two hypotheses that are reported as indistinguishable. Default 0.2.
    pub max_indistinguishable: f64,
    /// Weight of the residual with the bodies of the robot description in the score, relative to the residual with the
    /// best physically consistent bodies. Default 0.5, because descriptions have errors.
    pub nominal_weight: f64,
    /// Cost that is added to the score for each joint whose positions exceed its limits. Default 1.
    pub limit_cost: f64,
    /// Largest mean over joints of `ln(residual of a consistent robot / residual of separate parameters of each joint)`
    /// with which a hypothesis is accepted. Default 0.9. Real logs of arms with unusual friction reach 0.55.
    pub max_log_ratio: f64,
    /// Smallest number of independent instants per parameter of a joint. Default 2. With fewer instants, separate
    /// parameters of a joint fit noise, friction and elasticity that the model does not contain.
    pub min_instants_per_parameter: f64,
    /// Largest factor on `min_gain` for short logs. Default 1.5, so that at most 0.9 is required. In parts of correct
    /// logs, the best wrong hypothesis improves the score by up to 0.83; the correction of a reversed joint in a short
    /// log improves it by 1.3.
    pub max_margin: f64,
    /// Factor on `min_gain`, which grows for short logs, from which `max_log_ratio` is not tested. Default 1.5.
    pub few_instants_margin: f64,
    /// Unexplained share of the torque of all joints above which lower cut-offs are tried and held-out logs are not
    /// examined. Default 0.5.
    pub max_unexplained: f64,
    /// Lower cut-offs that are tried if the unexplained share exceeds `max_unexplained`, relative to the cut-off that
    /// was selected from the data. Default 0.5 and 0.25.
    pub lower_cutoffs: [f64; 2],
    /// Largest number of mistakes in one study. Default 3.
    pub max_mistakes: usize,
    /// Largest number of other hypotheses that are reported. Default 4.
    pub max_reported: usize,
}

impl Default for ScoreSettings {
    fn default() -> Self {
        Self {
            min_gain: 0.6,
            min_gain_of_rate: 1.2,
            min_gain_of_torque_gain: 1.2,
            max_indistinguishable: 0.2,
            nominal_weight: 0.5,
            limit_cost: 1.0,
            max_log_ratio: 0.9,
            min_instants_per_parameter: 2.0,
            max_margin: 1.5,
            few_instants_margin: 1.5,
            max_unexplained: 0.5,
            lower_cutoffs: [0.5, 0.25],
            max_mistakes: 3,
            max_reported: 4,
        }
    }
}

/// Limits that a correction must keep relative to the hypothesis without it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct AcceptanceSettings {
    /// Largest ratio of the unexplained share of all joints with the correction to the share without it. Default 1.05.
    pub max_ratio_of_all: f64,
    /// Largest ratio of the unexplained share of any joint with the correction to the share without it. Default 1.25. A
    /// correction is rejected only if a joint also exceeds `max_increase_of_joint`.
    pub max_ratio_of_joint: f64,
    /// Largest increase of the unexplained share of any joint by the correction. Default 0.02.
    pub max_increase_of_joint: f64,
    /// Largest increase of the logarithm of one joint's unexplained share, divided by the improvement of the score of
    /// all joints. Default 0.1. This limit replaces `max_ratio_of_joint` if it permits more.
    pub max_share_of_gain: f64,
    /// Unexplained share above which the channels of a joint are mostly noise and prove nothing. Default 0.5.
    pub max_unexplained_of_joint: f64,
    /// Largest ratio of a joint's unexplained share with another unit to the share without it, for the other unit to be
    /// accepted. Default 0.8.
    pub max_ratio_of_unit: f64,
    /// Ratio of two unexplained shares of a joint above which its torque is inconsistent with the other joints: one
    /// robot for all joints, divided by separate parameters of the joint. Default 1.8.
    pub min_inconsistent_ratio: f64,
    /// Largest ratio of a joint's residual with another width of the smoothed friction sign to the residual without it,
    /// for the other width to be accepted. Default 0.9.
    pub max_ratio_of_step: f64,
}

impl Default for AcceptanceSettings {
    fn default() -> Self {
        Self {
            max_ratio_of_all: 1.05,
            max_ratio_of_joint: 1.25,
            max_increase_of_joint: 0.02,
            max_share_of_gain: 0.1,
            max_unexplained_of_joint: 0.5,
            max_ratio_of_unit: 0.8,
            min_inconsistent_ratio: 1.8,
            max_ratio_of_step: 0.9,
        }
    }
}

/// Limits of a plausible motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct MotionLimits {
    /// Largest distance beyond a position limit, as a share of the joint's range. Default 0.02, because zeros are
    /// calibrated to about a degree. Positions further beyond are treated as impossible.
    pub max_overtravel: f64,
    /// Largest ratio of a velocity to the velocity limit in the robot description. Default 1.5, because descriptions
    /// state rated velocities.
    pub max_velocity_ratio: f64,
    /// Lowest and highest rate of a recorder, Hz, for an arm of usual size
    /// ([`CharacteristicScale::hertz`](dynident_model::CharacteristicScale::hertz)). Default 4 to 50,000.
    pub recorder_rates_hz: [f64; 2],
    /// Largest share of interpolated samples in the filtered torque of a row, 0 to 1. Default 0.3. Rows with a larger
    /// share are excluded.
    pub max_interpolated: f64,
    /// Velocity below which a joint is at rest, relative to its root mean square velocity. Default 0.02. The friction
    /// of a joint at rest can have any value up to the friction in motion, so its torque does not test a robot model.
    pub max_rest_velocity: f64,
    /// Smallest number of instants in motion with which instants with a joint at rest are excluded. Default 100.
    pub min_moving_instants: usize,
    /// Smallest share of instants with a joint at rest with which they are excluded. Default 0.15. In a continuous
    /// motion of seven joints, the reversals alone are about a tenth of the instants.
    pub min_rest_share: f64,
}

impl Default for MotionLimits {
    fn default() -> Self {
        Self {
            max_overtravel: 0.02,
            max_velocity_ratio: 1.5,
            recorder_rates_hz: [4.0, 50_000.0],
            max_interpolated: 0.3,
            max_rest_velocity: 0.02,
            min_moving_instants: 100,
            min_rest_share: 0.15,
        }
    }
}

/// Limits for channels that were logged too late or too early. Times are those of an arm of usual size
/// ([`CharacteristicScale::seconds`](dynident_model::CharacteristicScale::seconds)), which moves at about 1 Hz.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LateChannelSettings {
    /// Largest shift of all torques relative to the positions that is tried, in both directions, s. Default 2.
    pub max_lag_s: f64,
    /// Step between the shifts that are tried, s. Default 0.1.
    pub lag_step_s: f64,
    /// Largest shift of one joint's channel that is tried, s. Default 0.5. A longer shift is half a period of the
    /// motion, which looks like a reversed sign.
    pub max_lag_of_joint_s: f64,
    /// Largest shift that is tried, as a share of the longest uninterrupted motion. Default 1/6, because the torque
    /// must be known before and after each instant.
    pub max_share_of_motion: f64,
    /// Smallest number of instants per regressor column of a joint. Default 2. With fewer instants, parameters can fit
    /// wrong shifts.
    pub min_instants_per_column: usize,
    /// Unexplained share of the torque of all joints below which shifts are not tried. Default 0.02.
    pub min_unexplained: f64,
    /// Ratio of two residuals of a joint above which shifts of its channels alone are tried: one robot for all joints,
    /// divided by separate parameters of the joint. Default 1.5.
    pub min_ratio_of_joint: f64,
    /// Largest ratio of the unexplained share of all joints with a shift to that of the best hypothesis without it, for
    /// the shift to be accepted. Default 0.8.
    pub max_ratio_of_all: f64,
}

impl Default for LateChannelSettings {
    fn default() -> Self {
        Self {
            max_lag_s: 2.0,
            lag_step_s: 0.1,
            max_lag_of_joint_s: 0.5,
            max_share_of_motion: 1.0 / 6.0,
            min_instants_per_column: 2,
            min_unexplained: 0.02,
            min_ratio_of_joint: 1.5,
            max_ratio_of_all: 0.8,
        }
    }
}

/// Limits for the comparison with the robot description.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DescriptionSettings {
    /// Smallest share of a joint's torque, with friction removed, that the nominal bodies times a factor must explain.
    /// Default 0.5. If they explain less, the factor is ignored.
    pub min_explained: f64,
    /// Largest usual factor between the torque and the torque of the described bodies. Default 3. A factor above it, or
    /// below 1/3, indicates another unit or a motor constant.
    pub max_scale: f64,
    /// Largest unexplained share of a joint's torque, with friction removed, for the best physically consistent robot.
    /// Default 0.4. Joints with a larger share are not compared with the description.
    pub max_unexplained: f64,
    /// Explained share of the best joint below which the description is treated as that of another robot. Default 0.65.
    /// On six sets of real logs the smallest share is 0.90; descriptions of other arms with as many joints reach 0.45.
    /// In slow or small motion, correct descriptions explain less, so the share is also compared with that of random
    /// robots with usual errors.
    pub min_explained_of_best: f64,
    /// Largest relative difference between the median factor over the joints and the factor of a unit, for this unit to
    /// be reported. Default 0.15.
    pub max_unit_error: f64,
    /// Largest relative difference between the factor of a joint and the factor of a unit, for the joint to support
    /// this unit. Default 0.8.
    pub max_unit_spread: f64,
    /// Usual range of the ratio of a body's mass to its mass in the description. Default 0.5 to 2.
    pub usual_mass_ratios: [f64; 2],
}

impl Default for DescriptionSettings {
    fn default() -> Self {
        Self {
            min_explained: 0.5,
            max_scale: 3.0,
            max_unexplained: 0.4,
            min_explained_of_best: 0.65,
            max_unit_error: 0.15,
            max_unit_spread: 0.8,
            usual_mass_ratios: [0.5, 2.0],
        }
    }
}

/// Limits for channels that no correction can repair.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ChannelSettings {
    /// Unexplained share of a joint above which its channels are compared with those of other joints, and above which
    /// torques without negative values are treated as magnitudes. Default 0.1. (Below it, equal channels may be two
    /// joints that move in the same way.)
    pub min_unexplained_of_duplicate: f64,
    /// Largest relative difference between duplicate columns. Default 1e-6, because filters round.
    pub max_difference_of_duplicate: f64,
    /// Largest relative difference between a position and a torque from the same column, which pass different filters.
    /// Default 0.01.
    pub max_difference_of_filters: f64,
    /// Largest torque of the wrong sign that a filter may cause in magnitudes, relative to the largest torque of the
    /// joint. Default 0.05.
    pub max_undershoot: f64,
    /// Ratio of two unexplained shares of a joint above which its torque is reported as doubtful: one robot for all
    /// joints, divided by separate parameters of the joint. Default 2.4. Seven sets of real logs reach 1.8, single logs
    /// of these sets 2.3.
    pub min_doubted_ratio: f64,
    /// Ratio of two unexplained shares of a joint (as in `min_doubted_ratio`) above which its torque does not belong to
    /// this robot. Default 2.6.
    pub min_foreign_ratio: f64,
    /// Smallest unexplained share of a joint that is reported as doubtful. Default 0.03.
    pub min_doubted_unexplained: f64,
    /// Unexplained share with separate parameters of the joint above which a torque is independent of the motion.
    /// Default 0.75.
    pub min_independent_alone: f64,
    /// Unexplained share with one robot for all joints above which a torque is independent of the motion. Default 1:
    /// the prediction from the other joints is then no better than zero torque.
    pub min_independent: f64,
    /// Residual of the bodies of the description without friction, relative to the torque, up to which the torque of
    /// every joint was computed from the description; 0.02. Dry friction of real drives is at least several percent.
    pub max_residual_of_description: f64,
}

impl Default for ChannelSettings {
    fn default() -> Self {
        Self {
            min_unexplained_of_duplicate: 0.1,
            max_difference_of_duplicate: 1.0e-6,
            max_difference_of_filters: 1.0e-2,
            max_undershoot: 0.05,
            min_doubted_ratio: 2.4,
            min_foreign_ratio: 2.6,
            min_doubted_unexplained: 0.03,
            min_independent_alone: 0.75,
            min_independent: 1.0,
            max_residual_of_description: 0.02,
        }
    }
}

/// Limits for held-out logs.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct HeldOutSettings {
    /// Unexplained share of a joint in a held-out log, divided by that in the training logs, above which the log is
    /// reported as not explained. Default 3. Real data sets reach 2.4 for all joints together.
    pub min_unexplained_ratio: f64,
    /// Improvement of the score with which a fitted number (such as a scale) replaces the nearest standard candidate.
    /// Default 0.05.
    pub min_gain_of_number: f64,
    /// Ratio of the predicted to the measured torque, or its inverse, above which another gain is tried. Default 1.15.
    pub min_torque_gain: f64,
    /// Residual with one robot for all logs, divided by that with a payload or a mistake. Below this ratio neither is
    /// reported. Default 1.3.
    pub max_ratio_of_one_robot: f64,
    /// Largest ratio of the residual with a payload to the residual without it, for the payload to be reported. Default
    /// 0.6.
    pub max_ratio_with_payload: f64,
    /// Largest ratio of the residual of a joint with the correction of its mistake to that without, for a log whose
    /// other joints have a larger residual than in the training logs; 0.25.
    pub max_ratio_of_corrected_joint: f64,
    /// Largest root mean square distance of an instant from the training motion, relative to the ranges of positions
    /// and velocities, for the instant to repeat it; 0.03.
    pub max_distance_of_repeat: f64,
    /// Share of such instants from which a held-out log repeats the training motion; 0.9.
    pub min_share_of_repeat: f64,
    /// Smallest number of joints with which a repeated motion is reported; 3. The motions of fewer joints pass near
    /// each other without being equal.
    pub min_joints_of_repeat: usize,
    /// Ratio of the number of residuals to the number of independent residuals, for the standard deviation of a
    /// payload; 10. Neighbouring residuals are correlated.
    pub residuals_per_independent: f64,
    /// Smallest estimated mass of a payload, in its standard deviations, for the payload to be reported; 5.
    pub min_payload_deviations: f64,
}

impl Default for HeldOutSettings {
    fn default() -> Self {
        Self {
            min_unexplained_ratio: 3.0,
            min_gain_of_number: 0.05,
            min_torque_gain: 1.15,
            max_ratio_of_one_robot: 1.3,
            max_ratio_with_payload: 0.6,
            max_ratio_of_corrected_joint: 0.25,
            max_distance_of_repeat: 0.03,
            min_share_of_repeat: 0.9,
            min_joints_of_repeat: 3,
            residuals_per_independent: 10.0,
            min_payload_deviations: 5.0,
        }
    }
}

impl DiagnosisSettings {
    /// Checks that all limits are finite and positive, and that the ends of ranges are in ascending order.
    ///
    /// # Errors
    /// The first invalid limit.
    pub fn validate(&self) -> Result<(), InvalidLimit> {
        let Self { score, acceptance, motion, late_channel, description, channels, held_out } = self;
        let [lowest_hz, highest_hz] = motion.recorder_rates_hz;
        let [lightest, heaviest] = description.usual_mass_ratios;
        check_limits(&[
            ("score.min_gain", score.min_gain),
            ("score.min_gain_of_rate", score.min_gain_of_rate),
            ("score.min_gain_of_torque_gain", score.min_gain_of_torque_gain),
            ("score.max_indistinguishable", score.max_indistinguishable),
            ("score.nominal_weight", score.nominal_weight),
            ("score.limit_cost", score.limit_cost),
            ("score.max_log_ratio", score.max_log_ratio),
            ("score.min_instants_per_parameter", score.min_instants_per_parameter),
            ("score.max_margin above 1", score.max_margin - 1.0),
            ("score.few_instants_margin", score.few_instants_margin),
            ("score.max_unexplained", score.max_unexplained),
            ("score.lower_cutoffs[0]", score.lower_cutoffs[0]),
            ("score.lower_cutoffs[1]", score.lower_cutoffs[1]),
            ("acceptance.max_ratio_of_all", acceptance.max_ratio_of_all),
            ("acceptance.max_ratio_of_joint", acceptance.max_ratio_of_joint),
            ("acceptance.max_increase_of_joint", acceptance.max_increase_of_joint),
            ("acceptance.max_share_of_gain", acceptance.max_share_of_gain),
            ("acceptance.max_unexplained_of_joint", acceptance.max_unexplained_of_joint),
            ("acceptance.max_ratio_of_unit", acceptance.max_ratio_of_unit),
            ("acceptance.min_inconsistent_ratio", acceptance.min_inconsistent_ratio),
            ("acceptance.max_ratio_of_step", acceptance.max_ratio_of_step),
            ("motion.max_overtravel", motion.max_overtravel),
            ("motion.max_velocity_ratio", motion.max_velocity_ratio),
            ("motion.recorder_rates_hz[0]", lowest_hz),
            ("width of motion.recorder_rates_hz", highest_hz - lowest_hz),
            ("motion.max_interpolated", motion.max_interpolated),
            ("motion.max_rest_velocity", motion.max_rest_velocity),
            ("motion.min_rest_share", motion.min_rest_share),
            ("late_channel.max_lag_s", late_channel.max_lag_s),
            ("late_channel.lag_step_s", late_channel.lag_step_s),
            ("late_channel.max_lag_of_joint_s", late_channel.max_lag_of_joint_s),
            ("late_channel.max_share_of_motion", late_channel.max_share_of_motion),
            ("late_channel.min_unexplained", late_channel.min_unexplained),
            ("late_channel.min_ratio_of_joint", late_channel.min_ratio_of_joint),
            ("late_channel.max_ratio_of_all", late_channel.max_ratio_of_all),
            ("description.min_explained", description.min_explained),
            ("description.max_scale", description.max_scale),
            ("description.max_unexplained", description.max_unexplained),
            ("description.min_explained_of_best", description.min_explained_of_best),
            ("description.max_unit_error", description.max_unit_error),
            ("description.max_unit_spread", description.max_unit_spread),
            ("description.usual_mass_ratios[0]", lightest),
            ("width of description.usual_mass_ratios", heaviest - lightest),
            ("channels.min_unexplained_of_duplicate", channels.min_unexplained_of_duplicate),
            ("channels.max_difference_of_duplicate", channels.max_difference_of_duplicate),
            ("channels.max_difference_of_filters", channels.max_difference_of_filters),
            ("channels.max_undershoot", channels.max_undershoot),
            ("channels.min_doubted_ratio", channels.min_doubted_ratio),
            ("channels.min_foreign_ratio", channels.min_foreign_ratio),
            ("channels.min_doubted_unexplained", channels.min_doubted_unexplained),
            ("channels.min_independent_alone", channels.min_independent_alone),
            ("channels.min_independent", channels.min_independent),
            ("channels.max_residual_of_description", channels.max_residual_of_description),
            ("held_out.min_unexplained_ratio", held_out.min_unexplained_ratio),
            ("held_out.min_gain_of_number", held_out.min_gain_of_number),
            ("held_out.min_torque_gain", held_out.min_torque_gain),
            ("held_out.max_ratio_of_one_robot", held_out.max_ratio_of_one_robot),
            ("held_out.max_ratio_with_payload", held_out.max_ratio_with_payload),
            ("held_out.max_ratio_of_corrected_joint", held_out.max_ratio_of_corrected_joint),
            ("held_out.max_distance_of_repeat", held_out.max_distance_of_repeat),
            ("held_out.min_share_of_repeat", held_out.min_share_of_repeat),
            ("held_out.residuals_per_independent", held_out.residuals_per_independent),
            ("held_out.min_payload_deviations", held_out.min_payload_deviations),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_invalid_limits_are_rejected() {
        let mut settings = DiagnosisSettings::default();
        settings.validate().unwrap();
        settings.motion.recorder_rates_hz = [10.0, 1.0];
        let error = settings.validate().unwrap_err().to_string();
        assert!(error.contains("motion.recorder_rates_hz"), "{error}");
    }
}
