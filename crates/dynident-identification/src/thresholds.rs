//! Thresholds for decisions and tests.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Default maximum lag, s, for an arm of usual size. The lags of drives and buses are shorter.
pub(crate) const LONGEST_DELAY_S: f64 = 0.1;

/// A key of `[thresholds]` is not finite or below its minimum. Write a larger number, or delete the key to use the
/// default.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("thresholds.{name} = {value}: give a finite number of at least {minimum}")]
pub struct ThresholdError {
    /// Name of the threshold.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Smallest valid value.
    pub minimum: f64,
}

/// Checks that every value is finite and not below its minimum.
fn check(values: &[(&'static str, f64, f64)]) -> Result<(), ThresholdError> {
    match values.iter().find(|(_, value, minimum)| !(value.is_finite() && value >= minimum)) {
        Some(&(name, value, minimum)) => Err(ThresholdError { name, value, minimum }),
        None => Ok(()),
    }
}

/// Thresholds for the decisions before the last fit, and for treating a fit as doubtful.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct DecisionThresholds {
    /// Test for drive inertia.
    pub drive_inertia: DriveInertiaThresholds,
    /// Selection of cut-offs.
    pub cutoff: CutoffThresholds,
    /// Significance of friction terms.
    pub friction: FrictionThresholds,
    /// When a fit is doubtful, so that hypotheses about mistakes in the study are tested.
    pub doubt: DoubtThresholds,
    /// Which bodies differ from the robot description.
    pub description: DescriptionThresholds,
    /// Loads that a single training log carries.
    pub log_load: LogLoadThresholds,
}

/// Thresholds for bodies that differ from the robot description
/// ([`Differences`](crate::changes::Differences)).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct DescriptionThresholds {
    /// Minimum probability of all explanations by one or two bodies together, for the exported model to follow the most
    /// probable one: bodies that did not change then keep the values of the description, and a load is added to the
    /// body that carries it. 0.7 by default. In simulations with one or two changed bodies the probability was above
    /// 0.74; it is not close to 1, because noisy logs do not exclude small differences of all bodies. With differences
    /// of every body, it was below 0.6 in five of six simulations.
    pub min_probability: f64,
    /// Largest relative difference (standard deviation) that all bodies may have in an explanation by one or two
    /// bodies. 0.03 by default: masses of good descriptions are accurate to a few percent.
    pub max_small_share: f64,
    /// Probability of a change below which a body of the exported model keeps the values of the description. 0.1 by
    /// default: twice the prior probability, which is also the result for a body without effect on the torque.
    pub max_unchanged_probability: f64,
    /// Minimum mass of a changed body of the exported model, relative to its mass in the description. 0.1 by default.
    pub min_mass_ratio: f64,
    /// Prior probability of all small differences of all bodies from a description; that of large ones is the
    /// complement. 0.5 by default: neither few nor all bodies are preferred.
    pub small_probability: f64,
    /// Prior probability of small differences of all bodies between two estimates, and of large ones. 0.05 by default:
    /// two estimates usually belong to the same robot, whose bodies did not all change.
    pub other_robot_probability: f64,
    /// Prior probability of a change of terms, and of each way in which a body changes: a load, a common factor of all
    /// its values, or both. 0.025 by default.
    pub change_probability: f64,
    /// Expected value of the common factor of a changed body, minus 1. 0.5 by default.
    pub expected_factor: f64,
    /// Expected common factor with a load, relative to that without. 5.0 by default: most of a load near the centre of
    /// mass of its body is a factor, and the rest is small.
    pub factor_with_load: f64,
    /// Factors of the error bars of a difference from a description, with the same probability. 0.5, 1 and 2 by
    /// default: error bars for correlated residuals can be twice too wide.
    pub error_factors: [f64; 3],
    /// Expected difference of a friction or drive parameter relative to its value. 50.0 by default, because robot
    /// descriptions do not contain the friction of the real drive.
    pub unknown_term_ratio: f64,
    /// Among explanations with the same changed bodies, smaller differences of the other bodies are preferred if their
    /// probability is at least this share of the largest one. 0.1 by default, because descriptions are usually right.
    pub min_share_of_largest: f64,
    /// Minimum probability with which an explanation is listed in `result.json`. 0.01 by default.
    pub min_listed_probability: f64,
}

