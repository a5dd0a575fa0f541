//! Limits behind the verdicts of the diagnosis.
//!
//! "Unexplained share" is the residual of a joint's torque over this torque (root mean squares), 0 to 1. Scores are
//! sums of its logarithm over all joints.

use crate::limits::{InvalidLimit, check_limits};

/// Limits of the diagnosis by topic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiagnosisSettings {
    /// Comparison of hypotheses.
    pub score: ScoreSettings,
    /// Acceptance of one hypothesis.
    pub acceptance: AcceptanceSettings,
    /// Plausible motion.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreSettings {
    /// Smallest improvement of the score for which another hypothesis replaces the study as written; 0.6, as if the
    /// unexplained share of one joint fell to 0.55 of its value. On seven sets of real logs the best wrong hypothesis
    /// gains 0.41.
    pub min_gain: f64,
    /// Smallest improvement of the score for another sample rate; 1.2. Wrong hypotheses about correct rates gain up to
    /// 1.1, corrections of wrong rates 2.0 and more.
    pub min_gain_of_rate: f64,
    /// Smallest improvement of the score from which another gain of one torque needs no further evidence; 1.2. On real
    /// logs a wrong gain reaches 0.83.
    pub min_gain_of_torque_gain: f64,
    /// Largest difference between the scores of two hypotheses that are reported as indistinguishable; 0.2.
    pub max_indistinguishable: f64,
    /// Weight in the score of the residual of the bodies of the robot description, relative to that of the best
    /// consistent bodies; 0.5, since descriptions have errors.
    pub nominal_weight: f64,
    /// Added to the score for each joint whose positions are beyond its limits; 1, in units of the score.
    pub limit_cost: f64,
    /// Largest mean over joints of `ln(residual of a consistent robot / residual of separate parameters of each joint)`
    /// for a hypothesis that is accepted; 0.9. Real logs of arms with unusual friction reach 0.55.
    pub max_log_ratio: f64,
    /// Smallest number of independent instants per parameter of a joint; 2. With fewer, separate parameters of a joint
    /// fit the noise, and friction and elasticity without a term in the model.
    pub min_instants_per_parameter: f64,
    /// Largest factor on `min_gain` for short logs; 1.5, so that 0.9 is required. In parts of correct logs the best
    /// wrong hypothesis improves the score by up to 0.83; the correction of a reversed joint in a short log improves it
    /// by 1.3.
    pub max_margin: f64,
    /// Factor on `min_gain` (because the log is short) from which `max_log_ratio` is not tested; 1.5.
    pub few_instants_margin: f64,
    /// Unexplained share of all torque above which lower cut-offs are tried and held-out logs are not examined; 0.5.
    pub max_unexplained: f64,
    /// Cut-offs that are then tried, relative to a cut-off that was chosen from the data; 0.5 and 0.25.
    pub lower_cutoffs: [f64; 2],
    /// Largest number of mistakes in one study; 3.
    pub max_mistakes: usize,
    /// Largest number of other hypotheses that are reported; 4.
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

/// Limits that a hypothesis has to keep relative to the hypothesis that it corrects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AcceptanceSettings {
    /// Largest ratio of the unexplained share of all torque with the correction to that without; 1.05.
    pub max_ratio_of_all: f64,
    /// Largest ratio of the unexplained share of any joint with the correction to that without; 1.25. A joint is
    /// rejected only if it exceeds `max_increase_of_joint` as well.
    pub max_ratio_of_joint: f64,
    /// Largest increase of the unexplained share of any joint by the correction; 0.02.
    pub max_increase_of_joint: f64,
    /// Largest logarithm of the ratio of one joint over the improvement of all joints; 0.1. It replaces
    /// `max_ratio_of_joint` where it allows more.
    pub max_share_of_gain: f64,
    /// Unexplained share above which the channels of a joint are mostly noise and prove nothing; 0.5.
    pub max_unexplained_of_joint: f64,
    /// Largest ratio of the unexplained share of a joint with another unit to that without, for the other unit to be
    /// proven; 0.8.
    pub max_ratio_of_unit: f64,
    /// Ratio of a joint's unexplained share by one robot to that by the joint's own parameters from which its torque is
    /// inconsistent with the other joints; 1.8.
    pub min_inconsistent_ratio: f64,
    /// Largest ratio of the residual of a joint with another width of the friction step to that without, for the other
    /// width to be proven; 0.9.
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

/// Limits of plausible motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Largest distance beyond a position limit, as a share of the joint's range; 0.02, since zeros are calibrated to
    /// about a degree. Beyond it the position is treated as impossible.
    pub max_overtravel: f64,
    /// Largest ratio of a velocity to the velocity limit of the description; 1.5, since descriptions state rated
    /// velocities.
    pub max_velocity_ratio: f64,
    /// Lowest and highest rate of a recorder, Hz, for an arm of usual size
    /// ([`CharacteristicScale::hertz`](dynident_model::CharacteristicScale::hertz)); 4 to 50,000.
    pub recorder_rates_hz: [f64; 2],
    /// Largest share of interpolated samples in the filtered torque of a row, 0 to 1; 0.3. Rows with more are left out.
    pub max_interpolated: f64,
}

impl Default for MotionLimits {
    fn default() -> Self {
        Self {
            max_overtravel: 0.02,
            max_velocity_ratio: 1.5,
            recorder_rates_hz: [4.0, 50_000.0],
            max_interpolated: 0.3,
        }
    }
}

