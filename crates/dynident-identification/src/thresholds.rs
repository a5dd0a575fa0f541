//! Thresholds of decisions and tests.

use thiserror::Error;

/// Default maximum lag, in seconds for an arm of usual size; drives and buses stay below.
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

/// Thresholds of the decisions before the last fit, and of the doubt about a study.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct DecisionThresholds {
    /// Test for drive inertia.
    pub drive_inertia: DriveInertiaThresholds,
    /// Selection of cut-offs.
    pub cutoff: CutoffThresholds,
    /// Significance of friction terms.
    pub friction: FrictionThresholds,
    /// Reasons to test alternative hypotheses.
    pub doubt: DoubtThresholds,
    /// Bodies that differ from the robot description.
    pub description: DescriptionThresholds,
}

/// Thresholds for bodies that differ from the robot description
/// ([`Differences`](crate::changes::Differences)).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DescriptionThresholds {
    /// Probability of all explanations by one or two bodies from which the written model follows the most probable one:
    /// bodies that did not change keep the values of the description, and a load is written in the body that carries
    /// it. 0.7 by default: in simulations the probability is above 0.74 with one or two changed bodies, because noisy
    /// logs do not exclude small differences of all bodies, and in five of six draws below 0.6 with differences of
    /// every body.
    pub min_probability: f64,
    /// Largest relative difference (standard deviation) that all bodies may have while one or two bodies explain the
    /// rest. 0.03 by default: masses of good descriptions are accurate to a few percent.
    pub max_small_share: f64,
}

impl Default for DescriptionThresholds {
    fn default() -> Self {
        Self { min_probability: 0.7, max_small_share: 0.03 }
    }
}

/// Threshold of the test for drive inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DriveInertiaThresholds {
    /// Minimum statistic of the test for drive inertia, in standard deviations of its distribution without drive
    /// inertia; from this value on, drive inertia is added to the model. 3.0 by default: exceeded by chance once in 740
    /// studies. An added inertia that is absent widens the other error bars; a missing one loses its torque. A stricter
    /// limit would exclude a single drive whose deviation has three degrees of freedom: thirty of its standard
    /// deviations are 3.7 normal ones.
    pub min_std: f64,
}

impl Default for DriveInertiaThresholds {
    fn default() -> Self {
        Self { min_std: 3.0 }
    }
}

/// Thresholds for the selection of cut-offs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CutoffThresholds {
    /// Ratio of the larger to the smaller of two cut-offs from which friction is selected again at the new cut-off. 1.2
    /// by default; candidates are √2 apart.
    pub min_friction_ratio: f64,
    /// Standard deviation of the velocity noise relative to the width of a friction step, above which the noise smears
    /// the step. 0.05 by default; noise widens a smooth step by half the square of this ratio.
    pub max_step_noise_ratio: f64,
    /// Cut-off of the regressor relative to that of the instruments, used if the study states neither. 2.0 by default:
    /// positions are hardly smoothed inside the instruments' band.
    pub instruments_ratio: f64,
    /// After `auto` selected instruments, a new cut-off replaces the old one only if it is at most this share of the
    /// old one. 0.8 by default.
    pub max_lowered_ratio: f64,
}

impl Default for CutoffThresholds {
    fn default() -> Self {
        Self { min_friction_ratio: 1.2, max_step_noise_ratio: 0.05, instruments_ratio: 2.0, max_lowered_ratio: 0.8 }
    }
}

/// Thresholds for friction terms.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FrictionThresholds {
    /// Critical values of Wald's test for a further friction term with 1, 2 and 3 degrees of freedom; a term with a
    /// smaller statistic is not added. By default χ² at 5 %: stricter tests drop terms that improve the prediction
    /// although they are not the true ones.
    pub term_chi_square: [f64; 3],
    /// The same for terms that only a second selection from the same motion adds. By default χ² at 1 %, because every
    /// term is then tested twice.
    pub second_selection_chi_square: [f64; 3],
    /// Minimum of `Σ e^{-2|q̇/v_s|^δ}` over the rows of a joint, the sum of squares of the column of a Stribeck term;
    /// with less, the term is not tried. 1.0 by default, the value of one row at rest.
    pub min_column_square_sum: f64,
    /// Minimum gain of a law with memory or with load-dependent friction: the decrease of the joint's root mean square
    /// error in cross-validation, as a share of the error with the best laws without memory and load. 0.02 by default:
    /// smaller gains disappear in the differences between logs, and not every controller and simulator can hold these
    /// laws.
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

/// Reasons to test alternative hypotheses about the logs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DoubtThresholds {
    /// Mean over joints of `ln(residual of a consistent robot / residual of separate joint parameters)` above which
    /// alternative hypotheses are tested. 0.1 by default; simulated and well-described robots stay below 0.05.
    pub max_log_residual_ratio: f64,
    /// Number of rows per parameter of a joint below which alternative hypotheses are tested. 4/3 by default; with
    /// fewer rows the separate fit follows the noise.
    pub min_rows_per_parameter: f64,
    /// Residual of a held-out log relative to the noise of the fit, above which alternative hypotheses are tested. 1.7
    /// by default; friction that changes with the motion causes less.
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
        let Self { drive_inertia, cutoff, friction, doubt, description } = self;
        check(&[
            ("description.min_probability", description.min_probability, 0.5),
            ("description.max_small_share", description.max_small_share, 0.0),
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
        let term = friction.term_chi_square.map(|value| ("friction.term_chi_square", value, 1e-9));
        let second = friction.second_selection_chi_square;
        check(&term)?;
        check(&second.map(|value| ("friction.second_selection_chi_square", value, 1e-9)))
    }
}