impl Default for DescriptionThresholds {
    fn default() -> Self {
        Self {
            min_probability: 0.7,
            max_small_share: 0.03,
            max_unchanged_probability: 0.1,
            min_mass_ratio: 0.1,
            small_probability: 0.5,
            other_robot_probability: 0.05,
            change_probability: 0.025,
            expected_factor: 0.5,
            factor_with_load: 5.0,
            error_factors: [0.5, 1.0, 2.0],
            unknown_term_ratio: 50.0,
            min_share_of_largest: 0.1,
            min_listed_probability: 0.01,
        }
    }
}

/// Thresholds for a load that a single training log carries ([`LogLoad`](crate::changes::LogLoad)).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct LogLoadThresholds {
    /// Minimum probability of all explanations that contain the body, for a load to be reported. 0.95 by default.
    pub min_probability: f64,
    /// Minimum mass of a load divided by its standard deviation, for the load to be reported. 5.0 by default.
    pub min_deviations: f64,
}

impl Default for LogLoadThresholds {
    fn default() -> Self {
        Self { min_probability: 0.95, min_deviations: 5.0 }
    }
}

/// Threshold of the test for drive inertia.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct DriveInertiaThresholds {
    /// Minimum test statistic with which drive inertia is added to the model, in standard deviations of its
    /// distribution without drive inertia. 3.0 by default, which chance exceeds once in 740 studies. (Drive inertia
    /// that is added wrongly only increases the other error bars; if it is omitted wrongly, its torque is missing.) A
    /// higher threshold could exclude a robot with a single drive: with three degrees of freedom, an estimate of thirty
    /// times its standard deviation corresponds to only 3.7 standard deviations of a normal distribution.
    pub min_std: f64,
}

impl Default for DriveInertiaThresholds {
    fn default() -> Self {
        Self { min_std: 3.0 }
    }
}

/// Thresholds for the selection of cut-offs.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct CutoffThresholds {
    /// Minimum ratio of the larger to the smaller of two cut-offs with which friction is selected again at the new
    /// cut-off. 1.2 by default; neighbouring candidates have a ratio of √2.
    pub min_friction_ratio: f64,
    /// Ratio of the velocity noise (standard deviation) to the width of the smoothed friction sign above which the
    /// noise blurs the sign. 0.05 by default; noise increases the width by half the square of this ratio.
    pub max_step_noise_ratio: f64,
    /// Ratio of the regressor's cut-off to the cut-off of the instruments, used if the study states neither. 2.0 by
    /// default: with this ratio, the low-pass on the positions hardly affects the frequency band of the instruments.
    pub instruments_ratio: f64,
    /// After `auto` selected instrumental variables, a new cut-off replaces the old one only if it is at most this
    /// share of the old one. 0.8 by default.
    pub max_lowered_ratio: f64,
}

impl Default for CutoffThresholds {
    fn default() -> Self {
        Self { min_friction_ratio: 1.2, max_step_noise_ratio: 0.05, instruments_ratio: 2.0, max_lowered_ratio: 0.8 }
    }
}

/// Thresholds for friction terms.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct FrictionThresholds {
    /// Critical values of Wald's test for an additional friction term with 1, 2 and 3 degrees of freedom. A term with a
    /// smaller test statistic is not added. By default χ² at 5 %: stricter tests also drop terms that improve the
    /// prediction, even if they are not physically correct.
    pub term_chi_square: [f64; 3],
    /// Critical values of Wald's test with 1, 2 and 3 degrees of freedom for terms that only a second selection from
    /// the same motion adds. By default χ² at 1 %, because every term is then tested twice.
    pub second_selection_chi_square: [f64; 3],
    /// Minimum of `Σ e^{-2|q̇/v_s|^δ}` over the rows of a joint: the sum of squares of the column of a Stribeck term
    /// with velocity v_s and exponent δ. With a smaller sum, the term is not tried. 1.0 by default, the value of one
    /// row at rest.
    pub min_column_square_sum: f64,
    /// Minimum improvement with which a law with hysteresis or load dependence is selected: the decrease of the joint's
    /// root mean square error in cross-validation, relative to the error with the best laws without hysteresis and load
    /// dependence. 0.02 by default: smaller improvements disappear in the differences between logs, and not every
    /// controller and simulator supports these laws.
    pub min_gain_ratio: f64,
}