/// Limits for channels that were logged too late or too early. Times are those of an arm of usual size
/// ([`CharacteristicScale::seconds`](dynident_model::CharacteristicScale::seconds)), which moves at about 1 Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateChannelSettings {
    /// Largest tried shift of all torques relative to the positions, in both directions, s; 2.
    pub max_lag_s: f64,
    /// Step of the tried shifts, s; 0.1.
    pub lag_step_s: f64,
    /// Largest tried shift of one joint's channel, s; 0.5. A longer shift is half a period of its motion, which looks
    /// like another sign.
    pub max_lag_of_joint_s: f64,
    /// Largest tried shift as a share of the longest uninterrupted motion; 1/6, since instants need torque on both
    /// sides.
    pub max_share_of_motion: f64,
    /// Smallest number of instants per column of a joint; 2. With fewer, parameters fit the shifts.
    pub min_instants_per_column: usize,
    /// Unexplained share of all torque below which shifts are not tried; 0.02.
    pub min_unexplained: f64,
    /// Ratio of a joint's residual by one robot to that by its own parameters from which its channels are shifted
    /// alone; 1.5.
    pub min_ratio_of_joint: f64,
    /// Largest ratio of the unexplained share of all torque with a shift to that of the best hypothesis without, for
    /// the shift to be accepted; 0.8.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescriptionSettings {
    /// Smallest share of a joint's torque, without friction, that the scaled nominal bodies explain; 0.5. With less,
    /// their scale is ignored.
    pub min_explained: f64,
    /// Largest usual factor between torque and description; 3. A factor above it, or below 1/3, shows another unit or a
    /// motor constant.
    pub max_scale: f64,
    /// Largest share of a joint's torque, without friction, that the best consistent robot leaves unexplained; 0.4.
    /// Joints with more are not compared with the description.
    pub max_unexplained: f64,
    /// Explained share of the best joint below which the description is of another robot; 0.65. On six sets of real
    /// logs the least share is 0.90; descriptions of other arms with as many joints reach 0.45. In slow or small motion
    /// correct descriptions explain less, so robots with usual errors are compared as well.
    pub min_explained_of_best: f64,
    /// Largest relative difference between the median factor over the joints and the factor of a unit, for this unit to
    /// be named; 0.15.
    pub max_unit_error: f64,
    /// Largest relative difference between the factor of a joint and the factor of a unit, for the joint to support
    /// this unit; 0.8.
    pub max_unit_spread: f64,
    /// Usual range of the ratio of a body's mass to the described mass; 0.5 to 2.
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

/// Limits for channels that no correction repairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelSettings {
    /// Unexplained share of a joint from which its channels are compared with those of other joints, and from which
    /// torques without negative values are magnitudes; 0.1. Two joints may move in the same way.
    pub min_unexplained_of_duplicate: f64,
    /// Largest torque of the wrong sign that a filter may add to magnitudes, relative to the largest torque of the
    /// joint; 0.05.
    pub max_undershoot: f64,
    /// Ratio of a joint's unexplained share by one robot to that by its own parameters from which its torque is
    /// doubted; 2.4. Seven sets of real logs reach 1.8, single logs of these 2.3.
    pub min_doubted_ratio: f64,
    /// The same ratio from which the torque is not of this robot; 2.6.
    pub min_foreign_ratio: f64,
    /// Smallest unexplained share of a joint that is doubted; 0.03.
    pub min_doubted_unexplained: f64,
    /// Unexplained share by the joint's own parameters above which a torque is independent of the motion; 0.75.
    pub min_independent_alone: f64,
    /// Unexplained share by one robot, which predicts a torque from the other joints, above which a torque is
    /// independent of the motion; 1.
    pub min_independent: f64,
    /// Residual of the bodies of the description without friction, relative to the torque, up to which the torque of
    /// every joint was computed from the description; 0.02. Dry friction of real drives is at least several percent.
    pub max_residual_of_description: f64,
}

impl Default for ChannelSettings {
    fn default() -> Self {
        Self {
            min_unexplained_of_duplicate: 0.1,
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutSettings {
    /// Unexplained share of a joint in a held-out log, relative to that in the training logs, from which the log is
    /// reported as not explained; 3. Real sets reach 2.4 for all joints together.
    pub min_unexplained_ratio: f64,
    /// Improvement of the score from which a fitted number (such as a scale) replaces the nearest candidate; 0.05.
    pub min_gain_of_number: f64,
    /// Ratio of a torque to its measurement, or the inverse, from which another gain is tried; 1.15.
    pub min_torque_gain: f64,
    /// Residual of one robot for all logs, relative to that with a payload or a mistake, up to which neither is
    /// reported; 1.3.
    pub max_ratio_of_one_robot: f64,
    /// Largest ratio of the residual with a payload to that without, for the payload to be reported; 0.6.
    pub max_ratio_with_payload: f64,
    /// Largest ratio of the residual of a joint with the correction of its mistake to that without, for a log whose
    /// other joints have a larger residual than in the training logs; 0.25.
    pub max_ratio_of_corrected_joint: f64,
    /// Largest root mean square distance of an instant from the training motion, relative to the ranges of positions
    /// and velocities, for the instant to repeat it; 0.03.
    pub max_distance_of_repeat: f64,
    /// Share of such instants from which a held-out log repeats the training motion; 0.9.
    pub min_share_of_repeat: f64,
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
            min_payload_deviations: 5.0,
        }
    }
}

impl DiagnosisSettings {
    /// Checks that all limits are finite and positive, and that ranges are ascending.
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