/// Thresholds of the estimation.
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
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LagThresholds {
    /// Smallest change of a parameter by a lag correction, in error bars of the parameter, for which the lag is
    /// corrected. 0.3 by default.
    pub min_parameter_shift: f64,
    /// χ² of the joint lags about their common lag, in standard deviations above its mean, above which one common lag
    /// is rejected and joints may get separate lags. 4.0 by default.
    pub max_scatter_std: f64,
    /// Share of the squared residual of a joint that its separate lag has to explain; with less, the joint keeps the
    /// common lag. 0.5 by default; unmodelled friction looks like a lag but explains less.
    pub min_own_share: f64,
    /// Prior standard deviation of a lag of a drive or a bus, in seconds for an arm of usual size
    /// ([`CharacteristicScale`](dynident_model::CharacteristicScale)). 5 ms by default: drives and buses are as fast as
    /// their machine needs.
    pub prior_std_s: f64,
    /// Maximum lag in the search, in seconds for an arm of usual size. 0.1 s by default; drives and buses stay below.
    pub max_lag_s: f64,
}

impl Default for LagThresholds {
    fn default() -> Self {
        Self {
            min_parameter_shift: 0.3,
            max_scatter_std: 4.0,
            min_own_share: 0.5,
            prior_std_s: 5.0e-3,
            max_lag_s: LONGEST_DELAY_S,
        }
    }
}

/// Thresholds for noise in the regressor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct NoiseThresholds {
    /// Coefficient of the measured torque on the torque of the fast motion (1 if the robot really makes this motion, 0
    /// for noise), below which the fast motion is mostly noise. 0.75 by default.
    pub max_followed: f64,
    /// Root mean square over the parameters of the difference of two estimates, in error bars of the more accurate one,
    /// up to which the estimates agree. 1.5 by default; two independent estimates with the same error bars differ by
    /// 1.4.
    pub max_contrast_rms: f64,
    /// Largest difference of one parameter between two estimates, in error bars of the more accurate one, up to which
    /// the estimates agree. 3.0 by default.
    pub max_contrast: f64,
    /// Torque of the fast motion as a share of the whole torque, above which instruments with lower cut-offs are always
    /// tried. 0.1 by default; the instruments of the first cut-off may then contain much noise themselves.
    pub max_fast_torque_share: f64,
    /// Smallest shift of the parameters by the noise, in error bars (root mean square over the parameters), for which
    /// the noise matters; the shift is at most `√(Σ_j ‖V_j θ‖² / σ_j² / p)`. 0.3 by default, because large noise also
    /// reduces θ and this bound.
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
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LogVariationThresholds {
    /// Minimum number of pairs (one parameter in two logs) for the variation of one kind of parameters; with fewer, the
    /// variation is not estimated. 5 by default.
    pub min_pairs: usize,
    /// Minimum degrees of freedom of a parameter's variance in the fit of a single log; a pair with less is left out.
    /// 4.5 by default.
    pub min_degrees_of_freedom: f64,
    /// Largest `z²` of a pair relative to the typical one, where z is the difference of a parameter between two logs
    /// over the standard deviation of this difference, and the typical `z²` follows from the median over all pairs of
    /// bodies or of friction. Larger values are reduced to this limit. 25.0 by default, so that one wrong log does not
    /// look like a variation of all logs.
    pub max_relative_square: f64,
}

impl Default for LogVariationThresholds {
    fn default() -> Self {
        Self { min_pairs: 5, min_degrees_of_freedom: 4.5, max_relative_square: 25.0 }
    }
}

/// Requirements on the motion of the simultaneous and maximum-likelihood methods.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MotionThresholds {
    /// Largest residual of the positions from their Fourier series, relative to the size of the motion; above it the
    /// motion is not periodic, and the method is refused. 0.1 by default.
    pub max_series_residual: f64,
    /// Smallest size of the motion of a joint, rad (m); below it the joint is at rest. 1e-4 by default.
    pub min_motion: f64,
    /// Maximum ratio of filtered residuals to those of weighted least squares for the spline fit. 1.25 by default.
    /// Above it the correlated part of the torque residuals is model error, and the whitening filter has removed a part
    /// of the motion as noise.
    pub max_spline_residual_ratio: f64,
}

impl Default for MotionThresholds {
    fn default() -> Self {
        Self { max_series_residual: 0.1, min_motion: 1e-4, max_spline_residual_ratio: 1.25 }
    }
}

/// Threshold for drive gains.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct GainThresholds {
    /// Largest half width of the 95 % interval of a gain, relative to the gain; above it the gain is reported as not
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