impl Default for FrictionThresholds {
    fn default() -> Self {
        Self {
            term_chi_square: [3.84, 5.99, 7.81],
            second_selection_chi_square: [6.63, 9.21, 11.34],
            min_column_square_sum: 1.0,
            min_gain_ratio: 0.02,
        }
    }
}

/// Thresholds above which a fit is doubtful, so that hypotheses about mistakes in the study are tested.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct DoubtThresholds {
    /// Mean over joints of `ln(residual of a physically consistent robot / residual of separate joint parameters)`
    /// above which a fit is doubtful. 0.1 by default; simulated and well-described robots stay below 0.05.
    pub max_log_residual_ratio: f64,
    /// Number of rows per parameter of a joint below which a fit is doubtful. 4/3 by default; with fewer rows, the fit
    /// with separate parameters follows the noise.
    pub min_rows_per_parameter: f64,
    /// Residual of a held-out log relative to the noise of the fit above which a fit is doubtful. 1.7 by default;
    /// friction that changes with the motion causes a smaller ratio.
    pub max_held_out_ratio: f64,
}

impl Default for DoubtThresholds {
    fn default() -> Self {
        Self { max_log_residual_ratio: 0.1, min_rows_per_parameter: 4.0 / 3.0, max_held_out_ratio: 1.7 }
    }
}

impl DecisionThresholds {
    /// Checks the values.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), ThresholdError> {
        let Self { drive_inertia, cutoff, friction, doubt, description, log_load } = self;
        check(&[
            ("description.min_probability", description.min_probability, 0.5),
            ("description.max_small_share", description.max_small_share, 0.0),
            ("description.max_unchanged_probability", description.max_unchanged_probability, 0.0),
            ("description.min_mass_ratio", description.min_mass_ratio, 1e-6),
            ("description.small_probability", description.small_probability, 1e-6),
            ("description.small_probability below 1", 1.0 - description.small_probability, 1e-6),
            ("description.other_robot_probability", description.other_robot_probability, 1e-6),
            ("description.other_robot_probability below 0.5", 0.5 - description.other_robot_probability, 1e-6),
            ("description.change_probability", description.change_probability, 1e-6),
            ("description.change_probability below 1", 1.0 - description.change_probability, 1e-6),
            ("description.expected_factor", description.expected_factor, 1e-6),
            ("description.factor_with_load", description.factor_with_load, 1e-6),
            ("description.unknown_term_ratio", description.unknown_term_ratio, 0.0),
            ("description.min_share_of_largest", description.min_share_of_largest, 0.0),
            ("description.min_listed_probability", description.min_listed_probability, 0.0),
            ("log_load.min_probability", log_load.min_probability, 0.0),
            ("log_load.min_deviations", log_load.min_deviations, 0.0),
            ("drive_inertia.min_std", drive_inertia.min_std, 0.0),
            ("cutoff.min_friction_ratio", cutoff.min_friction_ratio, 1.0),
            ("cutoff.max_step_noise_ratio", cutoff.max_step_noise_ratio, 0.0),
            ("cutoff.instruments_ratio", cutoff.instruments_ratio, 1.0),
            ("cutoff.max_lowered_ratio", cutoff.max_lowered_ratio, 0.0),
            ("friction.min_column_square_sum", friction.min_column_square_sum, 0.0),
            ("friction.min_gain_ratio", friction.min_gain_ratio, 0.0),
            ("doubt.max_log_residual_ratio", doubt.max_log_residual_ratio, 0.0),
            ("doubt.min_rows_per_parameter", doubt.min_rows_per_parameter, 1.0),
            ("doubt.max_held_out_ratio", doubt.max_held_out_ratio, 0.0),
        ])?;
        check(&description.error_factors.map(|value| ("description.error_factors", value, 1e-6)))?;
        let term = friction.term_chi_square.map(|value| ("friction.term_chi_square", value, 1e-9));
        let second = friction.second_selection_chi_square;
        check(&term)?;
        check(&second.map(|value| ("friction.second_selection_chi_square", value, 1e-9)))
    }
}

/// Thresholds for the estimation.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct EstimationThresholds {
    /// Selection of the lag.
    pub lag: LagThresholds,
    /// Test for noise in the regressor.
    pub noise: NoiseThresholds,
    /// Variation between logs.
    pub log_variation: LogVariationThresholds,
    /// Requirements on the motion of the simultaneous method.
    pub motion: MotionThresholds,
    /// Drive gains.
    pub gain: GainThresholds,
}

/// Thresholds for the lag between motion and torque.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct LagThresholds {
    /// Minimum change of a parameter by a lag correction with which the lag is corrected, in error bars of the
    /// parameter. 0.3 by default.
    pub min_parameter_shift: f64,
    /// Limit on the χ² of the joints' lags around their common lag, in standard deviations above its mean. Above it a
    /// single common lag is rejected, and joints may get separate lags. 4.0 by default.
    pub max_scatter_std: f64,
    /// Minimum share of a joint's squared residual that its separate lag must explain; otherwise the joint keeps the
    /// common lag. 0.5 by default; unmodelled friction looks like a lag but explains less.
    pub min_own_share: f64,
    /// Limit on the χ² of the times between the zero of each joint's velocity and the change of sign of its friction,
    /// in standard deviations above its mean. Above it these times are estimated with the lag. 2.0 by default: normal
    /// errors of six joints exceed it in 4 of 100 studies.
    pub max_reversal_std: f64,
    /// Prior standard deviation of the lag of a drive or a bus, s, for an arm of usual size
    /// ([`CharacteristicScale`](dynident_model::CharacteristicScale)). 5 ms by default; the speed of drives and buses
    /// is assumed to scale with the size of the robot.
    pub prior_std_s: f64,
    /// Maximum lag in the search, s, for an arm of usual size. 0.1 s by default; the lags of drives and buses are
    /// shorter.
    pub max_lag_s: f64,
}

impl Default for LagThresholds {
    fn default() -> Self {
        Self {
            min_parameter_shift: 0.3,
            max_scatter_std: 4.0,
            min_own_share: 0.5,
            max_reversal_std: 2.0,
            prior_std_s: 5.0e-3,
            max_lag_s: LONGEST_DELAY_S,
        }
    }
}

/// Thresholds for the test whether noise in the regressor biases least squares.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct NoiseThresholds {
    /// Regression coefficient of the measured torque on the torque of the fast motion, below which the fast motion is
    /// mostly noise. (It is 1 if the robot really makes this motion, and 0 for noise.) 0.75 by default.
    pub max_followed: f64,
    /// Largest root mean square difference between two estimates (over the parameters, in error bars of the more
    /// accurate estimate) with which the estimates agree. 1.5 by default; two independent estimates with equal error
    /// bars differ by 1.4.
    pub max_contrast_rms: f64,
    /// Largest difference of a single parameter between two estimates, in error bars of the more accurate estimate,
    /// with which the estimates agree. 3.0 by default.
    pub max_contrast: f64,
    /// Share of the torque of the fast motion in the total torque above which instruments with lower cut-offs are
    /// always tried. 0.1 by default; the instruments with the first cut-off may then also contain much noise.
    pub max_fast_torque_share: f64,
    /// Minimum shift of the parameters by noise with which the noise is significant, in error bars (root mean square
    /// over the parameters). The shift is at most `√(Σ_j ‖V_j θ‖² / σ_j² / p)`: torque `V_j θ` of the noise at joint j,
    /// standard deviation σ_j of the residual, and p parameters. 0.3 by default, because large noise also reduces θ and
    /// therefore this bound.
    pub min_parameter_shift: f64,
}

impl Default for NoiseThresholds {
    fn default() -> Self {
        Self {
            max_followed: 0.75,
            max_contrast_rms: 1.5,
            max_contrast: 3.0,
            max_fast_torque_share: 0.1,
            min_parameter_shift: 0.3,
        }
    }
}

/// Thresholds for the variation of parameters between logs.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct LogVariationThresholds {
    /// Minimum number of pairs (one parameter in two logs) for estimating the variation of one kind of parameters. 5 by
    /// default.
    pub min_pairs: usize,
    /// Minimum degrees of freedom of a parameter's variance in the fit to a single log; pairs with fewer are excluded.
    /// 4.5 by default.
    pub min_degrees_of_freedom: f64,
    /// Largest `z²` of a pair relative to the typical `z²`; larger values are reduced to this limit. Here z is the
    /// difference of a parameter between two logs, divided by the standard deviation of this difference. The typical
    /// `z²` follows from the median over all pairs for bodies or for friction. 25.0 by default, so that one wrong log
    /// does not look like a variation of all logs.
    pub max_relative_square: f64,
}

impl Default for LogVariationThresholds {
    fn default() -> Self {
        Self { min_pairs: 5, min_degrees_of_freedom: 4.5, max_relative_square: 25.0 }
    }
}

/// Requirements on the motion of the simultaneous and maximum-likelihood methods.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct MotionThresholds {
    /// Largest residual of the positions from their Fourier series, relative to the size of the motion. Above it the
    /// motion is not periodic, and the method is rejected. 0.1 by default.
    pub max_series_residual: f64,
    /// Minimum size of the motion of a joint, rad (m). Below it the joint is treated as resting. 1e-4 by default.
    pub min_motion: f64,
    /// Maximum ratio of the filtered residuals of the spline fit to those of weighted least squares. 1.25 by default.
    /// Above it the correlated part of the torque residuals is model error, and the fit has treated a part of the
    /// motion as noise.
    pub max_spline_residual_ratio: f64,
}

impl Default for MotionThresholds {
    fn default() -> Self {
        Self { max_series_residual: 0.1, min_motion: 1e-4, max_spline_residual_ratio: 1.25 }
    }
}

/// Threshold for drive gains.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct GainThresholds {
    /// Largest half-width of the 95 % interval of a gain, relative to the gain. Above it the gain is reported as not
    /// identified. 0.5 by default.
    pub max_half_width: f64,
}

impl Default for GainThresholds {
    fn default() -> Self {
        Self { max_half_width: 0.5 }
    }
}

impl EstimationThresholds {
    /// Checks the values.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), ThresholdError> {
        let Self { lag, noise, log_variation, motion, gain } = self;
        check(&[
            ("lag.min_parameter_shift", lag.min_parameter_shift, 0.0),
            ("lag.max_scatter_std", lag.max_scatter_std, 0.0),
            ("lag.min_own_share", lag.min_own_share, 0.0),
            ("lag.max_reversal_std", lag.max_reversal_std, 0.0),
            ("lag.prior_std_s", lag.prior_std_s, 1e-9),
            ("lag.max_lag_s", lag.max_lag_s, 1e-9),
            ("noise.max_followed", noise.max_followed, 0.0),
            ("noise.max_contrast_rms", noise.max_contrast_rms, 0.0),
            ("noise.max_contrast", noise.max_contrast, 0.0),
            ("noise.max_fast_torque_share", noise.max_fast_torque_share, 0.0),
            ("noise.min_parameter_shift", noise.min_parameter_shift, 0.0),
            ("log_variation.min_pairs", log_variation.min_pairs as f64, 1.0),
            ("log_variation.min_degrees_of_freedom", log_variation.min_degrees_of_freedom, 2.0),
            ("log_variation.max_relative_square", log_variation.max_relative_square, 0.0),
            ("motion.max_series_residual", motion.max_series_residual, 0.0),
            ("motion.min_motion", motion.min_motion, 0.0),
            ("motion.max_spline_residual_ratio", motion.max_spline_residual_ratio, 0.0),
            ("gain.max_half_width", gain.max_half_width, 0.0),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_valid_and_values_that_are_not_finite_are_rejected() {
        let (decision, estimation) = (DecisionThresholds::default(), EstimationThresholds::default());
        assert!(decision.validate().is_ok() && estimation.validate().is_ok());
        let lag = LagThresholds { max_lag_s: f64::NAN, ..LagThresholds::default() };
        assert_eq!(EstimationThresholds { lag, ..estimation }.validate().unwrap_err().name, "lag.max_lag_s");
        let friction = FrictionThresholds { term_chi_square: [3.84, 0.0, 7.81], ..FrictionThresholds::default() };
        assert!(DecisionThresholds { friction, ..decision }.validate().is_err());
    }
}
